//! Simulated sensors in a world: calibrated on their own bench, pressed, compared with the truth.

pub mod bench;
pub mod campaign;
pub mod demo;
pub mod engine;
pub mod instrument;
pub mod press;
mod report;
pub mod results;
pub mod scenario;
pub mod shard;
pub mod touch;
pub mod verdict;
