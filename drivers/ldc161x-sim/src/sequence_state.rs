//! State of the conversion schedule.

use crate::conversion::Gate;
use crate::results::CHANNELS;
use crate::time::{Moment, Time};

/// Current step of the schedule.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SequenceStep {
    /// Asleep, shut down or without supply.
    Idle,
    /// The 16 384 periods of the internal oscillator after sleep.
    StartUp,
    /// The oscillation of a channel builds up.
    Activation,
    /// A channel is counted.
    Conversion(Gate),
    /// Pause between a conversion and the next step.
    Pause,
}

/// State of the schedule.
#[derive(Clone, Debug)]
pub(crate) struct Sequence {
    pub(crate) step: SequenceStep,
    pub(crate) channel: u8,
    pub(crate) ends: Moment,
    /// Length and end of the last activation.
    pub(crate) settle_s: f64,
    pub(crate) settled: Moment,
    /// Phase of the divided sensor signal, cycles.
    pub(crate) phase: f64,
    /// Time at which the watchdog acts, unless it sees an oscillation and a reference before.
    pub(crate) watchdog: Moment,
    /// Codes that the amplitude calibration has found since the chip left sleep.
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

    /// Stops; the next start calibrates again.
    pub(crate) fn halt(&mut self) {
        self.step = SequenceStep::Idle;
        self.ends = Moment::NEVER;
        self.calibrated = [None; CHANNELS];
    }

    /// Records a register write during a conversion.
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
