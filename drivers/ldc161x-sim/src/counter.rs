//! The counter: turns a frequency into a quotient of two whole numbers.
//!
//! Recorded words decode as round(2²⁸ M/N) with N about 16 to 28 below 32 RCOUNT, some of them with
//! odd M (reference `ldc1614.md`, section 0.1). A reciprocal counter produces such words: it
//! measures the time of a whole number of sensor periods, from the first edge in the gate to the
//! last, in whole reference periods. This module computes the times of those edges. It needs no
//! formula for the variance of the result: dithering, stuck words and beats follow from the edges.

use crate::switches::Counter;

/// Word of a sensor as fast as the reference.
const FULL_SCALE: u64 = 1 << 28;

/// Time at the start of a gate during which no edge is counted: the sum of a number of reference
/// clocks and a number of sensor periods.
///
/// Both numbers were fitted by maximum likelihood to 15 recorded words: nine at 12 MHz with 3.8
/// clocks in a sensor period, six at 40 MHz with 9.2. No constant number of clocks explains all of
/// them: the gap between N and 32 RCOUNT grows with the sensor's period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StartUp {
    /// Number of reference clocks. Both [`Counter`] methods fit best with 4, the "+4" of datasheet
    /// equation 7.
    clocks: f64,
    /// Number of sensor periods, after FIN_DIVIDERx.
    periods: f64,
}

impl StartUp {
    /// Fitted for [`Counter::TwoGates`], for each of its gates; values off by ±0.5 clocks and ±0.1
    /// periods fit equally well.
    const TWO_GATES: Self = Self {
        clocks: 4.0,
        periods: 0.5,
    };
    /// Fitted for [`Counter::HalfPeriods`]; with half a clock more, one of the recorded words could
    /// not occur.
    const HALF_PERIODS: Self = Self {
        clocks: 4.0,
        periods: 1.0,
    };

    pub(crate) const fn of(counter: Counter) -> Self {
        match counter {
            Counter::TwoGates => Self::TWO_GATES,
            Counter::HalfPeriods => Self::HALF_PERIODS,
        }
    }
}

/// Parameters of the counting method.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Core {
    pub(crate) counter: Counter,
    pub(crate) start_up: StartUp,
    /// Delay of the falling edge after the rising one, in cycles.
    pub(crate) falling_edge: f64,
}

/// The two whole numbers of one conversion; their ratio M/N gives the word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// M: sensor periods, summed over both gates ([`Counter::TwoGates`]), or sensor half periods in the
    /// only gate ([`Counter::HalfPeriods`]).
    pub sensor: u64,
    /// N: reference periods, summed over both gates, or reference half periods in the only gate.
    pub reference: u64,
}

/// Word for the ratio M/N of a count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ratio {
    /// No edge was counted.
    Zero,
    /// A word below full scale.
    Word(u32),
    /// The sensor is as fast as the reference or faster.
    FullScale,
}

impl Counts {
    /// Computes round(2²⁸ M/N).
    pub(crate) fn ratio(self) -> Ratio {
        if self.sensor == 0 || self.reference == 0 {
            Ratio::Zero
        } else if self.sensor >= self.reference {
            Ratio::FullScale
        } else {
            // M < N, so the product is below 2^29 N, and N is at most about 2^21.
            let doubled = u128::from(self.sensor) * u128::from(2 * FULL_SCALE);
            let word = (doubled + u128::from(self.reference)) / (2 * u128::from(self.reference));
            Ratio::Word(u32::try_from(word).unwrap_or(u32::MAX))
        }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            sensor: self.sensor.saturating_add(other.sensor),
            reference: self.reference.saturating_add(other.reference),
        }
    }
}

/// Computes round(2²⁸ ratio) without counting, for tests without quantisation.
pub(crate) fn exact_ratio(ratio: f64) -> Ratio {
    let word = libm::round(ratio * FULL_SCALE as f64);
    if word >= FULL_SCALE as f64 {
        Ratio::FullScale
    } else if word >= 1.0 {
        Ratio::Word(word as u32)
    } else {
        Ratio::Zero
    }
}

/// The sensor signal after its divider during one conversion, with the reference clock as its time
/// base.
///
/// Time is in reference periods from the start of the conversion, which is an edge of the
/// reference, since the gate is counted in reference periods. The sensor's phase is independent of
/// the reference. Only the first and the last edge in the gate matter, so the signal is given by
/// its phase and its rate at both ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DividedSignal {
    /// Phase at the start of the conversion, cycles.
    pub(crate) phase: f64,
    /// Cycles during the whole conversion: the integral of the frequency.
    pub(crate) cycles: f64,
    /// Cycles per reference period at the start of the conversion.
    pub(crate) first_rate: f64,
    /// Cycles per reference period at the end of the conversion.
    pub(crate) last_rate: f64,
}

impl DividedSignal {
    /// Counts M and N of a conversion of `clocks` reference periods.
    pub(crate) fn count(&self, core: Core, clocks: f64) -> Counts {
        if !(self.first_rate > 0.0 && self.last_rate > 0.0 && self.cycles > 0.0) {
            return Counts::default();
        }
        let opening = core.start_up.clocks + core.start_up.periods / self.first_rate;
        match core.counter {
            Counter::TwoGates => {
                let rising = self.gate(0.0, opening, clocks);
                let falling = self.gate(1.0 - core.falling_edge, opening, clocks);
                rising.plus(falling)
            }
            Counter::HalfPeriods => self.in_halves().gate(0.0, 2.0 * opening, 2.0 * clocks),
        }
    }

    /// This signal in units of half periods of the sensor and of the reference.
    fn in_halves(&self) -> Self {
        Self {
            phase: 2.0 * self.phase,
            cycles: 2.0 * self.cycles,
            ..*self
        }
    }

    /// Number of whole periods between the first and the last edge from `opening` to `clocks`, and
    /// number of reference edges between those two edges. An edge falls where the phase plus
    /// `offset` is a whole number.
    fn gate(&self, offset: f64, opening: f64, clocks: f64) -> Counts {
        let phase_first = self.phase + self.first_rate * opening + offset;
        let phase_last = self.phase + self.cycles + offset;
        let first_edge = libm::ceil(phase_first);
        let last_edge = libm::floor(phase_last);
        if last_edge <= first_edge {
            return Counts::default();
        }
        let first_time = opening + (first_edge - phase_first) / self.first_rate;
        let last_time = clocks - (phase_last - last_edge) / self.last_rate;
        Counts {
            sensor: whole(last_edge - first_edge),
            // Both edges are sampled by the reference: each counts at the next reference edge.
            reference: whole(libm::floor(last_time) - libm::floor(first_time)),
        }
    }
}

/// Converts a number to an integer; a negative number gives zero.
fn whole(number: f64) -> u64 {
    number as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steady(phase: f64, rate: f64, clocks: f64) -> DividedSignal {
        DividedSignal {
            phase,
            cycles: rate * clocks,
            first_rate: rate,
            last_rate: rate,
        }
    }

    fn core(counter: Counter, clocks: f64, periods: f64) -> Core {
        Core {
            counter,
            start_up: StartUp { clocks, periods },
            falling_edge: 0.5,
        }
    }

    #[test]
    fn a_hand_counted_gate() {
        // Sensor period of 8 clocks in a gate of 80.5 clocks. Rising edges at 4, 12 ... 76: 9
        // periods in 72 clocks; falling edges at 0, 8 ... 80: 10 periods in 80 clocks.
        let signal = steady(0.5, 0.125, 80.5);
        let counts = signal.count(core(Counter::TwoGates, 0.0, 0.0), 80.5);
        assert_eq!((counts.sensor, counts.reference), (19, 152));
        // Half periods: edges at 0, 4 ... 80, so 20 half periods in 160 half clocks.
        let counts = signal.count(core(Counter::HalfPeriods, 0.0, 0.0), 80.5);
        assert_eq!((counts.sensor, counts.reference), (20, 160));
        // A start-up of 5 clocks loses the edges at 0 and 4.
        let counts = signal.count(core(Counter::TwoGates, 5.0, 0.0), 80.5);
        assert_eq!((counts.sensor, counts.reference), (17, 136));
        // A start-up of 1 clock and half a sensor period loses the edges at 0 and 4, too.
        let counts = signal.count(core(Counter::TwoGates, 1.0, 0.5), 80.5);
        assert_eq!((counts.sensor, counts.reference), (17, 136));
        // Falling edges a quarter of a period after the rising ones: at 6, 14 ... 78.
        let uneven = Core {
            falling_edge: 0.25,
            ..core(Counter::TwoGates, 0.0, 0.0)
        };
        let counts = signal.count(uneven, 80.5);
        assert_eq!((counts.sensor, counts.reference), (18, 144));
    }

    #[test]
    fn edges_between_reference_ticks_are_counted_at_whole_ticks() {
        // Sensor period of 10.5 clocks, gate of 64. Rising edges at 0.25, 10.75, ... 52.75, 63.25:
        // 6 periods in 63 - 0 clocks; falling edges at 5.5, 16, ... 58: 5 periods in 58 - 5 clocks.
        let rate = 1.0 / 10.5;
        let signal = steady(1.0 - 0.25 * rate, rate, 64.0);
        let counts = signal.count(core(Counter::TwoGates, 0.0, 0.0), 64.0);
        assert_eq!((counts.sensor, counts.reference), (11, 63 + 53));
    }

    /// Counts one gate by walking over every edge of a signal with the phase `phase + rate t + bend
    /// t²/2`.
    fn walk(phase: f64, rate: f64, bend: f64, opening: f64, clocks: f64) -> (u64, u64) {
        let mut edges = (0..).map(|edge| {
            let advance = f64::from(edge) - phase;
            // Root of `bend t²/2 + rate t = advance`, in the form without cancellation for a small
            // bend.
            2.0 * advance / (rate + (rate * rate + 2.0 * bend * advance).sqrt())
        });
        let first = edges.find(|&time| time >= opening).expect("an edge");
        let (mut last, mut periods) = (first, 0);
        for time in edges.take_while(|&time| time <= clocks) {
            last = time;
            periods += 1;
        }
        (periods, last.floor() as u64 - first.floor() as u64)
    }

    #[test]
    fn the_shortcut_agrees_with_a_walk_over_all_edges() {
        let mut random = crate::random::Random::new(3, 0);
        for trial in 0..4_000 {
            let clocks = 16.0 * (9.0 + (random.uniform() * 300.0).floor());
            // Half of the trials have only 0.5 to 10 periods in the gate. Their frequency is
            // constant, since the tested code assumes a constant frequency up to the first edge and
            // after the last.
            let (rate, change) = if trial % 2 == 0 {
                (0.02 + 0.23 * random.uniform(), 0.01)
            } else {
                ((0.5 + 9.5 * random.uniform()) / clocks, 0.0)
            };
            // The frequency changes by up to one percent over the gate.
            let bend = change * rate / clocks * random.uniform();
            let phase = random.uniform();
            let falling_edge = 0.1 + 0.8 * random.uniform();
            let core = Core {
                falling_edge,
                ..core(Counter::TwoGates, 4.0, 0.5)
            };
            let signal = DividedSignal {
                phase,
                cycles: rate * clocks + bend * clocks * clocks / 2.0,
                first_rate: rate,
                last_rate: rate + bend * clocks,
            };
            let opening = 4.0 + 0.5 / rate;
            let rising = walk(phase, rate, bend, opening, clocks);
            let falling = walk(phase + 1.0 - falling_edge, rate, bend, opening, clocks);
            let counts = signal.count(core, clocks);
            assert_eq!(counts.sensor, rising.0 + falling.0, "trial {trial}");
            let walked = rising.1 + falling.1;
            // With a varying frequency, the rounding of the first edge's time may differ by one
            // clock.
            assert!(counts.reference.abs_diff(walked) <= 1, "trial {trial}");

            let halves = Core {
                counter: Counter::HalfPeriods,
                ..core
            };
            let counts = signal.count(halves, clocks);
            let walked = walk(2.0 * phase, rate, bend / 2.0, 2.0 * opening, 2.0 * clocks);
            assert_eq!(counts.sensor, walked.0, "halves, trial {trial}");
            assert!(
                counts.reference.abs_diff(walked.1) <= 1,
                "halves, trial {trial}"
            );
        }
    }

    #[test]
    fn too_few_edges_count_nothing() {
        let counts = steady(0.1, 0.001, 160.0).count(core(Counter::TwoGates, 0.0, 0.0), 160.0);
        assert_eq!(counts.ratio(), Ratio::Zero);
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let counts =
                steady(0.5, rate, 160.0).count(core(Counter::HalfPeriods, 4.0, 1.0), 160.0);
            let _ = counts.ratio();
        }
    }

    #[test]
    fn words_are_rounded_to_the_nearest() {
        let word = |sensor, reference| Counts { sensor, reference }.ratio();
        assert_eq!(word(1, 2), Ratio::Word(1 << 27));
        assert_eq!(word(1, 3), Ratio::Word(89_478_485)); // 89478485.33
        assert_eq!(word(2, 3), Ratio::Word(178_956_971)); // 178956970.67
        assert_eq!(word(3, 3), Ratio::FullScale);
        assert_eq!(word(1, 0), Ratio::Zero);
        // the word in eddy-ng's README: 0x4409e8b = 2^28 * 12854 / 48364 - 0.32
        assert_eq!(word(12_854, 48_364), Ratio::Word(0x0440_9E8B));
    }

    #[test]
    fn the_exact_ratio_keeps_the_same_ends() {
        assert_eq!(exact_ratio(0.25), Ratio::Word(1 << 26));
        assert_eq!(exact_ratio(1.0), Ratio::FullScale);
        assert_eq!(exact_ratio(0.0), Ratio::Zero);
        assert_eq!(exact_ratio(f64::NAN), Ratio::Zero);
    }
}
