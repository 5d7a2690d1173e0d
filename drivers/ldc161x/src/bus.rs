//! Register access over the bus, and its cost in bit times.

/// How the registers of a frame are fetched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BusAccess {
    /// One transaction for each frame, its registers joined by repeated starts. Fastest; no other
    /// transfer can come between the reads of one frame.
    #[default]
    FramePerTransaction,
    /// One `write_read` per register: for HALs whose `transaction` takes two operations only.
    RegisterPerTransaction,
    /// `write`, stop, `read`: for HALs without transactions. The chip keeps its pointer between the
    /// two transfers; no other master may use the bus meanwhile.
    SeparateTransfers,
}

impl BusAccess {
    /// Bit times of reading `registers` registers; each start and stop condition counts as one bit
    /// time.
    ///
    /// ```
    /// use ldc161x::BusAccess;
    /// // MSB and LSB of one channel; of four channels; of one channel behind STATUS
    /// assert_eq!(BusAccess::FramePerTransaction.bit_times(2), 95);
    /// assert_eq!(BusAccess::FramePerTransaction.bit_times(8), 377);
    /// assert_eq!(BusAccess::FramePerTransaction.bit_times(3), 142);
    /// assert_eq!(BusAccess::RegisterPerTransaction.bit_times(2), 96);
    /// ```
    pub const fn bit_times(self, registers: u32) -> u32 {
        // The pointer takes a start, an address and a pointer byte; the data take a start, an
        // address and two bytes. A byte takes nine bit times.
        let pointer = 1 + 9 + 9;
        let data = 1 + 9 + 18;
        match self {
            Self::FramePerTransaction => registers * (pointer + data) + 1,
            Self::RegisterPerTransaction => registers * (pointer + data + 1),
            Self::SeparateTransfers => registers * (pointer + 1 + data + 1),
        }
    }
}
