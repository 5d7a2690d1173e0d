//! Records of a board as messages.
//!
//! Frame of a sensor: x and y in its surface, z out of it. A press pushes the sensor along -z.

use palpate_cli::describe;
use palpate_cli::modulus::{DeclaredTip, Evaluated};
use palpate_wire::Record;
use palpate_wire::code::TouchVerdict;
use palpate_wire::record::{Estimate, Refusal, Touch as TouchRecord};

use crate::messages::{Header, Stiffness, Temperature, Touch, Vector3, WrenchStamped};

/// A message about a board.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// Force.
    Force(WrenchStamped),
    /// Temperature of the coil.
    Temperature(Temperature),
    /// Result of a measurement.
    Stiffness(Box<Stiffness>),
    /// Press on an array.
    Touch(Box<Touch>),
}

/// Converts the records of one boot of a board.
#[derive(Debug, Default)]
pub struct Converter {
    /// The board's data are simulated.
    pub simulated: bool,
    tip: DeclaredTip,
    /// Whether the samples have a force; the force of an array's touches is then left out.
    has_force: bool,
}

impl Converter {
    /// For a new boot, whose records follow.
    pub fn new(simulated: bool) -> Self {
        Self {
            simulated,
            ..Self::default()
        }
    }

    /// Messages of a record; `header` has its time and the frame of the sensor.
    pub fn convert(&mut self, record: &Record, header: &Header) -> Vec<Output> {
        self.tip.take(record);
        match record {
            Record::Sample(sample) if sample.sensor == 0 => {
                self.has_force = sample.force_n.is_some();
                let force = sample
                    .force_n
                    .map(|newton| wrench(header, newton.into(), [0.0; 2]));
                force.map(Output::Force).into_iter().collect()
            }
            Record::Touch(touch) => {
                let message = Output::Touch(Box::new(touched(header, touch)));
                let force = self.force_of(touch, header).map(Output::Force);
                force.into_iter().chain([message]).collect()
            }
            Record::Status(status) => {
                let temperature = status.temperature_c.map(|celsius| {
                    Output::Temperature(Temperature {
                        header: header.clone(),
                        temperature: celsius.into(),
                        variance: 0.0,
                    })
                });
                temperature.into_iter().collect()
            }
            Record::Estimate(estimate) => {
                vec![Output::Stiffness(Box::new(
                    self.estimated(header, estimate),
                ))]
            }
            Record::Refusal(refusal) => {
                vec![Output::Stiffness(Box::new(self.refused(header, refusal)))]
            }
            _ => Vec::new(),
        }
    }

    /// Force of a touch at its place; none while the readings claim no force.
    fn force_of(&self, touch: &TouchRecord, header: &Header) -> Option<WrenchStamped> {
        let is_clear = touch.verdict == TouchVerdict::Clear;
        let newton = touch.force_n.or(is_clear.then_some(0.0));
        let place = [touch.x_m, touch.y_m].map(|of| of.map_or(0.0, f64::from));
        newton
            .filter(|_| !self.has_force)
            .map(|newton| wrench(header, newton.into(), place))
    }

    fn estimated(&self, header: &Header, estimate: &Estimate) -> Stiffness {
        let is_rigid = estimate.stiffness_n_per_m.is_none();
        let claims = [
            describe::estimated(estimate),
            format!("95 %: {}", describe::interval(estimate)),
        ];
        let mut message = Stiffness {
            verdict: if is_rigid {
                Stiffness::AT_LEAST
            } else {
                Stiffness::MEASURED
            },
            text: claims.join(", "),
            measurement: estimate.measurement,
            stiffness: number(estimate.stiffness_n_per_m),
            standard_error: number(estimate.standard_error_n_per_m),
            lower: estimate.lower_n_per_m.into(),
            upper: estimate.upper_n_per_m.map_or(f64::INFINITY, f64::from),
            force: estimate.force_n.into(),
            temperature: number(estimate.temperature_c),
            ..self.empty(header)
        };
        match self.tip.evaluate(estimate) {
            Some(Evaluated::Modulus(modulus)) => {
                message.modulus = number(modulus.young_pa);
                message.modulus_lower = modulus.lower_pa.into();
                message.modulus_upper = modulus.upper_pa.map_or(f64::INFINITY, f64::from);
            }
            Some(Evaluated::NoModulus(reason)) => message.modulus_reason = reason,
            None => {}
        }
        message
    }

    fn refused(&self, header: &Header, refusal: &Refusal) -> Stiffness {
        Stiffness {
            verdict: Stiffness::REFUSED,
            reason: refusal.reason.to_string(),
            text: describe::refusal(refusal),
            measurement: refusal.measurement,
            ..self.empty(header)
        }
    }

    /// Message without a number.
    fn empty(&self, header: &Header) -> Stiffness {
        Stiffness {
            header: header.clone(),
            verdict: Stiffness::REFUSED,
            reason: String::new(),
            text: String::new(),
            measurement: 0,
            simulated: self.simulated,
            stiffness: f64::NAN,
            standard_error: f64::NAN,
            lower: f64::NAN,
            upper: f64::NAN,
            force: f64::NAN,
            temperature: f64::NAN,
            modulus: f64::NAN,
            modulus_lower: f64::NAN,
            modulus_upper: f64::NAN,
            modulus_reason: String::new(),
        }
    }
}

/// A press at a place, with its torque about the origin of the frame.
fn wrench(header: &Header, newton: f64, [x_m, y_m]: [f64; 2]) -> WrenchStamped {
    let vector = |x, y, z| Vector3 { x, y, z };
    WrenchStamped {
        header: header.clone(),
        force: vector(0.0, 0.0, -newton),
        torque: vector(-y_m * newton, x_m * newton, 0.0),
    }
}

fn touched(header: &Header, touch: &TouchRecord) -> Touch {
    let product = |value: Option<f32>, relative: Option<f32>| number(value) * number(relative);
    Touch {
        header: header.clone(),
        verdict: touch.verdict.number(),
        x: number(touch.x_m),
        y: number(touch.y_m),
        x_standard_error: number(touch.x_sigma_m),
        y_standard_error: number(touch.y_sigma_m),
        correlation: number(touch.correlation),
        force: number(touch.force_n),
        force_standard_error: product(touch.force_n, touch.force_uncertainty),
        radius: number(touch.radius_m),
        radius_standard_error: product(touch.radius_m, touch.radius_uncertainty),
        chi_square: number(touch.chi_square),
    }
}

fn number(value: Option<f32>) -> f64 {
    value.map_or(f64::NAN, f64::from)
}

#[cfg(test)]
mod tests {
    use palpate_wire::code::{Contact, RefusalReason, TipShape};
    use palpate_wire::command::Tip;
    use palpate_wire::record::Sample;

    use super::*;

    fn header() -> Header {
        Header {
            frame_id: "palpate_left".to_owned(),
            ..Header::default()
        }
    }

    fn sample(force_n: Option<f32>) -> Record {
        Record::Sample(Sample {
            sensor: 0,
            missed: 0,
            gap: false,
            channels: Default::default(),
            contact: Contact::Held,
            force_n,
            force_sigma_n: None,
            current_a: None,
            ripple_a: None,
        })
    }

    fn touch(verdict: TouchVerdict, force_n: Option<f32>) -> Record {
        Record::Touch(TouchRecord {
            verdict,
            x_m: force_n.map(|_| 2e-3),
            y_m: force_n.map(|_| -1e-3),
            force_n,
            force_uncertainty: force_n.map(|_| 0.5),
            ..TouchRecord::without_claim(verdict)
        })
    }

    fn estimate(stiffness_n_per_m: Option<f32>) -> Record {
        Record::Estimate(Estimate {
            measurement: 3,
            stiffness_n_per_m,
            standard_error_n_per_m: stiffness_n_per_m.map(|of| 0.02 * of),
            lower_n_per_m: 1900.0,
            upper_n_per_m: stiffness_n_per_m.map(|of| 1.05 * of),
            load_ratio: 1.0,
            load_ratio_standard_error: 0.01,
            samples: 1000,
            ramps: 20,
            reduced_chi_square: None,
            tangent_n_per_m: None,
            tangent_standard_error_n_per_m: None,
            two_state_n_per_m: None,
            force_n: 1.0,
            total_displacement_m: 1e-3,
            temperature_c: None,
            duration_s: 1.0,
            load_points: 0,
        })
    }

    fn forces(converter: &mut Converter, record: &Record) -> Vec<WrenchStamped> {
        let outputs = converter.convert(record, &header()).into_iter();
        let forces = outputs.filter_map(|output| match output {
            Output::Force(force) => Some(force),
            _ => None,
        });
        forces.collect()
    }

    fn stiffness(converter: &mut Converter, record: &Record) -> Stiffness {
        match converter.convert(record, &header()).pop() {
            Some(Output::Stiffness(message)) => *message,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_press_pushes_along_minus_z_and_an_uncalibrated_board_has_no_force() {
        let mut converter = Converter::default();
        let pressed = forces(&mut converter, &sample(Some(1.5)));
        assert_eq!(
            pressed[0].force,
            Vector3 {
                x: 0.0,
                y: 0.0,
                z: -1.5
            }
        );
        assert_eq!(pressed[0].header, header());
        assert!(forces(&mut converter, &sample(None)).is_empty());
    }

    /// The torque about the origin is the place times the force; r x F by hand.
    #[test]
    fn a_touch_has_a_force_at_its_place_unless_the_samples_have_one() {
        let mut converter = Converter::default();
        let pressed = touch(TouchVerdict::Inside, Some(4.0));
        let found = forces(&mut converter, &pressed);
        let torque = found[0].torque;
        assert!((torque.x - 4e-3).abs() < 1e-9 && (torque.y - 8e-3).abs() < 1e-9);
        let clear = forces(&mut converter, &touch(TouchVerdict::Clear, None));
        assert_eq!(clear[0].force.z.abs(), 0.0);
        assert!(forces(&mut converter, &touch(TouchVerdict::BeyondArray, None)).is_empty());
        forces(&mut converter, &sample(Some(1.0)));
        assert!(forces(&mut converter, &pressed).is_empty());
    }

    #[test]
    fn a_touch_states_standard_errors_in_its_units() {
        let record = touch(TouchVerdict::Inside, Some(4.0));
        let Some(Output::Touch(found)) = Converter::default().convert(&record, &header()).pop()
        else {
            panic!("no touch");
        };
        assert_eq!((found.verdict, found.force_standard_error), (3, 2.0));
        assert!(found.radius.is_nan());
    }

    #[test]
    fn a_stiffness_is_measured_or_a_lower_limit() {
        let mut converter = Converter::new(true);
        let measured = stiffness(&mut converter, &estimate(Some(2000.0)));
        assert_eq!(
            (measured.verdict, measured.measurement),
            (Stiffness::MEASURED, 3)
        );
        assert!(measured.simulated && measured.modulus.is_nan());
        assert_eq!((measured.stiffness, measured.lower), (2000.0, 1900.0));
        assert!(measured.text.contains("2.00 N/mm"), "{}", measured.text);
        let rigid = stiffness(&mut converter, &estimate(None));
        assert_eq!(
            (rigid.verdict, rigid.upper),
            (Stiffness::AT_LEAST, f64::INFINITY)
        );
        assert!(rigid.stiffness.is_nan());
    }

    /// E of a thick object under a flat pin: c (1 - nu^2) / (2 a), by Sneddon.
    #[test]
    fn a_declared_tip_gives_a_modulus() {
        let mut converter = Converter::default();
        let tip = Tip {
            shape: TipShape::FlatPin,
            radius_m: 4e-3,
            radius_uncertainty: 0.01,
            thickness_m: 0.0,
            thickness_uncertainty: 0.0,
            poisson_ratio: 0.5,
            poisson_uncertainty: 0.01,
            support_m_per_n: 0.0,
            support_uncertainty: 0.0,
        };
        converter.convert(&Record::Tip(tip), &header());
        let found = stiffness(&mut converter, &estimate(Some(2000.0)));
        let expected = 2000.0 * 0.75 / 8e-3;
        assert!((found.modulus / expected - 1.0).abs() < 1e-3, "{found:?}");
        assert!(found.modulus_lower < found.modulus && found.modulus < found.modulus_upper);
    }

    #[test]
    fn a_refusal_has_its_reason_and_no_number() {
        let refusal = Record::Refusal(Refusal {
            measurement: 4,
            reason: RefusalReason::Unsteady,
            value: Some(2e-5),
            limit: Some(1e-5),
            wait_s: None,
        });
        let found = stiffness(&mut Converter::default(), &refusal);
        assert_eq!(
            (found.verdict, found.reason.as_str()),
            (Stiffness::REFUSED, "unsteady")
        );
        assert!(found.text.contains("limit 10.0 µm/s"), "{}", found.text);
        assert!(found.lower.is_nan() && found.upper.is_nan() && found.force.is_nan());
    }
}
