//! What tasks have to tell the instrument: faults, and counts.

use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::Mutex;
use ldc161x::Error;
use palpate_procedure::event::Failure;
use palpate_wire::code::{Chip, FaultCode, Place};

use crate::bus::BusError;

/// A fault with the value that the protocol tells of it.
type Standing = Option<(FaultCode, Option<u16>)>;

/// The converter's fault that stands.
static STANDING: Mutex<Cell<Standing>> = Mutex::new(Cell::new(None));

/// A count that goes up, by one task each.
pub struct Count(AtomicU32);

impl Count {
    const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Adds to it. Only the task that owns the count may.
    pub fn add(&self, number: u32) {
        let sum = self.0.load(Ordering::Relaxed).wrapping_add(number);
        self.0.store(sum, Ordering::Relaxed);
    }

    /// The count.
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Transfers that failed.
pub static BUS_ERRORS: Count = Count::new();
/// Recoveries of bus or converter.
pub static RECOVERIES: Count = Count::new();
/// Microseconds in which the processor slept.
pub static ASLEEP_US: Count = Count::new();

/// A fault of the converter stands, or none does any more.
pub fn set_fault(fault: Option<&Error<BusError>>) {
    let code = fault.map(code);
    critical_section::with(|section| STANDING.borrow(section).set(code));
}

/// The converter's fault that stands.
pub fn fault() -> Option<Failure> {
    let (code, value) = critical_section::with(|section| STANDING.borrow(section).get())?;
    let place = match code {
        FaultCode::BusDataStuck
        | FaultCode::BusClockStuck
        | FaultCode::BusNotAcknowledged
        | FaultCode::BusTimeout => Place::Bus,
        _ => Place::Sensor,
    };
    Some(Failure {
        value: value.map(f32::from),
        ..Failure::new(code, place)
    })
}

/// Which chip answers at the converter's address, once it was asked.
static CHIP: Mutex<Cell<Option<Chip>>> = Mutex::new(Cell::new(None));

/// What came of asking the converter who it is.
pub fn set_identity(asked: Result<(), Error<BusError>>) {
    let chip = match asked {
        Ok(()) => Chip::Ldc161x,
        Err(Error::WrongIdentity {
            device: LDC131X, ..
        }) => Chip::Ldc131x,
        Err(Error::WrongIdentity { .. }) => Chip::Foreign,
        Err(_) => Chip::Absent,
    };
    critical_section::with(|section| CHIP.borrow(section).set(Some(chip)));
}

/// Device identity of an LDC1312 or LDC1314 (datasheet SNOSCZ0, DEVICE_ID).
const LDC131X: u16 = 0x3054;

/// Which chip answers, once it was asked.
pub fn chip() -> Option<Chip> {
    critical_section::with(|section| CHIP.borrow(section).get())
}

/// The number of an error in the protocol, and its value.
fn code(error: &Error<BusError>) -> (FaultCode, Option<u16>) {
    match error {
        Error::Bus { source, .. } => match source {
            BusError::NotAcknowledged { address: true } => (FaultCode::SensorAbsent, None),
            BusError::NotAcknowledged { address: false } => (FaultCode::BusNotAcknowledged, None),
            BusError::DataStuck | BusError::Arbitration => (FaultCode::BusDataStuck, None),
            BusError::ClockStuck => (FaultCode::BusClockStuck, None),
            BusError::Silent => (FaultCode::SensorSilent, None),
            BusError::Pace => (FaultCode::Clock, None),
            BusError::Timeout | BusError::Length | BusError::Aborted => {
                (FaultCode::BusTimeout, None)
            }
        },
        Error::WrongIdentity { device, .. } => (FaultCode::SensorIdentity, Some(*device)),
        Error::ReadBack { register, .. } => (
            FaultCode::SensorRegister,
            Some(u16::from(register.address())),
        ),
        Error::RegistersLost { register, .. } => {
            (FaultCode::SensorReset, Some(u16::from(register.address())))
        }
        Error::InterruptStuck => (FaultCode::InterruptStuck, Some(0)),
        Error::NoInterrupt { .. } => (FaultCode::SensorSilent, None),
        _ => (FaultCode::SensorSilent, None),
    }
}
