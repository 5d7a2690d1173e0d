//! Inputs of the bridge.

use crate::rp2040::pwm::Wave;

/// Source of a bridge input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InputSource {
    /// A constant level.
    Level(bool),
    /// An output of the PWM: A or B.
    Pwm(usize),
}

/// Levels at the bridge's pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BridgeInputs {
    /// Whether nSLEEP is high.
    pub awake: bool,
    /// Whether the bridge's current limit is reduced, for its test.
    pub limit_low: bool,
    pub(crate) sources: [InputSource; 2],
}

impl Default for BridgeInputs {
    fn default() -> Self {
        Self {
            awake: false,
            limit_low: false,
            sources: [InputSource::Level(false); 2],
        }
    }
}

impl BridgeInputs {
    pub(crate) fn levels_at(&self, wave: &Wave, now_ps: u64) -> [bool; 2] {
        self.sources.map(|source| match source {
            InputSource::Level(level) => level,
            InputSource::Pwm(output) => wave.is_high(output, now_ps),
        })
    }

    /// Time at which an input next changes without an access.
    pub(crate) fn next_edge(&self, wave: &Wave, now_ps: u64) -> u64 {
        let edges = self.sources.into_iter().filter_map(|source| match source {
            InputSource::Level(_) => None,
            InputSource::Pwm(output) => wave.next_edge(output, now_ps),
        });
        edges.min().unwrap_or(u64::MAX)
    }
}
