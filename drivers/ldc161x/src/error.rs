//! Errors of the driver, with location, cause and remedy.

use core::fmt;

use crate::{DEVICE_ID, MANUFACTURER_ID, Register};

/// Direction of a bus access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// Read from a register.
    Read,
    /// Write to a register.
    Write,
}

/// Error of the driver; `E` is the bus's own error type.
///
/// The error flags of a conversion are not errors of the driver: they are part of its
/// [`Reading`](crate::Reading).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Error<E> {
    /// A bus transfer failed.
    Bus {
        /// The register that was accessed, or the first register of the frame.
        register: Register,
        /// Read or write.
        direction: Direction,
        /// The bus's own error.
        source: E,
    },
    /// A device answers, but not with the identity of an LDC1612 or LDC1614.
    WrongIdentity {
        /// Value read from MANUFACTURER_ID.
        manufacturer: u16,
        /// Value read from DEVICE_ID.
        device: u16,
    },
    /// A register does not read back the value written to it.
    ReadBack {
        /// The register.
        register: Register,
        /// Value written.
        written: u16,
        /// Value read.
        read: u16,
    },
    /// A register of the running chip lost its value: the chip was reset or disturbed. Every frame
    /// after the last confirmed one is in doubt.
    RegistersLost {
        /// The register.
        register: Register,
        /// Expected value.
        expected: u16,
        /// Value read.
        found: u16,
    },
    /// The configuration uses a channel that this chip does not have.
    NoSuchChannel,
    /// No configuration has been started yet.
    NotStarted,
    /// The chip is asleep or has lost its registers, so it converts nothing.
    NotRunning,
    /// The number of bytes does not match the frame request.
    FrameLength {
        /// Number of bytes in a frame.
        expected: usize,
        /// Number of bytes given.
        found: usize,
    },
    /// INTB did not fall within the time of two frames.
    NoInterrupt {
        /// Time waited, in microseconds.
        waited_us: u32,
    },
    /// INTB stays low although both data and STATUS were read.
    InterruptStuck,
    /// A pin could not be read or set.
    Pin,
}

impl<E> Error<E> {
    /// The likely cause and the remedy, in plain words.
    ///
    /// ```
    /// use ldc161x::Error;
    /// let error: Error<()> = Error::WrongIdentity { manufacturer: 0x5449, device: 0x3054 };
    /// assert!(error.advice().contains("LDC131x"));
    /// ```
    pub const fn advice(&self) -> &'static str {
        match self {
            Self::Bus { .. } => {
                "check wiring, pull-ups, supply, the level of SD (low) and the address: ADDR low \
                 is 0x2A, high 0x2B; then recover"
            }
            Self::WrongIdentity {
                manufacturer: 0x5449,
                device: 0x3054,
            } => "this is an LDC131x or FDC221x, not an LDC161x: its data words differ",
            Self::WrongIdentity {
                manufacturer: 0xFFFF,
                ..
            } => "no device drives the data line: the chip is absent, unpowered or shut down",
            Self::WrongIdentity {
                manufacturer: 0x5449,
                ..
            } => "another chip of Texas Instruments",
            Self::WrongIdentity { .. } => {
                "another device answers at this address, or the wiring is bad"
            }
            Self::ReadBack { .. } => {
                "the bus is disturbed, or the chip was not asleep; start again"
            }
            Self::RegistersLost { .. } => {
                "the supply dipped (the start of a coil can do that): recover, discard frames since \
                 the last confirmed one, and check the supply"
            }
            Self::NoSuchChannel => "use an LDC1614, or channels 0 and 1 only",
            Self::NotStarted => "call start with a configuration first",
            Self::FrameLength { .. } => "request the frame again after a change of settings",
            Self::NotRunning => "call wake after sleep, recover after an error",
            Self::NoInterrupt { .. } => {
                "check the wire of INTB, that the chip is awake, and that its clock runs"
            }
            Self::InterruptStuck => {
                "check INTB for a short to ground, and that it has its own wire"
            }
            Self::Pin => "check the pin's configuration",
        }
    }
}

impl<E: fmt::Debug> fmt::Display for Error<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus {
                register,
                direction,
                source,
            } => {
                let verb = match direction {
                    Direction::Read => "reading",
                    Direction::Write => "writing",
                };
                write!(f, "bus error {source:?} while {verb} {register:?}")?;
            }
            Self::WrongIdentity {
                manufacturer,
                device,
            } => write!(
                f,
                "identity {manufacturer:#06x} {device:#06x} instead of {MANUFACTURER_ID:#06x} \
                 {DEVICE_ID:#06x}"
            )?,
            Self::ReadBack {
                register,
                written,
                read,
            } => {
                write!(
                    f,
                    "{register:?} reads {read:#06x} after {written:#06x} was written"
                )?;
            }
            Self::RegistersLost {
                register,
                expected,
                found,
            } => {
                write!(
                    f,
                    "{register:?} holds {found:#06x} instead of {expected:#06x}"
                )?;
            }
            Self::NoSuchChannel => f.write_str("the chip has no such channel")?,
            Self::NotStarted => f.write_str("no configuration")?,
            Self::NotRunning => f.write_str("the chip does not convert")?,
            Self::FrameLength { expected, found } => {
                write!(f, "{found} bytes instead of a frame's {expected}")?;
            }
            Self::NoInterrupt { waited_us } => write!(f, "no interrupt in {waited_us} us")?,
            Self::InterruptStuck => f.write_str("INTB is stuck low")?,
            Self::Pin => f.write_str("a pin failed")?,
        }
        write!(f, ": {}", self.advice())
    }
}

impl<E: fmt::Debug> core::error::Error for Error<E> {}
