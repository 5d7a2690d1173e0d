//! What is computed of a sensor before it is built, and of conversion words.

pub mod field;
pub mod plan;
pub mod plan_ldc;
pub mod stack;
pub mod words;
