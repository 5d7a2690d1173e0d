//! Messages of ROS 2, with the fields and their order as in the `.msg` files: CDR has no names.

use serde::{Deserialize, Serialize};

/// A message with the name of its type.
pub trait Named: Serialize {
    /// Package and type.
    const NAME: (&'static str, &'static str);
}

/// `builtin_interfaces/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds since 1970.
    pub sec: i32,
    /// Nanoseconds of the second.
    pub nanosec: u32,
}

impl Time {
    /// Time from ns since 1970. Times beyond the message's range (1901 to 2038) become its limits.
    pub fn from_ns(ns: i64) -> Self {
        let seconds = ns.div_euclid(1_000_000_000);
        let limit = if seconds < 0 { i32::MIN } else { i32::MAX };
        Self {
            sec: i32::try_from(seconds).unwrap_or(limit),
            nanosec: ns.rem_euclid(1_000_000_000) as u32,
        }
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of what the message says.
    pub stamp: Time,
    /// Frame in which it is said.
    pub frame_id: String,
}

/// `geometry_msgs/Vector3`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

/// `geometry_msgs/WrenchStamped`, without the name of the structure between.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WrenchStamped {
    /// Time and frame.
    pub header: Header,
    /// Force, N.
    pub force: Vector3,
    /// Torque, N m.
    pub torque: Vector3,
}

impl Named for WrenchStamped {
    const NAME: (&'static str, &'static str) = ("geometry_msgs", "WrenchStamped");
}

/// `sensor_msgs/Temperature`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Temperature {
    /// Time and frame.
    pub header: Header,
    /// Temperature, degrees Celsius.
    pub temperature: f64,
    /// Variance, K^2; 0 for unknown.
    pub variance: f64,
}

impl Named for Temperature {
    const NAME: (&'static str, &'static str) = ("sensor_msgs", "Temperature");
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// Name.
    pub key: String,
    /// Value as text.
    pub value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// Level: [`OK`](Self::OK), [`WARN`](Self::WARN) or [`ERROR`](Self::ERROR).
    pub level: u8,
    /// Part that is described.
    pub name: String,
    /// Description.
    pub message: String,
    /// Number of the hardware.
    pub hardware_id: String,
    /// Values.
    pub values: Vec<KeyValue>,
}

impl DiagnosticStatus {
    /// All is well.
    pub const OK: u8 = 0;
    /// Works, with a restriction.
    pub const WARN: u8 = 1;
    /// Does not work.
    pub const ERROR: u8 = 2;
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Time.
    pub header: Header,
    /// One for each board.
    pub status: Vec<DiagnosticStatus>,
}

impl Named for DiagnosticArray {
    const NAME: (&'static str, &'static str) = ("diagnostic_msgs", "DiagnosticArray");
}

/// `palpate_msgs/Stiffness`; the `.msg` file says what the fields mean.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the .msg file documents them")]
pub struct Stiffness {
    pub header: Header,
    pub verdict: u8,
    pub reason: String,
    pub text: String,
    pub measurement: u32,
    pub simulated: bool,
    pub stiffness: f64,
    pub standard_error: f64,
    pub lower: f64,
    pub upper: f64,
    pub force: f64,
    pub temperature: f64,
    pub modulus: f64,
    pub modulus_lower: f64,
    pub modulus_upper: f64,
    pub modulus_reason: String,
}

impl Stiffness {
    /// A stiffness with its interval.
    pub const MEASURED: u8 = 0;
    /// The load cannot be distinguished from a rigid one: the interval has only a lower end.
    pub const AT_LEAST: u8 = 1;
    /// No result.
    pub const REFUSED: u8 = 2;
}

impl Named for Stiffness {
    const NAME: (&'static str, &'static str) = ("palpate_msgs", "Stiffness");
}

/// `palpate_msgs/Touch`; the `.msg` file says what the fields mean.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the .msg file documents them")]
pub struct Touch {
    pub header: Header,
    pub verdict: u8,
    pub x: f64,
    pub y: f64,
    pub x_standard_error: f64,
    pub y_standard_error: f64,
    pub correlation: f64,
    pub force: f64,
    pub force_standard_error: f64,
    pub radius: f64,
    pub radius_standard_error: f64,
    pub chi_square: f64,
}

impl Named for Touch {
    const NAME: (&'static str, &'static str) = ("palpate_msgs", "Touch");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_before_1970_has_a_positive_fraction() {
        let time = |sec, nanosec| Time { sec, nanosec };
        assert_eq!(Time::from_ns(1_500_000_001), time(1, 500_000_001));
        assert_eq!(Time::from_ns(-1), time(-1, 999_999_999));
        assert_eq!(Time::from_ns(i64::MAX).sec, i32::MAX);
    }
}
