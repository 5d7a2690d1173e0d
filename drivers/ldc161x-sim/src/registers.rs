//! The register file, transcribed from datasheet SNOSCY9A section 7.6.

/// Addresses of the registers. For a register that each of the four channels has, it is the address
/// for channel 0; add the channel, or twice the channel for the two halves of a result.
pub mod address {
    /// DATA0_MSB; the halves of the four channels' results follow in turn, up to 0x07.
    pub const DATA: u8 = 0x00;
    /// RCOUNT0.
    pub const RCOUNT: u8 = 0x08;
    /// OFFSET0.
    pub const OFFSET: u8 = 0x0C;
    /// SETTLECOUNT0.
    pub const SETTLE_COUNT: u8 = 0x10;
    /// CLOCK_DIVIDERS0.
    pub const CLOCK_DIVIDERS: u8 = 0x14;
    /// STATUS.
    pub const STATUS: u8 = 0x18;
    /// ERROR_CONFIG.
    pub const ERROR_CONFIG: u8 = 0x19;
    /// CONFIG.
    pub const CONFIG: u8 = 0x1A;
    /// MUX_CONFIG.
    pub const MUX_CONFIG: u8 = 0x1B;
    /// RESET_DEV.
    pub const RESET_DEV: u8 = 0x1C;
    /// DRIVE_CURRENT0.
    pub const DRIVE_CURRENT: u8 = 0x1E;
    /// MANUFACTURER_ID.
    pub const MANUFACTURER_ID: u8 = 0x7E;
    /// DEVICE_ID.
    pub const DEVICE_ID: u8 = 0x7F;
}

/// Datasheet description of one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Address on the bus.
    pub address: u8,
    /// Name in the datasheet's table of registers.
    pub name: &'static str,
    /// Value after power-up, reset or shutdown.
    pub reset: u16,
    /// Bits that a write changes ("R/W" in the datasheet, reserved ones included).
    pub writable: u16,
    /// Reserved bits, which "must be written only with indicated value".
    pub reserved: u16,
    /// Required value of the reserved bits.
    pub required: u16,
}

const fn read_only(address: u8, name: &'static str, reset: u16) -> Register {
    Register {
        address,
        name,
        reset,
        writable: 0,
        reserved: 0,
        required: 0,
    }
}

const fn read_write(address: u8, name: &'static str, reset: u16) -> Register {
    Register {
        address,
        name,
        reset,
        writable: 0xFFFF,
        reserved: 0,
        required: 0,
    }
}

const fn reserving(register: Register, reserved: u16, required: u16) -> Register {
    Register {
        reserved,
        required,
        ..register
    }
}

/// DRIVE_CURRENTx. Bits 10:6, INIT_IDRIVEx, are read-only and must be written zero. For channels 1
/// to 3 the datasheet's tables give no access for bits 5:0, so a write does not change them there.
const fn drive_current(address: u8, name: &'static str, writable: u16) -> Register {
    Register {
        address,
        name,
        reset: 0x0000,
        writable,
        reserved: 0x07FF,
        required: 0x0000,
    }
}

/// All registers in order of address (datasheet figure 14 and tables 1 to 35).
pub const REGISTERS: [Register; 35] = [
    read_only(0x00, "DATA0_MSB", 0x0000),
    read_only(0x01, "DATA0_LSB", 0x0000),
    read_only(0x02, "DATA1_MSB", 0x0000),
    read_only(0x03, "DATA1_LSB", 0x0000),
    read_only(0x04, "DATA2_MSB", 0x0000),
    read_only(0x05, "DATA2_LSB", 0x0000),
    read_only(0x06, "DATA3_MSB", 0x0000),
    read_only(0x07, "DATA3_LSB", 0x0000),
    read_write(0x08, "RCOUNT0", 0x0080),
    read_write(0x09, "RCOUNT1", 0x0080),
    read_write(0x0A, "RCOUNT2", 0x0080),
    read_write(0x0B, "RCOUNT3", 0x0080),
    read_write(0x0C, "OFFSET0", 0x0000),
    read_write(0x0D, "OFFSET1", 0x0000),
    read_write(0x0E, "OFFSET2", 0x0000),
    read_write(0x0F, "OFFSET3", 0x0000),
    read_write(0x10, "SETTLECOUNT0", 0x0000),
    read_write(0x11, "SETTLECOUNT1", 0x0000),
    read_write(0x12, "SETTLECOUNT2", 0x0000),
    read_write(0x13, "SETTLECOUNT3", 0x0000),
    reserving(read_write(0x14, "CLOCK_DIVIDERS0", 0x0000), 0x0C00, 0),
    reserving(read_write(0x15, "CLOCK_DIVIDERS1", 0x0000), 0x0C00, 0),
    reserving(read_write(0x16, "CLOCK_DIVIDERS2", 0x0000), 0x0C00, 0),
    reserving(read_write(0x17, "CLOCK_DIVIDERS3", 0x0000), 0x0C00, 0),
    read_only(0x18, "STATUS", 0x0000),
    reserving(read_write(0x19, "ERROR_CONFIG", 0x0000), 0x0702, 0),
    reserving(read_write(0x1A, "CONFIG", 0x2801), 0x013F, 0x0001),
    reserving(read_write(0x1B, "MUX_CONFIG", 0x020F), 0x1FF8, 0x0208),
    reserving(read_write(0x1C, "RESET_DEV", 0x0000), 0x7FFF, 0),
    drive_current(0x1E, "DRIVE_CURRENT0", 0xF83F),
    drive_current(0x1F, "DRIVE_CURRENT1", 0xF800),
    drive_current(0x20, "DRIVE_CURRENT2", 0xF800),
    drive_current(0x21, "DRIVE_CURRENT3", 0xF800),
    read_only(0x7E, "MANUFACTURER_ID", 0x5449),
    read_only(0x7F, "DEVICE_ID", 0x3055),
];

/// Description of the register at an address; `None` if there is none.
#[must_use]
pub fn describe(address: u8) -> Option<&'static Register> {
    REGISTERS
        .iter()
        .find(|register| register.address == address)
}

/// Number of stored registers: addresses up to the last DRIVE_CURRENT. Results, STATUS and
/// identities are not stored here.
const STORED: usize = 0x22;

/// The stored registers: all writable ones.
#[derive(Clone, Debug)]
pub(crate) struct RegisterFile([u16; STORED]);

impl RegisterFile {
    pub(crate) fn new() -> Self {
        let mut file = Self([0; STORED]);
        for register in &REGISTERS {
            file.set(register.address, register.reset);
        }
        file
    }

    pub(crate) fn get(&self, address: u8) -> u16 {
        self.0.get(usize::from(address)).copied().unwrap_or(0)
    }

    /// Sets a register, including bits that a write over the bus does not change.
    pub(crate) fn set(&mut self, address: u8, value: u16) {
        if let Some(word) = self.0.get_mut(usize::from(address)) {
            *word = value;
        }
    }

    /// Applies a write over the bus: changes the register's writable bits only.
    pub(crate) fn write(&mut self, register: &Register, value: u16) {
        let kept = self.get(register.address) & !register.writable;
        self.set(register.address, kept | (value & register.writable));
    }

    fn of_channel(&self, base: u8, channel: u8) -> u16 {
        self.get(base.saturating_add(channel))
    }

    pub(crate) fn rcount(&self, channel: u8) -> u16 {
        self.of_channel(address::RCOUNT, channel)
    }

    pub(crate) fn offset(&self, channel: u8) -> u16 {
        self.of_channel(address::OFFSET, channel)
    }

    /// Length of the sensor activation in reference clocks: 16 SETTLECOUNT, but at least 32
    /// (datasheet table 17).
    pub(crate) fn settle_clocks(&self, channel: u8) -> f64 {
        16.0 * f64::from(self.settle_count(channel).max(2))
    }

    pub(crate) fn settle_count(&self, channel: u8) -> u16 {
        self.of_channel(address::SETTLE_COUNT, channel)
    }

    /// FIN_DIVIDERx; zero is reserved.
    pub(crate) fn sensor_divider(&self, channel: u8) -> u16 {
        self.of_channel(address::CLOCK_DIVIDERS, channel) >> 12
    }

    /// FREF_DIVIDERx; zero is reserved.
    pub(crate) fn reference_divider(&self, channel: u8) -> u16 {
        self.of_channel(address::CLOCK_DIVIDERS, channel) & 0x03FF
    }

    /// IDRIVEx, 0 to 31.
    pub(crate) fn drive_code(&self, channel: u8) -> u8 {
        (self.of_channel(address::DRIVE_CURRENT, channel) >> 11) as u8
    }

    /// Stores the drive code that the amplitude calibration found in INIT_IDRIVEx.
    pub(crate) fn show_initial_drive(&mut self, channel: u8, code: u8) {
        let address = address::DRIVE_CURRENT.saturating_add(channel);
        let others = self.get(address) & !0x07C0;
        self.set(address, others | (u16::from(code & 0x1F) << 6));
    }

    pub(crate) fn error_config(&self) -> u16 {
        self.get(address::ERROR_CONFIG)
    }

    pub(crate) fn config(&self) -> Config {
        Config(self.get(address::CONFIG))
    }

    pub(crate) fn mux(&self) -> Mux {
        Mux(self.get(address::MUX_CONFIG))
    }
}

/// CONFIG, 0x1A (datasheet table 27).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Config(pub(crate) u16);

impl Config {
    const fn bit(self, bit: u16) -> bool {
        self.0 & (1 << bit) != 0
    }
    pub(crate) const fn active_channel(self) -> u8 {
        (self.0 >> 14) as u8
    }
    pub(crate) const fn sleeps(self) -> bool {
        self.bit(13)
    }
    pub(crate) const fn overrides_rp(self) -> bool {
        self.bit(12)
    }
    pub(crate) const fn low_power_activation(self) -> bool {
        self.bit(11)
    }
    pub(crate) const fn amplitude_correction(self) -> bool {
        !self.bit(10)
    }
    pub(crate) const fn external_clock(self) -> bool {
        self.bit(9)
    }
    pub(crate) const fn interrupt_disabled(self) -> bool {
        self.bit(7)
    }
    pub(crate) const fn high_current(self) -> bool {
        self.bit(6)
    }
}

/// MUX_CONFIG, 0x1B (datasheet table 28).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mux(pub(crate) u16);

impl Mux {
    pub(crate) const fn autoscan(self) -> bool {
        self.0 & 0x8000 != 0
    }

    /// The last channel of the autoscan sequence, which always starts at channel 0.
    pub(crate) const fn last_channel(self) -> u8 {
        match (self.0 >> 13) & 3 {
            0b01 => 2,
            0b10 => 3,
            _ => 1,
        }
    }

    pub(crate) const fn deglitch(self) -> u8 {
        (self.0 & 7) as u8
    }
}
