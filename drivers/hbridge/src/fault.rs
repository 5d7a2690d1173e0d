//! Faults of a drive, and refusals of requests.

use core::fmt;

/// Why the bridge was switched off. It stays off until the fault is cleared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A sample of the current was above [`Limits::trip_a`](crate::Limits::trip_a).
    OverCurrent,
    /// The bridge reported a fault through nFAULT.
    Bridge,
    /// Voltage is applied, but the current that it should drive is missing: an open circuit, a
    /// failed current measurement, or a hardware limit that is too low.
    CurrentMissing,
    /// Current flows without the voltage that it needs: a short in the coil.
    CurrentUnexplained,
    /// The current did not reach its setpoint.
    NotFollowing,
    /// The supply is below its limit.
    SupplyLow,
    /// The supply is above its limit.
    SupplyHigh,
    /// The bridge was on for too long.
    OnTime,
    /// The circuit took too much energy.
    Energy,
    /// [`Drive::apply`](crate::Drive::apply) was not called in time.
    Unattended,
    /// Self-test: the reading without current is too far from its nominal value.
    Offset,
    /// Self-test: no current flows.
    Open,
    /// Self-test: resistance or inductance is too low.
    Short,
    /// Self-test: the current's sign is wrong.
    SenseReversed,
    /// The measured current does not follow a small change of the setpoint: the measurement is
    /// frozen.
    SenseFrozen,
    /// Samples were lost: see [`Drive::tick`](crate::Drive::tick).
    SamplesLost,
    /// Self-test: resistance or inductance is too high.
    NotACoil,
    /// Self-test: the current limit of the hardware does not act.
    NoHardwareLimit,
}

impl Fault {
    /// Every fault.
    pub const ALL: [Self; 18] = [
        Self::OverCurrent,
        Self::Bridge,
        Self::CurrentMissing,
        Self::CurrentUnexplained,
        Self::NotFollowing,
        Self::SupplyLow,
        Self::SupplyHigh,
        Self::OnTime,
        Self::Energy,
        Self::Unattended,
        Self::Offset,
        Self::Open,
        Self::Short,
        Self::SenseReversed,
        Self::SenseFrozen,
        Self::SamplesLost,
        Self::NotACoil,
        Self::NoHardwareLimit,
    ];
}

impl Fault {
    /// Whether coil or current measurement are in doubt after this fault, so that a self-test must
    /// precede driving again.
    #[must_use]
    pub const fn requires_self_test(self) -> bool {
        !matches!(
            self,
            Self::SupplyLow | Self::SupplyHigh | Self::OnTime | Self::Energy | Self::Unattended
        )
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OverCurrent => "too much current: look for a short in coil and wires",
            Self::Bridge => "the bridge reports a fault: let it cool, check its supply",
            Self::CurrentMissing => {
                "voltage but no current: check the coil's wires and the current amplifier"
            }
            Self::CurrentUnexplained => "current without voltage: look for a short in the coil",
            Self::NotFollowing => "the current does not reach its setpoint: check the supply",
            Self::SupplyLow => "the supply is too low",
            Self::SupplyHigh => "the supply is too high",
            Self::OnTime => "the coil was on for too long: request a shorter current",
            Self::Energy => "too much energy: let the coil cool",
            Self::Unattended => "no order arrived in time: the program hangs",
            Self::Offset => "the current amplifier has an offset: check its supply and reference",
            Self::Open => "no current flows: connect the coil",
            Self::Short => "resistance or inductance is too low: look for a short",
            Self::SenseReversed => "the current amplifier is reversed: swap its inputs",
            Self::SenseFrozen => "the current amplifier is frozen: check its supply and output",
            Self::SamplesLost => "samples of the current were lost: restart the converter",
            Self::NotACoil => "resistance or inductance is too high: check the coil",
            Self::NoHardwareLimit => "the bridge's own current limit does not act: set it up",
        })
    }
}

impl core::error::Error for Fault {}

/// Reason why a request was refused. The refused request changes nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// A field of [`Hardware`](crate::Hardware) is out of range.
    Hardware(&'static str),
    /// A field of [`Limits`](crate::Limits) is out of range, or does not fit the hardware.
    Limits(&'static str),
    /// A fault is latched: clear it first.
    Latched(Fault),
    /// The self-test has not found a coil yet.
    NotTested,
    /// The self-test is running.
    Testing,
    /// A current beyond the limit or not a number, A.
    Current(f32),
    /// A duration that is negative, not a number, or beyond the limit of the on-time, s.
    Duration(f32),
    /// The request needs more energy, J, than the account has left.
    Energy(f32),
    /// The supply is outside its limits, V.
    Supply(f32),
    /// An invalid calibration of the current.
    Correction,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hardware(field) => write!(f, "the hardware's {field} is out of range"),
            Self::Limits(field) => write!(f, "the limit {field} is out of range"),
            Self::Latched(fault) => write!(f, "a fault is latched: {fault}"),
            Self::NotTested => f.write_str("run the self-test first"),
            Self::Testing => f.write_str("the self-test runs: wait for it"),
            Self::Current(current_a) => write!(f, "{current_a} A is beyond the limit"),
            Self::Duration(duration_s) => write!(f, "{duration_s} s is beyond the limit"),
            Self::Energy(energy_j) => write!(f, "{energy_j} J exceeds the remaining energy: wait"),
            Self::Supply(supply_v) => write!(f, "the supply of {supply_v} V is out of its limits"),
            Self::Correction => {
                f.write_str("these currents are not a valid calibration: measure again")
            }
        }
    }
}

impl core::error::Error for Refusal {}
