//! The register file, transcribed from datasheet SNOSCY9A section 7.6.

/// Addresses of the registers. Where each of the four channels has its own register, the constant
/// is the address for channel 0: add the channel's number.
pub(crate) mod address {
    /// RCOUNT0.
    pub(crate) const RCOUNT: u8 = 0x08;
    /// OFFSET0.
    pub(crate) const OFFSET: u8 = 0x0C;
    /// SETTLECOUNT0.
    pub(crate) const SETTLE_COUNT: u8 = 0x10;
    /// CLOCK_DIVIDERS0.
    pub(crate) const CLOCK_DIVIDERS: u8 = 0x14;
    /// STATUS.
    pub(crate) const STATUS: u8 = 0x18;
    /// ERROR_CONFIG.
    pub(crate) const ERROR_CONFIG: u8 = 0x19;
    /// CONFIG.
    pub(crate) const CONFIG: u8 = 0x1A;
    /// MUX_CONFIG.
    pub(crate) const MUX_CONFIG: u8 = 0x1B;
    /// RESET_DEV.
    pub(crate) const RESET_DEV: u8 = 0x1C;
    /// DRIVE_CURRENT0.
    pub(crate) const DRIVE_CURRENT: u8 = 0x1E;
    /// MANUFACTURER_ID.
    pub(crate) const MANUFACTURER_ID: u8 = 0x7E;
    /// DEVICE_ID.
    pub(crate) const DEVICE_ID: u8 = 0x7F;
}

/// Datasheet description of registers of one kind, which have successive addresses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Register {
    first: u8,
    last: u8,
    /// Value after power-up, reset or shutdown.
    pub(crate) reset: u16,
    /// Bits that a write changes ("R/W" in the datasheet, reserved ones included).
    pub(crate) writable: u16,
    /// Reserved bits, which "must be written only with indicated value".
    pub(crate) reserved: u16,
    /// Required value of the reserved bits.
    pub(crate) required: u16,
}

const fn read_only(first: u8, last: u8, reset: u16) -> Register {
    Register {
        first,
        last,
        reset,
        writable: 0,
        reserved: 0,
        required: 0,
    }
}

const fn read_write(first: u8, last: u8, reset: u16) -> Register {
    Register {
        writable: 0xFFFF,
        ..read_only(first, last, reset)
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
/// to 3 the datasheet's tables give no access for bits 5:0, so writes to these bits are ignored.
const fn drive_current(first: u8, last: u8, writable: u16) -> Register {
    Register {
        writable,
        ..reserving(read_only(first, last, 0), 0x07FF, 0)
    }
}

/// All registers in order of address (datasheet figure 14 and tables 1 to 35).
const REGISTERS: [Register; 14] = [
    // The results.
    read_only(0x00, 0x07, 0),
    // RCOUNT, OFFSET, SETTLECOUNT and CLOCK_DIVIDERS of the four channels.
    read_write(0x08, 0x0B, 0x0080),
    read_write(0x0C, 0x0F, 0),
    read_write(0x10, 0x13, 0),
    reserving(read_write(0x14, 0x17, 0), 0x0C00, 0),
    // STATUS, ERROR_CONFIG, CONFIG, MUX_CONFIG and RESET_DEV.
    read_only(0x18, 0x18, 0),
    reserving(read_write(0x19, 0x19, 0), 0x0702, 0),
    reserving(read_write(0x1A, 0x1A, 0x2801), 0x013F, 0x0001),
    reserving(read_write(0x1B, 0x1B, 0x020F), 0x1FF8, 0x0208),
    reserving(read_write(0x1C, 0x1C, 0), 0x7FFF, 0),
    drive_current(0x1E, 0x1E, 0xF83F),
    drive_current(0x1F, 0x21, 0xF800),
    // Manufacturer and device.
    read_only(0x7E, 0x7E, 0x5449),
    read_only(0x7F, 0x7F, 0x3055),
];

/// Description of the register at an address; `None` if there is none.
pub(crate) fn describe(address: u8) -> Option<&'static Register> {
    REGISTERS
        .iter()
        .find(|register| (register.first..=register.last).contains(&address))
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
            for address in register.first..=register.last {
                file.set(address, register.reset);
            }
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
    pub(crate) fn write(&mut self, address: u8, value: u16) {
        let writable = describe(address).map_or(0, |register| register.writable);
        let kept = self.get(address) & !writable;
        self.set(address, kept | (value & writable));
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
