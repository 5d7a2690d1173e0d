//! Computations for designers of a sensor, and decoding of conversion words.

pub mod field;
pub mod plan;
pub mod plan_ldc;
pub mod plan_touch;
pub mod stack;
pub mod words;
