#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable,
        clippy::indexing_slicing
    )
)]
#![doc = include_str!("../README.md")]

mod access;
mod bus;
mod chip;
mod conversion;
mod counter;
mod drive;
mod errors;
mod faults;
mod i2c;
mod i2c_state;
mod random;
mod registers;
mod results;
mod sensor;
mod sequence;
mod sequence_state;
mod settings;
mod switches;
mod time;

pub use bus::{Bus, Delay, I2cError, IntbPin, ShutdownPin};
pub use chip::{Chip, Misuse};
pub use conversion::TrueConversion;
pub use counter::Counts;
pub use errors::Errors;
pub use faults::{ChipFault, FaultEvent, Lost, Path, ScheduleFull, Span, Strike, Trigger};
pub use i2c::Ack;
pub use i2c_state::Traffic;
pub use results::CHANNELS;
pub use sensor::{Sensors, Tank, Window};
pub use settings::{Conversions, ExternalClock, InternalClock, PartNumber, SensorDrive, Settings};
pub use switches::{
    ActiveWrite, BurstRead, ConfigReadback, Counter, Deglitch33, EarlyTermination, FlagRead,
    InterruptRelease, Overhead, Overwrite, RcountMinimum, ShadowLatch, SleepExit, StatusReporting,
    Switches, UnreadCleared,
};
pub use time::Time;
