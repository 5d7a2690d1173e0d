//! Inductance and field of a conductor in air, from straight filaments.
//!
//! Each piece of track is two filaments with half of the current each, at ±w/(2√3) of its width w: the points of
//! Gauss's rule, so that the mean over the width is exact to the third order. Their own distance R is such
//! that the geometric mean distance of a track to itself is Grover's 0.2235 (w + t).

use core::f64::consts::PI;

use palpate_field::design::{Core, Rectangle};
use rayon::prelude::*;

use super::winding::{Place, Track, Winding};

/// μ0/4π, H/m.
const MU_0_OVER_4_PI: f64 = 1e-7;

type Vector = [f64; 3];

/// A straight piece of a filament with half of the current.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filament {
    from: Vector,
    /// Unit vector of the current.
    along: Vector,
    length_m: f64,
    /// Geometric mean distance to itself, m.
    own_m: f64,
}

impl Filament {
    fn new(from: Vector, to: Vector, own_m: f64) -> Self {
        let way = less(to, from);
        let length_m = dot(way, way).sqrt();
        let along = way.map(|part| part / length_m);
        Self {
            from,
            along,
            length_m,
            own_m,
        }
    }

    /// The filament at another place on the board.
    pub(super) fn moved(&self, [y, z]: Place) -> Self {
        let [from_x, from_y, from_z] = self.from;
        Self {
            from: [from_x, from_y + y, from_z + z],
            ..*self
        }
    }

    fn at(&self, s: f64) -> Vector {
        let mut place = self.from;
        for (place, along) in place.iter_mut().zip(self.along) {
            *place += s * self.length_m * along;
        }
        place
    }

    /// ∫∫ ds·ds′/|distance| with another filament, m.
    fn neumann_m(&self, other: &Self) -> f64 {
        let cosine = dot(self.along, other.along);
        let apart = less(self.at(0.5), other.at(0.5));
        let apart_m2 = dot(apart, apart);
        let lengths_m = self.length_m + other.length_m;
        // Beyond three lengths the midpoints are right within 0.5 % of the pair.
        if apart_m2 > 9.0 * lengths_m * lengths_m {
            return cosine * self.length_m * other.length_m / apart_m2.sqrt();
        }
        let own_m2 = self.own_m * other.own_m;
        let mean: f64 = GAUSS
            .iter()
            .map(|(s, weight)| {
                let to = less(self.at(*s), other.from);
                let along = dot(to, other.along);
                let across = (dot(to, to) - along * along).max(0.0) + own_m2;
                let across = across.sqrt();
                weight * (((other.length_m - along) / across).asinh() + (along / across).asinh())
            })
            .sum();
        cosine * self.length_m * mean
    }
}

/// Points and weights of Gauss's rule of four points from 0 to 1 (Abramowitz and Stegun, table 25.4).
const GAUSS: [(f64, f64); 4] = [
    (0.069_431_844_202_974, 0.173_927_422_568_727),
    (0.330_009_478_207_572, 0.326_072_577_431_273),
    (0.669_990_521_792_428, 0.326_072_577_431_273),
    (0.930_568_155_797_026, 0.173_927_422_568_727),
];

/// Filaments of windings in series, in the order of their current.
pub(super) fn of_windings(windings: &[&Winding]) -> Vec<Filament> {
    let mut filaments = Vec::new();
    for winding in windings {
        filaments.extend(winding.tracks.iter().flat_map(of_track));
        if let [first, second] = winding.tracks.as_slice()
            && let (Some(&end), Some(via)) = (
                first.places.last(),
                winding.holes.iter().find(|hole| hole.number == 3),
            )
        {
            let ends = [first, second].map(|track| [track.x_m, end[0], end[1]]);
            let wall = Filament::new(ends[0], ends[1], 0.5 * via.drill_m());
            filaments.extend([wall, wall]);
        }
    }
    filaments
}

fn of_track(track: &Track) -> Vec<Filament> {
    let width = [track.width_m, track.thickness_m];
    of_places(&track.places, track.x_m, width)
}

/// Filaments of the design's own turns: closed circles with as many corners as the tracks have.
pub(super) fn of_rings<'r>(rings: impl Iterator<Item = (&'r Rectangle, f64)>) -> Vec<Filament> {
    let ring = |(ring, sense): (&Rectangle, f64)| {
        let radius_m = 0.5 * (ring.r_m[0] + ring.r_m[1]);
        let corner = |step: u32| {
            let angle = sense * core::f64::consts::TAU * f64::from(step) / f64::from(CORNERS);
            [radius_m * angle.cos(), radius_m * angle.sin()]
        };
        let places: Vec<Place> = (0..=CORNERS).map(corner).collect();
        let width = [ring.r_m[1] - ring.r_m[0], ring.x_m[1] - ring.x_m[0]];
        of_places(&places, 0.5 * (ring.x_m[0] + ring.x_m[1]), width)
    };
    rings.flat_map(ring).collect()
}

/// Corners of a circle: the polygon's area is 0.05 % less.
const CORNERS: u32 = 120;

fn of_places(places: &[Place], x_m: f64, [width_m, thickness_m]: [f64; 2]) -> Vec<Filament> {
    let aside_m = 0.5 * width_m / 3.0_f64.sqrt();
    let own_m = (0.2235 * (width_m + thickness_m)).powi(2) / (2.0 * aside_m);
    let mut filaments = Vec::new();
    for side in [-aside_m, aside_m] {
        let place = |index: usize| {
            let [before, here, after] = [index.saturating_sub(1), index, index + 1]
                .map(|index| places[index.min(places.len() - 1)]);
            let mut way = [after[0] - before[0], after[1] - before[1]];
            // A closed line has no ends.
            if index == 0 || index == places.len() - 1 {
                let last = places.len() - 1;
                if super::winding::distance(places[0], places[last]) < 1e-9 {
                    way = [
                        places[1][0] - places[last - 1][0],
                        places[1][1] - places[last - 1][1],
                    ];
                }
            }
            let scale = side / way[0].hypot(way[1]);
            [x_m, here[0] - scale * way[1], here[1] + scale * way[0]]
        };
        filaments
            .extend((1..places.len()).map(|end| Filament::new(place(end - 1), place(end), own_m)));
    }
    filaments
}

/// Inductance of filaments in series, H (Neumann).
pub(super) fn inductance_h(filaments: &[Filament]) -> f64 {
    let row = |index: usize| {
        let own = &filaments[index];
        let before: f64 = filaments[..index]
            .iter()
            .map(|other| own.neumann_m(other))
            .sum();
        2.0 * before + own.neumann_m(own)
    };
    let sum: f64 = (0..filaments.len()).into_par_iter().map(row).sum();
    0.25 * MU_0_OVER_4_PI * sum
}

/// Mutual inductance of two conductors, H (Neumann).
pub(super) fn mutual_h(filaments: &[Filament], others: &[Filament]) -> f64 {
    let row = |own: &Filament| -> f64 { others.iter().map(|other| own.neumann_m(other)).sum() };
    let sum: f64 = filaments.par_iter().map(row).sum();
    0.25 * MU_0_OVER_4_PI * sum
}

/// Field at a point per ampere, T (Biot and Savart), as [along the axis, across, across].
pub(super) fn field_t(filaments: &[Filament], place: Vector) -> Vector {
    let mut field = [0.0; 3];
    for filament in filaments {
        let [a, b] = [0.0, 1.0].map(|end| less(place, filament.at(end)));
        let [long_a, long_b] = [a, b].map(|way| dot(way, way).sqrt());
        let scale = 0.5 * MU_0_OVER_4_PI * (long_a + long_b)
            / (long_a * long_b * (long_a * long_b + dot(a, b)));
        for (axis, field) in field.iter_mut().enumerate() {
            let [next, last] = [(axis + 1) % 3, (axis + 2) % 3];
            *field += scale * (a[next] * b[last] - a[last] * b[next]);
        }
    }
    field
}

/// Mean over the core's volume of the field along the axis per ampere, T.
pub(super) fn core_mean_t(filaments: &[Filament], core: &Core) -> f64 {
    const ANGLES: u32 = 16;
    let [from, to] = core.x_m;
    let ring = |(along, weight): &(f64, f64)| {
        let around = |step: u32| {
            // Four rings of equal area, each with a quarter of the angles.
            let radius_m = core.r_m * (0.25 * (f64::from(step % 4) + 0.5)).sqrt();
            let (sin, cos) = (2.0 * PI * f64::from(step) / f64::from(4 * ANGLES)).sin_cos();
            field_t(
                filaments,
                [from + along * (to - from), radius_m * cos, radius_m * sin],
            )[0]
        };
        let steps = (0..4 * ANGLES).into_par_iter().map(around);
        weight * steps.sum::<f64>() / f64::from(4 * ANGLES)
    };
    GAUSS.iter().map(ring).sum()
}

fn less(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use palpate_field::design::builtin;
    use palpate_sim::sensing_coil::CoilDesign;

    use super::super::winding::Winding;
    use super::*;

    fn rings(name: &str) -> Vec<Filament> {
        let design = builtin(name).unwrap();
        let rings = design.coils.iter().flat_map(|coil| &coil.rings);
        of_rings(rings.map(|ring| (ring, 1.0)))
    }

    /// The paper's coils by the finite elements (the table of docs/field.md), and the sensing coil by Maxwell's
    /// and Grover's formulas.
    #[test]
    fn circles_have_the_inductance_and_the_field_of_other_methods() {
        let design = builtin("air").unwrap();
        let air = rings("air");
        assert!(
            (inductance_h(&air) / 20.0e-6 - 1.0).abs() < 3e-3,
            "{}",
            inductance_h(&air)
        );
        let centre_t = field_t(&air, [design.core.middle_m(), 0.0, 0.0])[0];
        assert!((centre_t / 1012.95e-6 - 1.0).abs() < 1e-3, "{centre_t}");
        let mean_t = core_mean_t(&air, &design.core);
        assert!((mean_t / 1073.76e-6 - 1.0).abs() < 2e-3, "{mean_t}");
        let exact_h = CoilDesign::REFERENCE.inductance_of_tracks_in_air_h(0.1e-3);
        let found_h = inductance_h(&rings("sensing"));
        assert!(
            (found_h / exact_h - 1.0).abs() < 2e-3,
            "{found_h} {exact_h}"
        );
    }

    /// Compares the tracks with the circles that they replace.
    #[test]
    fn tracks_do_what_the_turns_of_the_design_do() {
        for name in ["air", "sensing"] {
            let design = builtin(name).unwrap();
            let windings = Winding::all(&design, 0.2e-3).unwrap();
            let tracks = of_windings(&windings.iter().collect::<Vec<_>>());
            let circles = rings(name);
            let off = inductance_h(&tracks) / inductance_h(&circles) - 1.0;
            assert!(off.abs() < 0.01, "{name}: L off by {off}");
            let off =
                core_mean_t(&tracks, &design.core) / core_mean_t(&circles, &design.core) - 1.0;
            assert!(off.abs() < 0.01, "{name}: field off by {off}");
        }
    }
}
