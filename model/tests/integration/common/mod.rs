//! References for the tests and examples: a plant, a noise source, bounds and a reference
//! estimator, all in `f64` and independent of the crate. None of them calls the crate's functions;
//! only the conversion of a reading uses the crate's own sample type.
#![allow(dead_code, unreachable_pub)]

pub mod disturbances;
pub mod efficiency;
pub mod fisher;
pub mod linalg;
pub mod pipeline;
pub mod plant;
pub mod reference;
pub mod rng;
pub mod statistics;
