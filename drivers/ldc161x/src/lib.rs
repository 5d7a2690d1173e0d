#![no_std]
#![doc = include_str!("../README.md")]

mod bus;
mod chip;
mod configuration;
mod drive;
mod driver;
mod error;
mod plan;
mod rational;
mod reading;
mod refusal;
mod register;
mod scale;
mod state;

pub use bus::BusAccess;
pub use chip::{Acquisition, Address, Channel, Model, Sequence};
pub use configuration::{ChannelSettings, Configuration, ReferenceClock};
pub use drive::{DriveCode, HIGHEST_AMPLITUDE_V, LOWEST_AMPLITUDE_V, LOWEST_CLEAN_AMPLITUDE_V};
#[cfg(feature = "async")]
pub use driver::AsyncLdc161x;
pub use driver::Ldc161x;
pub use error::{Direction, Error};
pub use plan::{Advice, Plan, Rate, Request, Sensor};
pub use rational::{Hypothesis, PlausibilityCount, RatioOfSums, Rational, Window};
pub use reading::{Code28, Flags, Frame, Freshness, Marks, Quality, Reading, Word};
pub use refusal::LimitError;
pub use register::{
    ClockDividers, Config, DEVICE_ID, Deglitch, DriveCurrent, ErrorConfig, MANUFACTURER_ID,
    MuxConfig, Rcount, Register, SettleCount, Status,
};
pub use scale::{Noise, Scale};
pub use state::{Canary, FrameRequest, InterruptRelease};
