//! A calibration in use, checked by a press upon a spring that is known.
//!
//! What changes most after a calibration has the signal's own shape, so that no press upon an unknown load shows
//! it: the stiffening, by temperature and age. With W = 1 + kappa + c_S/c_D0, a press upon a spring of a known
//! kappa_0 that reads kappa says that the signal is the part e = W_0/W - 1 larger than the calibration has it.
//! Of that the part P/S is taken over, P being the variance that the calibration gives the signal's size, S
//! that of e: what the press leaves open of e by everything else stays out of the calibration. This is the scalar
//! filter of Kalman (Trans. ASME 82D, 1960, p. 35).

use std::fmt;

use palpate_wire::Command;
use palpate_wire::command::{Springs, StiffeningCurve, StiffeningKnot, TemperatureEffect};

use super::adjustment::LEAST_SCATTER;

/// A press upon a spring that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownPress {
    /// Stiffness of the spring with what it stands on, N/m.
    pub spring_n_per_m: f64,
    /// How far that may be off, relative, uniform.
    pub tolerance: f64,
    /// c_S/c_L as measured, and its standard error.
    pub load_ratio: f64,
    /// Standard error of it, the calibration's part included.
    pub standard_error: f64,
    /// Force at the end of the press, N.
    pub force_n: f64,
    /// Temperature that the board has measured, degrees Celsius; nothing of a board without a thermometer.
    pub temperature_c: Option<f64>,
}

/// A calibration after its check.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// The commands that set it.
    pub commands: Vec<Command>,
    /// How far the press was off, in standard errors; positive where the spring was read too stiff.
    pub deviation: f64,
    /// Relative change of the rise that follows.
    pub rise_change: f64,
    /// Relative standard uncertainty of the signal's size at this temperature, before and after.
    pub signal_uncertainty: [f64; 2],
}

/// Why a check gives nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unchecked {
    /// A part of the calibration is not set.
    Missing(&'static str),
    /// The press contradicts the calibration: so many standard errors.
    Contradiction {
        /// Positive where the spring was read too stiff.
        deviation: f64,
    },
    /// A number is not one that a press upon a spring has.
    NotAPress,
}

/// Standard errors beyond which the calibration is not believed, and not mended either: one check in 370 of a
/// calibration that holds.
pub const MOST_DEVIATION: f64 = 3.0;

impl fmt::Display for Unchecked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(part) => write!(
                f,
                "the board has no {part}: calibrate it with `palpate calibrate sensor`"
            ),
            Self::Contradiction { deviation } => write!(
                f,
                "the spring is read {:.1} standard errors too {}, more than the {MOST_DEVIATION:.0} that a \
                 calibration may be off. Press the same spring once more; if it stays so, see that it is \
                 the spring that was named, that nothing else touches the sensor and that no iron is near, \
                 and calibrate anew",
                deviation.abs(),
                if *deviation > 0.0 { "stiff" } else { "soft" }
            ),
            Self::NotAPress => write!(
                f,
                "the press has no force or no uncertainty: press the spring as deep as objects are pressed"
            ),
        }
    }
}

impl std::error::Error for Unchecked {}

/// Checks a calibration, as the commands that set it, by a press.
///
/// # Errors
/// If a part of the calibration is missing, or the press contradicts it.
pub fn check(commands: &[Command], press: &KnownPress) -> Result<Checked, Unchecked> {
    let calibrated = InForce::of(commands)?;
    let of_stiffening = calibrated.stiffening_of_signal(press.force_n)?;
    let sensing_n_per_m = f64::from(calibrated.springs.sensing_n_per_m);
    let kappa = sensing_n_per_m / press.spring_n_per_m;
    let (true_whole, whole) = (
        1.0 + kappa + calibrated.ratio(),
        1.0 + press.load_ratio + calibrated.ratio(),
    );
    let grown_by = true_whole / whole - 1.0;
    let warmer_k = calibrated.warmer_k(press.temperature_c);
    let prior = calibrated.signal_variance(warmer_k);
    // A train scatters at least by so much, whatever the calibration says.
    let least = prior + LEAST_SCATTER * LEAST_SCATTER;
    let of_spring = kappa * press.tolerance / 3_f64.sqrt();
    let variance = (press.standard_error / whole).powi(2).max(least) + (of_spring / whole).powi(2);
    // A signal that has grown is read as that of a stiffer spring.
    let deviation = grown_by / variance.sqrt();
    if !deviation.is_finite() {
        return Err(Unchecked::NotAPress);
    }
    if deviation.abs() > MOST_DEVIATION {
        return Err(Unchecked::Contradiction { deviation });
    }
    let taken_over = prior / variance;
    let left = (prior * (1.0 - taken_over)).sqrt();
    // The attraction's part of the signal stays as it is.
    let grows = 1.0 + taken_over * grown_by / of_stiffening;
    let before = calibrated.rise_at_peak()?;
    let after = grown(before, grows);
    Ok(Checked {
        commands: calibrated.with(grows, left * (1.0 + after), press.temperature_c),
        deviation,
        rise_change: after / before - 1.0,
        signal_uncertainty: [prior.sqrt(), left],
    })
}

/// What of the calibration in force is needed.
struct InForce<'c> {
    commands: &'c [Command],
    springs: &'c Springs,
    effect: Option<&'c TemperatureEffect>,
    knots: Vec<&'c StiffeningKnot>,
    /// Relative standard uncertainty of the rise, as the instrument takes it.
    rise_uncertainty: f64,
    peak_a: f64,
    attraction_n_per_a2: f64,
}

impl<'c> InForce<'c> {
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

    /// The rise at the peak current, between the two knots beside it.
    fn rise_at_peak(&self) -> Result<f64, Unchecked> {
        let missing = Unchecked::Missing("stiffening curve up to the peak current");
        let pairs = self.knots.iter().zip(self.knots.iter().skip(1));
        let mut pairs = pairs.map(|(low, high)| (low, high, f64::from(high.current_a)));
        let (low, high, high_a) = pairs.find(|(_, _, a)| *a >= self.peak_a).ok_or(missing)?;
        let low_a = f64::from(low.current_a);
        let part = (self.peak_a - low_a) / (high_a - low_a);
        Ok(f64::from(low.rise) + part * (f64::from(high.rise) - f64::from(low.rise)))
    }

    /// What the stiffening alone would make of the signal's size, as a part of it: one or more, since the
    /// attraction takes away.
    fn stiffening_of_signal(&self, force_n: f64) -> Result<f64, Unchecked> {
        let rise = self.rise_at_peak()?;
        let h = -self.ratio() * rise / (1.0 + rise);
        let actuated = self.ratio() / (1.0 + rise);
        // Over the deformation, which is the force over c_S.
        let pulled = self.attraction_n_per_a2 * self.peak_a * self.peak_a * actuated / force_n;
        let of_stiffening = h / (h + pulled);
        if force_n > 0.0 && of_stiffening > 0.0 && of_stiffening.is_finite() {
            return Ok(of_stiffening);
        }
        Err(Unchecked::NotAPress)
    }

    /// By how much warmer than at the calibration, K.
    fn warmer_k(&self, temperature_c: Option<f64>) -> f64 {
        let effect = self.effect.zip(temperature_c);
        effect.map_or(0.0, |(effect, now_c)| {
            now_c - f64::from(effect.calibrated_at_c)
        })
    }

    /// Variance of the signal's size, relative. The instrument counts an error of the rise by W/(1 + rise).
    fn signal_variance(&self, warmer_k: f64) -> f64 {
        let per_k = self
            .effect
            .map_or(0.0, |of| of.rise_uncertainty_per_k.into());
        let of_rise = self.rise_uncertainty.hypot(per_k * warmer_k);
        let rise = self.rise_at_peak().unwrap_or(0.0);
        (of_rise / (1.0 + rise)).powi(2)
    }

    /// The commands with another size of h, its uncertainty, and what is known now of the temperature.
    fn with(&self, grows: f64, rise_uncertainty: f64, temperature_c: Option<f64>) -> Vec<Command> {
        let changed = |command: &Command| match command {
            Command::SetStiffeningCurve(chunk) => Command::SetStiffeningCurve(StiffeningCurve {
                rise_uncertainty: rise_uncertainty as f32,
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
            // The springs' own change with temperature is not seen by the size of the signal.
            Command::SetSprings(springs) => Command::SetSprings(Springs {
                force_scale_uncertainty: self.force_scale_uncertainty(temperature_c) as f32,
                ..springs.clone()
            }),
            other => other.clone(),
        };
        self.commands.iter().map(changed).collect()
    }

    fn force_scale_uncertainty(&self, temperature_c: Option<f64>) -> f64 {
        let per_k = self
            .effect
            .map_or(0.0, |of| of.springs_uncertainty_per_k.into());
        let of_temperature: f64 = per_k * self.warmer_k(temperature_c);
        f64::from(self.springs.force_scale_uncertainty).hypot(of_temperature)
    }
}

/// A rise rho of which h = -g rho/(1 + rho) is larger by a factor.
fn grown(rise: f64, grows: f64) -> f64 {
    let h = rise / (1.0 + rise) * grows;
    h / (1.0 - h)
}

#[cfg(test)]
mod tests {
    use palpate_wire::command::{Attraction, Settings};

    use super::*;
    use crate::made::{ATTRACTION_N_PER_A2, PEAK_A, RATIO, RISE, SENSING_N_PER_M};

    const DEPTH_M: f64 = 0.3e-3;
    const CALIBRATED_AT_C: f64 = 20.0;

    /// A calibration of the sensor of closed form, with a purely quadratic rise.
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

    /// How deep the sensing layer is at the peak of the train, over its depth at rest: the three springs.
    fn deeper(rise: f64, kappa: f64) -> f64 {
        let ratio = RATIO / (1.0 + rise);
        let pull_m = ATTRACTION_N_PER_A2 * PEAK_A * PEAK_A / SENSING_N_PER_M;
        (1.0 + kappa + RATIO - pull_m / DEPTH_M * ratio) / (1.0 + kappa + ratio)
    }

    /// kappa of which a calibrated sensor goes as deep at the peak.
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

    /// A press upon a spring of c_S on a sensor whose rise has become another.
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

    fn rise_of(commands: &[Command]) -> f64 {
        InForce::of(commands).unwrap().rise_at_peak().unwrap()
    }

    #[test]
    fn what_the_stiffening_has_become_is_found() {
        for grown in [0.9, 1.05] {
            let rise = RISE * grown;
            // Nearly all that is open is the rise.
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
            // And the spring is read as what it is.
            let again = read_as(rise, 1.0, RISE * found / prior);
            assert!((again - 1.0).abs() < 0.02, "{again}");
        }
    }

    #[test]
    fn a_press_within_what_is_open_otherwise_changes_nothing() {
        let press = press(RISE * 1.02, 0.1);
        let checked = check(&calibration(0.0), &press).unwrap();
        assert!(checked.rise_change.abs() < 1e-12);
        assert_eq!(checked.signal_uncertainty, [0.0, 0.0]);
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
        let [before, after] = checked.unwrap().signal_uncertainty;
        assert!((before / of_rise - 1.0).abs() < 0.01, "{before}");
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
        // The spring is read softer than what is said of it.
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
        let springs = InForce::of(&checked.commands).unwrap().springs;
        let scale = f64::from(springs.force_scale_uncertainty);
        assert!(
            (scale / f64::hypot(0.003, 0.02) - 1.0).abs() < 1e-5,
            "{scale}"
        );
        // 10 K leave 3 % of the rise open, of which the press finds most.
        let [before, after] = checked.signal_uncertainty;
        assert!((before / (0.03_f64.hypot(0.01) / (1.0 + RISE)) - 1.0).abs() < 0.01);
        assert!(after < before);
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
}
