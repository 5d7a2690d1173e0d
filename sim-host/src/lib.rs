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

pub mod current;
pub mod device;
pub mod electrical;
pub mod magnetorheological;
pub mod mechanics;
pub mod native;
pub mod parameters;
pub mod random;
pub mod replay;
pub mod rig;
pub mod scenario;
pub mod sensing_coil;
pub mod stack;
pub mod switches;
pub mod thermal;
pub mod touch;
pub mod world;

/// Virtual time, shared by world and converter: whole picoseconds, so that no clock drifts against
/// another.
pub use ldc161x_sim::Time;
