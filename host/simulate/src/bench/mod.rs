//! The simulated bench: rigs, stage and gauges of `palpate_sim`, for a calibration.

mod gauges;
mod native;
#[cfg(test)]
mod tests;

pub use self::gauges::{GaugeReading, bench_sample};
pub use self::native::{NativeBench, mean_bare, on_rig, press};
