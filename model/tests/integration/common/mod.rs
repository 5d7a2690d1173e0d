//! References for the tests and examples: a plant, a noise source and a reference estimator, all in
//! `f64` and independent of the crate. None of them calls the crate's formulas; only the conversion
//! of a reading uses the crate's own sample type.
#![allow(dead_code, unreachable_pub)]

pub mod layer;
pub mod linalg;
pub mod pipeline;
pub mod plant;
pub mod reference;
pub mod rng;
pub mod touch_world;
