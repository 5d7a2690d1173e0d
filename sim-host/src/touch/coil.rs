//! What a sensing coil reads of an elastomer that moves.
//!
//! A slab of magnetic elastomer lies above the coil. If its lower boundary moves down by w₁ and its
//! upper one by w₂, the inductance changes to first order by
//!
//! dL = ∫ (s₁ w₁ − s₂ w₂) dA,  s = μ0 (μ − 1) (H_t² + H_n²/μ)
//!
//! with the field of 1 A at that boundary: H_t along it and H_n across it, on its side in air. This
//! is the change of the energy of a permeable body at constant current, ½ ∫ (μ − 1) μ0 H · H' dV
//! with the field H before and H' after (Stratton, "Electromagnetic theory", 1941, section 2.14).
//!
//! The slab's field is that of images of the coil at the depths d + 2nt below the boundary, from the
//! reflection at both boundaries (g = (μ − 1)/(μ + 1), gap d, thickness t). For displacements that
//! are not small against the gap, s is integrated along the approach as if the gap were even.
//!
//! A slope of the boundary turns its normal in the field, by which each boundary adds
//! ∫ κ w ∂w/∂r dA with κ = μ0 (μ − 1)²/μ H_t H_n. Integrated by parts this is −∫ 1/r ∂(rP)/∂r dA with
//! P = ∫ κ w dw, so that no slope is needed. It holds for slopes that change little over a gap, and is
//! exact for a tilted plane to second order. Turns are filaments.

use core::f64::consts::{PI, TAU};

use super::network::Complex;
use super::quadrature::panels;
use crate::sensing_coil::{CoilDesign, layers};

/// Permeability of free space, H/m.
const MU_0: f64 = 4e-7 * PI;

/// Terms of the series in the approach.
const TERMS: usize = 10;

/// Panels of rings over the turns, and directions in which each ring is sampled.
const PANELS: u32 = 3;
const ANGLES: u32 = 72;

/// Distance of two layers of copper on a board, m (0.2 mm, a common prepreg; guess).
const LAYERS_APART_M: f64 = 0.2e-3;

/// Steps of the table of the field at rest.
const FIELDS: u32 = 160;

/// Radius up to which the elastomer counts, in outer radii of the coil. Beyond it lies less than
/// 0.1 % of the reading of an even approach.
const REACH: f64 = 3.5;

/// Approaches that the series covers, m: away from the coil, at most half the gap, and towards it. At
/// gaps below 0.4 of the pitch the field has peaks at the turns, which rings do not resolve.
const AWAY_M: f64 = 0.5e-3;
const TOWARDS_M: f64 = 1.2e-3;
const LEAST_GAP_PITCHES: f64 = 0.4;

/// Field along x and y of the boundary, and across it, A/m.
type Vector = [f64; 3];

/// Field of 1 A in a coil at one radius of a boundary, on its side in air, A/m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Field {
    /// Along the boundary, away from the axis.
    along: f64,
    /// Across the boundary.
    across: f64,
}

/// The readings of one kind of coil.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    /// Rings around the axis.
    rings: Vec<Ring>,
    /// Centre and half of the range of approaches, m.
    centre_m: f64,
    half_m: f64,
    /// Fields at both boundaries at rest, in equal steps of the radius from half a step on.
    fields: Vec<[Field; 2]>,
    step_m: f64,
    /// Directions of the samples of a ring.
    angles: u32,
    relative_permeability: f64,
}

/// A ring around the coil's axis.
#[derive(Clone, Debug)]
struct Ring {
    r_m: f64,
    /// Area of a sample, m².
    area_m2: f64,
    /// Inductance per displacement of both boundaries together, H/m² of area, as a series of the
    /// approach, times the area of a sample, so that its value is in H.
    together: [f64; TERMS],
    /// Inductance lost per thinning of the slab, H/m, as such a series.
    thinning: [f64; TERMS],
    /// Half the growth of that loss with the thinning, H/m², as such a series.
    thinner: [f64; TERMS],
}

/// A sample of a coil's surroundings: relative to its axis, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    pub(super) x_m: f64,
    pub(super) y_m: f64,
}

/// Downward displacements of the slab's boundaries, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moved {
    pub(super) lower_m: f64,
    pub(super) upper_m: f64,
}

impl Moved {
    /// Adds a share of other displacements.
    pub(super) fn add(&mut self, other: &Self, share: f64) {
        self.lower_m += share * other.lower_m;
        self.upper_m += share * other.upper_m;
    }
}

impl Reading {
    /// Readings of a coil under a slab (`gap_at_rest_m` and `slab_m` of the design; its sides are
    /// not used).
    pub(super) fn new(design: &CoilDesign) -> Self {
        Self::sampled(design, PANELS, ANGLES)
    }

    /// Readings with this many panels of rings over the turns, and directions.
    pub(super) fn sampled(design: &CoilDesign, count: u32, angles: u32) -> Self {
        let gap_m = design.gap_at_rest_m;
        let least_m = (LEAST_GAP_PITCHES * design.pitch_m()).max(0.1e-3);
        let towards_m = (gap_m - least_m).min(TOWARDS_M);
        let away_m = -AWAY_M.min(0.5 * gap_m);
        let (centre_m, half_m) = (0.5 * (towards_m + away_m), 0.5 * (towards_m - away_m));
        let outer_m = 0.5 * design.outer_diameter_m;
        // Rings are dense over the turns, where the field is.
        let mut radii = panels(count, 16, 0.0, 1.5 * outer_m);
        radii.extend(panels(1, 16, 1.5 * outer_m, REACH * outer_m));
        let ring = |&(r_m, weight_m): &(f64, f64)| {
            let area_m2 = TAU / f64::from(angles) * r_m * weight_m;
            let step_m = 0.02 * design.slab_m;
            let thin_design = CoilDesign {
                slab_m: design.slab_m - step_m,
                ..*design
            };
            let approach_of = |node| centre_m + half_m * chebyshev_node(node);
            let nodes: [[f64; 2]; TERMS] =
                core::array::from_fn(|node| densities(design, gap_m - approach_of(node), r_m));
            let mut thin = nodes;
            for (node, both) in thin.iter_mut().enumerate() {
                let [_, thinner] = densities(&thin_design, gap_m - approach_of(node), r_m);
                let [_, per_m] = both;
                *per_m = (thinner - *per_m) / step_m;
            }
            let rate = series(&nodes.map(|[lower, upper]| area_m2 * (lower - upper)));
            let mut together = integrated(&rate, half_m, -centre_m / half_m);
            let sloped: [f64; TERMS] =
                core::array::from_fn(|node| area_m2 * sloped(design, approach_of(node), r_m));
            for (term, sloped) in together.iter_mut().zip(series(&sloped)) {
                *term += sloped;
            }
            Ring {
                r_m,
                area_m2,
                together,
                thinning: series(&nodes.map(|[_, upper]| area_m2 * upper)),
                thinner: series(&thin.map(|[_, per_m]| 0.5 * area_m2 * per_m)),
            }
        };
        let step_m = REACH * outer_m / f64::from(FIELDS);
        let field = |step: u32| boundary_fields(design, gap_m, step_m * (f64::from(step) + 0.5));
        Self {
            rings: radii.iter().map(ring).collect(),
            centre_m,
            half_m,
            fields: (0..FIELDS).map(field).collect(),
            step_m,
            angles,
            relative_permeability: design.relative_permeability,
        }
    }

    /// Fields at both boundaries at a radius, at rest.
    fn fields(&self, r_m: f64) -> [Field; 2] {
        let position = (r_m / self.step_m - 0.5).max(0.0);
        let first = position as usize;
        let share = position - first as f64;
        let mut fields = [Field::default(); 2];
        let pair = self.fields.iter().skip(first);
        for (table, weight) in pair.zip([1.0 - share, share]) {
            for (field, from) in fields.iter_mut().zip(table) {
                field.along += weight * from.along;
                field.across += weight * from.across;
            }
        }
        fields
    }

    /// Change of this coil's inductance by the currents in other coils, per downward displacement of the
    /// boundaries at each sample, H/m; to first order at rest. `others` are at `x_m`, `y_m` from this
    /// coil, with complex currents per current in this one.
    ///
    /// A current u in another coil makes s that of the field H + u H'; the part of H alone is left out.
    pub(super) fn induced(&self, others: &[([f64; 2], &Self, Complex)]) -> Vec<Moved> {
        let mu = self.relative_permeability;
        let density = |fields: &[Vector; 2]| {
            let [real, imaginary] = fields.map(|[x, y, z]| x * x + y * y + z * z / mu);
            MU_0 * (mu - 1.0) * (real - imaginary)
        };
        let at = |(area_m2, sample): (f64, Sample)| {
            let own = self.vectors(sample.x_m, sample.y_m);
            let mut sums = own.map(|field| [field, [0.0; 3]]);
            for ([x_m, y_m], other, current) in others {
                let fields = other.vectors(sample.x_m - x_m, sample.y_m - y_m);
                for (sum, field) in sums.iter_mut().zip(fields) {
                    for (sum, part) in sum.iter_mut().zip(current) {
                        sum.iter_mut()
                            .zip(field)
                            .for_each(|(sum, of)| *sum += part * of);
                    }
                }
            }
            let [lower, upper] = sums.map(|sum| density(&sum));
            let [lower_alone, upper_alone] = own.map(|field| density(&[field, [0.0; 3]]));
            Moved {
                lower_m: area_m2 * (lower - lower_alone),
                upper_m: -area_m2 * (upper - upper_alone),
            }
        };
        self.areas_m2().zip(self.samples()).map(at).collect()
    }

    /// Fields at both boundaries at a place, at rest.
    fn vectors(&self, x_m: f64, y_m: f64) -> [Vector; 2] {
        let r_m = libm::hypot(x_m, y_m).max(f64::MIN_POSITIVE);
        self.fields(r_m)
            .map(|of| [of.along * x_m / r_m, of.along * y_m / r_m, of.across])
    }

    /// Areas of the samples, m².
    fn areas_m2(&self) -> impl Iterator<Item = f64> + '_ {
        let (rings, angles) = (self.rings.iter(), self.angles);
        rings.flat_map(move |ring| (0..angles).map(move |_| ring.area_m2))
    }

    /// Places at which [`Self::change_h`] asks for displacements, in its order.
    pub(super) fn samples(&self) -> impl Iterator<Item = Sample> + '_ {
        let angles = self.angles;
        self.rings.iter().flat_map(move |ring| {
            (0..angles).map(move |index| {
                let angle = TAU / f64::from(angles) * (f64::from(index) + 0.5);
                Sample {
                    x_m: ring.r_m * libm::cos(angle),
                    y_m: ring.r_m * libm::sin(angle),
                }
            })
        })
    }

    /// Change of the inductance by displacements at the samples, H. Approaches beyond the range of
    /// the series count as its end: the layer lies on the coil.
    pub(super) fn change_h(&self, moved: impl Iterator<Item = Moved>) -> f64 {
        let rings = self
            .rings
            .iter()
            .flat_map(|ring| (0..self.angles).map(move |_| ring));
        rings
            .zip(moved)
            .map(|(ring, moved)| {
                let x = ((moved.lower_m - self.centre_m) / self.half_m).clamp(-1.0, 1.0);
                let thinner_m = moved.upper_m - moved.lower_m;
                let together = value(&ring.together, x);
                if thinner_m == 0.0 {
                    together
                } else {
                    let growth = thinner_m * value(&ring.thinner, x);
                    together - thinner_m * (value(&ring.thinning, x) + growth)
                }
            })
            .sum()
    }
}

/// s of the lower and the upper boundary at a radius, H/m³.
fn densities(design: &CoilDesign, gap_m: f64, r_m: f64) -> [f64; 2] {
    let mu = design.relative_permeability;
    let fields = boundary_fields(design, gap_m, r_m);
    fields.map(|field| product(mu, field, field, 1.0))
}

/// Effect of the boundaries' slope on an approach, −1/r ∂(rP)/∂r, H/m². The field in P is that at two
/// thirds of the approach, where the mean of κ w lies.
fn sloped(design: &CoilDesign, approach_m: f64, r_m: f64) -> f64 {
    let mu = design.relative_permeability;
    let gap_m = design.gap_at_rest_m - approach_m / 1.5;
    let moment = |r_m: f64| -> f64 {
        let fields = boundary_fields(design, gap_m, r_m);
        let products = fields.map(|field| field.along * field.across);
        r_m * products.iter().sum::<f64>()
    };
    let step_m = 0.02 * r_m.min(design.gap_at_rest_m);
    let slope = (moment(r_m + step_m) - moment(r_m - step_m)) / (2.0 * step_m);
    -0.5 * MU_0 * (mu - 1.0) * (mu - 1.0) / mu * approach_m * approach_m * slope / r_m
}

/// The density of two fields, H/m³; `cosine` is that of the angle between their radii. It is s for
/// a field with itself, and that of a mutual inductance for the fields of two coils.
pub(super) fn product(mu: f64, one: Field, other: Field, cosine: f64) -> f64 {
    MU_0 * (mu - 1.0) * (one.along * other.along * cosine + one.across * other.across / mu)
}

/// Fields at the slab's lower and upper boundary, by images.
pub(super) fn boundary_fields(design: &CoilDesign, gap_m: f64, r_m: f64) -> [Field; 2] {
    let g = (design.relative_permeability - 1.0) / (design.relative_permeability + 1.0);
    let mut fields = [Field::default(); 2];
    let (mut power, mut depth_m) = (1.0, gap_m);
    let mut before = 0.0;
    // Each further image is weaker by g², and its field falls with the cube of its distance.
    let outer_m = 0.5 * design.outer_diameter_m;
    let far = |depth_m: f64| libm::pow(outer_m / (outer_m + depth_m), 3.0);
    while power * far(depth_m) > 1e-6 {
        let image = coil_field(design, r_m, depth_m);
        let through = coil_field(design, r_m, depth_m + design.slab_m);
        // Coefficients of e^(−2nkt) in 1 − G, 1 + G and the field behind the slab.
        let along = if before == 0.0 {
            1.0 - g
        } else {
            before * (1.0 - g * g)
        };
        let across = if before == 0.0 {
            1.0 + g
        } else {
            -before * (1.0 - g * g)
        };
        let [lower, upper] = &mut fields;
        lower.along += along * image.along;
        lower.across += across * image.across;
        upper.along += (1.0 - g * g) * power * through.along;
        upper.across += (1.0 - g * g) * power * through.across;
        before = power * g;
        power *= g * g;
        depth_m += 2.0 * design.slab_m;
    }
    fields
}

/// Field of 1 A in the turns in air, at a radius and a distance from their plane.
fn coil_field(design: &CoilDesign, r_m: f64, z_m: f64) -> Field {
    let mut sum = Field::default();
    for a_m in design.radii_m() {
        let turn = turn_field(a_m, r_m, z_m);
        sum.along += turn.along;
        sum.across += turn.across;
    }
    sum
}

/// Field of a turn (Smythe, "Static and dynamic electricity", 1950, section 7.10), with the complete
/// elliptic integrals by the arithmetic–geometric mean.
fn turn_field(a_m: f64, r_m: f64, z_m: f64) -> Field {
    let near = (a_m - r_m) * (a_m - r_m) + z_m * z_m;
    let far = libm::sqrt((a_m + r_m) * (a_m + r_m) + z_m * z_m);
    let complement = libm::sqrt(near) / far;
    let (mut a, mut b) = (1.0, complement);
    let (mut sum, mut weight) = (0.5 * (1.0 - complement * complement), 0.5);
    while a - b > 1e-9 * a {
        let c = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), libm::sqrt(a * b));
        weight *= 2.0;
        sum += weight * c * c;
    }
    let first = PI / (a + b);
    let second = first * (1.0 - sum);
    let squares = r_m * r_m + z_m * z_m;
    let across = first + (a_m * a_m - squares) / near * second;
    let along = z_m / r_m * ((a_m * a_m + squares) / near * second - first);
    Field {
        along: along / (TAU * far),
        across: across / (TAU * far),
    }
}

fn chebyshev_node(index: usize) -> f64 {
    libm::cos(PI * (index as f64 + 0.5) / TERMS as f64)
}

/// Chebyshev series through values at the nodes.
fn series(values: &[f64; TERMS]) -> [f64; TERMS] {
    core::array::from_fn(|term| {
        let terms = values.iter().enumerate().map(|(node, value)| {
            let angle = PI * term as f64 * (node as f64 + 0.5) / TERMS as f64;
            value * libm::cos(angle)
        });
        let share = if term == 0 { 1.0 } else { 2.0 };
        share / TERMS as f64 * terms.sum::<f64>()
    })
}

/// Integral of a series, with x in units of `unit`, that vanishes at `zero`:
/// ∫ Tₙ = Tₙ₊₁/2(n + 1) − Tₙ₋₁/2(n − 1). The term beyond the last is left out.
fn integrated(series: &[f64; TERMS], unit: f64, zero: f64) -> [f64; TERMS] {
    let term = |n: usize| series.get(n).copied().unwrap_or(0.0);
    let mut integral = core::array::from_fn(|n| match n {
        0 => 0.0,
        1 => unit * (term(0) - 0.5 * term(2)),
        _ => 0.5 * unit * (term(n - 1) - term(n + 1)) / n as f64,
    });
    let offset = value(&integral, zero);
    if let Some(constant) = integral.first_mut() {
        *constant -= offset;
    }
    integral
}

/// Value of a Chebyshev series (Clenshaw 1955).
fn value(series: &[f64; TERMS], x: f64) -> f64 {
    let [constant, rest @ ..] = series;
    let (mut this, mut before) = (0.0, 0.0);
    for term in rest.iter().rev() {
        (this, before) = (term + 2.0 * x * this - before, this);
    }
    constant + x * this - before
}

/// Mutual inductance of two coils of one kind at rest, H, whose axes are `apart_m` from each other:
/// μ0 π ∫ S(k)² J0(k apart) [e^(−k layers) + F(k)] dk with S and F as in [`crate::sensing_coil`].
/// Coils that overlap lie in two layers of copper.
pub(super) fn mutual_h(design: &CoilDesign, apart_m: f64) -> f64 {
    let last = 18.0 / LAYERS_APART_M;
    let count = (last * (design.outer_diameter_m + apart_m) / 25.0).ceil() as u32;
    let sum: f64 = panels(count.clamp(1, 2000), 16, 0.0, last)
        .iter()
        .map(|&(k, weight)| {
            let turns: f64 = design.radii_m().map(|a_m| a_m * libm::j1(k * a_m)).sum();
            let slab = layers::slab(design.relative_permeability, design.slab_m, k);
            let through = libm::exp(-k * LAYERS_APART_M);
            let back = layers::one_side(slab, design.gap_at_rest_m, k);
            weight * turns * turns * libm::j0(k * apart_m) * (through + back)
        })
        .sum();
    MU_0 * PI * sum
}

#[cfg(test)]
mod tests {
    use super::super::indenter::Indenter;
    use super::super::layer::Layer;
    use super::super::press::{Contacts, Heights};
    use super::*;
    use crate::sensing_coil::Sides;
    use crate::sensing_coil::integral::CoilIntegral;

    const COIL: CoilDesign = CoilDesign {
        outer_diameter_m: 13.5e-3,
        inner_diameter_m: 3.5e-3,
        turns: 10,
        sides: Sides::One,
        slab_m: 2e-3,
        gap_at_rest_m: 0.6e-3,
        relative_permeability: 3.7,
    };

    fn even(reading: &Reading, lower_m: f64, upper_m: f64) -> f64 {
        reading.change_h(reading.samples().map(|_| Moved { lower_m, upper_m }))
    }

    #[test]
    fn an_even_approach_is_that_of_the_filament_model() {
        for (gap_m, lower_m) in [
            (0.6e-3, [-0.2e-3, 1e-6, 0.1e-3, 0.2e-3, 0.35e-3]),
            (3.6e-3, [-0.4e-3, 1e-6, 0.1e-3, 0.4e-3, 1e-3]),
        ] {
            let design = CoilDesign {
                gap_at_rest_m: gap_m,
                ..COIL
            };
            let reading = Reading::new(&design);
            let model = |lower_m: f64, thinner_m: f64| {
                let slab_m = 2e-3 - thinner_m;
                CoilIntegral::new(CoilDesign { slab_m, ..design }, None)
                    .inductance_h(gap_m - lower_m)
            };
            for lower_m in lower_m {
                let expected = model(lower_m, 0.0) - model(0.0, 0.0);
                let error = even(&reading, lower_m, lower_m) / expected - 1.0;
                println!("together {gap_m:e} {lower_m:e}: {expected:e} {error:e}");
                assert!(error.abs() < 1e-3, "{gap_m} {lower_m}: {error}");
            }
            for (lower_m, thinner_m) in [(0.0, 10e-6), (0.1e-3, 50e-6), (0.1e-3, 0.2e-3)] {
                let expected = model(lower_m, thinner_m) - model(lower_m, 0.0);
                let thin = even(&reading, lower_m, lower_m + thinner_m);
                let error = (thin - even(&reading, lower_m, lower_m)) / expected - 1.0;
                println!("thinner {gap_m:e} {lower_m:e} {thinner_m:e}: {expected:e} {error:e}");
                assert!(error.abs() < 0.01, "{gap_m} {lower_m} {thinner_m}: {error}");
            }
        }
    }

    /// Inductance by the image of the coil in a permeable half-space whose boundary is tilted about the
    /// y axis, H: Neumann's integral over the turns and their mirror images.
    fn mirrored_h(tilt_rad: f64) -> f64 {
        let (sin, cos) = (tilt_rad.sin(), tilt_rad.cos());
        let mirrored = |[x, y, z]: [f64; 3], height: f64| {
            let twice = 2.0 * (x * sin + (z - height) * cos);
            [x - twice * sin, y, z - twice * cos]
        };
        let points = 128;
        let turns: Vec<([f64; 3], [f64; 3])> = COIL
            .radii_m()
            .flat_map(|a| {
                (0..points).map(move |point| {
                    let (sin, cos) = (TAU * f64::from(point) / f64::from(points)).sin_cos();
                    let step = TAU * a / f64::from(points);
                    ([a * cos, a * sin, 0.0], [-step * sin, step * cos, 0.0])
                })
            })
            .collect();
        let mut sum = 0.0;
        for (there, along) in &turns {
            let (there, along) = (mirrored(*there, COIL.gap_at_rest_m), mirrored(*along, 0.0));
            for (here, step) in &turns {
                let distance: f64 = (0..3).map(|i| (here[i] - there[i]).powi(2)).sum();
                let scalar: f64 = (0..3).map(|i| along[i] * step[i]).sum();
                sum += scalar / distance.sqrt();
            }
        }
        2.7 / 4.7 * 1e-7 * sum
    }

    #[test]
    fn a_tilted_boundary_is_that_of_mirror_images() {
        // To first order the tilt has no effect; the slope's part is 9 % of the second order.
        let thick = CoilDesign {
            slab_m: 40e-3,
            ..COIL
        };
        let reading = Reading::new(&thick);
        let scale = even(&reading, 0.1e-3, 0.1e-3);
        for (tilt_rad, most) in [(0.02_f64, 0.01), (0.04, 0.05)] {
            let expected = mirrored_h(tilt_rad) - mirrored_h(0.0);
            let moved = reading.samples().map(|sample| {
                let w = tilt_rad.tan() * sample.x_m;
                Moved {
                    lower_m: w,
                    upper_m: w,
                }
            });
            let found = reading.change_h(moved);
            println!("tilt {tilt_rad}: {expected:e} {found:e}, 0.1 mm: {scale:e}");
            assert!((found / expected - 1.0).abs() < most, "{tilt_rad}");
        }
    }

    #[test]
    fn twice_the_rings_in_an_uneven_approach() {
        // A dome as under a ball, beside the axis.
        let [coarse, fine] = [3, 6].map(|count| {
            let reading = Reading::sampled(&COIL, count, ANGLES);
            let moved = reading.samples().map(|sample| {
                let square = (sample.x_m - 3e-3).powi(2) + (sample.y_m - 1e-3).powi(2);
                let w = 0.3e-3 * (-square / 6e-6).exp();
                Moved {
                    lower_m: w,
                    upper_m: w,
                }
            });
            reading.change_h(moved)
        });
        println!("{coarse:e} {fine:e}");
        assert!((coarse / fine - 1.0).abs() < 3e-3, "{coarse} {fine}");
    }

    #[test]
    fn small_contacts_are_sampled_finely_enough() {
        let layer = Layer {
            thickness_m: 5e-3,
            shear_modulus_pa: 20e3,
            poisson: 0.5,
        };
        let surface = Heights::new(&layer, 5e-3, 7e-3);
        let [coarse, fine] = [(PANELS, ANGLES), (9, 144)]
            .map(|(rings, angles)| Reading::sampled(&COIL, rings, angles));
        for (indenter, most) in [
            (Indenter::Pin { radius_m: 1e-3 }, 3e-3),
            (Indenter::Ball { radius_m: 3e-3 }, 3e-3),
        ] {
            let contacts = Contacts::new(&layer, &surface, &indenter, [0.0; 2], 6);
            let pressed = contacts.pressed(0.3e-3);
            let change_h = |reading: &Reading, x_m: f64| {
                let samples = reading.samples();
                reading.change_h(samples.map(|at| pressed.moved(at.x_m - x_m, at.y_m - 0.4 * x_m)))
            };
            let largest_h = change_h(&fine, 0.0);
            for x_m in [0.0, 1.3e-3, 2.9e-3, 4.4e-3, 6.1e-3, 9e-3] {
                let error = (change_h(&coarse, x_m) - change_h(&fine, x_m)) / largest_h;
                println!("{indenter:?} {x_m:e}: {error:e}");
                assert!(error.abs() < most, "{indenter:?} {x_m}: {error}");
            }
        }
    }

    #[test]
    fn a_mutual_inductance_changes_as_the_whole_does() {
        // With all boundaries moved down by w, M changes as the closed form does at another gap. At
        // the distance zero M and L differ in the first term alone.
        let reading = Reading::new(&COIL);
        for apart_m in [0.0, 6e-3, 10.4e-3] {
            let h = 1e-6;
            let at = |gap_at_rest_m| {
                mutual_h(
                    &CoilDesign {
                        gap_at_rest_m,
                        ..COIL
                    },
                    apart_m,
                )
            };
            let expected = (at(0.6e-3 - h) - at(0.6e-3 + h)) / (2.0 * h);
            // A current u adds 2u M and u^2 L to the inductance.
            let sum = |u: f64| -> f64 {
                let samples = reading.induced(&[([apart_m, 0.0], &reading, [u, 0.0])]);
                samples.iter().map(|s| s.lower_m + s.upper_m).sum()
            };
            let found = 0.25 * (sum(1.0) - sum(-1.0));
            println!(
                "{apart_m:e}: {:e} {found:e} {expected:e}",
                mutual_h(&COIL, apart_m)
            );
            let whole = 0.5 * (sum(1.0) + sum(-1.0));
            assert!(
                (found - expected).abs() < 5e-3 * whole,
                "{apart_m}: {found} {expected}"
            );
            // A current a quarter of a period later adds nothing to first order.
            let later = reading.induced(&[([apart_m, 0.0], &reading, [0.0, 1.0])]);
            let later: f64 = later.iter().map(|s| s.lower_m + s.upper_m).sum();
            assert!((later + whole).abs() < 1e-9 * whole);
        }
    }

    #[test]
    fn a_turn_has_the_field_of_its_axis_and_no_divergence() {
        let axis = turn_field(5e-3, 1e-9, 3e-3);
        let expected = 0.5 * 25e-6 / (25e-6_f64 + 9e-6).powf(1.5);
        assert!((axis.across / expected - 1.0).abs() < 1e-6);
        let (r, z, h) = (3e-3, 2e-3, 1e-7);
        let radial = |r: f64| r * turn_field(5e-3, r, z).along;
        let axial = |z: f64| turn_field(5e-3, r, z).across;
        let outwards = (radial(r + h) - radial(r - h)) / (2.0 * h * r);
        let upwards = (axial(z + h) - axial(z - h)) / (2.0 * h);
        assert!(
            (outwards + upwards).abs() < 1e-5 * upwards.abs(),
            "{outwards} {upwards}"
        );
    }
}
