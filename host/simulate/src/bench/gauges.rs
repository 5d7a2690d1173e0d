//! Readings of the bench's gauges, beside a sample of the instrument.

use palpate_calibration::session::BenchSample;
use palpate_sim::current::effective_current_a;
use palpate_sim::rig::RigReading;
use palpate_wire::record::Sample;

/// Readings of the bench's gauges at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GaugeReading {
    /// Load cell, N.
    pub force_n: Option<f64>,
    /// Scale of the stage, m.
    pub stage_m: Option<f64>,
}

impl From<RigReading> for GaugeReading {
    fn from(reading: RigReading) -> Self {
        Self {
            force_n: Some(reading.force_n),
            stage_m: Some(reading.stage_m),
        }
    }
}

/// Combines a sample of the instrument, taken at `time_s`, with gauge readings taken at
/// `gauges_time_s`. Returns `None` for a sample without a channel.
pub fn bench_sample(
    time_s: f64,
    sample: &Sample,
    gauges_time_s: f64,
    gauges: GaugeReading,
) -> Option<BenchSample> {
    let conversion = sample.channels.first()?;
    Some(BenchSample {
        time_s,
        frequency_hz: conversion.frequency_hz,
        current_a: effective_current_a(
            sample.current_a.unwrap_or(0.0).into(),
            sample.ripple_a.unwrap_or(0.0).into(),
        ),
        gauges_time_s,
        force_n: gauges.force_n,
        stage_m: gauges.stage_m,
    })
}
