//! Records of a board as messages.
//!
//! Frame of a sensor: x and y in its surface, z out of it. A press pushes the sensor along -z.

use palpate_cli::describe;
use palpate_cli::modulus::{DeclaredTip, Evaluated};
use palpate_wire::code::TouchVerdict;
use palpate_wire::record::{Estimate, Refusal, Touch as TouchRecord};
use palpate_wire::{Message as _, Record};

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
    /// Whether the samples have a force; that of an array's touches is left then.
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
