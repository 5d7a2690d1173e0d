//! What happens to the procedure.

use coil_hbridge::Account;
use ldc161x::Reading;
use palpate_model::units::{Ampere, Celsius};
use palpate_wire::code::{FaultCode, Location, RebootTarget};
use palpate_wire::record::{CoilTest, CurrentTrace};
use palpate_wire::{Command, Frame, FrameError};

use crate::link::Link;
use crate::storage::StorageReport;
use crate::time::{Duration, Instant};

/// An event. Time comes beside it, as an argument of [`Procedure::step`](crate::Procedure::step).
#[derive(Clone, Debug)]
pub enum Event<'a> {
    /// Nothing but that time has passed. At least every 10 ms, so that deadlines hold without a
    /// conversion too.
    Tick,
    /// Conversions have been read.
    Scan(&'a Scan),
    /// A command frame has arrived whole.
    Command(Link, &'a Frame<Command>),
    /// A frame has arrived that could not be understood.
    NotUnderstood(Link, FrameError),
    /// The device is to start anew, for what is not a command: it does as soon as nothing is being
    /// stored.
    Restart(RebootTarget),
    /// The storage has done something.
    Storage(&'a StorageReport),
    /// The test of the coil has found something.
    CoilTested(CoilTest),
    /// A part of the current that was to be recorded.
    CurrentTraced {
        /// When its first was measured.
        at: Instant,
        /// The currents.
        trace: CurrentTrace,
    },
    /// What the slow measurements say.
    Conditions(Conditions),
    /// Something has failed. The bridge goes off.
    Fault(Failure),
    /// The cause of a failure has gone.
    Recovered(FaultCode),
}

/// One conversion of every active channel of a converter.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Converter: 0 first, 1 second.
    pub sensor: u8,
    /// Middle of the first channel's conversion.
    pub middle: Instant,
    /// How long a conversion takes.
    pub window: Duration,
    /// The conversions, in the order of their times.
    pub conversions: heapless::Vec<Conversion, 4>,
    /// Scans of this converter that were lost before this one.
    pub lost: u32,
    /// What went before is unknown: start, recovery or a loss.
    pub gap: bool,
    /// Mean of the coil's current over the first channel's conversion, as measured; absent without
    /// a current measurement.
    pub current: Option<Ampere>,
    /// Root mean square of its ripple meanwhile, which the bridge's switching makes; absent where
    /// it is not known, and then taken for none.
    pub ripple: Option<Ampere>,
    /// The energy that the coil has taken and not given off yet, as its drive counts it now; absent
    /// without a drive.
    pub account: Option<Account>,
}

/// The largest current that the protocol has room for, A.
const GREATEST_A: f32 = 100.0;

impl Scan {
    /// The current, if it is one that the protocol has room for: infinity or NaN would spoil every
    /// sum it went into.
    pub(crate) fn measured_current(&self) -> Option<Ampere> {
        self.current.filter(|of| of.0.abs() <= GREATEST_A)
    }

    /// The ripple, if it is one that the protocol has room for.
    pub(crate) fn known_ripple(&self) -> Option<Ampere> {
        self.ripple.filter(|of| (0.0..=GREATEST_A).contains(&of.0))
    }

    /// Mean square of the current in A^2, that of the ripple included: what heat, attraction and
    /// crosstalk go by.
    pub(crate) fn square_current_a2(&self) -> Option<f32> {
        let Ampere(mean_a) = self.measured_current()?;
        let square_a2 = mean_a * mean_a;
        Some(match self.known_ripple() {
            Some(Ampere(ripple_a)) => square_a2 + ripple_a * ripple_a,
            None => square_a2,
        })
    }

    /// The current that stiffens as mean and ripple do together: the root of the mean square.
    ///
    /// The stiffening is even, and its mean over the ripple differs from its value here by the part
    /// 4 s^2/Ic^2 at most, s the ripple and Ic the current of half the saturated stiffening: 1.2e-3
    /// with 1.2 A peak to peak and 20 A. The value at the mean current differs by s^2/I^2 far below
    /// saturation.
    pub(crate) fn acting_current(&self) -> Option<Ampere> {
        let square_a2 = self.square_current_a2()?;
        Some(Ampere(palpate_model::math::sqrt(square_a2)))
    }
}

/// A conversion within a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conversion {
    /// What the driver makes of it.
    pub reading: Reading,
    /// From the first conversion's middle to this one's.
    pub offset: Duration,
}

/// What is measured besides the sensor, every so often.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conditions {
    /// Temperature of the coil, by its thermometer.
    pub temperature: Option<Celsius>,
    /// Supply of the coil, in volts.
    pub supply_v: Option<f32>,
    /// Part of the processor's time in use.
    pub processor_load: Option<f32>,
    /// Greatest depth of the stack in bytes; 0 if it is not measured.
    pub stack_bytes: u32,
    /// Log messages dropped since the start.
    pub logs_dropped: u32,
    /// Transfers on the bus that have failed since the start.
    pub bus_errors: u32,
    /// Recoveries of bus or converter since the start.
    pub recoveries: u32,
}

impl Conditions {
    /// What is a number, within the protocol's limits.
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

/// What has failed, where, and by how much.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Failure {
    /// Which fault.
    pub code: FaultCode,
    /// Where.
    pub location: Location,
    /// What was found; the code says what it is.
    pub value: Option<f32>,
    /// What is allowed; the code says what it is.
    pub limit: Option<f32>,
}

impl Failure {
    /// A failure without numbers.
    pub const fn new(code: FaultCode, location: Location) -> Self {
        Self {
            code,
            location,
            value: None,
            limit: None,
        }
    }
}
