//! Evaluation of a session, with a load cell or by the springs alone.

use super::adjustment::{self, Adjusted, Layer};
use super::commands::Findings;
use super::curve::{PressCurve, frame, zero_shift_of};
use super::session::{Pressed, Session};
use super::{
    Basis, Calibration, Crosstalk, Known, Unusable, actuated, claim, contact, creep, samples,
    travel,
};

/// Evaluates a session.
///
/// # Errors
/// If a part of the session is missing, or it contradicts itself or the model of three springs.
pub fn evaluate(session: &Session, known: &Known) -> Result<Calibration, Unusable> {
    let (runs, deepest_press) = samples::of_session(session, known)?;
    let Pressing {
        force,
        crosstalk,
        fit,
        open,
        frame_m_per_n,
    } = match known.load_cell_gain {
        Some(gain) => with_load_cell(session, &runs, &deepest_press, gain, known)?,
        None => by_springs(&runs, &deepest_press, known)?,
    };
    let zero_uncertainty_m = match known.load_cell_gain {
        Some(_) => of_zero(zero_shift_of(&runs, &deepest_press, known)?),
        None => 0.0,
    };
    let adjusted = adjustment::adjust(&fit, crosstalk, known.spring_tolerance)?;
    let uncertainty = claim::uncertainty(&adjusted, open, known)?;
    let displaced = samples::of_runs(&session.contact, known)?;
    let contact = contact::effect(&displaced, &runs, (&force, &adjusted))?;
    if let Some(effect) = &contact {
        let allowed = known.settings.greatest_error.into();
        effect.check(&uncertainty, &adjusted.layer, allowed)?;
    }
    let least_press_m = WITHIN * fit.problem.shallowest_m();
    let Adjusted {
        layer,
        misses,
        covariance_of_exact_springs: covariance,
        ..
    } = adjusted;
    let stiffening_of_signal = layer.stiffening_of_signal();
    let Layer {
        actuated,
        crosstalk,
        depth_m,
        ..
    } = layer;
    let findings = Findings {
        known,
        temperature_c: session.temperature_c,
        rest_hz: runs.first().map_or(0.0, |run| run.rest_hz),
        force: &force,
        crosstalk: &crosstalk,
        actuated: &actuated,
        uncertainty: &uncertainty,
        stiffening_of_signal,
        least_press_m,
        zero_uncertainty_m,
    };
    let mut commands = findings.commands();
    commands.extend(creep::command(
        session,
        &|change| force.at(change),
        actuated.ratio,
        (known.sensing_n_per_m, frame_m_per_n),
    ));
    commands.extend(contact.map(|of| of.command(&actuated)));
    Ok(Calibration {
        commands,
        contact,
        sensing_n_per_m: known.sensing_n_per_m,
        actuated,
        stiffening_of_signal,
        uncertainty,
        crosstalk,
        basis: Basis {
            presses: beside(&force, &runs, &deepest_press),
            curve: force.points(),
            trains: misses,
            springs: travel::springs_n_per_m(&runs, &deepest_press, known).unwrap_or_default(),
        },
        coefficients: None,
        force,
        covariance,
        depth_m,
    })
}

/// Deviations of the load cell from the curve, thinned for a chart.
fn beside(
    force: &PressCurve,
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
) -> Vec<(f64, f64)> {
    /// Number of points that fit on a chart.
    const POINTS: usize = 400;
    let presses = runs.iter().chain([deepest]);
    let presses = presses.filter(|run| run.pressed == Pressed::Block);
    let samples = presses.flat_map(|run| &run.press);
    let points: Vec<(f64, f64)> = samples
        .filter_map(|sample| Some((sample.change, sample.force_n? - force.at(sample.change))))
        .collect();
    let step = points.len().div_ceil(POINTS).max(1);
    points.into_iter().step_by(step).collect()
}

/// Results of the presses and trains.
struct Pressing {
    /// Force against the relative change of inductance, F(y).
    force: PressCurve,
    crosstalk: Crosstalk,
    fit: actuated::Fit,
    /// Uncertainty of the bench.
    open: claim::BenchScatter,
    /// Compliance of the bench's frame, m/N; 0 if it is unknown.
    frame_m_per_n: f64,
}

fn with_load_cell(
    session: &Session,
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
    gain: f64,
    known: &Known,
) -> Result<Pressing, Unusable> {
    // An unmeasured frame adds an uncertainty.
    let (frame_m_per_n, open_m_per_n) = match session.bare.as_slice() {
        [] => (0.0, travel::FRAME_M_PER_N / 3_f64.sqrt()),
        bare => (frame(bare)?, 0.0),
    };
    let force = PressCurve::of_force(runs, deepest)?;
    let crosstalk = Crosstalk::fit(runs, &force, known)?;
    let fit = actuated::fit(runs, &force, crosstalk, frame_m_per_n, known)?;
    Ok(Pressing {
        force,
        crosstalk,
        fit,
        open: claim::BenchScatter {
            force: gain / 3_f64.sqrt(),
            frame_m_per_n: open_m_per_n,
        },
        frame_m_per_n,
    })
}

/// Evaluation without a load cell: springs and the stage's travel give the force, the trains
/// themselves the growth of the cross-talk. The frame's compliance stays unknown.
fn by_springs(
    runs: &[samples::SampleRun],
    deepest: &samples::SampleRun,
    known: &Known,
) -> Result<Pressing, Unusable> {
    let travel = travel::Travel::fit(runs, deepest)?;
    let (series_n_per_m, uncertainty) = travel.series_n_per_m(known.spring_tolerance)?;
    let force = travel.on_block.times(series_n_per_m);
    let crosstalk = Crosstalk::without_contact(runs, &force, known)?;
    let (fit, crosstalk) = actuated::fit_with_growth(runs, &force, crosstalk, known)?;
    Ok(Pressing {
        force,
        crosstalk,
        fit,
        open: claim::BenchScatter {
            force: uncertainty,
            frame_m_per_n: travel::FRAME_M_PER_N / 3_f64.sqrt(),
        },
        frame_m_per_n: 0.0,
    })
}

/// Shift of the force's zero on the block, m, up to which it is noise: three times the greatest one of
/// 40 flat benches (`Check::ForceBegins`).
const NOISE_OF_ZERO_M: f64 = 0.4e-6;

/// Standard uncertainty of the zero, m, for the deformation at which the force on the block begins, m. The
/// bench was tilted then, and a flat contact in use reads too little by this deformation.
fn of_zero(shift_m: f64) -> f64 {
    if shift_m > NOISE_OF_ZERO_M {
        shift_m
    } else {
        0.0
    }
}

/// Depth of the shallowest press allowed in use, over that of the shallowest train: creep and drift
/// change a depth by a twentieth.
const WITHIN: f64 = 0.95;
