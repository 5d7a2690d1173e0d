//! Reasons why a check gives no result, and the limits beyond which it refuses a calibration.

use std::fmt;

/// Why a check gives no result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unchecked {
    /// A part of the calibration is not set.
    Missing(&'static str),
    /// The press contradicts the calibration.
    Contradiction {
        /// Deviation in standard errors; positive where the spring was read too stiff.
        deviation: f64,
    },
    /// A value is impossible for a press onto a spring.
    NotAPress,
    /// The recorded run is not a train on the untouched sensor.
    NotATrain,
    /// Contact changed during a train without a press.
    Touched,
    /// The session does not belong to the calibration in force.
    OtherSession,
    /// The cross-talk of the untouched sensor has changed too much.
    OtherField {
        /// Relative change of the cross-talk.
        change: f64,
    },
}

/// Deviation of a press, in standard errors, beyond which the calibration is refused, not
/// corrected. One check in 370 refuses a valid calibration.
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
                 calibration may be off. Press the same spring again; if the error remains, check that \
                 it is the spring that was named, that nothing else touches the sensor and that no \
                 iron is near, and calibrate again",
                deviation.abs(),
                if *deviation > 0.0 { "stiff" } else { "soft" }
            ),
            Self::NotAPress => write!(
                f,
                "the press has no force or no uncertainty: press the spring as deep as objects are pressed"
            ),
            Self::NotATrain => write!(
                f,
                "half of the train's falls or more are missing: check that the board sends every \
                 sample, and that the current reaches its peak (`palpate doctor`)"
            ),
            Self::Touched => write!(
                f,
                "the reading of the untouched sensor drifts by more than a fifth of the current's \
                 effect on it: take everything off the sensor, wait until it has recovered from a \
                 press, and try again"
            ),
            Self::OtherSession => write!(
                f,
                "the active calibration was made from another session: name the file that \
                 `palpate calibrate sensor --save-session` wrote then"
            ),
            Self::OtherField { change } => write!(
                f,
                "the effect of the coil's current on the reading of the untouched sensor has changed \
                 by {:+.0} %, more than {:.0} %: check that no iron is near and that the board \
                 measures the current correctly (`palpate calibrate current`), and calibrate again",
                change * 100.0,
                MOST_CHANGE * 100.0
            ),
        }
    }
}

impl std::error::Error for Unchecked {}

/// Greatest relative change of the cross-talk that is corrected. Tests cover changes up to a fifth;
/// a larger change has causes outside the model.
pub const MOST_CHANGE: f64 = 0.3;
