//! What noise and the springs' tolerance leave open of a load.

use super::actuated::{self, Actuated, Fit, Problem};
use super::{Known, Unusable};

/// Standard uncertainties that a measurement takes over: of kappa = c_S/c_L by a constant, and by
/// a part of kappa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Of kappa, constant.
    pub constant: f64,
    /// Of kappa, as a part of it.
    pub scale: f64,
    /// By how much the trains' own lines bend, root of the mean square.
    pub bend: f64,
    /// What they consist of.
    pub parts: Parts,
}

/// The same two figures of each cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// The springs' tolerance.
    pub springs: Part,
    /// The samples' noise.
    pub noise: Part,
    /// What the trains leave unexplained: creep, memory, what slipped.
    pub trains: Part,
    /// The gauges: scale of the force, compliance of the frame.
    pub bench: Part,
}

/// A cause's part, as standard uncertainties.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Part {
    /// Of kappa, constant.
    pub constant: f64,
    /// Of kappa, as a part of it.
    pub scale: f64,
}

/// Standard uncertainties of what is not known of the bench.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bench {
    /// Scale of the force, relative.
    pub(crate) force: f64,
    /// Compliance of the frame, m/N.
    pub(crate) frame_m_per_n: f64,
}

/// Loads at which it is evaluated: kappa from a rigid load to one five times as soft as the
/// sensing layer.
const KAPPAS: [f64; 7] = [0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0];

pub(crate) fn uncertainty(fit: &Fit, bench: Bench, known: &Known) -> Result<Uncertainty, Unusable> {
    let add = |variances: &mut [f64; KAPPAS.len()], changed: &Actuated, sigma: f64| {
        for (variance, kappa) in variances.iter_mut().zip(KAPPAS) {
            let found = read_with(changed, &fit.actuated, &fit.problem, kappa);
            *variance += ((found - kappa) * sigma).powi(2);
        }
    };
    let mut by_springs = [0.0; KAPPAS.len()];
    // Each spring off by itself, uniformly within its tolerance. Looked at with a small step.
    const STEP: f64 = 1e-3;
    for spring in 0..fit.problem.springs() {
        let mut stiffer = vec![0.0; fit.problem.springs()];
        if let Some(stiffer) = stiffer.get_mut(spring) {
            *stiffer = STEP;
        }
        let changed = fit.problem.fit(&stiffer)?.actuated;
        add(
            &mut by_springs,
            &changed,
            known.spring_tolerance / 3_f64.sqrt() / STEP,
        );
    }
    let mut variances = by_springs;
    // The samples' noise, along the Cholesky columns of the covariance.
    for column in columns(fit) {
        let unknowns = fit.solution.unknowns.iter().zip(&column);
        let unknowns: Vec<f64> = unknowns.map(|(unknown, change)| unknown + change).collect();
        let changed = actuated::with_unknowns(&fit.actuated, &unknowns);
        add(&mut variances, &changed, 1.0);
    }
    let Part { constant, scale } = figures(&variances);
    let springs = figures(&by_springs);
    let mut by_noise = variances;
    let both = by_noise.iter_mut().zip(by_springs);
    both.for_each(|(all, springs)| *all -= springs);
    let misses = fit.problem.misses(&fit.actuated)?;
    let hard = misses.iter().filter(|(kappa, _)| *kappa < SOFT);
    let soft = misses.iter().filter(|(kappa, _)| *kappa >= SOFT);
    // What the trains were fitted with takes up part of their scatter.
    let count = misses.len() as f64;
    let taken_up = (count / (count - ADJUSTED).max(1.0)).sqrt();
    let trains = Part {
        constant: taken_up * rms(hard.map(|(_, miss)| *miss)),
        scale: taken_up * rms(soft.map(|(kappa, miss)| miss / kappa)),
    };
    let bench = Part {
        constant: bench.frame_m_per_n * known.sensing_n_per_m,
        scale: bench.force,
    };
    Ok(Uncertainty {
        constant: constant.hypot(trains.constant).hypot(bench.constant),
        scale: scale.hypot(trains.scale).hypot(bench.scale),
        bend: rms(fit.problem.bends(&fit.actuated)?.into_iter()),
        parts: Parts {
            springs,
            noise: figures(&by_noise),
            trains,
            bench,
        },
    })
}

/// The two figures of variances at the loads.
fn figures(variances: &[f64; KAPPAS.len()]) -> Part {
    let sigma = |index: usize| {
        variances
            .get(index)
            .map_or(0.0, |v: &f64| v.max(0.0).sqrt())
    };
    let scales = KAPPAS.iter().enumerate();
    let scales = scales.filter(|(_, kappa)| **kappa >= SOFT);
    Part {
        constant: sigma(0).max(sigma(1)).max(sigma(2)),
        scale: scales
            .map(|(index, kappa)| sigma(index) / kappa)
            .fold(0.0, f64::max),
    }
}

/// Loads softer than this (kappa) are read with an error in proportion, harder ones with a constant
/// one.
const SOFT: f64 = 0.4;
/// Quantities that move all trains' kappa: g0, the size of h, attraction, growth of the cross-talk.
const ADJUSTED: f64 = 4.0;

/// Root of the mean square; zero of nothing.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| {
        (sum + value * value, count + 1.0)
    });
    if count > 0.0 {
        f64::sqrt(sum / count)
    } else {
        0.0
    }
}

/// Columns of a square root of the shared unknowns' covariance.
fn columns(fit: &Fit) -> Vec<Vec<f64>> {
    let n = actuated::shared();
    let covariance = &fit.solution.covariance;
    let mut factor = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let rest: f64 = covariance[(i, j)] - dot;
            factor[i][j] = if i == j {
                rest.max(0.0).sqrt()
            } else if factor[j][j] > 0.0 {
                rest / factor[j][j]
            } else {
                0.0
            };
        }
    }
    (0..n)
        .map(|j| (0..n).map(|i| factor[i][j]).collect())
        .collect()
}

/// What an instrument calibrated as `wrong` reads of a load on a sensor that is as `right`: from
/// the two ends of a ramp, for how the one depends on the other.
fn read_with(wrong: &Actuated, right: &Actuated, problem: &Problem, kappa: f64) -> f64 {
    let (depth_m, sensing) = (problem.depth_m, problem.sensing_n_per_m);
    let peak_a = problem.peak_a;
    let square_a2 = peak_a * peak_a;
    // True deformation at rest is the depth; at the peak x (W + h) + p = depth W.
    let whole = 1.0 + kappa + right.ratio;
    let ratio_now = right.ratio + right.regressor(peak_a);
    let pull_m =
        |of: &Actuated, ratio_now: f64| of.attraction_n_per_a2 * square_a2 * ratio_now / sensing;
    let x_m = (depth_m * whole - pull_m(right, ratio_now)) / (1.0 + kappa + ratio_now);
    let wrong_now = wrong.ratio + wrong.regressor(peak_a);
    // x0/depth = W and x0/x = W + h + p/x, solved for W.
    let h = wrong.regressor(peak_a) + pull_m(wrong, wrong_now) / x_m;
    let whole_wrong = h / (depth_m / x_m - 1.0);
    whole_wrong - 1.0 - wrong.ratio
}
