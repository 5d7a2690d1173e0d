//! Events of the procedure.

use coil_hbridge::Account;
use ldc161x::Reading;
use palpate_model::units::{Ampere, Celsius};
use palpate_wire::code::{FaultCode, Location, RebootTarget};
use palpate_wire::record::{CoilTest, CurrentTrace};
use palpate_wire::{Command, Frame, FrameError};

use crate::link::Link;
use crate::storage::StorageReport;
use crate::time::{Duration, Instant};

/// One event. Its time is a separate argument of [`Procedure::step`](crate::Procedure::step).
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// Time has passed. The procedure needs this or another event at least every 10 ms, so that its
    /// deadlines hold without conversions.
    Tick,
    /// Conversions were read.
    Scan(&'a Scan),
    /// A whole command frame was received.
    Command(Link, &'a Frame<Command>),
    /// An undecodable frame was received.
    NotUnderstood(Link, FrameError),
    /// Restart request other than a command; the device restarts as soon as no save is in progress.
    Restart(RebootTarget),
    /// Report of the storage.
    Storage(&'a StorageReport),
    /// Result of the coil's test.
    CoilTested(CoilTest),
    /// Part of a requested current trace.
    CurrentTraced {
        /// Time of the first value.
        at: Instant,
        /// Values of the current.
        trace: CurrentTrace,
    },
    /// Slow measurements.
    Conditions(Conditions),
    /// A part has failed. The procedure switches the bridge off.
    Fault(Failure),
    /// The cause of a failure has ended.
    Recovered(FaultCode),
}

/// One conversion of every active channel of a converter.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Converter: 0 first, 1 second.
    pub sensor: u8,
    /// Middle of the first channel's conversion.
    pub middle: Instant,
    /// Duration of a conversion.
    pub window: Duration,
    /// Conversions in the order of their times.
    pub conversions: heapless::Vec<Conversion, 4>,
    /// Number of scans of this converter that were lost before this one.
    pub lost: u32,
    /// The time between the previous scan and this one is unknown, after a start, a recovery or a loss.
    pub gap: bool,
    /// Mean measured current of the coil over the first channel's conversion; `None` without a current
    /// measurement.
    pub current: Option<Ampere>,
    /// RMS ripple of the current during the conversion, caused by the bridge's switching; `None` if
    /// unknown, and then taken as zero.
    pub ripple: Option<Ampere>,
    /// Energy that the coil has taken and not yet given off, as its drive counts it at the time of this
    /// scan; `None` without a drive.
    pub account: Option<Account>,
}

/// Largest current that the protocol can represent, A.
const GREATEST_A: f32 = 100.0;

impl Scan {
    /// Returns the current if the protocol can represent it: infinity or NaN would spoil every sum.
    pub(crate) fn measured_current(&self) -> Option<Ampere> {
        self.current.filter(|of| of.0.abs() <= GREATEST_A)
    }

    /// Returns the ripple if the protocol can represent it.
    pub(crate) fn known_ripple(&self) -> Option<Ampere> {
        self.ripple.filter(|of| (0.0..=GREATEST_A).contains(&of.0))
    }

    /// Returns the mean square of the current with its ripple, in A^2, on which heat, attraction and
    /// crosstalk depend.
    pub(crate) fn square_current_a2(&self) -> Option<f32> {
        let Ampere(mean_a) = self.measured_current()?;
        let square_a2 = mean_a * mean_a;
        Some(match self.known_ripple() {
            Some(Ampere(ripple_a)) => square_a2 + ripple_a * ripple_a,
            None => square_a2,
        })
    }

    /// Returns the current whose stiffening equals that of mean and ripple together: the root of the
    /// mean square.
    ///
    /// Let s be the ripple and Ic the current of half the saturated stiffening. The stiffening's mean
    /// over the ripple differs from its value at the returned current by at most the fraction 4
    /// s^2/Ic^2: 1.2e-3 with 1.2 A peak to peak and 20 A. Far below saturation, its value at the mean
    /// current I differs by the fraction s^2/I^2.
    pub(crate) fn acting_current(&self) -> Option<Ampere> {
        let square_a2 = self.square_current_a2()?;
        Some(Ampere(palpate_model::math::sqrt(square_a2)))
    }
}

/// Conversion within a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conversion {
    /// Reading from the driver.
    pub reading: Reading,
    /// Time from the middle of the first conversion to the middle of this one.
    pub offset: Duration,
}

/// Slow measurements besides the sensor, taken periodically.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conditions {
    /// Temperature of the coil from its thermometer.
    pub temperature: Option<Celsius>,
    /// Supply of the coil, in volts.
    pub supply_v: Option<f32>,
    /// Fraction of the time in which the processor was awake.
    pub processor_load: Option<f32>,
    /// Greatest stack depth in bytes; 0 if it is not measured.
    pub stack_bytes: u32,
    /// Number of log messages dropped since start-up.
    pub logs_dropped: u32,
    /// Number of failed bus transfers since start-up.
    pub bus_errors: u32,
    /// Number of recoveries of bus or converter since start-up.
    pub recoveries: u32,
}

impl Conditions {
    /// Returns the conditions without infinite or NaN values, clamped to the protocol's limits.
    pub(crate) fn within_protocol(&self) -> Self {
        let within = |value: Option<f32>, low: f32, high: f32| {
            let number = value.filter(|value| value.is_finite());
            number.map(|value| value.max(low).min(high))
        };
        let temperature_c = self.temperature.map(|of| of.0);
        Self {
            temperature: within(temperature_c, -60.0, 250.0).map(Celsius),
            supply_v: within(self.supply_v, 0.0, 100.0),
            processor_load: within(self.processor_load, 0.0, 1.0),
            ..*self
        }
    }
}

/// Failure with location and values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Failure {
    /// Fault code.
    pub code: FaultCode,
    /// Location of the failure.
    pub location: Location,
    /// Measured value; its meaning depends on the code.
    pub value: Option<f32>,
    /// Limit of the value; its meaning depends on the code.
    pub limit: Option<f32>,
}

impl Failure {
    /// Creates a failure without values.
    pub const fn new(code: FaultCode, location: Location) -> Self {
        Self {
            code,
            location,
            value: None,
            limit: None,
        }
    }
}
