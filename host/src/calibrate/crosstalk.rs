//! What the coil's current adds to the reading of the untouched sensor.

use palpate_sim::bench::Pressed;

use super::curve::ForceCurve;
use super::least_squares::System;
use super::samples::Run;
use super::{Known, Unusable};

/// What the coil's current adds to the reading: X I^2 + G I^2 x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crosstalk {
    /// X, m/A^2, from the train without contact.
    pub(crate) untouched_m_per_a2: f64,
    /// G, 1/A^2, from the trains on block and springs ([`actuated`](super::actuated)).
    pub(crate) growth_per_a2: f64,
}

impl Crosstalk {
    /// Determines the part that is there without contact.
    pub(super) fn fit(runs: &[Run], force: &ForceCurve, known: &Known) -> Result<Self, Unusable> {
        Ok(Self {
            untouched_m_per_a2: untouched(runs, force, known)?,
            growth_per_a2: 0.0,
        })
    }

    /// A reading without it.
    pub(crate) fn without(&self, read_m: f64, current_a: f64) -> f64 {
        let square_a2 = current_a * current_a;
        (read_m - self.untouched_m_per_a2 * square_a2) / (1.0 + self.growth_per_a2 * square_a2)
    }

    /// The growth with the press as a part of X, 1/m.
    pub(super) fn growth_per_m(&self) -> f64 {
        // Where nothing is, nothing grows.
        if self.untouched_m_per_a2 == 0.0 {
            return 0.0;
        }
        self.growth_per_a2 / self.untouched_m_per_a2
    }
}

/// Apparent deformation per square of the current, m/A^2.
fn untouched(runs: &[Run], force: &ForceCurve, known: &Known) -> Result<f64, Unusable> {
    let free = runs
        .iter()
        .find(|run| run.pressed == Pressed::Nothing)
        .ok_or(Unusable::Missing("train without contact"))?;
    let metres_per_change = force.slope(0.0) / known.sensing_n_per_m;
    let mut system = System::new(3);
    for sample in &free.falls {
        let square_a2 = sample.current_a * sample.current_a;
        let apparent_m = sample.change * metres_per_change;
        system.add(vec![1.0, sample.time_s, square_a2], apparent_m, 1.0);
    }
    let solution = system.solve("the cross-talk")?;
    solution
        .unknowns
        .get(2)
        .copied()
        .ok_or(Unusable::Undetermined("the cross-talk"))
}
