//! Errors over the inside of a layout.

use palpate_cli::failure::Failure;
use rayon::prelude::*;

use super::errors::{Errors, Limits, Sensor, greatest};
use super::layout::Layout;

/// Errors of presses at all places inside, for one radius of contact.
pub(super) struct Map {
    pub(super) radius_m: f64,
    pub(super) presses: Vec<Press>,
    /// Greatest mean approach that a coil reads: m, and in units of its depth.
    pub(super) greatest_approach: [f64; 2],
}

/// A press.
#[derive(Clone, Copy, Debug)]
pub(super) struct Press {
    pub(super) at_m: [f64; 2],
    pub(super) errors: Errors,
    /// Whether place, force and radius are within their limits.
    pub(super) within: [bool; 3],
}

impl Map {
    /// Computes the maps of a layout, one for each radius.
    pub(super) fn all(layout: &Layout, limits: &Limits) -> Result<Vec<Self>, Failure> {
        let places = layout.inside.places();
        if places.is_empty() {
            return Err(Failure::Refused(format!(
                "the layout {}: no press lies inside; raise margin_m of [inside]",
                layout.name
            )));
        }
        let map = |radius_m: &f64| Self::of(layout, limits, *radius_m, &places);
        Ok(layout.radius.computed_m().iter().map(map).collect())
    }

    fn of(layout: &Layout, limits: &Limits, radius_m: f64, places: &[[f64; 2]]) -> Self {
        let sensor = Sensor::new(layout, radius_m);
        let press = |at_m: &[f64; 2]| {
            let errors = sensor.errors(*at_m, limits);
            Press {
                at_m: *at_m,
                errors,
                within: errors.within(limits),
            }
        };
        let approaches = places.iter().map(|at| sensor.greatest_approach(*at));
        Self {
            radius_m,
            presses: places.par_iter().map(press).collect(),
            greatest_approach: approaches.fold([0.0; 2], greatest),
        }
    }

    /// Share of the presses that meet a condition.
    pub(super) fn share(&self, meets: impl Fn(&Press) -> bool) -> f64 {
        let met = self.presses.iter().filter(|press| meets(press)).count();
        met as f64 / self.presses.len().max(1) as f64
    }

    /// Median and greatest of the errors of place (0), force (1) or radius (2).
    pub(super) fn median_and_worst(&self, quantity: usize) -> [f64; 2] {
        let mut errors: Vec<f64> = self
            .presses
            .iter()
            .map(|press| press.errors.standard[quantity])
            .collect();
        errors.sort_by(f64::total_cmp);
        let of = |index: usize| errors.get(index).copied().unwrap_or(f64::INFINITY);
        [of(errors.len() / 2), of(errors.len().saturating_sub(1))]
    }

    /// The press with the greatest error in units of its limits.
    pub(super) fn worst(&self, limits: &Limits) -> Option<&Press> {
        let size = |press: &&Press| {
            let parts = press.errors.standard.iter().zip(limits.all());
            parts
                .map(|(error, limit)| error / limit)
                .fold(0.0, f64::max)
        };
        self.presses
            .iter()
            .max_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// Number of presses of which a combination is not determined.
    pub(super) fn undetermined(&self) -> usize {
        let presses = self.presses.iter();
        presses.filter(|press| press.errors.is_undetermined).count()
    }
}

#[cfg(test)]
mod tests {
    use super::super::errors::tests::{LIMITS, earlier, square, three_around_one};
    use super::*;

    /// Shares of the inside within all limits, per cent, for contacts of 2 and 4 mm, against another program (Python with
    /// SciPy, on another lattice).
    #[test]
    fn the_shares_are_those_of_another_program() {
        let seven = earlier("seven");
        for (layout, expected) in [
            (three_around_one(), [93.0, 99.0]),
            (seven, [97.0, 100.0]),
            (square(), [50.0, 74.0]),
        ] {
            let maps = Map::all(&layout, &LIMITS).unwrap();
            assert_eq!(maps.len(), 2);
            for (map, expected) in maps.iter().zip(expected) {
                let share = 100.0 * map.share(|press| press.within == [true; 3]);
                assert!((share - expected).abs() < 3.0, "{}: {share}", layout.name);
                assert!(map.presses.len() > 1_000);
            }
        }
    }

    #[test]
    fn the_worst_press_of_a_square_lies_on_a_mid_line() {
        let maps = Map::all(&square(), &LIMITS).unwrap();
        for map in &maps {
            let [x, y] = map.worst(&LIMITS).unwrap().at_m;
            assert!(x.abs().min(y.abs()) < 1e-9, "{x} {y}");
            let lines = map.presses.iter().filter(|press| {
                let [x, y] = press.at_m;
                x.abs().min(y.abs()) < 1e-9
            });
            assert_eq!(map.undetermined(), lines.count());
            assert!(map.median_and_worst(1)[1].is_infinite());
        }
    }
}
