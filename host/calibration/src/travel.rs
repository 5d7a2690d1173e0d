//! Force from springs and the stage's travel, without a load cell.
//!
//! On a block the stage travels by the compression of both layers: s = G(y) at the change of
//! inductance y. On a spring k it travels further at the same y, since the force is the same: s =
//! G(y) (1 + C/k), with F = C G(y) and C the stiffness of both layers in series. So the travel
//! gives the shape of the force, and each spring gives a value of C; different values reveal a
//! wrong spring. The zero of the stage's scale is an unknown of each press.

use super::curve::{DEGREE, PressCurve, chebyshev};
use super::least_squares::System;
use super::samples::{self, SampleRun};
use super::{Known, Unusable};
use crate::session::{Pressed, Session};

/// Largest compliance of a frame that is not measured, m/N: 2 µm per newton, as of the softest of
/// the simulated benches. The compliance is taken as uniform from zero to this.
pub(crate) const FRAME_M_PER_N: f64 = 2e-6;
/// Maximum number of evaluated points of a press; more would not help: the noise is small, and the
/// errors are correlated over many points.
const POINTS: usize = 200;
/// Rounds of the iteration between the curve and the springs' travels: the third changes C by less
/// than a thousandth.
const ROUNDS: usize = 3;
/// Relative standard uncertainty of a travel, from the creep of the layers in presses of different
/// length. On the simulated sensors it is 0.4 to 1.4 %.
const OF_TRAVEL: f64 = 0.01;

/// Travel of the stage on block and springs.
#[derive(Clone, Debug)]
pub(crate) struct Travel {
    /// Travel on a block, m, against the change of inductance.
    pub(crate) on_block: PressCurve,
    /// Travel on each spring.
    pub(crate) springs: Vec<SpringTravel>,
}

/// Deviation of the travel on a spring from that expected from its nominal stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringDeviation {
    /// Nominal stiffness, N/m.
    pub n_per_m: f64,
    /// Actual over expected travel, less one.
    pub deviation: f64,
}

/// Compares every spring with its nominal stiffness, by load cell and stage, or without a load cell
/// by the other springs. Empty where the stage has no scale.
///
/// # Errors
/// If the session lacks the compared data.
pub fn spring_deviations(
    session: &Session,
    known: &Known,
) -> Result<Vec<SpringDeviation>, Unusable> {
    let (runs, deepest) = samples::of_session(session, known)?;
    let mut samples = runs.iter().chain([&deepest]).flat_map(|run| &run.press);
    if !samples.any(|sample| sample.stage_m.is_some()) {
        return Ok(Vec::new());
    }
    let travel = Travel::fit(&runs, &deepest)?;
    let series_n_per_m = travel.series_by_gauges_n_per_m(&runs, &deepest, known)?;
    let deviation = |spring: &SpringTravel| SpringDeviation {
        n_per_m: spring.n_per_m,
        deviation: spring.off_by(series_n_per_m),
    };
    Ok(travel.springs.iter().map(deviation).collect())
}

/// Travel of the stage on a spring.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpringTravel {
    /// Nominal stiffness, N/m.
    pub(crate) n_per_m: f64,
    /// Travel on the spring over that on a block, at equal change of inductance.
    pub(crate) times: f64,
}

impl SpringTravel {
    /// Stiffness C of both layers in series that the travel on this spring gives, N/m.
    pub(crate) fn series_n_per_m(&self) -> f64 {
        self.n_per_m * (self.times - 1.0)
    }

    /// Relative standard uncertainty of [`series_n_per_m`](Self::series_n_per_m), for springs
    /// within a tolerance.
    fn uncertainty(&self, tolerance: f64) -> f64 {
        let of_travel = OF_TRAVEL * self.times / (self.times - 1.0);
        (tolerance / 3_f64.sqrt()).hypot(of_travel)
    }

    /// Relative deviation of the travel from that expected of the spring, with both layers'
    /// stiffness in series, N/m.
    pub(crate) fn off_by(&self, series_n_per_m: f64) -> f64 {
        let should = 1.0 + series_n_per_m / self.n_per_m;
        self.times / should - 1.0
    }
}

/// Points of the presses onto one specimen: change of inductance, and the stage's scale, m.
type Points = Vec<(f64, f64)>;

impl Travel {
    /// Fits all presses.
    pub(crate) fn fit(runs: &[SampleRun], deepest: &SampleRun) -> Result<Self, Unusable> {
        let presses: Vec<(Pressed, Points)> = runs
            .iter()
            .chain([deepest])
            .filter(|run| run.pressed != Pressed::Nothing)
            .map(|run| (run.pressed, points(run)))
            .collect();
        let on_block = presses.iter().filter(|(of, _)| *of == Pressed::Block);
        let on_block: Vec<(f64, &Points)> = on_block.map(|(_, points)| (1.0, points)).collect();
        let mut curve = block_curve(&on_block)?;
        let mut springs = travels(&presses, &curve)?;
        for _ in 1..ROUNDS {
            let times = |pressed: &Pressed| match pressed {
                Pressed::Spring { n_per_m } => {
                    let own = springs.iter().find(|spring| spring.n_per_m == *n_per_m);
                    own.map(|spring| spring.times)
                }
                _ => Some(1.0),
            };
            let all: Vec<(f64, &Points)> = presses
                .iter()
                .filter_map(|(pressed, points)| Some((times(pressed)?, points)))
                .collect();
            curve = block_curve(&all)?;
            springs = travels(&presses, &curve)?;
        }
        Ok(Self {
            on_block: curve,
            springs,
        })
    }

    /// C and its relative standard uncertainty, as the weighted mean over the springs.
    pub(crate) fn series_n_per_m(&self, tolerance: f64) -> Result<(f64, f64), Unusable> {
        let (mut sum, mut weights) = (0.0, 0.0);
        for spring in self.springs.iter().filter(|spring| spring.times > 1.0) {
            let weight = spring.uncertainty(tolerance).powi(-2);
            sum += weight * spring.series_n_per_m();
            weights += weight;
        }
        if weights > 0.0 {
            Ok((sum / weights, weights.powf(-0.5)))
        } else {
            Err(Unusable::Undetermined(
                "the force: the stage moves no further on the springs than on the block",
            ))
        }
    }
}

fn points(run: &SampleRun) -> Points {
    let known = run.press.iter();
    let known: Points = known
        .filter_map(|sample| Some((sample.change, sample.stage_m?)))
        .collect();
    let step = known.len().div_ceil(POINTS).max(1);
    known.into_iter().step_by(step).collect()
}

/// Terms of the curve at a change of inductance.
fn terms(change: f64, greatest_change: f64) -> impl Iterator<Item = f64> {
    let terms = chebyshev(change / greatest_change).take(DEGREE);
    terms.map(|(value, _)| value)
}

/// Fits G(y) to presses, each with its travel relative to that on a block.
fn block_curve(presses: &[(f64, &Points)]) -> Result<PressCurve, Unusable> {
    let points = || {
        let numbered = presses.iter().enumerate();
        numbered.flat_map(|(index, (times, points))| {
            points.iter().map(move |point| (index, *times, point))
        })
    };
    let greatest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let greatest_change = greatest(&mut points().map(|(_, _, (change, _))| *change));
    if greatest_change <= 0.0 {
        return Err(Unusable::Missing(
            "press with a known position of the stage",
        ));
    }
    let mut system = System::new(DEGREE + presses.len());
    for (index, times, (change, stage_m)) in points() {
        let mut row = vec![0.0; DEGREE + presses.len()];
        let entries = row.iter_mut().zip(terms(*change, greatest_change));
        entries.for_each(|(entry, term)| *entry = term);
        if let Some(zero) = row.get_mut(DEGREE + index) {
            *zero = 1.0;
        }
        system.add(row, stage_m / times, 1.0);
    }
    let ways = presses.iter().map(|(times, points)| way(points) / times);
    let greatest_m = greatest(&mut ways.into_iter());
    let what = "the stage's travel against inductance";
    PressCurve::with_others(system, greatest_change, greatest_m, what).map(|(curve, _)| curve)
}

/// Span of the stage's positions, m.
fn way(points: &Points) -> f64 {
    let places = points.iter().map(|(_, stage_m)| *stage_m);
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), m| {
        (low.min(m), high.max(m))
    });
    (high - low).max(0.0)
}

/// Travel on each spring relative to that on a block, over all its presses.
fn travels(
    presses: &[(Pressed, Points)],
    curve: &PressCurve,
) -> Result<Vec<SpringTravel>, Unusable> {
    let mut springs: Vec<f64> = Vec::new();
    for (pressed, _) in presses {
        match pressed {
            Pressed::Spring { n_per_m } if !springs.contains(n_per_m) => springs.push(*n_per_m),
            _ => {}
        }
    }
    springs
        .into_iter()
        .map(|n_per_m| {
            let own = Pressed::Spring { n_per_m };
            let own = presses.iter().filter(|(pressed, _)| *pressed == own);
            let own: Vec<&Points> = own.map(|(_, points)| points).collect();
            let mut system = System::new(1 + own.len());
            for (index, points) in own.iter().enumerate() {
                for (change, stage_m) in *points {
                    let mut row = vec![0.0; 1 + own.len()];
                    let places = [(0, curve.at(*change)), (1 + index, 1.0)];
                    for (place, value) in places {
                        if let Some(entry) = row.get_mut(place) {
                            *entry = value;
                        }
                    }
                    system.add(row, *stage_m, 1.0);
                }
            }
            let solution = system.solve("the travel on a spring")?;
            let times = solution.unknowns.first().copied();
            Ok(SpringTravel {
                n_per_m,
                times: times.ok_or(Unusable::Missing("press upon a spring"))?,
            })
        })
        .collect()
}

/// Nominal stiffness of every spring, with the stiffness from travel and force, N/m.
pub(crate) fn springs_n_per_m(
    runs: &[SampleRun],
    deepest: &SampleRun,
    known: &Known,
) -> Result<Vec<(f64, f64)>, Unusable> {
    let travel = Travel::fit(runs, deepest)?;
    let series_n_per_m = travel.series_by_gauges_n_per_m(runs, deepest, known)?;
    let springs = travel.springs.iter();
    Ok(springs
        .map(|spring| (spring.n_per_m, series_n_per_m / (spring.times - 1.0)))
        .collect())
}

impl Travel {
    /// C by the load cell, or by the springs without one, N/m.
    pub(crate) fn series_by_gauges_n_per_m(
        &self,
        runs: &[SampleRun],
        deepest: &SampleRun,
        known: &Known,
    ) -> Result<f64, Unusable> {
        match known.load_cell_gain {
            Some(_) => self.series_by_force_n_per_m(runs, deepest),
            None => Ok(self.series_n_per_m(known.spring_tolerance)?.0),
        }
    }

    /// C by the load cell: force over travel on the block, N/m.
    fn series_by_force_n_per_m(
        &self,
        runs: &[SampleRun],
        deepest: &SampleRun,
    ) -> Result<f64, Unusable> {
        let mut system = System::new(1);
        let presses = runs.iter().chain([deepest]);
        let presses = presses.filter(|run| run.pressed == Pressed::Block);
        for sample in presses.flat_map(|run| &run.press) {
            if let Some(force_n) = sample.force_n {
                system.add([self.on_block.at(sample.change)], force_n, 1.0);
            }
        }
        let solution = system.solve("the force over the stage's travel")?;
        let first = solution.unknowns.first().copied();
        first.ok_or(Unusable::Missing("press upon the block"))
    }
}
