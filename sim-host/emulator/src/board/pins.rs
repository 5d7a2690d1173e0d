//! Pins and PWM slices of the board by role, as wired in docs/firmware.md.

/// Pin numbers.
pub(crate) mod pin {
    pub(crate) const SDA: usize = 4;
    pub(crate) const SCL: usize = 5;
    pub(crate) const INTB: usize = 7;
    pub(crate) const SD: usize = 8;
    pub(crate) const SECOND_INTB: usize = 9;
    pub(crate) const SECOND_SD: usize = 10;
    pub(crate) const IN1: usize = 16;
    pub(crate) const IN2: usize = 17;
    pub(crate) const SLEEP: usize = 18;
    pub(crate) const FAULT: usize = 19;
    pub(crate) const LIMIT: usize = 20;
    pub(crate) const CLKIN: usize = 21;
    pub(crate) const LED: usize = 25;
    /// ADC pins: coil current, thermistor, supply, and a third of VSYS, which a Raspberry Pi Pico
    /// connects.
    pub(crate) const ANALOGUE: [usize; 4] = [26, 27, 28, 29];
}

/// PWM slice of the coil.
pub(crate) const COIL_SLICE: usize = 0;
/// PWM slice that counts the falling edges of INTB.
pub(crate) const EDGE_SLICE: usize = 3;
/// PWM slice that counts the falling edges of the second converter's INTB.
pub(crate) const SECOND_EDGE_SLICE: usize = 4;
