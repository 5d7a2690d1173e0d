//! Temperature coefficients of springs and rise, from the same bench at two temperatures.
//!
//! The geometry of the coil, and so the deformation at a reading, does not depend on the
//! temperature. The forces of the layers change by one common factor, and the size of the
//! stiffening changes. As in the instrument, a quantity with the coefficient b is exp(b dT) times
//! as large when the sensor is warmer by dT kelvin.

use palpate_wire::Command;
use palpate_wire::command::{
    Springs, StiffeningCurve, StiffeningKnot, TemperatureCoefficients, TemperatureEffect,
};

use super::adjustment::{Changes, QUANTITIES};
use super::crosstalk::Crosstalk;
use super::session::Session;
use super::unusable::{LEAST_DIFFERENCE_K, MOST_PER_K, Unusable};
use super::{Calibration, Coefficient, Coefficients, Known, evaluate};

/// Evaluates two sessions of the same bench, with the same specimens, at two temperatures. Returns
/// the calibration of the first session with the coefficients.
///
/// # Errors
/// As [`evaluate`], and if the temperatures are too close.
pub fn evaluate_both(
    first: &Session,
    second: &Session,
    known: &Known,
) -> Result<Calibration, Unusable> {
    let warmer_k = second.temperature_c - first.temperature_c;
    if warmer_k.is_nan() || warmer_k.abs() < LEAST_DIFFERENCE_K {
        return Err(Unusable::SameTemperature {
            difference_k: warmer_k,
        });
    }
    if !same_specimens(first, second) {
        return Err(Unusable::OtherSpecimens);
    }
    let calibration = evaluate(first, known)?;
    let other = evaluate(second, known)?;
    let coefficients = coefficients(&calibration, &other, warmer_k);
    for of in [coefficients.springs, coefficients.rise] {
        if of.per_k.is_nan() || of.per_k.abs() > MOST_PER_K {
            return Err(Unusable::OtherSensor { per_k: of.per_k });
        }
    }
    Ok(with(calibration, coefficients))
}

/// Whether both sessions pressed the same specimens in the same order.
fn same_specimens(first: &Session, second: &Session) -> bool {
    let tasks = |session: &Session| -> Vec<_> {
        let runs = session.runs.iter();
        runs.map(|run| (run.pressed, run.depth_m)).collect()
    };
    tasks(first) == tasks(second)
}

fn coefficients(at_first: &Calibration, at_second: &Calibration, warmer_k: f64) -> Coefficients {
    let springs = force_ratio(at_first, at_second);
    let known = quantities_of(at_first, at_second, springs);
    let size = size_of_h(&known, &at_second.covariance);
    let of_first = size_of_h(&Changes::default(), &at_first.covariance);
    let rise = rise_ratio(at_first, at_second, springs * (1.0 + size.value));
    let coefficient = |ratio: f64, noise: f64| Coefficient {
        per_k: ratio.ln() / warmer_k,
        uncertainty_per_k: (noise / warmer_k).hypot(OF_LAW * ratio.ln() / warmer_k),
    };
    Coefficients {
        springs: coefficient(springs, NOISE_OF_SPRINGS),
        rise: coefficient(
            rise,
            size.uncertainty
                .hypot(of_first.uncertainty)
                .hypot(NOISE_OF_RISE),
        ),
    }
}

/// Returns the changes that convert the quantities of the second session to those of the first. The
/// instrument keeps c_S/c_D0 of the first session at every temperature, since both layers change
/// alike, and also its attraction and cross-talk. The second session is evaluated with c_S at the
/// first temperature: its deformations are `springs` times the true ones, and the rest of the
/// sensing layer's deformation counts as part of c_S/c_D0.
fn quantities_of(first: &Calibration, second: &Calibration, springs: f64) -> Changes {
    let square_a2 = second.actuated.peak_a * second.actuated.peak_a;
    let at_depth = |difference: f64| difference * square_a2 / second.depth_m;
    let of_first = first.actuated.ratio / (1.0 + first.actuated.ratio - springs);
    let attraction_n_per_a2 =
        first.actuated.attraction_n_per_a2 * of_first - second.actuated.attraction_n_per_a2;
    let (of_first, of_second) = (&first.crosstalk, &second.crosstalk);
    let growth = |of: &Crosstalk| of.untouched_m_per_a2 * of.growth_per_m;
    [
        ((1.0 + first.actuated.ratio) / springs - 1.0) / second.actuated.ratio - 1.0,
        0.0,
        at_depth(attraction_n_per_a2 / second.sensing_n_per_m),
        at_depth(springs * of_first.untouched_m_per_a2 - of_second.untouched_m_per_a2),
        (growth(of_first) - growth(of_second)) * square_a2,
    ]
}

/// A relative change with its standard uncertainty.
struct Change {
    value: f64,
    uncertainty: f64,
}

/// Returns the change of the size of h if the other adjusted quantities change as `known`, from the
/// covariance of their errors. The trains determine a combination of all five quantities, so the size
/// of h is far better known together with the others than by itself.
fn size_of_h(known: &Changes, covariance: &[Changes; QUANTITIES]) -> Change {
    const SIZE: usize = 1;
    let (mut mean, mut covariance) = (Changes::default(), *covariance);
    for index in (0..QUANTITIES).filter(|index| *index != SIZE) {
        let row = covariance[index];
        if row[index] <= 0.0 {
            continue;
        }
        let off = (known[index] - mean[index]) / row[index];
        mean.iter_mut()
            .zip(&row)
            .for_each(|(mean, with)| *mean += with * off);
        for (other, with) in covariance.iter_mut().zip(row) {
            let part = with / row[index];
            other
                .iter_mut()
                .zip(&row)
                .for_each(|(entry, with)| *entry -= part * with);
        }
    }
    Change {
        value: mean[SIZE],
        uncertainty: covariance[SIZE][SIZE].max(0.0).sqrt(),
    }
}

/// Force at the second temperature over that at the first temperature, at equal readings: slope of
/// a line through zero.
fn force_ratio(first: &Calibration, second: &Calibration) -> f64 {
    let both = first.force.points().into_iter().map(|(change, force_n)| {
        let within = change <= second.force.greatest_change;
        (
            force_n,
            if within { second.force.at(change) } else { 0.0 },
            within,
        )
    });
    let both = both.filter(|(.., within)| *within);
    slope_through_zero(both.map(|(of_first, of_second, _)| (of_first, of_second)))
}

/// Rise at the second temperature over that at the first. The instrument keeps c_S/c_D0 constant, so
/// only the size of h changes. `scale` converts the h of the second session, which is in units of the
/// springs at its temperature.
fn rise_ratio(first: &Calibration, second: &Calibration, scale: f64) -> f64 {
    /// Number of currents at which the falls are compared.
    const CURRENTS: u8 = 32;
    let (first, second) = (&first.actuated, &second.actuated);
    let parts = (0..=CURRENTS).map(|index| f64::from(index) / f64::from(CURRENTS));
    let both = parts.map(|part| {
        let current_a = part * first.peak_a;
        let of_second = second.regressor(current_a) * scale;
        (first.regressor(current_a), of_second)
    });
    let at_peak = first.regressor(first.peak_a) * slope_through_zero(both);
    let rise = -at_peak / (first.ratio + at_peak);
    rise / first.rise(first.peak_a)
}

/// Slope of the line through zero that fits the points best.
fn slope_through_zero(points: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (products, squares) = points.fold((0.0, 0.0), |(products, squares), (x, y)| {
        (products + x * y, squares + x * x)
    });
    products / squares
}

/// Adds coefficients to a calibration.
fn with(calibration: Calibration, coefficients: Coefficients) -> Calibration {
    let Coefficients { springs, rise } = coefficients;
    let of_signal = calibration.stiffening_of_signal;
    let commands = calibration
        .commands
        .into_iter()
        .map(|command| match command {
            Command::SetTemperatureEffect(effect) => {
                Command::SetTemperatureEffect(TemperatureEffect {
                    springs_uncertainty_per_k: springs.uncertainty_per_k as f32,
                    // As in [`evaluate`], the instrument treats an error of the rise as an error of
                    // the signal.
                    rise_uncertainty_per_k: (rise.uncertainty_per_k * of_signal) as f32,
                    ..effect
                })
            }
            other => other,
        });
    let set = Command::SetTemperatureCoefficients(TemperatureCoefficients {
        springs_per_k: springs.per_k as f32,
        rise_per_k: rise.per_k as f32,
    });
    Calibration {
        commands: commands.chain([set]).collect(),
        coefficients: Some(coefficients),
        ..calibration
    }
}

/// Commands of a calibration at another temperature, with the uncertainties of the original:
/// springs and rise change by the coefficients, if any.
pub(crate) fn brought_to(commands: &[Command], now_c: Option<f64>) -> Vec<Command> {
    let (mut effect, mut coefficients) = (None, None);
    for command in commands {
        match command {
            Command::SetTemperatureEffect(of) => effect = Some(of),
            Command::SetTemperatureCoefficients(of) => coefficients = Some(of),
            _ => {}
        }
    }
    let Some(((effect, of), now_c)) = effect.zip(coefficients).zip(now_c) else {
        return commands.to_vec();
    };
    let warmer_k = now_c - f64::from(effect.calibrated_at_c);
    let factor = |per_k: f32| (f64::from(per_k) * warmer_k).exp();
    let times = |value: f32, factor: f64| (f64::from(value) * factor) as f32;
    let (springs, rise) = (factor(of.springs_per_k), factor(of.rise_per_k));
    let changed = |command: &Command| match command {
        Command::SetSprings(of) => Command::SetSprings(Springs {
            sensing_n_per_m: times(of.sensing_n_per_m, springs),
            actuated_n_per_m: times(of.actuated_n_per_m, springs),
            ..of.clone()
        }),
        Command::SetStiffeningCurve(chunk) => Command::SetStiffeningCurve(StiffeningCurve {
            knots: chunk
                .knots
                .iter()
                .map(|knot| StiffeningKnot {
                    current_a: knot.current_a,
                    rise: times(knot.rise, rise),
                })
                .collect(),
            ..chunk.clone()
        }),
        other => other.clone(),
    };
    commands.iter().map(changed).collect()
}

/// Relative difference between the coefficients from 20 K above and from 20 K below, for a quantity
/// linear in the temperature at 0.5 %/K, which the instrument describes by an exponential: ln(1 -
/// 0.1) is 5 % off -0.1.
const OF_LAW: f64 = 0.05;
/// Root mean square difference of the force at a given reading, between two sessions at one
/// temperature: 0.6e-4 on 30 simulated sensors of the design `ultrasoft`, seeds 760001 to 760030.
const NOISE_OF_SPRINGS: f64 = 1e-4;
/// Relative standard uncertainty of the ratio of two rises, in quadrature with that from the trains'
/// scatter. Chosen so that the stated uncertainty of the coefficient equals its RMS error: 0.15e-3 /K
/// with sessions 20 K apart, on 36 simulated sensors of the design `ultrasoft` (seeds 1200001 to
/// 1200040).
const NOISE_OF_RISE: f64 = 0.0025;

#[cfg(test)]
mod tests {
    use palpate_wire::command::StiffeningKnot;

    use super::*;

    const PER_K: (f64, f64) = (-2e-3, -4e-3);

    /// Springs, rise and temperature of a calibration at 20 degrees Celsius.
    fn commands() -> Vec<Command> {
        let knot = |current_a: f32| StiffeningKnot {
            current_a,
            rise: 0.001 * current_a * current_a,
        };
        vec![
            Command::SetSprings(Springs {
                sensing_n_per_m: 6e3,
                sensing_uncertainty: 0.01,
                actuated_n_per_m: 4e3,
                actuated_uncertainty: 0.0,
                force_scale_uncertainty: 0.002,
                zero_uncertainty_m: 0.0,
                bend: 0.01,
            }),
            Command::SetStiffeningCurve(StiffeningCurve {
                total: 3,
                first: 0,
                rise_uncertainty: 0.02,
                knots: [0.0, 5.0, 10.0].into_iter().map(knot).collect(),
            }),
            Command::SetTemperatureEffect(TemperatureEffect {
                calibrated_at_c: 20.0,
                springs_uncertainty_per_k: 1e-4,
                rise_uncertainty_per_k: 2e-4,
            }),
        ]
    }

    /// If errors of two quantities compensate each other, a known change of one gives the other.
    #[test]
    fn the_size_of_h_follows_what_is_known_of_the_other_quantities() {
        let mut covariance = [Changes::default(); QUANTITIES];
        // Only the combination 2 h - c_S/c_D0 is known well, to 0.001.
        let (ratio, own) = (0.02_f64, 0.000_5_f64);
        covariance[0][0] = ratio * ratio;
        covariance[0][1] = 0.5 * ratio * ratio;
        covariance[1][0] = covariance[0][1];
        covariance[1][1] = 0.25 * ratio * ratio + own * own;
        covariance[3][3] = 1e-8;
        let found = size_of_h(&[0.01, 0.0, 0.0, 1e-4, 0.0], &covariance);
        assert!((found.value - 0.005).abs() < 1e-12, "{}", found.value);
        assert!(
            (found.uncertainty - own).abs() < 1e-9,
            "{}",
            found.uncertainty
        );
    }

    fn springs(commands: &[Command]) -> &Springs {
        let found = commands.iter().find_map(|command| match command {
            Command::SetSprings(of) => Some(of),
            _ => None,
        });
        found.unwrap()
    }

    fn rises(commands: &[Command]) -> Vec<f32> {
        let found = commands.iter().find_map(|command| match command {
            Command::SetStiffeningCurve(of) => {
                Some(of.knots.iter().map(|knot| knot.rise).collect())
            }
            _ => None,
        });
        found.unwrap()
    }

    #[test]
    fn springs_and_rise_are_brought_to_another_temperature() {
        let mut all = commands();
        // Without coefficients the commands stay the same.
        assert_eq!(brought_to(&all, Some(35.0)), all);
        all.push(Command::SetTemperatureCoefficients(
            TemperatureCoefficients {
                springs_per_k: PER_K.0 as f32,
                rise_per_k: PER_K.1 as f32,
            },
        ));
        assert_eq!(brought_to(&all, None), all);
        let warm = brought_to(&all, Some(35.0));
        let (by_springs, by_rise) = ((15.0 * PER_K.0).exp(), (15.0 * PER_K.1).exp());
        let near = |found: f32, expected: f64| {
            assert!(
                (f64::from(found) / expected - 1.0).abs() < 1e-6,
                "{found} {expected}"
            );
        };
        near(springs(&warm).sensing_n_per_m, 6e3 * by_springs);
        near(springs(&warm).actuated_n_per_m, 4e3 * by_springs);
        for (warm, cold) in rises(&warm).iter().zip(rises(&all)).skip(1) {
            near(*warm, f64::from(cold) * by_rise);
        }
        // The change back to the first temperature restores the commands.
        let effect = |command: &mut Command| {
            if let Command::SetTemperatureEffect(of) = command {
                of.calibrated_at_c = 35.0;
            }
        };
        let mut moved = warm;
        moved.iter_mut().for_each(effect);
        near(
            springs(&brought_to(&moved, Some(20.0))).sensing_n_per_m,
            6e3,
        );
    }
}
