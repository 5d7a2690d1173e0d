//! Cross-talk: the apparent deformation that the coil's current adds to the reading.

use crate::session::Pressed;

use super::curve::PressCurve;
use super::least_squares::System;
use super::samples::SampleRun;
use super::{Known, Unusable};

/// Cross-talk of the coil's current: X I^2 (1 + growth x).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crosstalk {
    /// X, m/A^2.
    pub untouched_m_per_a2: f64,
    /// Growth with the deformation, 1/m.
    pub growth_per_m: f64,
}

impl Crosstalk {
    /// Determines X and the growth, with the load cell.
    pub(crate) fn fit(
        runs: &[SampleRun],
        force: &PressCurve,
        known: &Known,
    ) -> Result<Self, Unusable> {
        let untouched_m_per_a2 = untouched(runs, force, known)?;
        Ok(Self {
            untouched_m_per_a2,
            growth_per_m: growth(runs, force, untouched_m_per_a2, known)?,
        })
    }

    /// Determines the cross-talk without contact; its growth stays zero.
    pub(crate) fn without_contact(
        runs: &[SampleRun],
        force: &PressCurve,
        known: &Known,
    ) -> Result<Self, Unusable> {
        Ok(Self {
            untouched_m_per_a2: untouched(runs, force, known)?,
            growth_per_m: 0.0,
        })
    }

    /// Reading for a deformation, m.
    pub(crate) fn with(&self, deformation_m: f64, current_a: f64) -> f64 {
        let untouched_m = self.untouched_m_per_a2 * current_a * current_a;
        deformation_m * (1.0 + untouched_m * self.growth_per_m) + untouched_m
    }

    /// Deformation for a reading, m.
    pub(crate) fn without(&self, read_m: f64, current_a: f64) -> f64 {
        let untouched_m = self.untouched_m_per_a2 * current_a * current_a;
        (read_m - untouched_m) / (1.0 + untouched_m * self.growth_per_m)
    }
}

/// Growth of the cross-talk with the deformation, 1/m, from the trains on block and springs.
///
/// On the falls of run j the coil reads
///
/// x = a_j + d_j phi(t) + F/c + X I^2 (1 + growth x),
///
/// with the force F from the load cell. On a single run both F and the cross-talk follow I^2, so
/// their shares cannot be distinguished. But on a soft spring the force follows I^2 less than on a
/// block, while the cross-talk is the same. c is the sensing layer's spring for changes as fast as
/// the ramps.
fn growth(
    runs: &[SampleRun],
    force: &PressCurve,
    crosstalk_m_per_a2: f64,
    known: &Known,
) -> Result<f64, Unusable> {
    let pressed: Vec<&SampleRun> = runs
        .iter()
        .filter(|run| run.pressed != Pressed::Nothing)
        .collect();
    let unknowns = 2 + 2 * pressed.len();
    let mut system = System::new(unknowns);
    for (index, run) in pressed.iter().enumerate() {
        for sample in &run.falls {
            let untouched_m = crosstalk_m_per_a2 * sample.current_a * sample.current_a;
            let read_m = force.at(sample.change) / known.sensing_n_per_m;
            let phi = (sample.time_s / run.since_touch_s).ln_1p();
            let mut row = vec![0.0; unknowns];
            let own = row.iter_mut().skip(2 + 2 * index);
            own.zip([1.0, phi])
                .for_each(|(entry, value)| *entry = value);
            let force_n = sample.force_n.ok_or(Unusable::Missing("load cell"))?;
            let shared = [force_n, untouched_m * (read_m - untouched_m)];
            let entries = row.iter_mut().zip(shared);
            entries.for_each(|(entry, value)| *entry = value);
            system.add(row, read_m - untouched_m, 1.0);
        }
    }
    // A cross-talk of a millionth of the deformation needs no growth, and cannot determine one.
    let greatest_a2 = f64::from(known.settings.peak_current_a).powi(2);
    let deepest_m = force.at(force.greatest_change) / known.sensing_n_per_m;
    if (crosstalk_m_per_a2 * greatest_a2).abs() < 1e-6 * deepest_m {
        return Ok(0.0);
    }
    let solution = system.solve("the cross-talk's growth with the press")?;
    solution
        .unknowns
        .get(1)
        .copied()
        .ok_or(Unusable::Undetermined("the cross-talk's growth"))
}

/// Apparent deformation per square of the current, m/A^2.
fn untouched(runs: &[SampleRun], force: &PressCurve, known: &Known) -> Result<f64, Unusable> {
    let free = runs
        .iter()
        .find(|run| run.pressed == Pressed::Nothing)
        .ok_or(Unusable::Missing("train without contact"))?;
    let metres_per_change = force.slope(0.0) / known.sensing_n_per_m;
    let mut system = System::new(3);
    for sample in &free.falls {
        let square_a2 = sample.current_a * sample.current_a;
        let apparent_m = sample.change * metres_per_change;
        system.add([1.0, sample.time_s, square_a2], apparent_m, 1.0);
    }
    let solution = system.solve("the cross-talk")?;
    solution
        .unknowns
        .get(2)
        .copied()
        .ok_or(Unusable::Undetermined("the cross-talk"))
}
