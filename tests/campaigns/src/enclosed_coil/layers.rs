//! A coil with magneto-sensitive elastomer (MSE) above it, below it, or both: inductance, field at each
//! boundary of the MSE, and the change of the inductance by a displacement of boundaries and turns.

use std::f64::consts::PI;

use palpate_sim::sensing_coil::CoilDesign;
use palpate_sim::sensing_coil::layers::{both_sides, one_side, slab};

/// Permeability of free space, H/m.
const MU_0: f64 = 4e-7 * PI;

/// Greatest wave number, 1/m: there the field at the least gap, 0.1 mm, is down to exp(−2 · 9).
const LAST_PER_M: f64 = 9.0 / 0.1e-3;

/// Distance between the copper of two neighbouring coils, m (guess; as in `palpate_sim::touch`).
const APART_M: f64 = 0.2e-3;

/// A slab of MSE on one side of the coil.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slab {
    /// Distance of its near boundary from the turns, m, 0.1 mm or more.
    pub(super) gap_m: f64,
    pub(super) thickness_m: f64,
}

/// A coil between slabs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    pub(super) above: Option<Slab>,
    pub(super) below: Option<Slab>,
    pub(super) permeability: f64,
}

/// Change of the inductance per downward displacement of an area at each radius, H/m³, for one boundary.
pub(super) struct Boundary {
    /// Height above the turns, m.
    pub(super) height_m: f64,
    pub(super) density: Vec<f64>,
}

/// Changes of an inductance by small displacements of boundaries and turns.
pub(super) struct Sensitivity {
    /// Radii with the weights of their rings, m and m².
    pub(super) rings: Vec<(f64, f64)>,
    pub(super) boundaries: Vec<Boundary>,
    /// Radii of the turns, m, and change of the inductance per downward displacement of each, H/m.
    pub(super) turns: Vec<(f64, f64)>,
}

/// The winding in the domain of wave numbers.
pub(super) struct Winding {
    design: CoilDesign,
    /// Wave numbers, 1/m, with S(k), the mean of e^(ikx) over a track, and the rule's weights.
    waves: Vec<[f64; 4]>,
}

impl Winding {
    pub(super) fn new(design: CoilDesign) -> Self {
        // Midpoints resolve the oscillation of S², whose period is π over the outer radius.
        let step_per_m = PI / (0.5 * design.outer_diameter_m) / 16.0;
        let half_track_m = 0.25 * design.pitch_m();
        let wave = |index: u32| {
            let k = step_per_m * (f64::from(index) + 0.5);
            let turns: f64 = design.radii_m().map(|a_m| a_m * libm::j1(k * a_m)).sum();
            // The current is spread over tracks of half a pitch.
            let phase = k * half_track_m;
            let track = phase.sin() / phase;
            [k, turns * track, track, step_per_m]
        };
        Self {
            design,
            waves: (0..(LAST_PER_M / step_per_m) as u32).map(wave).collect(),
        }
    }

    /// Inductance, H.
    pub(super) fn inductance_h(&self, layers: &Layers) -> f64 {
        self.design.inductance_in_air_h() + self.integral_h(|k| layers.gain(k))
    }

    /// Mutual inductance with an equal coil beside this one, H.
    pub(super) fn mutual_h(&self, layers: &Layers, distance_m: f64) -> f64 {
        let through = |k: f64| (-k * APART_M).exp() + layers.gain(k);
        self.integral_h(|k| through(k) * libm::j0(k * distance_m))
    }

    fn integral_h(&self, factor: impl Fn(f64) -> f64) -> f64 {
        let terms = self.waves.iter();
        MU_0 * PI
            * terms
                .map(|[k, s, _, weight]| weight * s * s * factor(*k))
                .sum::<f64>()
    }

    /// Sensitivity to displacements.
    pub(super) fn sensitivity(&self, layers: &Layers) -> Sensitivity {
        let step = |from_um: u32, to_um: u32, step_um: u32| {
            (from_um..to_um).step_by(step_um as usize).map(move |um| {
                let (r_m, width_m) = (
                    1e-6 * (f64::from(um) + 0.5 * f64::from(step_um)),
                    1e-6 * f64::from(step_um),
                );
                (r_m, 2.0 * PI * r_m * width_m)
            })
        };
        let rings: Vec<(f64, f64)> = step(0, 9_000, 30).chain(step(9_000, 30_000, 200)).collect();
        let amplitudes: Vec<_> = self
            .waves
            .iter()
            .map(|[k, ..]| layers.amplitudes(*k))
            .collect();
        let mut boundaries: Vec<Boundary> = layers
            .heights_m()
            .into_iter()
            .map(|(height_m, _)| Boundary {
                height_m,
                density: Vec::new(),
            })
            .collect();
        let mu = layers.permeability;
        let signs: Vec<f64> = layers
            .heights_m()
            .into_iter()
            .map(|(_, sign)| sign)
            .collect();
        for &(r_m, _) in &rings {
            let mut fields = vec![[0.0; 2]; boundaries.len()];
            for ([k, s, _, weight], amplitudes) in self.waves.iter().zip(&amplitudes) {
                let factor = 0.5 * weight * s * k;
                let (along, across) = (factor * libm::j1(k * r_m), factor * libm::j0(k * r_m));
                for (field, amplitude) in fields.iter_mut().zip(&amplitudes.boundaries) {
                    field[0] += along * amplitude[0];
                    field[1] += across * amplitude[1];
                }
            }
            for ((boundary, [along, across]), sign) in boundaries.iter_mut().zip(fields).zip(&signs)
            {
                let energy = along * along + across * across / mu;
                boundary.density.push(sign * MU_0 * (mu - 1.0) * energy);
            }
        }
        let turn = |a_m: f64| {
            let terms = self.waves.iter().zip(&amplitudes);
            let slope: f64 = terms
                .map(|([k, s, track, weight], of)| {
                    weight * s * track * k * libm::j1(k * a_m) * (of.from_below - of.from_above)
                })
                .sum();
            // Twice the slope of the reflected flux, per downward displacement.
            (a_m, 2.0 * PI * MU_0 * a_m * slope)
        };
        let turns = self.design.radii_m().map(turn).collect();
        Sensitivity {
            rings,
            boundaries,
            turns,
        }
    }
}

/// Amplitudes of the field of one wave number.
struct Amplitudes {
    /// Components along and across each boundary, on its side in air.
    boundaries: Vec<[f64; 2]>,
    /// Waves that return to the turns.
    from_above: f64,
    from_below: f64,
}

impl Layers {
    fn reflections(&self, k: f64) -> [f64; 2] {
        let side = |side: Option<Slab>| {
            side.map_or(0.0, |of| {
                one_side(slab(self.permeability, of.thickness_m, k), of.gap_m, k)
            })
        };
        [side(self.above), side(self.below)]
    }

    fn gain(&self, k: f64) -> f64 {
        let [above, below] = self.reflections(k);
        both_sides(above, below)
    }

    /// Heights of the boundaries, m, each with 1 if its downward motion adds MSE, −1 if it removes MSE.
    fn heights_m(&self) -> Vec<(f64, f64)> {
        let above = self
            .above
            .map(|of| [(of.gap_m, 1.0), (of.gap_m + of.thickness_m, -1.0)]);
        let below = self
            .below
            .map(|of| [(-of.gap_m, -1.0), (-of.gap_m - of.thickness_m, 1.0)]);
        above.into_iter().chain(below).flatten().collect()
    }

    fn amplitudes(&self, k: f64) -> Amplitudes {
        let [above, below] = self.reflections(k);
        let loops = 1.0 - above * below;
        let from_above = above * (1.0 + below) / loops;
        let from_below = below * (1.0 + above) / loops;
        let sides = [
            (self.above, 1.0 + from_below),
            (self.below, 1.0 + from_above),
        ];
        let boundaries = sides
            .into_iter()
            .filter_map(|(side, incident)| side.map(|side| self.at_slab(k, side, incident)))
            .flatten()
            .collect();
        Amplitudes {
            boundaries,
            from_above,
            from_below,
        }
    }

    /// Field at both boundaries of a slab that this wave reaches, with the reflection in the slab.
    fn at_slab(&self, k: f64, side: Slab, incident: f64) -> [[f64; 2]; 2] {
        let mu = self.permeability;
        let here = incident * (-k * side.gap_m).exp();
        let reflection = slab(mu, side.thickness_m, k);
        let (along, across) = (here * (1.0 - reflection), here * (1.0 + reflection));
        // Behind the slab there is one wave: with g = (μ − 1)/(μ + 1) it is (1 − g²) e^(−kt)/(1 − g² e^(−2kt)).
        let g = (mu - 1.0) / (mu + 1.0);
        let decay = (-k * side.thickness_m).exp();
        let through = here * (1.0 - g * g) * decay / (1.0 - g * g * decay * decay);
        [[along, across], [through, through]]
    }
}

impl Sensitivity {
    /// Change of the inductance, H, by downward displacements of the boundaries and of the turns, as
    /// functions of height and radius, m.
    pub(super) fn change_h(&self, moved_m: impl Fn(f64, f64) -> f64, turns_move: bool) -> f64 {
        let boundary = |boundary: &Boundary| {
            let rings = self.rings.iter().zip(&boundary.density);
            rings
                .map(|((r_m, area_m2), density)| {
                    area_m2 * density * moved_m(boundary.height_m, *r_m)
                })
                .sum::<f64>()
        };
        let boundaries: f64 = self.boundaries.iter().map(boundary).sum();
        if !turns_move {
            return boundaries;
        }
        let turns = self
            .turns
            .iter()
            .map(|(a_m, per_m)| per_m * moved_m(0.0, *a_m));
        boundaries + turns.sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COIL: CoilDesign = super::super::COIL;

    fn slab_of(gap_m: f64, thickness_m: f64) -> Option<Slab> {
        Some(Slab { gap_m, thickness_m })
    }

    #[test]
    fn moved_boundaries_change_the_inductance_as_its_closed_form_does() {
        let winding = Winding::new(COIL);
        let layers = |above: f64, below: f64| Layers {
            above: slab_of(1.5e-3 + above, 1e-3),
            below: slab_of(0.8e-3 + below, 2e-3),
            permeability: 3.7,
        };
        let sensitivity = winding.sensitivity(&layers(0.0, 0.0));
        let h = 1e-6;
        let slope = |above: f64, below: f64| {
            let at = |step: f64| winding.inductance_h(&layers(step * above, step * below));
            (at(h) - at(-h)) / (2.0 * h)
        };
        for (above, below) in [(1.0, 0.0), (0.0, 1.0)] {
            let expected = slope(above, below);
            // Away from the coil: up above it, down below it.
            let moved = |height_m: f64, _: f64| if height_m > 0.0 { -above } else { below };
            let found = sensitivity.change_h(moved, false);
            println!("{above} {below}: {found:e} {expected:e}");
            assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
        }
    }

    #[test]
    fn what_moves_as_a_whole_changes_nothing() {
        let winding = Winding::new(COIL);
        let layers = Layers {
            above: slab_of(0.1e-3, 2e-3),
            below: slab_of(1.3e-3, 1e-3),
            permeability: 3.7,
        };
        let sensitivity = winding.sensitivity(&layers);
        let turns = sensitivity.change_h(|height_m, _| f64::from(u8::from(height_m == 0.0)), true);
        let all = sensitivity.change_h(|_, _| 1.0, true);
        println!("{turns:e} {all:e}");
        assert!(all.abs() < 0.01 * turns.abs(), "{turns} {all}");
    }
}
