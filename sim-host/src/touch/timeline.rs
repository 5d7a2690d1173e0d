//! Frequencies of a touched sensor over time, as the sensors of simulated converters.

use ldc161x_sim::Sensors;

use super::sensor::{Press, Pressing, Surroundings};

/// Frequencies of all coils in equal steps of time, interpolated linearly; the ends stay.
#[derive(Clone, Debug)]
pub struct Timeline {
    start_s: f64,
    step_s: f64,
    /// Frequencies, Hz, by time and coil.
    frequencies_hz: Vec<Vec<f64>>,
    first_coil: usize,
}

impl Timeline {
    /// Records a press from `start_s` for `count` steps of `step_s`. Noise is left to the converter.
    pub fn record(
        pressing: &mut Pressing<'_>,
        (start_s, step_s, count): (f64, f64, u32),
        path: impl Fn(f64) -> Press,
        around: &Surroundings,
    ) -> Self {
        let at = |step: u32| {
            let time_s = start_s + step_s * f64::from(step);
            pressing.frequencies_hz(time_s, &path(time_s), around)
        };
        Self {
            start_s,
            step_s,
            frequencies_hz: (0..=count).map(at).collect(),
            first_coil: 0,
        }
    }

    /// The coils of the second converter: those from the fifth on.
    #[must_use]
    pub fn second_converter(&self) -> Self {
        Self {
            first_coil: 4,
            ..self.clone()
        }
    }
}

impl Sensors for Timeline {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        let last = self.frequencies_hz.len().saturating_sub(1) as f64;
        let position = ((time_s - self.start_s) / self.step_s).clamp(0.0, last);
        let share = position - libm::floor(position);
        let coil = self.first_coil + channel;
        let steps = self.frequencies_hz.iter().skip(position as usize);
        let pair = steps.map(|all| all.get(coil).copied().unwrap_or(0.0));
        pair.zip([1.0 - share, share])
            .map(|(hz, weight)| weight * hz)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_its_coil_between_the_steps() {
        let timeline = Timeline {
            start_s: 1.0,
            step_s: 0.5,
            frequencies_hz: vec![vec![1.0, 2.0, 3.0, 4.0, 5.0], vec![2.0, 4.0, 3.0, 4.0, 9.0]],
            first_coil: 0,
        };
        assert_eq!(timeline.frequency_hz(1, 0.0), 2.0);
        assert_eq!(timeline.frequency_hz(1, 1.125), 2.5);
        assert_eq!(timeline.frequency_hz(1, 9.0), 4.0);
        let second = timeline.second_converter();
        assert_eq!(second.frequency_hz(0, 1.25), 7.0);
        assert_eq!(second.frequency_hz(1, 1.25), 0.0);
    }
}
