//! State of the chip's I2C interface.

/// Counts of the bus traffic since the chip was created, including traffic for other devices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// STARTs after a STOP.
    pub transactions: u64,
    /// All STARTs, repeated ones included.
    pub starts: u64,
    /// Bytes, addresses included.
    pub bytes: u64,
    /// STOPs.
    pub stops: u64,
}

impl Traffic {
    /// Time of this traffic in bits: 9 for a byte, 1 for a START and for a STOP.
    #[must_use]
    pub const fn bit_times(&self) -> u64 {
        self.starts + 9 * self.bytes + self.stops
    }
}

/// The next byte that the chip expects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Expecting {
    /// None: the chip was not addressed, or the access is over.
    #[default]
    Start,
    /// The register pointer.
    Pointer,
    /// The high byte to write.
    HighByte,
    /// The low byte to write; holds the high byte.
    LowByte(u8),
    /// None: both bytes are written.
    NoByte,
    /// The chip sends the high byte next.
    SendHigh,
    /// The chip sends this low byte next.
    SendLow(u8),
    /// The chip has sent both bytes.
    SendMore,
    /// None: the master has refused the low byte.
    CutShort,
}

/// State of the chip's side of the bus.
#[derive(Clone, Debug, Default)]
pub(crate) struct Link {
    pub(crate) expecting: Expecting,
    /// Register pointer, kept between transactions.
    pub(crate) pointer: u8,
    pub(crate) in_transaction: bool,
    /// Bytes of this transaction that the chip has received or sent, addresses included.
    pub(crate) bytes: u32,
    pub(crate) sent: u32,
    pub(crate) written: u32,
    pub(crate) pointers: u32,
    /// Whether an earlier access was broken off, so that every byte is one bit late.
    pub(crate) slipped: bool,
    pub(crate) slips_next: bool,
}

impl Link {
    /// Resets the chip's side after a loss of power; the traffic on the wires continues.
    pub(crate) fn lose_power(&mut self) {
        *self = Self {
            in_transaction: self.in_transaction,
            ..Self::default()
        };
    }
}
