//! What the firmware decides without touching hardware: from settings to a plan for the converter,
//! and from frames with their edges to samples in time.
//!
//! The tasks of `palpate-firmware` are shells over it: they own bus, pins and clock, and pass what
//! they have read. Time is an argument, in microseconds of the board's timer.

#![no_std]
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

pub mod acquisition;
