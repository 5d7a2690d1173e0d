//! Errors of transfers to a converter, and the protocol's fault for each failure.

use core::fmt;

use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use ldc161x::{Direction, Error, Register};
use palpate_procedure::event::Failure;
use palpate_wire::code::{Chip, FaultCode, Location};

/// Error of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TransferError {
    /// The address, or a byte after it, was not acknowledged.
    NotAcknowledged {
        /// The address was not acknowledged.
        address: bool,
    },
    /// SDA was low where it had to be high.
    Arbitration,
    /// The transaction took too long; the bus was freed afterwards.
    Timeout,
    /// SDA is held low, and nine clocks did not free it.
    DataStuck,
    /// SCL is held low.
    ClockStuck,
    /// No edge of INTB came in time.
    Silent,
    /// INTB stays at one level while conversions end.
    InterruptStuck {
        /// Level of INTB.
        high: bool,
    },
    /// The edges of INTB come at another rate than planned.
    Pace,
    /// The transaction has more commands than any frame, or none.
    Length,
    /// The bus master aborted for another reason.
    Aborted,
}

impl embedded_hal::i2c::Error for TransferError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NotAcknowledged { address: true } => {
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)
            }
            Self::NotAcknowledged { address: false } => {
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data)
            }
            Self::Arbitration => ErrorKind::ArbitrationLoss,
            Self::DataStuck | Self::ClockStuck => ErrorKind::Bus,
            _ => ErrorKind::Other,
        }
    }
}

impl fmt::Display for TransferError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("I2C transfer failed")
    }
}

impl core::error::Error for TransferError {}

/// Error of a converter's driver.
pub type ConverterError = Error<TransferError>;

/// Error of a converter whose registers are intact but whose scan rate is wrong: its clock is wrong.
pub(crate) const OFF_PACE: ConverterError = edge_error(TransferError::Pace);

/// Returns the error of a frame that was read on an edge.
pub(crate) const fn edge_error(source: TransferError) -> ConverterError {
    Error::Bus {
        register: Register::Config,
        direction: Direction::Read,
        source,
    }
}

/// Returns the failure for an error of converter 0 or 1.
pub(crate) fn failure(error: &ConverterError, converter: usize) -> Failure {
    let (code, value) = code(error);
    let location = match (code, converter) {
        (FaultCode::BusDataStuck | FaultCode::BusClockStuck, _)
        | (FaultCode::BusNotAcknowledged | FaultCode::BusTimeout, 0) => Location::Bus,
        (_, 0) => Location::Sensor,
        // An error of the second converter is located there: the bus may work for the first one.
        _ => Location::SecondSensor,
    };
    Failure {
        value: value.map(f32::from),
        ..Failure::new(code, location)
    }
}

/// Returns the fault, and the value that the protocol reports with it.
const fn code(error: &ConverterError) -> (FaultCode, Option<u16>) {
    match error {
        Error::Bus { source, .. } => match source {
            TransferError::NotAcknowledged { address: true } => (FaultCode::SensorAbsent, None),
            TransferError::NotAcknowledged { address: false } => {
                (FaultCode::BusNotAcknowledged, None)
            }
            TransferError::DataStuck | TransferError::Arbitration => {
                (FaultCode::BusDataStuck, None)
            }
            TransferError::ClockStuck => (FaultCode::BusClockStuck, None),
            TransferError::Silent => (FaultCode::SensorSilent, None),
            TransferError::InterruptStuck { high } => {
                (FaultCode::InterruptStuck, Some(*high as u16))
            }
            TransferError::Pace => (FaultCode::Clock, None),
            TransferError::Timeout | TransferError::Length | TransferError::Aborted => {
                (FaultCode::BusTimeout, None)
            }
        },
        Error::WrongIdentity { device, .. } => (FaultCode::SensorIdentity, Some(*device)),
        Error::ReadBack { register, .. } => {
            (FaultCode::SensorRegister, Some(register.address() as u16))
        }
        Error::RegistersLost { register, .. } => {
            (FaultCode::SensorReset, Some(register.address() as u16))
        }
        Error::InterruptStuck => (FaultCode::InterruptStuck, Some(0)),
        _ => (FaultCode::SensorSilent, None),
    }
}

/// Returns which chip answers, by the result of its identification.
pub(crate) const fn chip(identified: &Result<(), ConverterError>) -> Chip {
    /// Device id of an LDC1312 or LDC1314 (datasheet SNOSCZ0, DEVICE_ID).
    const LDC131X: u16 = 0x3054;
    match identified {
        Ok(()) => Chip::Ldc161x,
        Err(Error::WrongIdentity {
            device: LDC131X, ..
        }) => Chip::Ldc131x,
        Err(Error::WrongIdentity { .. }) => Chip::Foreign,
        Err(_) => Chip::Absent,
    }
}

#[cfg(test)]
mod tests {
    use embedded_hal::i2c::Error as _;

    use super::*;

    const REGISTER: Register = Register::Config;

    /// The table repeats the entries of docs/faults.md.
    #[test]
    fn every_error_has_its_fault_and_place() {
        use FaultCode::{
            BusClockStuck, BusDataStuck, BusNotAcknowledged, BusTimeout, Clock, InterruptStuck,
            SensorAbsent, SensorIdentity, SensorRegister, SensorReset, SensorSilent,
        };
        let absent = TransferError::NotAcknowledged { address: true };
        let refused = TransferError::NotAcknowledged { address: false };
        let table = [
            (
                edge_error(absent),
                SensorAbsent,
                [Location::Sensor, Location::SecondSensor],
            ),
            (
                edge_error(refused),
                BusNotAcknowledged,
                [Location::Bus, Location::SecondSensor],
            ),
            (
                edge_error(TransferError::Arbitration),
                BusDataStuck,
                [Location::Bus; 2],
            ),
            (
                edge_error(TransferError::DataStuck),
                BusDataStuck,
                [Location::Bus; 2],
            ),
            (
                edge_error(TransferError::ClockStuck),
                BusClockStuck,
                [Location::Bus; 2],
            ),
            (
                edge_error(TransferError::Timeout),
                BusTimeout,
                [Location::Bus, Location::SecondSensor],
            ),
            (
                edge_error(TransferError::Length),
                BusTimeout,
                [Location::Bus, Location::SecondSensor],
            ),
            (
                edge_error(TransferError::Aborted),
                BusTimeout,
                [Location::Bus, Location::SecondSensor],
            ),
            (
                edge_error(TransferError::Silent),
                SensorSilent,
                [Location::Sensor, Location::SecondSensor],
            ),
            (OFF_PACE, Clock, [Location::Sensor, Location::SecondSensor]),
            (
                Error::WrongIdentity {
                    manufacturer: 0x5449,
                    device: 0x3054,
                },
                SensorIdentity,
                [Location::Sensor, Location::SecondSensor],
            ),
            (
                Error::ReadBack {
                    register: REGISTER,
                    written: 1,
                    read: 2,
                },
                SensorRegister,
                [Location::Sensor, Location::SecondSensor],
            ),
            (
                Error::RegistersLost {
                    register: REGISTER,
                    expected: 1,
                    found: 2,
                },
                SensorReset,
                [Location::Sensor, Location::SecondSensor],
            ),
            (
                Error::InterruptStuck,
                InterruptStuck,
                [Location::Sensor, Location::SecondSensor],
            ),
            (
                Error::NoInterrupt { waited_us: 9 },
                SensorSilent,
                [Location::Sensor, Location::SecondSensor],
            ),
        ];
        for (error, code, locations) in table {
            for (converter, location) in locations.into_iter().enumerate() {
                let found = failure(&error, converter);
                assert_eq!((found.code, found.location), (code, location), "{error:?}");
            }
        }
    }

    #[test]
    fn the_chip_that_answers_is_known_by_its_identity() {
        let identity = |manufacturer, device| {
            Err(Error::WrongIdentity {
                manufacturer,
                device,
            })
        };
        assert_eq!(chip(&Ok(())), Chip::Ldc161x);
        assert_eq!(chip(&identity(0x5449, 0x3054)), Chip::Ldc131x);
        assert_eq!(chip(&identity(0x1234, 0x5678)), Chip::Foreign);
        assert_eq!(chip(&Err(edge_error(TransferError::Silent))), Chip::Absent);
    }

    #[test]
    fn a_bus_error_has_its_kind() {
        let kinds = [
            (TransferError::Arbitration, ErrorKind::ArbitrationLoss),
            (TransferError::DataStuck, ErrorKind::Bus),
            (TransferError::ClockStuck, ErrorKind::Bus),
            (TransferError::Timeout, ErrorKind::Other),
            (
                TransferError::NotAcknowledged { address: true },
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            ),
            (
                TransferError::NotAcknowledged { address: false },
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data),
            ),
        ];
        for (error, kind) in kinds {
            assert_eq!(error.kind(), kind);
            assert_eq!(error.to_string(), "I2C transfer failed");
        }
    }
}
