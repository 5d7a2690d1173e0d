//! Check of a calibration in use by a press onto a known spring.
//!
//! After a calibration the stiffening changes most, by temperature and age. This change has the
//! signal's own shape, so no press onto an unknown load shows it. Let W = 1 + kappa + c_S/c_D0. If
//! a press onto a spring of known kappa gives another W, the signal seems to have changed by the
//! ratio of the true to the measured W. The check corrects a share of this change: the variance of
//! kappa due to the signal over the total variance of kappa. This is Kalman's filter (Trans. ASME
//! 82D, 1960, p. 35) for one quantity. A constant error and one proportional to kappa remain. Their
//! effect on the press counts as signal, so they cancel near the spring's kappa. The uncertainties
//! from place and tilt of the contact (`set_contact`) belong to each press: they stay.

use palpate_wire::Command;
use palpate_wire::command::{Springs, StiffeningCurve, StiffeningKnot, TemperatureEffect};

use super::adjustment::{LEAST_SCATTER, of_signal, scattered};
use super::claim::LOADS;
use super::temperature::brought_to;
use super::terms::terms;
use super::unchecked::{MOST_DEVIATION, Unchecked};

/// A press onto a known spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPress {
    /// Stiffness of the spring with its support, N/m.
    pub spring_n_per_m: f64,
    /// Tolerance of that stiffness, relative, uniform.
    pub tolerance: f64,
    /// Measured c_S/c_L.
    pub load_ratio: f64,
    /// Standard error of `load_ratio`, including the contribution of the calibration.
    pub standard_error: f64,
    /// Force at the end of the press, N.
    pub force_n: f64,
    /// Temperature measured by the board, degrees Celsius; `None` without a thermometer.
    pub temperature_c: Option<f64>,
}

/// A checked calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// Commands that set it.
    pub commands: Vec<Command>,
    /// Deviation of the press in standard errors; positive where the spring was read too stiff.
    pub deviation: f64,
    /// Relative change of the rise.
    pub rise_change: f64,
    /// Relative standard uncertainty of 1/c_L before the check, at each of [`LOADS`] and at this
    /// temperature, without the noise of a press.
    pub uncertainty_before: [f64; LOADS.len()],
    /// Relative standard uncertainty of 1/c_L after the check, at each of [`LOADS`] and at this
    /// temperature, without the noise of a press.
    pub uncertainty_after: [f64; LOADS.len()],
}

/// Checks a calibration, given as the commands that set it, by a press.
///
/// # Errors
/// If a part of the calibration is missing, or the press contradicts it.
pub fn check(commands: &[Command], press: &KnownPress) -> Result<Checked, Unchecked> {
    let brought = brought_to(commands, press.temperature_c);
    let calibrated = ActiveCalibration::of(&brought)?;
    let of_stiffening = calibrated.stiffening_of_signal(press.force_n)?;
    let open = calibrated.open(press.temperature_c);
    let filter = Filter::of(&open, calibrated.ratio(), press, calibrated.kappa(press));
    let deviation = filter.error / filter.variance.sqrt();
    if !deviation.is_finite() {
        return Err(Unchecked::NotAPress);
    }
    if deviation.abs() > MOST_DEVIATION {
        return Err(Unchecked::Contradiction { deviation });
    }
    let left = terms(calibrated.ratio(), |kappa| filter.left(&open, kappa));
    let left = KappaVariance::of_terms(left.map_err(|_| Unchecked::NotAPress)?);
    // Only the stiffening changes; the attraction's contribution to the signal does not.
    let grows = 1.0 + filter.gain * filter.error / filter.whole / of_stiffening;
    let before = calibrated.rise_at_peak()?;
    Ok(Checked {
        commands: calibrated.with(grows, &left, press.temperature_c),
        deviation,
        rise_change: grown(before, grows) / before - 1.0,
        uncertainty_before: open.at_loads(calibrated.ratio()),
        uncertainty_after: left.at_loads(calibrated.ratio()),
    })
}

/// Independent standard uncertainties of kappa: a constant one, one proportional to kappa, and one
/// proportional to W.
#[derive(Clone, Copy, Debug, PartialEq)]
struct KappaVariance {
    constant: f64,
    scale: f64,
    signal: f64,
}

impl KappaVariance {
    const fn of_terms([constant, scale, signal]: [f64; 3]) -> Self {
        Self {
            constant,
            scale,
            signal,
        }
    }

    /// Relative standard uncertainty of 1/c_L at each of [`LOADS`].
    fn at_loads(&self, ratio: f64) -> [f64; LOADS.len()] {
        LOADS.map(|load| {
            let kappa = 1.0 / load;
            self.variance(kappa, 1.0 + kappa + ratio).sqrt() / kappa
        })
    }

    /// Variance of kappa.
    fn variance(&self, kappa: f64, whole: f64) -> f64 {
        self.constant.powi(2) + (self.scale * kappa).powi(2) + (self.signal * whole).powi(2)
    }
}

/// Estimate of the signal's size from a press onto a known spring.
struct Filter {
    ratio: f64,
    /// kappa of the known spring.
    kappa: f64,
    whole: f64,
    /// Error of the measured kappa; positive where it is too small.
    error: f64,
    /// Variance of `error`.
    variance: f64,
    /// Part of `variance` that press and spring contribute.
    own: f64,
    /// Share of `error` that is attributed to the signal.
    gain: f64,
}

impl Filter {
    fn of(open: &KappaVariance, ratio: f64, press: &KnownPress, kappa: f64) -> Self {
        let whole = 1.0 + kappa + ratio;
        let read_whole = 1.0 + press.load_ratio + ratio;
        // The instrument's standard error includes the calibration's contribution, which is
        // removed. A train scatters by `least` at least.
        let of_train = press.standard_error.powi(2) - open.variance(press.load_ratio, read_whole);
        let of_train = of_train * (whole / read_whole).powi(2);
        let least = scattered(LEAST_SCATTER, kappa, ratio).powi(2);
        let of_spring = (kappa * press.tolerance).powi(2) / 3.0;
        let own = of_train.max(least) + of_spring;
        let variance = open.variance(kappa, whole) + own;
        Self {
            ratio,
            kappa,
            whole,
            // Relative to the measured W, since the correction multiplies the signal's size.
            error: (whole / read_whole - 1.0) * whole,
            variance,
            own,
            gain: (open.signal * whole).powi(2) / variance,
        }
    }

    /// Variance at another kappa after the check. The constant error and the error proportional to
    /// kappa remain; their effect on the press is contained in the signal's size.
    fn left(&self, open: &KappaVariance, kappa: f64) -> f64 {
        let whole = 1.0 + kappa + self.ratio;
        let turned = self.gain * whole / self.whole;
        let of_constant = open.constant * (1.0 - turned);
        let of_scale = open.scale * (kappa - turned * self.kappa);
        let of_signal = open.signal * whole * (1.0 - self.gain);
        of_constant.powi(2) + of_scale.powi(2) + of_signal.powi(2) + turned * turned * self.own
    }
}

/// The needed parts of the calibration in force.
struct ActiveCalibration<'c> {
    commands: &'c [Command],
    springs: &'c Springs,
    effect: Option<&'c TemperatureEffect>,
    knots: Vec<&'c StiffeningKnot>,
    /// Relative standard uncertainty of the rise, as the instrument uses it.
    rise_uncertainty: f64,
    peak_a: f64,
    attraction_n_per_a2: f64,
}

impl<'c> ActiveCalibration<'c> {
    fn of(commands: &'c [Command]) -> Result<Self, Unchecked> {
        let (mut springs, mut effect, mut settings, mut attraction) = (None, None, None, None);
        let mut chunks: Vec<&StiffeningCurve> = Vec::new();
        for command in commands {
            match command {
                Command::SetSprings(of) => springs = Some(of),
                Command::SetTemperatureEffect(of) => effect = Some(of),
                Command::SetSettings(of) => settings = Some(of),
                Command::SetAttraction(of) => attraction = Some(of),
                Command::SetStiffeningCurve(of) => chunks.push(of),
                _ => {}
            }
        }
        let uncertainty = chunks.first().map(|chunk| chunk.rise_uncertainty);
        Ok(Self {
            commands,
            springs: springs.ok_or(Unchecked::Missing("springs"))?,
            effect,
            rise_uncertainty: uncertainty
                .ok_or(Unchecked::Missing("stiffening curve"))?
                .into(),
            knots: chunks.into_iter().flat_map(|chunk| &chunk.knots).collect(),
            peak_a: settings
                .ok_or(Unchecked::Missing("settings"))?
                .peak_current_a
                .into(),
            attraction_n_per_a2: attraction.map_or(0.0, |of| of.attraction_n_per_a2.into()),
        })
    }

    /// c_S/c_D0.
    fn ratio(&self) -> f64 {
        f64::from(self.springs.sensing_n_per_m) / f64::from(self.springs.actuated_n_per_m)
    }

    /// Rise at the peak current, interpolated between the neighbouring knots.
    fn rise_at_peak(&self) -> Result<f64, Unchecked> {
        let missing = Unchecked::Missing("stiffening curve up to the peak current");
        let pairs = self.knots.iter().zip(self.knots.iter().skip(1));
        let mut pairs = pairs.map(|(low, high)| (low, high, f64::from(high.current_a)));
        let (low, high, high_a) = pairs.find(|(_, _, a)| *a >= self.peak_a).ok_or(missing)?;
        let low_a = f64::from(low.current_a);
        let part = (self.peak_a - low_a) / (high_a - low_a);
        Ok(f64::from(low.rise) + part * (f64::from(high.rise) - f64::from(low.rise)))
    }

    /// Relative error of the signal per relative error of the stiffening, in a press with this
    /// force.
    fn stiffening_of_signal(&self, force_n: f64) -> Result<f64, Unchecked> {
        let at = |knot: &&StiffeningKnot| {
            let (rise, current_a) = (f64::from(knot.rise), f64::from(knot.current_a));
            let (h, actuated) = (
                -self.ratio() * rise / (1.0 + rise),
                self.ratio() / (1.0 + rise),
            );
            // Attraction over c_S, divided by the deformation, which is the force over c_S.
            let pulled = self.attraction_n_per_a2 * current_a * current_a * actuated / force_n;
            (h, h + pulled)
        };
        let of_stiffening = of_signal(self.knots.iter().map(at));
        if force_n > 0.0 && of_stiffening > 0.0 && of_stiffening.is_finite() {
            return Ok(of_stiffening);
        }
        Err(Unchecked::NotAPress)
    }

    /// Temperature above that of the calibration, K.
    fn warmer_k(&self, temperature_c: Option<f64>) -> f64 {
        let effect = self.effect.zip(temperature_c);
        effect.map_or(0.0, |(effect, now_c)| {
            now_c - f64::from(effect.calibrated_at_c)
        })
    }

    /// c_S/c_L of the known spring.
    fn kappa(&self, press: &KnownPress) -> f64 {
        f64::from(self.springs.sensing_n_per_m) / press.spring_n_per_m
    }

    /// Uncertainties at a temperature. The instrument multiplies an error of the rise by W/(1 +
    /// rise) to get one of kappa.
    fn open(&self, temperature_c: Option<f64>) -> KappaVariance {
        let warmer_k = self.warmer_k(temperature_c);
        let per_k = |of: fn(&TemperatureEffect) -> f32| {
            let per_k = self.effect.map_or(0.0, |effect| of(effect).into());
            let uncertainty: f64 = per_k * warmer_k;
            uncertainty
        };
        let of_rise = self
            .rise_uncertainty
            .hypot(per_k(|of| of.rise_uncertainty_per_k));
        let rise = self.rise_at_peak().unwrap_or(0.0);
        KappaVariance {
            constant: self.springs.sensing_uncertainty.into(),
            scale: f64::from(self.springs.force_scale_uncertainty)
                .hypot(per_k(|of| of.springs_uncertainty_per_k)),
            signal: of_rise / (1.0 + rise),
        }
    }

    /// The commands with h scaled by `grows`, with new uncertainties, and with the temperature of
    /// the check.
    fn with(&self, grows: f64, open: &KappaVariance, temperature_c: Option<f64>) -> Vec<Command> {
        let rise = grown(self.rise_at_peak().unwrap_or(0.0), grows);
        let changed = |command: &Command| match command {
            Command::SetStiffeningCurve(chunk) => Command::SetStiffeningCurve(StiffeningCurve {
                rise_uncertainty: (open.signal * (1.0 + rise)) as f32,
                knots: chunk
                    .knots
                    .iter()
                    .map(|knot| StiffeningKnot {
                        current_a: knot.current_a,
                        rise: grown(knot.rise.into(), grows) as f32,
                    })
                    .collect(),
                ..chunk.clone()
            }),
            Command::SetTemperatureEffect(effect) => {
                Command::SetTemperatureEffect(TemperatureEffect {
                    calibrated_at_c: temperature_c
                        .map_or(effect.calibrated_at_c, |now_c| now_c as f32),
                    ..effect.clone()
                })
            }
            Command::SetSprings(springs) => Command::SetSprings(Springs {
                sensing_uncertainty: open.constant as f32,
                force_scale_uncertainty: open.scale as f32,
                ..springs.clone()
            }),
            other => other.clone(),
        };
        self.commands.iter().map(changed).collect()
    }
}

/// Rise rho for which h = -g rho/(1 + rho) is larger by the factor `grows`.
fn grown(rise: f64, grows: f64) -> f64 {
    let h = rise / (1.0 + rise) * grows;
    h / (1.0 - h)
}

#[cfg(test)]
mod tests {
    use palpate_sim::random::Stream;
    use palpate_wire::command::{Attraction, ContactTolerance, Settings, TemperatureCoefficients};

    use super::*;
    use crate::made::{ATTRACTION_N_PER_A2, PEAK_A, RATIO, RISE, SENSING_N_PER_M};

    const DEPTH_M: f64 = 0.3e-3;
    const CALIBRATED_AT_C: f64 = 20.0;

    /// A calibration of the closed-form sensor, with a purely quadratic rise.
    fn calibration(rise_uncertainty: f64) -> Vec<Command> {
        let knot = |index: u8| {
            let part = f64::from(index) / 7.0;
            StiffeningKnot {
                current_a: (1.03 * part * PEAK_A) as f32,
                rise: (RISE * (1.03 * part).powi(2)) as f32,
            }
        };
        vec![
            Command::SetSettings(Settings {
                peak_current_a: PEAK_A as f32,
                ..palpate_sim::native::default_settings()
            }),
            Command::SetSprings(Springs {
                sensing_n_per_m: SENSING_N_PER_M as f32,
                sensing_uncertainty: 0.005,
                actuated_n_per_m: (SENSING_N_PER_M / RATIO) as f32,
                actuated_uncertainty: 0.0,
                force_scale_uncertainty: 0.003,
                zero_uncertainty_m: 0.0,
                bend: 0.01,
            }),
            Command::SetStiffeningCurve(StiffeningCurve {
                total: 8,
                first: 0,
                rise_uncertainty: rise_uncertainty as f32,
                knots: (0..8).map(knot).collect(),
            }),
            Command::SetAttraction(Attraction {
                attraction_n_per_a2: ATTRACTION_N_PER_A2 as f32,
                uncertainty: 0.0,
            }),
            Command::SetTemperatureEffect(TemperatureEffect {
                calibrated_at_c: CALIBRATED_AT_C as f32,
                springs_uncertainty_per_k: 0.002,
                rise_uncertainty_per_k: 0.003,
            }),
        ]
    }

    /// Deformation of the sensing layer at the train's peak over that at rest, by the three
    /// springs.
    fn deeper(rise: f64, kappa: f64) -> f64 {
        let ratio = RATIO / (1.0 + rise);
        let pull_m = ATTRACTION_N_PER_A2 * PEAK_A * PEAK_A / SENSING_N_PER_M;
        (1.0 + kappa + RATIO - pull_m / DEPTH_M * ratio) / (1.0 + kappa + ratio)
    }

    /// kappa that a sensor calibrated with `calibrated_rise` reads: the kappa at which that rise
    /// gives the deformation at the peak that `rise` and the true `kappa` give.
    fn read_as(rise: f64, kappa: f64, calibrated_rise: f64) -> f64 {
        let (mut low, mut high) = (-0.5, 20.0);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if deeper(calibrated_rise, middle) > deeper(rise, kappa) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// A press onto a spring of c_S on a sensor with another rise.
    fn press(rise: f64, standard_error: f64) -> KnownPress {
        KnownPress {
            spring_n_per_m: SENSING_N_PER_M,
            tolerance: 0.0,
            load_ratio: read_as(rise, 1.0, RISE),
            standard_error,
            force_n: DEPTH_M * SENSING_N_PER_M,
            temperature_c: Some(CALIBRATED_AT_C),
        }
    }

    /// Uncertainty of the signal's size at a temperature.
    fn signal_of(commands: &[Command], temperature_c: f64) -> f64 {
        ActiveCalibration::of(commands)
            .unwrap()
            .open(Some(temperature_c))
            .signal
    }

    fn rise_of(commands: &[Command]) -> f64 {
        ActiveCalibration::of(commands)
            .unwrap()
            .rise_at_peak()
            .unwrap()
    }

    #[test]
    fn what_the_stiffening_has_become_is_found() {
        for grown in [0.9, 1.05] {
            let rise = RISE * grown;
            // Nearly all uncertainty of the calibration is that of the rise.
            let press = press(rise, 0.0);
            let whole = 1.0 + press.load_ratio + RATIO;
            let press = KnownPress {
                standard_error: 0.1 * whole,
                ..press
            };
            let checked = check(&calibration(0.1 * (1.0 + RISE)), &press).unwrap();
            let (found, prior) = (rise_of(&checked.commands), rise_of(&calibration(0.1)));
            assert!((checked.rise_change - (found / prior - 1.0)).abs() < 1e-3);
            assert!((found / prior / grown - 1.0).abs() < 0.01, "{found} {rise}");
            assert_eq!(checked.deviation > 0.0, grown > 1.0);
            // After the correction the spring is read correctly.
            let again = read_as(rise, 1.0, RISE * found / prior);
            assert!((again - 1.0).abs() < 0.02, "{again}");
        }
    }

    #[test]
    fn a_press_within_what_is_open_otherwise_changes_nothing() {
        let press = press(RISE * 1.02, 0.1);
        let checked = check(&calibration(0.0), &press).unwrap();
        assert!(checked.rise_change.abs() < 1e-12);
        assert_eq!(checked.uncertainty_after, checked.uncertainty_before);
    }

    #[test]
    fn what_is_left_open_is_less_than_either_alone() {
        let whole = 1.0 + 1.0 + RATIO;
        let (of_rise, of_else) = (0.03, 0.02);
        let standard_error = whole * f64::hypot(of_rise, of_else);
        let checked = check(
            &calibration(of_rise * (1.0 + RISE)),
            &press(RISE, standard_error),
        );
        let after = signal_of(&checked.unwrap().commands, CALIBRATED_AT_C);
        let expected = 1.0 / f64::hypot(1.0 / of_rise, 1.0 / of_else);
        assert!((after / expected - 1.0).abs() < 0.01, "{after} {expected}");
    }

    #[test]
    fn a_press_that_contradicts_the_calibration_is_refused() {
        let of_other_spring = KnownPress {
            spring_n_per_m: 2.0 * SENSING_N_PER_M,
            ..press(RISE, 0.05)
        };
        let refused = check(&calibration(0.01), &of_other_spring).unwrap_err();
        let Unchecked::Contradiction { deviation } = refused else {
            panic!("{refused:?}");
        };
        // The spring is read softer than its nominal value.
        assert!(deviation < -MOST_DEVIATION, "{deviation}");
        assert!(refused.to_string().contains("too soft"), "{refused}");
    }

    #[test]
    fn from_then_on_the_temperature_counts_from_the_checks() {
        let warmer = KnownPress {
            temperature_c: Some(CALIBRATED_AT_C + 10.0),
            ..press(RISE, 0.2)
        };
        let checked = check(&calibration(0.01), &warmer).unwrap();
        let effect = checked.commands.iter().find_map(|command| match command {
            Command::SetTemperatureEffect(effect) => Some(effect.calibrated_at_c),
            _ => None,
        });
        assert_eq!(effect, Some(30.0));
        let springs = ActiveCalibration::of(&checked.commands).unwrap().springs;
        // 10 K make the springs uncertain by 2 %, which the signal does not show.
        let scale = f64::from(springs.force_scale_uncertainty);
        assert!(scale > 0.005, "{scale}");
        // 10 K make the rise uncertain by 3 %, and the press determines most of it.
        let before = signal_of(&calibration(0.01), CALIBRATED_AT_C + 10.0);
        assert!((before / (0.03_f64.hypot(0.01) / (1.0 + RISE)) - 1.0).abs() < 0.01);
        assert!(signal_of(&checked.commands, CALIBRATED_AT_C + 10.0) < before);
        // On a spring of c_S the stiffening causes 1 % and 3 %, enlarged by W = 3.1; the springs cause 2 %.
        let [_, at_like, _] = checked.uncertainty_before;
        let whole = 2.0 + RATIO;
        let expected = (before * whole).hypot(0.005).hypot(0.003_f64.hypot(0.02));
        assert!(
            (at_like / expected - 1.0).abs() < 1e-3,
            "{at_like} {expected}"
        );
        let both = checked
            .uncertainty_after
            .into_iter()
            .zip(checked.uncertainty_before);
        assert!(both.into_iter().all(|(after, before)| after < before));
    }

    #[test]
    fn with_coefficients_it_is_the_calibration_of_the_press_own_temperature_that_is_checked() {
        const WARMER_K: f64 = 10.0;
        const RISE_PER_K: f64 = 0.01;
        let mut commands = calibration(0.01);
        commands.push(Command::SetTemperatureCoefficients(
            TemperatureCoefficients {
                springs_per_k: 0.0,
                rise_per_k: RISE_PER_K as f32,
            },
        ));
        // With these coefficients the instrument reads the spring correctly.
        let warm = KnownPress {
            load_ratio: 1.0,
            temperature_c: Some(CALIBRATED_AT_C + WARMER_K),
            ..press(RISE, 0.1)
        };
        let checked = check(&commands, &warm).unwrap();
        assert!(checked.deviation.abs() < 1e-6, "{checked:?}");
        let expected = rise_of(&commands) * (RISE_PER_K * WARMER_K).exp();
        let rise = rise_of(&checked.commands);
        assert!((rise / expected - 1.0).abs() < 1e-6, "{rise} {expected}");
        // From the check on the temperature coefficients apply relative to the temperature of the
        // check.
        assert_eq!(
            brought_to(&checked.commands, warm.temperature_c),
            checked.commands
        );
    }

    /// One press does not test other places and tilts, so their tolerance stays. Its part of the
    /// press's standard error does not count as an error of the signal's size.
    #[test]
    fn a_check_leaves_the_contacts_tolerance_as_it_is() {
        let tolerance = Command::SetContact(ContactTolerance {
            within_m: 1e-3,
            tilt_rad: 2e-3,
            rise_uncertainty: 0.02,
            zero_uncertainty_m: 5e-6,
        });
        let mut commands = calibration(0.02);
        commands.push(tolerance.clone());
        let whole = 2.0 + RATIO;
        let of_calibration = 0.02 / (1.0 + RISE) * whole;
        let [exact, within] = [0.0, 0.03 * whole].map(|of_contact| {
            let press = press(RISE * 1.02, of_calibration.hypot(of_contact));
            check(&commands, &press).unwrap()
        });
        assert!(within.commands.contains(&tolerance));
        assert!(within.rise_change > 0.0 && within.rise_change < 0.5 * exact.rise_change);
        let [_, exact, _] = exact.uncertainty_after;
        let [_, within, _] = within.uncertainty_after;
        assert!(within > 1.2 * exact, "{within} {exact}");
    }

    #[test]
    fn what_is_missing_and_what_is_no_press_is_said() {
        let commands = calibration(0.01);
        assert_eq!(
            check(&commands[..1], &press(RISE, 0.1)).unwrap_err(),
            Unchecked::Missing("springs")
        );
        let without_force = KnownPress {
            force_n: 0.0,
            ..press(RISE, 0.1)
        };
        assert_eq!(
            check(&commands, &without_force).unwrap_err(),
            Unchecked::NotAPress
        );
        let without_number = KnownPress {
            load_ratio: f64::NAN,
            ..press(RISE, 0.1)
        };
        assert_eq!(
            check(&commands, &without_number).unwrap_err(),
            Unchecked::NotAPress
        );
    }

    /// Checks many sensors by a press each. Their random errors have the sizes that the calibration
    /// states for its three terms. The uncertainty claimed after the check must match the errors that
    /// remain.
    #[test]
    fn claimed_uncertainty_after_a_check_matches_the_errors_that_remain() {
        const SENSORS: u32 = 2_000;
        let (constant, scale, signal, own) = (0.005, 0.003, 0.02, 0.006);
        let commands: Vec<Command> = calibration(signal * (1.0 + RISE))
            .into_iter()
            .filter(|command| !matches!(command, Command::SetAttraction(_)))
            .collect();
        let mut chance = Stream::named(1, "check");
        let loads = [0.2, 1.0, 5.0];
        let (mut squares, mut claimed) = ([0.0; 3], [0.0; 3]);
        for _ in 0..SENSORS {
            let mut off = |sigma: f64| sigma * chance.normal();
            let (constant_off, scale_off, signal_off) = (off(constant), off(scale), off(signal));
            let whole = |kappa: f64| 1.0 + kappa + RATIO;
            // A larger signal is read as one of a smaller W.
            let off_by = |kappa: f64, signal_off: f64| {
                constant_off + scale_off * kappa - signal_off * whole(kappa)
            };
            let of_terms = |kappa: f64, [constant, scale, signal]: [f64; 3]| {
                let terms = [constant, scale * kappa, signal * whole(kappa)];
                terms.iter().map(|term: &f64| term * term).sum::<f64>()
            };
            let standard_error = (of_terms(1.0, [constant, scale, signal]) + own * own).sqrt();
            let press = KnownPress {
                load_ratio: 1.0 + off_by(1.0, signal_off) + off(own),
                ..press(RISE, standard_error)
            };
            // A few in a thousand are refused.
            let Ok(checked) = check(&commands, &press) else {
                continue;
            };
            let (before, after) = (rise_of(&commands), rise_of(&checked.commands));
            let h = |rise: f64| rise / (1.0 + rise);
            let taken_over = h(after) / h(before) - 1.0;
            let springs = ActiveCalibration::of(&checked.commands).unwrap().springs;
            let terms = [
                springs.sensing_uncertainty.into(),
                springs.force_scale_uncertainty.into(),
                signal_of(&checked.commands, CALIBRATED_AT_C),
            ];
            for (index, kappa) in loads.into_iter().enumerate() {
                squares[index] += off_by(kappa, signal_off - taken_over).powi(2);
                claimed[index] += of_terms(kappa, terms);
            }
        }
        for (kappa, (squares, claimed)) in loads.into_iter().zip(squares.into_iter().zip(claimed)) {
            let ratio = (squares / claimed).sqrt();
            println!("{kappa}: {ratio}");
            // The true variance has a minimum between the loads. The three terms cannot follow it
            // and are larger there.
            assert!((0.6..1.15).contains(&ratio), "{kappa}: {ratio}");
        }
    }
}
