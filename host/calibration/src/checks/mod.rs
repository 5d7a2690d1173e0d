//! Plausibility checks of the data recorded on the bench.
//!
//! Each check compares one value with one limit, and docs/evidence/springs.md lists the values of
//! good sessions beside the limits. A run is checked as soon as it is over, a session before its
//! evaluation. The refusal of a value beyond its limit states the value, the likely cause and a
//! remedy.

mod data_fault;
mod figures;
mod kinds;

pub use self::data_fault::DataFault;
use self::figures::Figures;
pub use self::kinds::Check;
use crate::session::{Pressed, Run, Session};
use crate::{Known, Unusable, frame, spring_deviations, zero_shift_m};

/// A value that is compared with the limit of its check.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedFigure {
    /// The check.
    pub check: Check,
    /// Value, in the unit of the limit.
    pub value: f64,
    /// Location, in words.
    pub place: String,
}

impl CheckedFigure {
    /// The fault; `None` for a good value.
    fn fault(&self) -> Option<DataFault> {
        // NaN counts as a fault.
        let is_good = self.value <= self.check.limit();
        (!is_good).then(|| self.check.fault(self.value, &self.place))
    }
}

/// Returns the first fault of a run.
pub fn fault_of_run(run: &Run, untouched: Option<&Run>, known: &Known) -> Option<DataFault> {
    first(&of_run(run, untouched, known))
}

/// Returns the first fault of a session whose runs are good.
pub fn fault_of_session(session: &Session, known: &Known) -> Option<DataFault> {
    match of_session(session, known) {
        Ok(checked) => first(&checked),
        Err(unusable) => Some(DataFault {
            name: "unusable",
            cause: unusable.to_string(),
            action: "Check specimens, gauges and plugs, and start again",
        }),
    }
}

fn first(checked: &[CheckedFigure]) -> Option<DataFault> {
    checked.iter().find_map(CheckedFigure::fault)
}

/// Returns all checks of a run, starting with those whose fault makes others meaningless.
/// `untouched` is the run without contact.
pub fn of_run(run: &Run, untouched: Option<&Run>, known: &Known) -> Vec<CheckedFigure> {
    let Some(figures) = Figures::of(run, known) else {
        return vec![at(run, Check::Samples, 1.0)];
    };
    let mut checked = vec![at(run, Check::Samples, figures.missing)];
    if known.load_cell_gain.is_some() {
        checked.push(at(run, Check::ForceMissing, figures.force_missing));
    }
    if run.ramps_s > run.began_s {
        checked.push(at(run, Check::Current, figures.current_missing));
    }
    checked.extend(figures.rest_force.map(|of| at(run, Check::Zero, of.abs())));
    checked.extend(figures.force_noise.map(|of| at(run, Check::ForceNoise, of)));
    if run.pressed == Pressed::Nothing {
        checked.push(at(run, Check::Touched, figures.change.abs()));
        return checked;
    }
    if let Some(before) = untouched.and_then(|run| Figures::of(run, known)) {
        let moved = figures.rest_hz / before.rest_hz - 1.0;
        checked.push(at(run, Check::RestFrequency, moved.abs()));
    }
    checked.push(at(run, Check::Reached, Check::reached(figures.change)));
    if let Some(stage) = figures.travel {
        checked.push(at(run, Check::StageSign, -stage));
        checked.push(at(run, Check::StageUnit, apart(stage)));
    }
    if let Some(force) = figures.force {
        checked.push(at(run, Check::ForceSign, -force));
        checked.push(at(run, Check::ForceUnit, apart(force)));
    }
    checked.extend(figures.follows.map(|of| at(run, Check::ForceFollows, of)));
    if known.load_cell_gain.is_some() {
        checked.push(at(run, Check::ForceFrozen, figures.frozen_s));
    }
    let stage_follows = figures.stage_follows;
    checked.extend(stage_follows.map(|of| at(run, Check::StageFollows, of)));
    checked.push(at(run, Check::Slip, figures.slipped()));
    checked.extend(
        figures
            .force_slip
            .map(|of| at(run, Check::ForceSlip, of.abs())),
    );
    checked.extend(figures.scatter.map(|of| at(run, Check::Scatter, of)));
    checked
}

/// Factor between a ratio and one, in either direction; infinite for a ratio that is not positive.
fn apart(ratio: f64) -> f64 {
    if ratio > 0.0 {
        ratio.max(1.0 / ratio)
    } else {
        f64::INFINITY
    }
}

fn at(run: &Run, check: Check, value: f64) -> CheckedFigure {
    let depth = format!("{:.2} mm deep", 1e3 * run.depth_m);
    let place = match run.pressed {
        Pressed::Nothing => "nothing pressed".to_owned(),
        Pressed::Block => format!("block, {depth}"),
        Pressed::Spring { n_per_m } => format!("spring of {:.3} N/mm, {depth}", 1e-3 * n_per_m),
        Pressed::BlockBeside { distance_m, .. } => {
            format!(
                "block {:.2} mm beside the centre, {depth}",
                1e3 * distance_m
            )
        }
        Pressed::BlockTilted { angle_rad, .. } => {
            format!("block tilted by {:.3} deg, {depth}", angle_rad.to_degrees())
        }
    };
    CheckedFigure {
        check,
        value,
        place,
    }
}

/// Returns all checks of a session as a whole.
///
/// # Errors
/// If the session lacks the compared data.
pub fn of_session(session: &Session, known: &Known) -> Result<Vec<CheckedFigure>, Unusable> {
    let runs = session.runs.iter().chain([&session.deepest_press]);
    let pressed = runs.filter(|run| run.pressed != Pressed::Nothing);
    let mut checked = depths(pressed, known);
    if !session.bare.is_empty() {
        let softness = frame(&session.bare)? * known.sensing_n_per_m;
        checked.push(whole(Check::Frame, softness));
    }
    if known.load_cell_gain.is_some() {
        let depth_m = mean_depth_m(session);
        let begins = zero_shift_m(session, known)? / depth_m;
        checked.push(whole(Check::ForceBegins, begins));
    }
    checked.extend(springs(session, known)?);
    Ok(checked)
}

/// Mean target depth of the presses onto the block, m.
fn mean_depth_m(session: &Session) -> f64 {
    let blocks = session.runs.iter();
    let blocks = blocks.filter(|run| run.pressed == Pressed::Block);
    let depths: Vec<f64> = blocks.map(|run| run.depth_m).collect();
    depths.iter().sum::<f64>() / depths.len() as f64
}

fn whole(check: Check, value: f64) -> CheckedFigure {
    CheckedFigure {
        check,
        value,
        place: "all runs".to_owned(),
    }
}

/// Checks the depth of each press against its target and the other presses: change of inductance
/// per metre, over the median.
fn depths<'r>(runs: impl Iterator<Item = &'r Run>, known: &Known) -> Vec<CheckedFigure> {
    let figures = runs.filter_map(|run| {
        let change = Figures::of(run, known)?.change;
        Some((run, change / run.depth_m))
    });
    let figures: Vec<(&Run, f64)> = figures.collect();
    let mut sorted: Vec<f64> = figures.iter().map(|(_, change)| *change).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
    figures
        .iter()
        .map(|(run, change)| at(run, Check::Depth, apart(change / median)))
        .collect()
}

/// Checks every spring against its nominal stiffness.
fn springs(session: &Session, known: &Known) -> Result<Vec<CheckedFigure>, Unusable> {
    let deviations = spring_deviations(session, known)?.into_iter();
    Ok(deviations
        .map(|spring| CheckedFigure {
            check: Check::Spring,
            value: spring.deviation.abs(),
            place: format!("spring of {:.3} N/mm", 1e-3 * spring.n_per_m),
        })
        .collect())
}
