//! Courses of the current, as a bounded list of straight lines.

use crate::fault::Refusal;
use crate::limits::Limits;

/// Lines in a waveform, at most.
pub const MOST_SEGMENTS: usize = 48;

/// A straight line to a current.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Segment {
    /// Where it ends, A; the sign is the polarity.
    pub to_a: f32,
    /// How long it takes, s; 0 for at once.
    pub over_s: f32,
}

/// A list of segments, which begins and ends without current.
///
/// ```
/// use coil_hbridge::Waveform;
/// // eight ramps from 8 A down to 2 A in 60 ms, each after a rise of 5 ms and 10 ms of rest
/// let train = Waveform::train(8, 8.0, 2.0, [5e-3, 10e-3, 60e-3])?;
/// assert_eq!(train.segments().len(), 25);
/// assert!((train.duration_s() - 0.605).abs() < 1e-3);
/// # Ok::<(), coil_hbridge::Refusal>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Waveform(heapless::Vec<Segment, MOST_SEGMENTS>);

impl Waveform {
    /// No current, for no time.
    #[must_use]
    pub const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    /// Goes on to a current.
    ///
    /// # Errors
    /// No number, a negative duration, no room.
    pub fn line(mut self, to_a: f32, over_s: f32) -> Result<Self, Refusal> {
        if !to_a.is_finite() {
            return Err(Refusal::Current(to_a));
        }
        // Negated, so that NaN fails.
        if !(over_s >= 0.0 && over_s.is_finite()) {
            return Err(Refusal::Duration(over_s));
        }
        self.0
            .push(Segment { to_a, over_s })
            .map_err(|_| Refusal::Full)?;
        Ok(self)
    }

    /// Stays where it is.
    ///
    /// # Errors
    /// As [`line`](Self::line).
    pub fn hold(self, for_s: f32) -> Result<Self, Refusal> {
        let at_a = self.0.last().map_or(0.0, |last| last.to_a);
        self.line(at_a, for_s)
    }

    /// A train of falling ramps: for each a rise to the peak, a rest there, the fall; at the end
    /// down to nothing in the time of a rise.
    ///
    /// # Errors
    /// As [`line`](Self::line).
    pub fn train(
        ramps: u8,
        peak_a: f32,
        end_a: f32,
        [rise_s, hold_s, fall_s]: [f32; 3],
    ) -> Result<Self, Refusal> {
        let mut train = Self::new();
        for _ in 0..ramps {
            train = train
                .line(peak_a, rise_s)?
                .hold(hold_s)?
                .line(end_a, fall_s)?;
        }
        train.line(0.0, rise_s)
    }

    /// A cycle that takes away magnetic memory: from one polarity to the other and back, each peak
    /// `keep` times the one before, and at last to nothing.
    ///
    /// # Errors
    /// As [`line`](Self::line).
    pub fn demagnetising(
        peak_a: f32,
        keep: f32,
        half_waves: u8,
        half_wave_s: f32,
    ) -> Result<Self, Refusal> {
        let (mut cycle, mut to_a) = (Self::new(), peak_a);
        for _ in 0..half_waves {
            cycle = cycle.line(to_a, half_wave_s)?;
            to_a *= -keep;
        }
        cycle.line(0.0, half_wave_s)
    }

    /// The segments.
    #[must_use]
    pub fn segments(&self) -> &[Segment] {
        &self.0
    }

    /// How long it takes, s.
    #[must_use]
    pub fn duration_s(&self) -> f32 {
        self.0.iter().map(|segment| segment.over_s).sum()
    }

    /// Integral of the current's square, A² s, from a current on.
    #[must_use]
    pub fn square_a2_s(&self, mut from_a: f32) -> f32 {
        let mut sum = 0.0;
        for &Segment { to_a, over_s } in &self.0 {
            sum += over_s * (from_a * from_a + from_a * to_a + to_a * to_a) / 3.0;
            from_a = to_a;
        }
        sum
    }

    /// Refuses what a limit forbids.
    pub(crate) fn check(&self, limits: &Limits) -> Result<(), Refusal> {
        let beyond = |segment: &&Segment| segment.to_a.abs() > limits.current_a;
        if let Some(segment) = self.0.iter().find(beyond) {
            return Err(Refusal::Current(segment.to_a));
        }
        let duration_s = self.duration_s();
        if duration_s > limits.on_time_s {
            return Err(Refusal::Duration(duration_s));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_train_rises_rests_and_falls() {
        let train = Waveform::train(2, 8.0, 2.0, [0.01, 0.02, 0.06]).unwrap();
        let ends: heapless::Vec<f32, 8> = train.segments().iter().map(|line| line.to_a).collect();
        assert_eq!(ends, [8.0, 8.0, 2.0, 8.0, 8.0, 2.0, 0.0]);
    }

    #[test]
    fn the_square_is_that_of_its_lines() {
        let ramp = Waveform::new().line(6.0, 1.0).unwrap().hold(2.0).unwrap();
        // 36/3 + 2 * 36
        assert!((ramp.square_a2_s(0.0) - 84.0).abs() < 1e-3);
    }

    #[test]
    fn demagnetising_alternates_and_ends() {
        let cycle = Waveform::demagnetising(8.0, 0.5, 4, 0.01).unwrap();
        let ends: heapless::Vec<f32, 8> = cycle.segments().iter().map(|line| line.to_a).collect();
        assert_eq!(ends, [8.0, -4.0, 2.0, -1.0, 0.0]);
    }

    #[test]
    fn it_is_bounded_and_takes_numbers_only() {
        assert_eq!(Waveform::train(17, 8.0, 2.0, [0.01; 3]), Err(Refusal::Full));
        for bad in [f32::NAN, f32::INFINITY] {
            assert!(Waveform::new().line(bad, 0.1).is_err());
            assert!(Waveform::new().line(1.0, bad).is_err());
        }
        assert!(Waveform::new().line(1.0, -0.1).is_err());
    }
}
