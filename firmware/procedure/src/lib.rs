#![doc = include_str!("../README.md")]
#![no_std]
#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing)
)]

mod action;
mod answer;
pub mod board;
pub mod boot;
pub mod configuration;
mod deformation;
pub mod event;
mod heat;
mod link;
mod list;
mod machine;
mod measurement;
mod relaxation;
mod steadiness;
pub mod storage;
mod stream;
pub mod thermometer;
mod time;
mod touch;

pub use action::{Action, Actions};
/// Units of the quantities in the public functions.
pub use palpate_model::units;

pub use board::{BoardInfo, Limits};
pub use configuration::Configuration;
pub use event::{Conversion, Event, Scan};
pub use link::Link;
pub use machine::Procedure;
pub use time::{Duration, Instant};
