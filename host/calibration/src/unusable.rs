//! Reasons why a session gives no calibration.

use std::fmt;

/// Why a session gives no calibration.
#[derive(Clone, Debug, PartialEq)]
pub enum Unusable {
    /// A part of the session is missing.
    Missing(&'static str),
    /// The data of the bench contradict each other or do not determine a quantity.
    Undetermined(&'static str),
    /// A quantity that must rise with the press does not.
    NotRising(&'static str),
    /// A train deformed the sensing layer beyond its curve. Compares the greatest relative change
    /// of inductance in the trains with that in the presses onto the block.
    BeyondPresses {
        /// Greatest change in the trains.
        train: f64,
        /// Greatest change in the presses.
        press: f64,
    },
    /// Two sessions for the temperature coefficients were at nearly the same temperature.
    SameTemperature {
        /// Temperature of the second less that of the first, K.
        difference_k: f64,
    },
    /// Two sessions differ in their specimens or depths.
    OtherSpecimens,
    /// Springs or rise differ between two sessions by more than the temperature can cause in any
    /// elastomer.
    OtherSensor {
        /// Relative change per kelvin.
        per_k: f64,
    },
    /// The remaining uncertainty exceeds the greatest allowed error of an estimate.
    TooUncertain {
        /// Relative standard uncertainty of 1/c_L of a load of c_S.
        at_sensing: f64,
        /// Greatest value that the settings allow.
        allowed: f64,
    },
    /// The tolerance of the contact leaves too large an uncertainty.
    ContactTooWide {
        /// Relative standard uncertainty of 1/c_L of a load of c_S.
        at_sensing: f64,
        /// Greatest value that the settings allow.
        allowed: f64,
    },
    /// The signal of the actuated layer's stiffening is too small.
    StiffensTooLittle(Signal),
    /// The signal is clear, but the trains contradict three springs in series.
    Contradiction {
        /// Signal of the stiffening.
        signal: Signal,
        /// c_S/c_D0 of the fit.
        ratio: f64,
    },
}

/// Effect of the current on the sensing layer's deformation under the hardest load, relative to the
/// deformation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// Change of the deformation at the peak current, relative to the deformation.
    pub change: f64,
    /// Standard deviation of a sample about the fit, relative to the deformation.
    pub scatter: f64,
}

impl Signal {
    /// Ratio of change to scatter below which a small signal counts as the cause of a failed
    /// evaluation. It is 0.7 at most on the design `paper`, and below zero on `ultrasoft` with a
    /// rise of 0.3 to 3 %, since the attraction outweighs the stiffening.
    const CLEAR: f64 = 10.0;

    pub(crate) fn is_clear(&self) -> bool {
        self.change >= Self::CLEAR * self.scatter
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the peak current changes the sensing layer's deformation by {:+.3} % (stiffening \
             increases it, the attraction of the actuated layer's halves reduces it), and samples \
             scatter by {:.3} %",
            self.change * 100.0,
            self.scatter * 100.0
        )
    }
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(part) => write!(f, "the calibration has no {part}"),
            Self::Undetermined(quantity) => {
                write!(f, "the calibration's runs do not determine {quantity}")
            }
            Self::NotRising(curve) => write!(
                f,
                "{curve} does not rise all along the presses upon the block: did the block slip, or a gauge \
                 fail?"
            ),
            Self::BeyondPresses { train, press } => write!(
                f,
                "a train deformed the sensing layer beyond its curve: the inductance rose by {:.1} %, \
                 and by {:.1} % in the deepest press upon the block. It is pressed flat: press less \
                 deep (press_depth_of_sensing_layer_m of the stack)",
                train * 100.0,
                press * 100.0
            ),
            Self::SameTemperature { difference_k } => write!(
                f,
                "the second session was {difference_k:+.1} K from the first, and the effect of \
                 temperature needs {:.0} K at least: warm or cool sensor and board further, and wait \
                 until all of it is at that temperature",
                LEAST_DIFFERENCE_K
            ),
            Self::OtherSpecimens => write!(
                f,
                "the two sessions are not of the same specimens, pressed to the same depths: errors of \
                 the springs would count as effects of the temperature"
            ),
            Self::OtherSensor { per_k } => write!(
                f,
                "springs or stiffening change by {:+.1} %/K between the two sessions, more than {:.0} %/K: are they \
                 of the same sensor, and had all of it both temperatures?",
                per_k * 100.0,
                MOST_PER_K * 100.0
            ),
            Self::TooUncertain {
                at_sensing,
                allowed,
            } => write!(
                f,
                "a load of c_S would be uncertain by {:.0} %, and the settings allow {:.0} %: either \
                 the trains contradict each other, or the attraction of the actuated layer's halves \
                 cancels nearly all of the stiffening. Fasten specimen and stage and calibrate again; \
                 if the error remains, the layer needs a larger gap or a stronger field",
                at_sensing * 100.0,
                allowed * 100.0
            ),
            Self::ContactTooWide {
                at_sensing,
                allowed,
            } => write!(
                f,
                "with contacts within this tolerance a load of c_S would be uncertain by {:.0} %, and the                  settings allow {:.0} %: state a smaller distance or tilt, and guide the objects so that they                  stay within it",
                at_sensing * 100.0,
                allowed * 100.0
            ),
            Self::StiffensTooLittle(signal) => write!(
                f,
                "the actuated layer stiffens too little to be measured: on the block {signal}. It \
                 needs a stronger field, a softer elastomer, or a softer actuated layer than the \
                 sensing one"
            ),
            Self::Contradiction { signal, ratio } => write!(
                f,
                "the trains contradict each other: on the block {signal}, so the layer does stiffen, \
                 but the fit gives c_S/c_D0 = {ratio:.3}. Are the stiffnesses of the springs right, do \
                 some differ from the sensor's own, and did nothing slip?"
            ),
        }
    }
}

impl std::error::Error for Unusable {}

/// Smallest difference of temperature between two sessions, K: even without a change of temperature
/// two calibrations differ by up to a per cent, which over five kelvin is 0.2 %/K.
pub const LEAST_DIFFERENCE_K: f64 = 5.0;

/// Largest coefficient, 1/K, as in the protocol. Silicone rubbers change by some tenths of a per
/// cent.
pub const MOST_PER_K: f64 = 0.05;
