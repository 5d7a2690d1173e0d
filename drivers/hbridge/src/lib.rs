#![no_std]
#![doc = include_str!("../README.md")]
#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing)
)]

mod averages;
mod blame;
mod correction;
mod current_line;
mod drive;
mod energy;
mod fault;
mod hardware;
mod limits;
mod line;
mod output;
mod pins;
mod probe;
mod regulator;
mod ripple;
mod self_test;
mod supervisor;
mod trace;
mod watch;

pub use averages::{Averages, BLOCK, Moment};
pub use correction::Correction;
pub use current_line::CurrentLine;
pub use drive::{Drive, DriveState, Order, Report};
pub use energy::{Account, EnergyDemand, Load};
pub use fault::{Fault, Refusal};
pub use hardware::{CoilParameters, Decay, Hardware};
pub use limits::Limits;
pub use output::{Levels, Output};
pub use pins::{HBridge, PinError};
pub use probe::{FROZEN_WITHIN, HELD_BEFORE};
pub use ripple::Ripple;
pub use self_test::{Findings, SELF_TEST_J};
pub use supervisor::Supervisor;
pub use trace::Trace;
pub use watch::{ATTENDED_WITHIN, BALANCED_WITHIN, FOLLOWS_WITHIN};
