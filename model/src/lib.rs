#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unreachable,
        clippy::unwrap_used,
    )
)]
// `!(a > b)` rejects NaN as well; comments mark these comparisons.
#![allow(clippy::neg_cmp_op_on_partial_ord)]
#![doc = include_str!("../README.md")]

pub mod calibration_curve;
pub mod contact;
mod coverage;
pub mod hardness;
pub mod indentation;
pub mod magnetorheological;
pub mod math;
pub mod ramp;
pub mod springs;
pub mod tank;
pub mod thermal;
pub mod touch;
pub mod uncertainty;
pub mod units;
