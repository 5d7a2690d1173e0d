//! State of the chip's I2C interface.

/// Counts of the bus traffic since the chip was created, including traffic for other devices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of transactions: STARTs that follow a STOP.
    pub transactions: u64,
    /// Number of STARTs, repeated ones included.
    pub starts: u64,
    /// Number of bytes, addresses included.
    pub bytes: u64,
    /// Number of STOPs.
    pub stops: u64,
}

impl Traffic {
    /// Time of this traffic in bits: 9 for each byte, 1 for each START and STOP.
    #[must_use]
    pub const fn bit_times(&self) -> u64 {
        self.starts + 9 * self.bytes + self.stops
    }
}

/// The next byte or condition that the chip expects on the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Expecting {
    /// No byte: the chip was not addressed, or the access is over.
    #[default]
    Start,
    /// The register pointer.
    Pointer,
    /// The high byte to write.
    HighByte,
    /// The low byte to write; holds the high byte.
    LowByte(u8),
    /// No byte: both bytes have been written.
    NoByte,
    /// The chip sends the high byte next.
    SendHigh,
    /// The chip sends this low byte next.
    SendLow(u8),
    /// The chip has sent both bytes of the register; what follows depends on [`crate::BurstRead`].
    SendMore,
    /// No byte: the master has refused the low byte.
    CutShort,
}

/// State of the chip's I2C interface.
#[derive(Clone, Debug, Default)]
pub(crate) struct Link {
    pub(crate) expecting: Expecting,
    /// Register pointer, kept between transactions.
    pub(crate) pointer: u8,
    pub(crate) in_transaction: bool,
    /// Number of bytes of this transaction that the chip has received or sent, addresses included.
    pub(crate) bytes: u32,
    pub(crate) sent: u32,
    pub(crate) written: u32,
    pub(crate) pointers: u32,
    /// Whether an earlier access was broken off, so that every byte is shifted by one bit.
    pub(crate) slipped: bool,
    pub(crate) slips_next: bool,
}

impl Link {
    /// Resets the chip's interface after a loss of power; the counts of the traffic stay.
    pub(crate) fn lose_power(&mut self) {
        *self = Self {
            in_transaction: self.in_transaction,
            ..Self::default()
        };
    }
}
