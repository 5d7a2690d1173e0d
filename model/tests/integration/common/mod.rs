//! What the tests and examples judge by: a plant, a noise source, bounds and a reference
//! estimator, all in `f64` and written apart from the crate. None of it calls the crate's
//! functions; only the conversion of a reading into the crate's own sample type knows it.
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
