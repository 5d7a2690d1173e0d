//! Scatter of a train's readings.

use palpate_wire::command::Settings;

use super::least_squares::System;
use super::samples::SampleRun;
use super::session::Run;

/// Smallest span of a train's readings to which their scatter is related, as a relative change of
/// inductance: 8 µm on the reference coil. Shallow trains on a hard load span half of that; on a
/// stand that vibrates by half a micrometre the scatter would be a tenth of their span.
const LEAST_SPAN: f64 = 2e-3;

/// Returns the standard deviation of the readings on the falls of a train about a smooth curve of
/// current and time, over their span, 8 µm at least. It contains noise and movements of the sensor.
/// `None` without a train.
pub fn train_scatter(run: &Run, settings: &Settings) -> Option<f64> {
    let train = SampleRun::new(run, settings).ok()?;
    let peak_a = f64::from(settings.peak_current_a);
    let mut system = System::new(6);
    for sample in &train.falls {
        let part = (sample.current_a / peak_a).powi(2);
        let creep = (sample.time_s / train.since_touch_s).ln_1p();
        let row = vec![1.0, sample.time_s, creep, part, part * part, part.powi(3)];
        system.add(row, sample.change, 1.0);
    }
    let changes = train.falls.iter().map(|sample| sample.change);
    let least = changes.clone().fold(f64::INFINITY, f64::min);
    let greatest = changes.fold(f64::NEG_INFINITY, f64::max);
    let solution = system.solve("the train's curve").ok()?;
    Some(solution.sigma / (greatest - least).max(LEAST_SPAN)).filter(|part| part.is_finite())
}
