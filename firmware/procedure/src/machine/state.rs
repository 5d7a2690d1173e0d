//! State of the procedure between two steps.

use coil_hbridge::{Account, Load};
use ldc161x::{Quality, Reading};
use palpate_model::units::{Ampere, Celsius};
use palpate_wire::code::{FaultCode, Outcome, State, StorageAction};
use palpate_wire::command::DriveCoil;
use palpate_wire::{Command, Header};

use crate::configuration::Cursor;
use crate::event::Failure;
use crate::link::Link;
use crate::measurement::train::TrainSegment;
use crate::measurement::{EstimateReport, Measurement, TrainDrive};
use crate::steadiness::Steadiness;
use crate::storage::Stored;
use crate::time::Instant;

/// Phase of the procedure, with its data.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one of it, and no heap to put the larger ones on"
)]
pub(super) enum Phase {
    SelfTest {
        good: u8,
    },
    Baseline,
    Watching,
    /// An object has touched since this time.
    Contact {
        since: Instant,
    },
    Settling(Settling),
    Driving(Measurement),
    /// Train for calibration, with the start of a touch if there is one.
    Sweeping {
        drive: TrainDrive,
        touched: Option<Instant>,
    },
    /// The estimate was sent; the points of the load's curve follow, one per step.
    Reporting {
        report: EstimateReport,
        next: u8,
        /// Start of the touch; `None` once the object is lifted.
        touched: Option<Instant>,
    },
    /// A measurement was completed or refused; the object still touches.
    Release {
        since: Instant,
    },
    /// Current commanded directly by a PC.
    Manual(ManualDrive),
    Fault(Failure),
}

/// State of waiting for a steady press.
#[derive(Clone, Debug)]
pub(super) struct Settling {
    /// Start of the touch.
    pub(super) touched: Instant,
    pub(super) began: Instant,
    pub(super) steadiness: Steadiness,
    /// Last rate of the deformation, in m/s.
    pub(super) rate_m_per_s: f32,
    /// Number of flagged conversions.
    pub(super) flagged: u32,
    /// Time of the last usable conversion.
    pub(super) last: Option<Instant>,
}

/// Kind of activity of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Activity {
    /// Sensing, with the coil at rest.
    Sensing,
    /// Waiting for a steady press.
    Settling,
    /// Driving a train.
    Train,
    /// Driving a current commanded by a PC.
    Manual,
    /// Sending a result.
    Reporting,
    /// Stopped by a fault.
    Fault,
}

impl Activity {
    /// Returns whether the coil is driven.
    pub(super) const fn drives(self) -> bool {
        matches!(self, Self::Train | Self::Manual)
    }

    /// Returns whether the activity ends in a result or a refusal.
    pub(super) const fn measures(self) -> bool {
        matches!(self, Self::Settling | Self::Train)
    }

    /// Checks that a command may use the coil; otherwise returns the command's outcome.
    pub(super) const fn ensure_free(self) -> Result<(), Outcome> {
        match self {
            Self::Sensing => Ok(()),
            Self::Fault => Err(Outcome::Faulted),
            Self::Settling | Self::Train | Self::Manual | Self::Reporting => Err(Outcome::Busy),
        }
    }
}

impl Phase {
    pub(super) const fn activity(&self) -> Activity {
        match self {
            Self::SelfTest { .. }
            | Self::Baseline
            | Self::Watching
            | Self::Contact { .. }
            | Self::Release { .. } => Activity::Sensing,
            Self::Settling(_) => Activity::Settling,
            Self::Driving(_) | Self::Sweeping { .. } => Activity::Train,
            Self::Manual(_) => Activity::Manual,
            Self::Reporting { .. } => Activity::Reporting,
            Self::Fault(_) => Activity::Fault,
        }
    }

    pub(super) const fn state(&self) -> State {
        match self {
            Self::SelfTest { .. } => State::SelfTest,
            Self::Baseline => State::Baseline,
            Self::Watching => State::Watching,
            Self::Contact { .. } => State::Contact,
            Self::Settling(_) => State::Settling,
            Self::Driving(Measurement { drive, .. }) | Self::Sweeping { drive, .. } => {
                let train = drive.train();
                match train.segment() {
                    TrainSegment::Rise | TrainSegment::Hold if train.completed() == 0 => {
                        State::Peak
                    }
                    _ => State::Ramps,
                }
            }
            Self::Reporting { .. } => State::Estimating,
            Self::Release { .. } => State::Release,
            Self::Manual(_) => State::Manual,
            Self::Fault(_) => State::Fault,
        }
    }
}

/// State of a current commanded directly by a PC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ManualDrive {
    pub(super) began: Instant,
    /// Link of the commanding PC; `last_received` is the time of its last message.
    pub(super) link: Link,
    pub(super) last_received: Instant,
    /// Start of the touch, if there is one.
    pub(super) touched: Option<Instant>,
}

/// State of the coil's test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CoilTestState {
    /// Not tested since arming, or the test was stopped.
    None,
    /// Test in progress since this time.
    Testing(Instant),
    /// Tested: the coil may be driven.
    Tested,
}

/// Command that needs the coil.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum CoilCommand {
    Measure,
    Sweep,
    Test,
    Drive(DriveCoil),
}

/// Command that waits for the end of the coil's test.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Waiting {
    pub(super) link: Link,
    pub(super) header: Header,
    pub(super) kind: u8,
    pub(super) command: CoilCommand,
}

impl CoilCommand {
    pub(super) fn of(command: &Command) -> Option<Self> {
        Some(match command {
            Command::Measure => Self::Measure,
            Command::Sweep => Self::Sweep,
            Command::TestCoil => Self::Test,
            Command::DriveCoil(line) => Self::Drive(line.clone()),
            _ => return None,
        })
    }
}

/// Last reports of the drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// Energy account and the time of its report.
    pub(super) account: Option<(Instant, Account)>,
    /// Current at the last scan.
    pub(super) current: Ampere,
    /// Start of the last coil test.
    pub(super) tested: Instant,
    /// Last step in which the coil was driven.
    pub(super) driven: Instant,
    /// Load measured by the coil test, and the lowest possible copper temperature at that time.
    pub(super) load: Option<(Load, Celsius)>,
}

impl Budget {
    pub(super) const fn new() -> Self {
        Self {
            account: None,
            current: Ampere(0.0),
            tested: Instant::from_ticks(0),
            driven: Instant::from_ticks(0),
            load: None,
        }
    }
}

/// For each channel, the time since which its readings have been flagged without a good one between.
#[derive(Clone, Debug, Default)]
pub(super) struct FlaggedSince {
    pub(super) channels: [[Option<Instant>; 4]; 2],
    /// At least one channel was flagged at the last check.
    pub(super) any: bool,
}

/// Returns the fault that a flag indicates. A reading that is old, inconsistent between two reads, or
/// after a gap does not indicate a fault of the sensor.
const fn cause(quality: Quality) -> Option<FaultCode> {
    match quality {
        Quality::Watchdog | Quality::UnderRange => Some(FaultCode::SensorNotOscillating),
        Quality::Amplitude => Some(FaultCode::SensorAmplitude),
        Quality::OverRange | Quality::AboveQuarterReference => Some(FaultCode::SensorOverRange),
        Quality::Good | Quality::AfterGap | Quality::Repeated | Quality::Differs => None,
    }
}

/// Returns whether a fault is of the readings, so that only good readings end it.
pub(super) const fn is_of_readings(code: FaultCode) -> bool {
    matches!(
        code,
        FaultCode::SensorNotOscillating | FaultCode::SensorAmplitude | FaultCode::SensorOverRange
    )
}

impl FlaggedSince {
    pub(super) fn forget_ended(&mut self) {
        self.any = self.channels.iter().flatten().any(Option::is_some);
    }

    /// Takes a reading; returns the fault and its start while the channel is flagged.
    pub(super) fn push(
        &mut self,
        sensor: u8,
        reading: &Reading,
        now: Instant,
    ) -> Option<(FaultCode, Instant)> {
        let channels = self.channels.get_mut(usize::from(sensor & 1))?;
        let since = channels.get_mut(usize::from(reading.channel.number()))?;
        let quality = reading.quality();
        if quality == Quality::Good {
            *since = None;
        }
        let code = cause(quality)?;
        self.any = true;
        Some((code, *since.get_or_insert(now)))
    }
}

/// State of the storage.
#[derive(Clone, Debug)]
pub(super) struct Storage {
    pub(super) stored: Stored,
    /// Number of stored items that the board refused when they were loaded.
    pub(super) refused: u16,
    pub(super) work: Option<Work>,
    /// An operation did not end: the flash may be unreadable until a restart.
    pub(super) is_abandoned: bool,
}

/// Operation in progress and its start.
#[derive(Clone, Debug)]
pub(super) struct Work {
    pub(super) action: StorageAction,
    pub(super) since: Instant,
    /// Position in the configuration of the next item to save.
    pub(super) put: Cursor,
    /// A load has delivered an item.
    pub(super) has_items: bool,
}

impl Storage {
    pub(super) const fn new() -> Self {
        Self {
            stored: Stored::UNAVAILABLE,
            refused: 0,
            work: None,
            is_abandoned: false,
        }
    }

    pub(super) const fn is_at_work(&self) -> bool {
        self.work.is_some()
    }
}
