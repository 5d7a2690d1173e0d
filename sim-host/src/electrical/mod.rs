//! The electrical side of the coil: bridge, supply, current measurement, converter.
//!
//! Double precision, without time steps: between two changes of the bridge's state the circuit is
//! linear, so its current is an exponential and can be computed for any time.

mod circuit;
mod control_loop;
mod regulated;
mod sense;

pub use circuit::{Circuit, CircuitParameters, Pins, Totals};
pub use control_loop::{ControlLoop, HISTORY, Passed, Period, Slow, TRACED};
pub use regulated::{Regulated, reference_hardware, reference_limits};
pub use sense::{Converter, ConverterParameters, Filter, thermistor_v};

/// Edges of a phase-correct PWM in one period: for each edge its time, as a fraction of the period,
/// and both levels after it. Both pulses are centred on the start of the period.
///
/// ```
/// use palpate_sim::electrical::edges;
/// // IN1 high throughout, IN2 for a half: the supply drives from 1/4 to 3/4 of the period
/// let found: Vec<_> = edges([960, 480], 960).collect();
/// assert_eq!(found, [(0.0, [true, true]), (0.25, [true, false]), (0.75, [true, true])]);
/// ```
pub fn edges(levels: [u16; 2], full: u16) -> impl Iterator<Item = (f64, [bool; 2])> {
    let part = |level: u16| 0.5 * f64::from(level.min(full)) / f64::from(full);
    let [first, second] = levels.map(part);
    let (low, high) = (first.min(second), first.max(second));
    let moments = [0.0, low, high, 1.0 - high, 1.0 - low];
    let is_high = move |high: f64, at: f64| at < high || at >= 1.0 - high;
    // Both levels in one number: comparing two bytes right after they are written stalls.
    let mut last = None;
    moments.into_iter().filter_map(move |at| {
        // At the full level both edges of an output coincide in mid-period: it stays high.
        let [first, second] = [is_high(first, at), is_high(second, at)];
        let state = u32::from(first) + 2 * u32::from(second);
        if at >= 1.0 || last == Some(state) {
            return None;
        }
        last = Some(state);
        Some((at, [first, second]))
    })
}

#[cfg(test)]
mod tests {
    use super::edges;

    #[test]
    fn constant_outputs_have_no_edges() {
        let all = |levels| edges(levels, 960).collect::<Vec<_>>();
        assert_eq!(all([0, 0]), [(0.0, [false, false])]);
        assert_eq!(all([960, 960]), [(0.0, [true, true])]);
        assert_eq!(all([960, 0]), [(0.0, [true, false])]);
        assert_eq!(
            all([480, 480]),
            [
                (0.0, [true, true]),
                (0.25, [false, false]),
                (0.75, [true, true])
            ]
        );
    }
}
