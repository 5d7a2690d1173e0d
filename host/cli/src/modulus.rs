//! Modulus and hardness of a measured object, from its estimate and the declared tip.
//!
//! The interval combines, in ln E and in quadrature, the distance to each end of the stiffness's
//! interval with 1.96 standard uncertainties of all other inputs: the change of ln E by one standard
//! uncertainty of radius, thickness, Poisson's ratio, stand and force, each by itself, and what the
//! formulas leave out. The force scale enters stiffness and force of a ball in opposite directions; here
//! they count as independent, which is cautious.

use palpate_model::hardness::Scale;
use palpate_model::indentation::{self, Indentation, OutOfLimit};
use palpate_model::units::{Metre, Newton, NewtonPerMetre, Pascal};
use palpate_wire::Record;
use palpate_wire::code::TipShape;
use palpate_wire::command::{Springs, Tip};
use palpate_wire::record::Estimate;
use serde::Serialize;

/// Quantile of the normal distribution for 95 %.
const QUANTILE: f32 = 1.96;

/// What a board's records say of its tip.
#[derive(Clone, Debug, Default)]
pub struct DeclaredTip {
    tip: Option<Tip>,
    springs: Option<Springs>,
}

/// Modulus of an object, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Evaluated {
    /// Modulus and hardness with their intervals.
    Modulus(Modulus),
    /// The reason.
    NoModulus(String),
}

/// Young's modulus and computed equivalents of Shore hardness.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Modulus {
    /// Young's modulus; absent if the object cannot be distinguished from a rigid one.
    pub young_pa: Option<f32>,
    /// Lower end of its 95 % interval.
    pub lower_pa: f32,
    /// Upper end; absent if it is infinite.
    pub upper_pa: Option<f32>,
    /// Computed equivalent, Shore A.
    pub shore_a: Hardness,
    /// Computed equivalent, Shore 00.
    pub shore_00: Hardness,
}

/// A reading of a durometer, computed, with its 95 % interval: 0 to 100.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hardness {
    /// Reading; absent as the modulus.
    pub reading: Option<f32>,
    /// Lower end.
    pub lower: f32,
    /// Upper end.
    pub upper: f32,
    /// Whether the reading lies where the standard accepts one.
    pub is_in_scale: bool,
}

impl DeclaredTip {
    /// Collects the tip from records of a board's configuration.
    pub fn with(in_force: &[Record]) -> Self {
        let mut declared = Self::default();
        in_force.iter().for_each(|record| declared.take(record));
        declared
    }

    /// Takes a record.
    pub fn take(&mut self, record: &Record) {
        match record {
            Record::Tip(tip) => self.tip = Some(tip.clone()),
            Record::Springs(springs) => self.springs = Some(springs.clone()),
            _ => {}
        }
    }

    /// Evaluates an estimate; `None` if no tip is declared.
    pub fn evaluate(&self, estimate: &Estimate) -> Option<Evaluated> {
        let tip = self.tip.as_ref()?;
        let of_springs = self.springs.as_ref();
        let contact = Contact {
            tip: match tip.shape {
                TipShape::FlatPin => indentation::Tip::FlatPin,
                TipShape::Ball => indentation::Tip::Ball,
                TipShape::None | TipShape::Unknown(_) => return None,
            },
            of: tip.clone(),
            force_n: of_springs.map_or(estimate.force_n, |of| middle_force_n(estimate, of)),
        };
        let force_uncertainty = of_springs.map_or(0.0, |springs| {
            springs
                .force_scale_uncertainty
                .hypot(springs.sensing_uncertainty)
        });
        Some(match contact.modulus(estimate, force_uncertainty) {
            Ok(modulus) => Evaluated::Modulus(modulus),
            Err(out) => Evaluated::NoModulus(out.to_string()),
        })
    }
}

/// Force in the middle of the ramps, for which the stiffness holds, N. The record's force is that at the
/// peak current. The sensing layer's deformation is proportional to 1/W, W = 1 + c_S/c_L + c_S/c_D: at the
/// peak W is x_0/x, at rest it has c_D0.
fn middle_force_n(estimate: &Estimate, springs: &Springs) -> f32 {
    // Greater falls of the force than a fifth occur on no sensor that can be calibrated.
    const LEAST: f32 = 0.8;
    let sensing_n_per_m = springs.sensing_n_per_m;
    let at_peak = estimate.total_displacement_m * sensing_n_per_m / estimate.force_n;
    let at_rest = 1.0 + estimate.load_ratio + sensing_n_per_m / springs.actuated_n_per_m;
    estimate.force_n * (at_peak / at_rest).clamp(LEAST, 1.0).sqrt()
}

/// Declared tip and object under a force.
#[derive(Clone)]
struct Contact {
    tip: indentation::Tip,
    of: Tip,
    force_n: f32,
}

impl Contact {
    fn modulus(&self, estimate: &Estimate, force_uncertainty: f32) -> Result<Modulus, OutOfLimit> {
        let measured = estimate.stiffness_n_per_m;
        // The lower end stands for an object that cannot be distinguished from a rigid one.
        let at_n_per_m = measured.unwrap_or(estimate.lower_n_per_m);
        if let Some(object_n_per_m) = self.object_n_per_m(at_n_per_m) {
            self.indentation()
                .modulus(NewtonPerMetre(object_n_per_m), Newton(self.force_n))?;
        }
        let tolerance = QUANTILE * self.uncertainty(at_n_per_m, force_uncertainty);
        let end = |n_per_m: f32, sign: f32| -> Option<f32> {
            let at = self.reduced_pa(n_per_m)?;
            let from = measured.and_then(|of| self.reduced_pa(of)).unwrap_or(at);
            Some(from * (sign * (at / from).ln().hypot(tolerance)).exp())
        };
        let lower_pa = end(estimate.lower_n_per_m, -1.0).unwrap_or_default();
        let upper_pa = estimate.upper_n_per_m.and_then(|of| end(of, 1.0));
        let reduced_pa = measured.and_then(|of| self.reduced_pa(of));
        let nu = self.of.poisson_ratio;
        let young = |reduced_pa: f32| reduced_pa * (1.0 - nu * nu);
        let hardness = |scale| Hardness::of(scale, reduced_pa, lower_pa, upper_pa);
        Ok(Modulus {
            young_pa: reduced_pa.map(young),
            lower_pa: young(lower_pa),
            upper_pa: upper_pa.map(young),
            shore_a: hardness(Scale::A),
            shore_00: hardness(Scale::Double0),
        })
    }

    fn indentation(&self) -> Indentation {
        Indentation {
            tip: self.tip,
            radius: Metre(self.of.radius_m),
            thickness: (self.of.thickness_m > 0.0).then_some(Metre(self.of.thickness_m)),
            poisson_ratio: self.of.poisson_ratio,
        }
    }

    /// Stiffness of the object without its stand, N/m; `None` if it cannot be distinguished from a
    /// rigid one.
    fn object_n_per_m(&self, measured_n_per_m: f32) -> Option<f32> {
        let compliance_m_per_n = 1.0 / measured_n_per_m - self.of.support_m_per_n;
        (compliance_m_per_n > 0.0).then(|| 1.0 / compliance_m_per_n)
    }

    /// E* for a stiffness of the object with its stand, Pa.
    fn reduced_pa(&self, measured_n_per_m: f32) -> Option<f32> {
        let object = NewtonPerMetre(self.object_n_per_m(measured_n_per_m)?);
        let modulus = self.indentation().unchecked(object, Newton(self.force_n));
        Some(modulus.reduced.0)
    }

    /// Relative standard uncertainty of E by all but the stiffness.
    fn uncertainty(&self, n_per_m: f32, force_uncertainty: f32) -> f32 {
        let by = |change: &dyn Fn(&mut Self)| {
            let mut changed = self.clone();
            change(&mut changed);
            let young = |of: &Self| {
                let nu = of.of.poisson_ratio;
                of.reduced_pa(n_per_m)
                    .map(|reduced_pa| reduced_pa * (1.0 - nu * nu))
            };
            let ratio = young(&changed).zip(young(self));
            ratio.map_or(0.0, |(changed_pa, pa)| (changed_pa / pa).ln())
        };
        let of = &self.of;
        // The step stays among the possible ratios.
        let poisson_step = if of.poisson_ratio < of.poisson_uncertainty {
            of.poisson_uncertainty
        } else {
            -of.poisson_uncertainty
        };
        let parts = [
            by(&|to| to.of.radius_m *= 1.0 + of.radius_uncertainty),
            by(&|to| to.of.thickness_m *= 1.0 + of.thickness_uncertainty),
            by(&|to| to.of.poisson_ratio += poisson_step),
            by(&|to| to.of.support_m_per_n *= 1.0 - of.support_uncertainty),
            by(&|to| to.force_n *= 1.0 + force_uncertainty),
            self.formula_uncertainty(n_per_m),
        ];
        parts.into_iter().fold(0.0, f32::hypot)
    }

    fn formula_uncertainty(&self, n_per_m: f32) -> f32 {
        self.object_n_per_m(n_per_m).map_or(0.0, |object_n_per_m| {
            let object = NewtonPerMetre(object_n_per_m);
            let modulus = self.indentation().unchecked(object, Newton(self.force_n));
            modulus.formula_uncertainty
        })
    }
}

impl Hardness {
    fn of(scale: Scale, reduced_pa: Option<f32>, lower_pa: f32, upper_pa: Option<f32>) -> Self {
        let reading = |pa: f32| scale.reading(Pascal(pa));
        let [least, greatest] = Scale::VALID;
        let at = reduced_pa.map(reading);
        Self {
            reading: at,
            lower: reading(lower_pa),
            upper: upper_pa.map_or(100.0, reading),
            is_in_scale: at.is_some_and(|of| (least..=greatest).contains(&of)),
        }
    }

    /// Formats the reading with its interval.
    fn text(&self, scale: &str) -> String {
        let [least, greatest] = Scale::VALID;
        match self.reading {
            Some(of) if of < least => format!("{scale} below {least}"),
            Some(of) if of <= greatest => {
                format!("{scale} {of:.0} ({:.0} to {:.0})", self.lower, self.upper)
            }
            _ => format!("{scale} above {greatest}"),
        }
    }
}

impl Evaluated {
    /// Formats the modulus and, in a second line, the hardness.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        [Some(self.modulus()), self.hardness()]
            .into_iter()
            .flatten()
    }

    /// Formats the modulus with its interval, or says why there is none.
    pub fn modulus(&self) -> String {
        match self {
            Self::NoModulus(reason) => format!("no modulus: {reason}"),
            Self::Modulus(of) => {
                let value = of.young_pa.map_or("as if rigid".to_owned(), pressure);
                let lower = pressure(of.lower_pa);
                let upper = of.upper_pa.map_or("rigid".to_owned(), pressure);
                format!("modulus {value}, 95 % between {lower} and {upper}")
            }
        }
    }

    /// Formats the equivalents of Shore hardness; `None` without a modulus.
    pub fn hardness(&self) -> Option<String> {
        let Self::Modulus(of) = self else { return None };
        Some(format!(
            "computed equivalent: {}; {}",
            of.shore_00.text("Shore 00"),
            of.shore_a.text("Shore A")
        ))
    }
}

/// Formats a modulus in kPa or MPa with three digits.
pub fn pressure(pa: f32) -> String {
    let (value, unit) = if pa < 1e6 {
        (pa * 1e-3, "kPa")
    } else {
        (pa * 1e-6, "MPa")
    };
    let digits = (2 - value.max(1e-3).log10().floor() as i32).clamp(0, 4);
    format!("{value:.*} {unit}", digits as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(n_per_m: Option<f32>, lower: f32, upper: Option<f32>) -> Estimate {
        Estimate {
            measurement: 1,
            stiffness_n_per_m: n_per_m,
            standard_error_n_per_m: None,
            lower_n_per_m: lower,
            upper_n_per_m: upper,
            load_ratio: 1.0,
            load_ratio_standard_error: 0.05,
            samples: 600,
            ramps: 12,
            reduced_chi_square: None,
            tangent_n_per_m: None,
            tangent_standard_error_n_per_m: None,
            two_state_n_per_m: None,
            force_n: 1.8,
            // W at the peak as at rest: 1 + 1 + 1.5.
            total_displacement_m: 3.5 * 1.8 / 6e3,
            temperature_c: None,
            duration_s: 1.2,
            load_points: 0,
        }
    }

    fn tip(shape: TipShape, radius_m: f32) -> Tip {
        Tip {
            shape,
            radius_m,
            radius_uncertainty: 0.0,
            thickness_m: 0.0,
            thickness_uncertainty: 0.0,
            poisson_ratio: 0.5,
            poisson_uncertainty: 0.0,
            support_m_per_n: 0.0,
            support_uncertainty: 0.0,
        }
    }

    fn springs(scale: f32) -> Record {
        Record::Springs(Springs {
            sensing_n_per_m: 6e3,
            sensing_uncertainty: 0.0,
            actuated_n_per_m: 4e3,
            actuated_uncertainty: 0.0,
            force_scale_uncertainty: scale,
            zero_uncertainty_m: 0.0,
            bend: 0.0,
        })
    }

    fn modulus(tip: Tip, estimate: &Estimate) -> Modulus {
        let declared = DeclaredTip::with(&[Record::Tip(tip), springs(0.02)]);
        match declared.evaluate(estimate) {
            Some(Evaluated::Modulus(modulus)) => modulus,
            other => panic!("{other:?}"),
        }
    }

    fn near(value: f32, exact: f64) {
        assert!(
            (f64::from(value) / exact - 1.0).abs() < 2e-5,
            "{value} is not {exact}"
        );
    }

    #[test]
    fn a_pin_passes_the_interval_of_the_stiffness_on() {
        // E = 0.75 c/(2 a).
        let of = estimate(Some(6e3), 5.4e3, Some(6.9e3));
        let pin = modulus(tip(TipShape::FlatPin, 3e-3), &of);
        near(pin.young_pa.unwrap(), 0.75e6);
        near(pin.lower_pa, 0.675e6);
        near(pin.upper_pa.unwrap(), 0.8625e6);
        let open = modulus(tip(TipShape::FlatPin, 3e-3), &estimate(None, 5.4e3, None));
        assert_eq!((open.young_pa, open.upper_pa), (None, None));
        near(open.lower_pa, 0.675e6);
        assert_eq!(open.shore_a.upper, 100.0);
    }

    #[test]
    fn tolerances_widen_the_interval_in_quadrature() {
        let of = estimate(Some(6e3), 6e3, Some(6e3));
        let wide = |change: &dyn Fn(&mut Tip), shape| {
            let mut tip = tip(shape, if shape == TipShape::Ball { 15e-3 } else { 3e-3 });
            change(&mut tip);
            let of = modulus(tip, &of);
            f64::from((of.upper_pa.unwrap() / of.young_pa.unwrap()).ln()) / 1.96
        };
        let pin = TipShape::FlatPin;
        let close =
            |value: f64, exact: f64| assert!((value - exact).abs() < 2e-4, "{value} {exact}");
        close(wide(&|_| {}, pin), 0.0);
        close(wide(&|of| of.radius_uncertainty = 0.03, pin), 1.03_f64.ln());
        // 1 - nu^2 at 0.48 and at 0.5.
        let by_poisson = ((1.0_f64 - 0.48 * 0.48) / 0.75).ln();
        close(wide(&|of| of.poisson_uncertainty = 0.02, pin), by_poisson);
        // 1/6000 - 1/60000, with a tenth more of the stand.
        let by_stand = ((1.0 / 6e3 - 0.9 / 60e3_f64) / (1.0 / 6e3 - 1.0 / 60e3)).ln();
        let stand = |of: &mut Tip| (of.support_m_per_n, of.support_uncertainty) = (1.0 / 60e3, 0.1);
        close(wide(&stand, pin), by_stand);
        let both = |of: &mut Tip| {
            stand(of);
            of.radius_uncertainty = 0.03;
        };
        close(wide(&both, pin), by_stand.hypot(1.03_f64.ln()));
        // E of a ball is proportional to the roots of force and radius; 2 % of the force scale, and
        // 0.577 * 0.21 (a/R)^2 with (a/R)^2 = 1.5 * 0.3 mm/15 mm.
        let of_ball = (0.5 * 1.02_f64.ln()).hypot(0.577 * 0.21 * 0.03);
        close(wide(&|_| {}, TipShape::Ball), of_ball);
        let of_radius = of_ball.hypot(0.5 * 1.03_f64.ln());
        close(
            wide(&|of| of.radius_uncertainty = 0.03, TipShape::Ball),
            of_radius,
        );
    }

    /// Four tenths of W are the actuated layer's, a tenth stiffer at the peak.
    #[test]
    fn a_ball_is_evaluated_with_the_force_in_the_middle_of_the_ramps() {
        let mut of = estimate(Some(6e3), 5.4e3, Some(6.9e3));
        let ball = tip(TipShape::Ball, 15e-3);
        let at_peak = modulus(ball.clone(), &of).young_pa.unwrap();
        of.total_displacement_m = (2.0 + 1.5 / 1.1) * 1.8 / 6e3;
        let ratio = f64::from(modulus(ball, &of).young_pa.unwrap() / at_peak);
        let force: f64 = ((2.0 + 1.5 / 1.1) / 3.5_f64).sqrt();
        assert!((ratio * force.sqrt() - 1.0).abs() < 1e-5, "{ratio}");
    }

    #[test]
    fn without_a_tip_nothing_is_computed_and_beyond_a_limit_the_reason_is_said() {
        let of = estimate(Some(6e3), 5.4e3, Some(6.9e3));
        assert_eq!(DeclaredTip::default().evaluate(&of), None);
        let none = Record::Tip(tip(TipShape::None, 3e-3));
        assert_eq!(DeclaredTip::with(&[none]).evaluate(&of), None);
        let small = Record::Tip(tip(TipShape::FlatPin, 1e-3));
        let evaluated = DeclaredTip::with(&[small]).evaluate(&of).unwrap();
        assert_eq!(
            evaluated.modulus(),
            "no modulus: the pin's depth is 0.30 of its radius; at most 0.2 is covered: use a larger pin"
        );
    }

    #[test]
    fn results_are_said_with_their_units_and_scales() {
        let of = estimate(Some(6e3), 5.4e3, Some(6.88e3));
        let declared = DeclaredTip::with(&[Record::Tip(tip(TipShape::FlatPin, 3e-3))]);
        let evaluated = declared.evaluate(&of).unwrap();
        assert_eq!(
            evaluated.modulus(),
            "modulus 750 kPa, 95 % between 675 kPa and 860 kPa"
        );
        assert_eq!(
            evaluated.hardness().unwrap(),
            "computed equivalent: Shore 00 71 (69 to 73); Shore A below 20"
        );
        assert_eq!(pressure(1.234e6), "1.23 MPa");
        assert_eq!(pressure(41_200.0), "41.2 kPa");
    }
}
