//! Figures of merit of a field.

use core::f64::consts::TAU;

use crate::design::Design;
use crate::force;
use crate::geometry::length;
use crate::mesh::{Region, Zone};
use crate::plates;
use crate::solve::{Figure, Level, Locator, Wanted};

/// Figures of merit of a field. The type is also used for errors and changes of the figures. A
/// figure that was not requested may be NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// B_x at the middle of the core, T.
    pub centre_t: f64,
    /// Mean of |B| over the core's volume, T.
    pub core_mean_t: f64,
    /// Standard deviation of |B| divided by its mean, by volume: over the whole core, and within
    /// three quarters and half of its radius. For a core of 8 mm these radii are 8, 6 and 4 mm.
    pub cv: [f64; 3],
    /// Peak-to-peak value of |B| along the core's axis, divided by the mean of |B| there.
    pub axial_pp: f64,
    /// Peak-to-peak value of |B| along the core's radius in the mid-plane, divided by the mean of
    /// |B| there.
    pub radial_pp: f64,
    /// Flux linked with all driven coils in series, Wb, including the flux of a background field.
    /// At one ampere without a background it equals the inductance in H.
    pub linkage_wb: f64,
    /// Force that closes the core's gap, N, by virtual work.
    pub force_n: f64,
    /// The closing force by Maxwell's stress on the mid-plane, N.
    pub force_by_stress_n: f64,
    /// Greatest |B| in the plates, T, at least 0.1 mm from corners.
    pub plate_max_t: f64,
}

/// Number of intervals along a profile for peak-to-peak values.
const STEPS: u32 = 100;

/// Figures together with the profiles from which their peak-to-peak values were computed.
pub(crate) struct ProfiledFigures {
    /// The figures.
    pub(crate) figures: Figures,
    /// |B| along the core's axis and along its radius, each divided by its mean.
    profiles: [Vec<f64>; 2],
    /// B_x at points of the axis about the centre, T.
    about_centre_t: Vec<f64>,
}

/// Distance of the farthest points about the centre, in lengths of the core.
const ABOUT_CENTRE: f64 = 0.2;
/// Weight of the scatter of changes about the centre against their mean. Elements about the centre
/// are smooth, and those of the next order remove nearly all of their error there.
const SCATTER: f64 = 0.3;

impl ProfiledFigures {
    /// Computes all figures of a solution.
    pub(crate) fn of(design: &Design, level: &Level, w: &[f64], wanted: Wanted<'_>) -> Self {
        let locator = Locator::new(level, w);
        let core = &design.core;
        let middle = core.middle_m();
        let points = core_points(level, w);
        let zones = Zone::SHARES.map(|(zone, _)| ZoneMean::of(&points, zone));
        let share = |step: u32| f64::from(step) / f64::from(STEPS);
        let axial = |step| {
            let x = core.x_m[0] + share(step) * (core.x_m[1] - core.x_m[0]);
            locator.at([0.0, inward(x, core.x_m)]).size()
        };
        let radial = |step| {
            let r = share(step) * core.r_m;
            locator.at([inward(r, [0.0, core.r_m]), middle]).size()
        };
        let profile = |figure, at: &dyn Fn(u32) -> f64| match wanted.has(figure) {
            true => over_mean((0..=STEPS).map(at).collect()),
            false => Vec::new(),
        };
        let profiles = [
            profile(Figure::AxialPp, &axial),
            profile(Figure::RadialPp, &radial),
        ];
        let of = |figure, compute: &dyn Fn() -> f64| match wanted.has(figure) {
            true => compute(),
            false => f64::NAN,
        };
        let figures = Figures {
            centre_t: locator.at([0.0, middle]).b[1],
            core_mean_t: zones[0].mean_t,
            cv: zones.map(|zone| zone.cv),
            axial_pp: of(Figure::AxialPp, &|| peak_to_peak(&profiles[0])),
            radial_pp: of(Figure::RadialPp, &|| peak_to_peak(&profiles[1])),
            linkage_wb: linkage(design, level, w),
            force_n: of(Figure::Force, &|| {
                force::by_virtual_work(design, level, w, &locator)
            }),
            force_by_stress_n: match wanted {
                Wanted::Figures => force::by_stress(design, level, &locator),
                Wanted::Only(_) => f64::NAN,
            },
            plate_max_t: of(Figure::PlateMax, &|| {
                plates::greatest(design, level, w, &locator)
            }),
        };
        let about_centre_t = (-4..=4).map(|step| {
            let x = middle + 0.25 * f64::from(step) * ABOUT_CENTRE * (core.x_m[1] - core.x_m[0]);
            locator.at([0.0, x]).b[1]
        });
        Self {
            figures,
            profiles,
            about_centre_t: about_centre_t.collect(),
        }
    }

    /// Absolute differences of all figures. For peak-to-peak values, the largest difference that
    /// the two profiles permit: the actual difference may vanish by chance.
    pub(crate) fn change_from(&self, other: &Self) -> Figures {
        let [axial_pp, radial_pp] = [0, 1].map(|line: usize| {
            let both = self.profiles[line].iter().zip(&other.profiles[line]);
            2.0 * both.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        });
        Figures {
            axial_pp,
            radial_pp,
            ..self.figures.change_from(&other.figures)
        }
    }

    /// Change of the field about the centre, T: the mean change, which distant edges of metal make,
    /// and [`SCATTER`] times the greatest difference from it. The change at the centre itself may
    /// vanish by chance.
    pub(crate) fn change_about_centre_t(&self, other: &Self) -> f64 {
        let both = self.about_centre_t.iter().zip(&other.about_centre_t);
        let changes: Vec<f64> = both.map(|(a, b)| a - b).collect();
        let mean = changes.iter().sum::<f64>() / changes.len() as f64;
        let scatter = changes.iter().map(|change| (change - mean).abs());
        mean.abs() + SCATTER * scatter.fold(0.0, f64::max)
    }
}

impl Figures {
    /// Computes all figures of a solution.
    #[must_use]
    pub fn of(design: &Design, level: &Level, w: &[f64]) -> Self {
        ProfiledFigures::of(design, level, w, Wanted::Figures).figures
    }

    fn map(&self, other: &Self, mut f: impl FnMut(f64, f64) -> f64) -> Self {
        Self {
            centre_t: f(self.centre_t, other.centre_t),
            core_mean_t: f(self.core_mean_t, other.core_mean_t),
            cv: [0, 1, 2].map(|k: usize| f(self.cv[k], other.cv[k])),
            axial_pp: f(self.axial_pp, other.axial_pp),
            radial_pp: f(self.radial_pp, other.radial_pp),
            linkage_wb: f(self.linkage_wb, other.linkage_wb),
            force_n: f(self.force_n, other.force_n),
            force_by_stress_n: f(self.force_by_stress_n, other.force_by_stress_n),
            plate_max_t: f(self.plate_max_t, other.plate_max_t),
        }
    }

    /// Differences of all figures.
    #[must_use]
    pub fn less(&self, other: &Self) -> Self {
        self.map(other, |a, b| a - b)
    }

    /// Absolute differences of all figures.
    #[must_use]
    pub fn change_from(&self, other: &Self) -> Self {
        self.map(other, |a, b| (a - b).abs())
    }

    /// The greater value of each figure.
    #[must_use]
    pub fn greater_of(&self, other: &Self) -> Self {
        self.map(other, f64::max)
    }

    /// Whether each error is at most its limit; an infinite limit is always met.
    pub(crate) fn is_within(&self, limits: &Self) -> bool {
        let mut within = true;
        self.map(limits, |error, limit| {
            within &= limit == f64::INFINITY || error <= limit;
            0.0
        });
        within
    }

    /// All figures multiplied by a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        self.map(self, |a, _| factor * a)
    }
}

/// Moves a position slightly into a range, so that it is not evaluated in the triangle beyond the
/// range's end.
fn inward(place: f64, [from, to]: [f64; 2]) -> f64 {
    let margin = 1e-7 * (to - from);
    place.clamp(from + margin, to - margin)
}

/// Values divided by their mean; all 0 if the mean is 0.
fn over_mean(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
    values.iter_mut().for_each(|value| *value *= scale);
    values
}

fn peak_to_peak(values: &[f64]) -> f64 {
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    high - low
}

/// A point of integration in the core.
struct CorePoint {
    zone: Zone,
    triangle: usize,
    volume_m3: f64,
    b_t: f64,
}

fn core_points(level: &Level, w: &[f64]) -> Vec<CorePoint> {
    let mut points = Vec::new();
    let in_core = |region: &Region| region.zone != Zone::None;
    level.visit_where(w, in_core, |at| {
        points.push(CorePoint {
            zone: at.region.zone,
            triangle: at.triangle,
            volume_m3: TAU * at.weight * at.point[0],
            b_t: length(at.b),
        });
    });
    points
}

/// |B| over a zone of the core.
#[derive(Clone, Copy)]
struct ZoneMean {
    volume_m3: f64,
    mean_t: f64,
    /// Coefficient of variation; 0 if the mean is 0.
    cv: f64,
}

impl ZoneMean {
    fn of(points: &[CorePoint], zone: Zone) -> Self {
        let mut sum = [0.0; 3];
        for point in points.iter().filter(|point| point.zone >= zone) {
            for (sum, value) in sum.iter_mut().zip([1.0, point.b_t, point.b_t.powi(2)]) {
                *sum += point.volume_m3 * value;
            }
        }
        let [volume_m3, first, second] = sum;
        let mean_t = first / volume_m3;
        let variance = (second / volume_m3 - mean_t * mean_t).max(0.0);
        let cv = if mean_t > 0.0 {
            variance.sqrt() / mean_t
        } else {
            0.0
        };
        Self {
            volume_m3,
            mean_t,
            cv,
        }
    }
}

/// Changes of mean and homogeneity from the field `before` to the field `after` if those of
/// single triangles did not cancel each other: the sums of their absolute values. All other figures
/// are NaN.
pub(crate) fn change_of_triangles(level: &Level, [before, after]: [&[f64]; 2]) -> Figures {
    let [points_before, points] = [before, after].map(|w| core_points(level, w));
    let [zones_before, zones] = [&points_before, &points]
        .map(|points| Zone::SHARES.map(|(zone, _)| ZoneMean::of(points, zone)));
    let pairs = || points_before.iter().zip(&points);
    let mean = pairs().map(|(a, b)| {
        let change = b.volume_m3 * (b.b_t - a.b_t);
        (b.triangle, change / zones[0].volume_m3)
    });
    let cv = |index: usize| {
        let (old, new) = (zones_before[index], zones[index]);
        let within = pairs().filter(|(_, b)| b.zone >= Zone::SHARES[index].0);
        let scale = new.volume_m3 * new.cv;
        sum_of_sizes(within.map(|(a, b)| {
            let deviation = b.b_t / new.mean_t - 1.0;
            let change = deviation - (a.b_t / old.mean_t - 1.0);
            (b.triangle, b.volume_m3 * deviation * change / scale)
        }))
    };
    Figures {
        core_mean_t: sum_of_sizes(mean),
        cv: [0, 1, 2].map(cv),
        ..Figures::default().scaled(f64::NAN)
    }
}

/// Sum of the absolute values of what each triangle contributes. Contributions, each with the index
/// of its triangle, are in the order of the triangles.
fn sum_of_sizes(contributions: impl Iterator<Item = (usize, f64)>) -> f64 {
    let (mut sum, mut of_one, mut current) = (0.0, 0.0_f64, 0);
    for (triangle, contribution) in contributions {
        if triangle != current {
            sum += of_one.abs();
            (of_one, current) = (0.0, triangle);
        }
        of_one += contribution;
    }
    sum + of_one.abs()
}

fn linkage(design: &Design, level: &Level, w: &[f64]) -> f64 {
    let mut linkage = 0.0;
    let in_ring = |region: &Region| region.ring.is_some();
    level.visit_where(w, in_ring, |at| {
        let Some([coil, ring]) = at.region.ring else {
            return;
        };
        let coil = design.coils.get(coil as usize).filter(|coil| coil.driven);
        let ring = coil.and_then(|coil| coil.rings.get(ring as usize));
        if let (Some(coil), Some(ring)) = (coil, ring) {
            linkage += TAU * at.weight * coil.sense * coil.turns / ring.area_m2()
                * (at.w + 0.5 * level.background_t)
                * at.point[0].powi(2);
        }
    });
    linkage
}
