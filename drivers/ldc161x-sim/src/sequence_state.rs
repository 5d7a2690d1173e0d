//! State of the conversion schedule.

use crate::conversion::Gate;
use crate::results::CHANNELS;
use crate::time::{Moment, Time};

/// Current step of the schedule.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SequenceStep {
    /// Asleep, shut down or without supply.
    Idle,
    /// Start-up of 16 384 periods of the internal oscillator after sleep.
    StartUp,
    /// The oscillation of the current channel builds up.
    Activation,
    /// The current channel is counted.
    Conversion(Gate),
    /// Pause after a conversion.
    Pause,
}

/// State of the schedule.
#[derive(Clone, Debug)]
pub(crate) struct Sequence {
    pub(crate) step: SequenceStep,
    pub(crate) channel: u8,
    pub(crate) ends: Moment,
    /// Length of the last activation, and the time at which it ended.
    pub(crate) settle_s: f64,
    pub(crate) settled: Moment,
    /// Phase of the divided sensor signal, cycles.
    pub(crate) phase: f64,
    /// Time at which the watchdog times out, unless an oscillating sensor and a running reference
    /// restart it before.
    pub(crate) watchdog: Moment,
    /// Drive codes that the amplitude calibration has found since the chip left sleep.
    pub(crate) calibrated: [Option<u8>; CHANNELS],
}

impl Sequence {
    pub(crate) fn new() -> Self {
        let start = Moment::at(Time::ZERO);
        Self {
            step: SequenceStep::Idle,
            channel: 0,
            ends: Moment::NEVER,
            settle_s: 0.0,
            settled: start,
            phase: 0.0,
            watchdog: Moment::NEVER,
            calibrated: [None; CHANNELS],
        }
    }

    /// Stops the schedule; the next start calibrates again.
    pub(crate) fn halt(&mut self) {
        self.step = SequenceStep::Idle;
        self.ends = Moment::NEVER;
        self.calibrated = [None; CHANNELS];
    }

    /// Notes that a register was written during the current conversion.
    pub(crate) fn disturb(&mut self) {
        if let SequenceStep::Conversion(gate) = &mut self.step {
            gate.disturbed = true;
        }
    }

    pub(crate) fn enter(&mut self, step: SequenceStep, ends: Moment) {
        self.step = step;
        self.ends = ends;
    }

    pub(crate) fn measures(&self) -> bool {
        !matches!(self.step, SequenceStep::Idle | SequenceStep::StartUp)
    }
}
