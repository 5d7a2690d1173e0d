//! Force against relative change of inductance, and the bench's own frame.

use palpate_sim::bench::Pressed;

use super::Unusable;
use super::least_squares::System;
use super::samples::Run;

/// Degree of the polynomial through the quick presses: with 7 the coil's own curve between two slabs
/// is met as with 9.
const DEGREE: usize = 7;
/// The coefficients of (y/y_greatest)^k fall off by this factor from one power to the next (0.36 to
/// 0.41 for presses of 0.3 to 0.5 mm between slabs 1 mm off): twice their size is what is believed
/// of them beforehand, so that noise of the load cell does not bend the curve.
const DECAY: f64 = 0.4;

/// F(y), y = L/L0 - 1, with F(0) = 0.
#[derive(Clone, Debug)]
pub(super) struct ForceCurve {
    /// Coefficients of (y/y_greatest)^k, k from 1, N.
    coefficients: Vec<f64>,
    pub(super) greatest_change: f64,
}

impl ForceCurve {
    /// Fits the presses upon the block.
    pub(super) fn fit(runs: &[Run]) -> Result<Self, Unusable> {
        let presses = runs.iter().filter(|run| run.pressed == Pressed::Block);
        let points: Vec<(f64, f64)> = presses.flat_map(|run| run.press.iter().copied()).collect();
        let greatest_change = points.iter().map(|(change, _)| *change).fold(0.0, f64::max);
        if greatest_change <= 0.0 {
            return Err(Unusable::Missing("press upon the block"));
        }
        let mut system = System::new(DEGREE);
        for (change, force_n) in &points {
            let powers = (1..=DEGREE as i32).map(|k| (change / greatest_change).powi(k));
            system.add(powers.collect(), *force_n, 1.0);
        }
        let what = "force against inductance";
        let noise_n = system.solve(what)?.sigma;
        let greatest_n = points
            .iter()
            .map(|(_, force_n)| *force_n)
            .fold(0.0, f64::max);
        for k in 2..=DEGREE {
            let sigma_n = 2.0 * greatest_n * DECAY.powi(k as i32 - 1);
            let mut row = vec![0.0; DEGREE];
            if let Some(entry) = row.get_mut(k - 1) {
                *entry = 1.0;
            }
            system.add(row, 0.0, noise_n / sigma_n);
        }
        let coefficients = system.solve(what)?.unknowns;
        let curve = Self {
            coefficients,
            greatest_change,
        };
        let steps = (0..=100).map(|step| greatest_change * f64::from(step) / 100.0);
        if steps.clone().any(|change| curve.slope(change) <= 0.0) {
            return Err(Unusable::Undetermined("a rising force against inductance"));
        }
        Ok(curve)
    }

    /// F, N.
    pub(super) fn at(&self, change: f64) -> f64 {
        let part = change / self.greatest_change;
        let terms = self.coefficients.iter().rev();
        part * terms.fold(0.0, |sum, coefficient| sum * part + coefficient)
    }

    /// dF/dy, N.
    pub(super) fn slope(&self, change: f64) -> f64 {
        let part = change / self.greatest_change;
        let terms = self.coefficients.iter().enumerate().rev();
        let sum = terms.fold(0.0, |sum, (place, coefficient)| {
            sum * part + (place + 1) as f64 * coefficient
        });
        sum / self.greatest_change
    }
}

/// Compliance of the bench's frame, m/N, from block upon block.
pub(super) fn frame(bare: &[(f64, f64)]) -> Result<f64, Unusable> {
    let mut system = System::new(2);
    for (force_n, stage_m) in bare {
        system.add(vec![1.0, *force_n], *stage_m, 1.0);
    }
    let solution = system.solve("the bench's frame")?;
    let slope = solution.unknowns.get(1).copied();
    // A frame stiffer than the scale resolves may come out below zero.
    slope
        .map(|slope| slope.max(0.0))
        .ok_or(Unusable::Missing("press of block upon block"))
}
