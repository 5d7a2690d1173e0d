//! The force from springs and the stage's travel, where there is no load cell.
//!
//! On a block the stage moves as far as both layers give way: s = G(y) at the change of inductance y. On a
//! spring k it moves further at the same y, since the force is the same: s = G(y) (1 + C/k), with
//! F = C G(y) and C the stiffness of both layers in series. So the travel gives the shape of the force, each
//! spring a value of C, and springs that contradict each other show. Where the stage's scale has its zero
//! is an unknown of each press.

use super::curve::{DEGREE, PressCurve, chebyshev};
use super::least_squares::System;
use super::samples::{self, SampleRun};
use super::{Known, Unusable};
use crate::session::{Pressed, Session};

/// Compliance of a bench's frame that is not measured, m/N: between none and that of one that gives way by
/// 2 µm under a newton, the softest of the simulated benches.
pub(crate) const FRAME_M_PER_N: f64 = 2e-6;
/// Points of a press that are used at most: its noise is little, and its errors last over many points.
const POINTS: usize = 200;
/// Rounds in which the curve and the springs' travels improve each other: the third changes C by less
/// than a thousandth.
const ROUNDS: usize = 3;
/// Standard uncertainty of a travel, relative: creep of the layers in presses of different length.
/// The simulated sensors' is 0.4 to 1.4 %.
const OF_TRAVEL: f64 = 0.01;

/// How far the stage moves.
#[derive(Clone, Debug)]
pub(crate) struct Travel {
    /// On a block, m, against the change of inductance.
    pub(crate) on_block: PressCurve,
    /// On each spring.
    pub(crate) springs: Vec<SpringTravel>,
}

/// By how much the stage's travel on a spring is off what is written on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringDeviation {
    /// What is written on the spring, N/m.
    pub n_per_m: f64,
    /// Travel over what it should be, less one.
    pub deviation: f64,
}

/// Every spring against what is written on it: by load cell and stage, or against the other springs. Empty
/// where the stage has no scale.
///
/// # Errors
/// If the session does not give what is compared.
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

/// How far it moves on a spring.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpringTravel {
    /// What is written on the spring, N/m.
    pub(crate) n_per_m: f64,
    /// The travel over that on a block, at the same change of inductance.
    pub(crate) times: f64,
}

impl SpringTravel {
    /// Stiffness of both layers in series that follows, N/m.
    pub(crate) fn series_n_per_m(&self) -> f64 {
        self.n_per_m * (self.times - 1.0)
    }

    /// Its standard uncertainty, relative, for springs within a tolerance.
    fn uncertainty(&self, tolerance: f64) -> f64 {
        let of_travel = OF_TRAVEL * self.times / (self.times - 1.0);
        (tolerance / 3_f64.sqrt()).hypot(of_travel)
    }

    /// By how much the travel differs from what the spring should take, relative to the travel.
    pub(crate) fn off_by(&self, series_n_per_m: f64) -> f64 {
        let should = 1.0 + series_n_per_m / self.n_per_m;
        self.times / should - 1.0
    }
}

/// Points of the presses upon one specimen: change of inductance, and the stage's scale, m.
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

    /// C, and its standard uncertainty, relative: the mean of what the springs say.
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

/// Terms of the curve at a change.
fn terms(change: f64, greatest_change: f64) -> impl Iterator<Item = f64> {
    let terms = chebyshev(change / greatest_change).take(DEGREE);
    terms.map(|(value, _)| value)
}

/// G(y) from presses, each with how many times as far the stage moves on it.
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
        return Err(Unusable::Missing("press with a known place of the stage"));
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

/// From the lowest to the highest place, m.
fn way(points: &Points) -> f64 {
    let places = points.iter().map(|(_, stage_m)| *stage_m);
    let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), m| {
        (low.min(m), high.max(m))
    });
    (high - low).max(0.0)
}

/// How many times as far as on a block the stage moves on each spring, over all its presses.
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

/// Of every spring what is written on it, and what the stage's travel says with the force, N/m.
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
    /// C by what there is: the load cell, or the springs themselves, N/m.
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
                system.add(vec![self.on_block.at(sample.change)], force_n, 1.0);
            }
        }
        let solution = system.solve("the force over the stage's travel")?;
        let first = solution.unknowns.first().copied();
        first.ok_or(Unusable::Missing("press upon the block"))
    }
}
