//! Coupling of a layout's coils, and what the currents in idle ones do to a reading.

use core::f64::consts::PI;
use std::fmt::Write as _;

use palpate_sim::sensing_coil::layers;

use super::coil::Winding;
use super::layout::{Coil, Layout};

/// Distance of two layers of copper, m: coils that overlap lie in different ones (0.2 mm, a common prepreg; guess).
const LAYERS_APART_M: f64 = 0.2e-3;
/// Thickness of the magnetic elastomer that is taken for the coupling, m.
const SLAB_M: f64 = 2e-3;
/// Pairs up to this factor of the least distance are neighbours.
const NEIGHBOURS: f64 = 1.2;

/// Two coils.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    apart_m: f64,
    /// Coupling factor M/sqrt(L L').
    factor: f64,
    /// Relative change of the reading of an even approach by the current in the other coil, which is grounded while it is idle
    /// (LDC1614, SNOSCY9A): its field opposes, so the inductance is L - M^2/L'.
    of_reading: f64,
}

impl Pair {
    fn of(one: &Coil, other: &Coil) -> Self {
        let [dx, dy] = [0, 1].map(|i| one.centre_m[i] - other.centre_m[i]);
        let apart_m = dx.hypot(dy);
        let at = |nearer_m: f64| {
            let [a, b] = [one, other].map(|coil| Winding {
                depth_m: coil.winding.depth_m - nearer_m,
                ..coil.winding
            });
            let [own_h, others_h] = [a, b].map(|of| of.inductance_h(SLAB_M));
            (own_h, others_h, mutual_h(&a, &b, apart_m))
        };
        let (own_h, others_h, mutual_h) = at(0.0);
        let step_m = 1e-3 * one.winding.depth_m;
        let slope = |with_idle: f64| {
            let seen_h = |nearer_m| {
                let (own_h, others_h, mutual_h) = at(nearer_m);
                own_h - with_idle * mutual_h * mutual_h / others_h
            };
            seen_h(step_m) - seen_h(-step_m)
        };
        Self {
            apart_m,
            factor: mutual_h / (own_h * others_h).sqrt(),
            of_reading: slope(1.0) / slope(0.0) - 1.0,
        }
    }
}

/// Mutual inductance of two coils beside an elastomer, H: mu_0 pi times the integral of S S' J0(k apart) (e^(-k layers) + F), with
/// S and F as in `palpate_sim::sensing_coil`.
fn mutual_h(one: &Winding, other: &Winding, apart_m: f64) -> f64 {
    const MU_0: f64 = 4e-7 * PI;
    let last = 18.0 / LAYERS_APART_M;
    // Twelve points or more for each wave of the products of Bessel functions.
    let step = 0.5 / (apart_m + one.outer_m + other.outer_m);
    let depth_m = 0.5 * (one.depth_m + other.depth_m);
    let terms = (0..(last / step) as u32).map(|index| {
        let k = (f64::from(index) + 0.5) * step;
        let slab = layers::slab(one.relative_permeability, SLAB_M, k);
        let back = layers::one_side(slab, depth_m, k);
        let turns = one.wave(k) * other.wave(k);
        turns * libm::j0(k * apart_m) * ((-k * LAYERS_APART_M).exp() + back)
    });
    MU_0 * PI * step * terms.sum::<f64>()
}

/// The neighbours with the greatest coupling, and the greatest of all other pairs.
pub(super) fn greatest(coils: &[Coil]) -> [Option<Pair>; 2] {
    let pairs = coils.iter().enumerate();
    let pairs =
        pairs.flat_map(|(index, one)| coils.iter().take(index).map(move |other| (one, other)));
    let distance_m = |(one, other): &(&Coil, &Coil)| {
        let [dx, dy] = [0, 1].map(|i| one.centre_m[i] - other.centre_m[i]);
        dx.hypot(dy)
    };
    let least_m = pairs
        .clone()
        .map(|pair| distance_m(&pair))
        .fold(f64::INFINITY, f64::min);
    [true, false].map(|near| {
        // Pairs of one kind at one distance couple alike.
        let mut kinds: Vec<(&Coil, &Coil)> = Vec::new();
        for pair in pairs.clone() {
            let is_near = distance_m(&pair) <= NEIGHBOURS * least_m;
            let is_alike = |known: &(&Coil, &Coil)| {
                (distance_m(known) - distance_m(&pair)).abs() < 1e-6
                    && known.0.winding == pair.0.winding
                    && known.1.winding == pair.1.winding
            };
            if is_near == near && !kinds.iter().any(is_alike) {
                kinds.push(pair);
            }
        }
        let found = kinds.into_iter().map(|(one, other)| Pair::of(one, other));
        found.max_by(|a, b| a.factor.abs().total_cmp(&b.factor.abs()))
    })
}

/// Formats the couplings for the terminal.
pub(super) fn text(layout: &Layout) -> String {
    let mut text = String::new();
    let names = ["neighbours", "other coils"];
    for (name, pair) in names.iter().zip(greatest(&layout.coils)) {
        if let Some(pair) = pair {
            // Writing to a `String` cannot fail.
            let _ = writeln!(
                text,
                "Coupling of {name}: up to {:+.3}, at {:.1} mm; the current in such an idle coil changes a reading by {:+.1} %.",
                pair.factor,
                1e3 * pair.apart_m,
                100.0 * pair.of_reading
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::layout::text_of;
    use super::*;

    fn pair(outer_m: f64, apart_m: f64) -> Pair {
        let winding = Winding {
            inner_m: 1.75e-3,
            outer_m,
            turns: 10,
            depth_m: 0.6e-3,
            relative_permeability: 3.7,
        };
        let coil = |x_m| Coil {
            centre_m: [x_m, 0.0],
            winding,
        };
        Pair::of(&coil(0.0), &coil(apart_m))
    }

    /// Compares with rough sums by another program, for turns from 1.75 mm to an outer edge.
    #[test]
    fn the_couplings_are_those_of_another_program() {
        for (outer_mm, apart_mm, expected) in [
            (6.75, 6.0, 0.16),
            (6.75, 8.0, -0.047),
            (6.75, 10.4, -0.10),
            (5.0, 5.0, 0.084),
            (5.0, 6.0, -0.041),
            (5.0, 7.0, -0.099),
            (5.0, 10.4, -0.040),
        ] {
            let found = pair(1e-3 * outer_mm, 1e-3 * apart_mm).factor;
            assert!(
                (found - expected).abs() < 0.03,
                "{outer_mm} {apart_mm}: {found}"
            );
        }
    }

    #[test]
    fn neighbours_of_the_built_in_layouts_hardly_couple() {
        for name in ["three-around-one", "seven"] {
            let layout = Layout::parse(name, &text_of(name).unwrap()).unwrap();
            let [near, far] = greatest(&layout.coils).map(Option::unwrap);
            assert!(near.factor.abs() < 0.02, "{name}: {near:?}");
            assert!(near.of_reading.abs() < 0.02, "{name}: {near:?}");
            assert!(far.factor.abs() < 0.06, "{name}: {far:?}");
        }
    }
}
