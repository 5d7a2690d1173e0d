//! The RP2040: its bus, memories and peripherals, except for USB.

pub(crate) mod adc;
pub(crate) mod base;
pub(crate) mod bus;
pub(crate) mod clocks;
pub(crate) mod dma;
pub(crate) mod gpio;
pub(crate) mod i2c;
pub(crate) mod interrupts;
pub(crate) mod memory;
pub(crate) mod power;
pub(crate) mod private;
pub(crate) mod pwm;
pub(crate) mod rom;
pub(crate) mod rom_calls;
pub(crate) mod sio;
pub(crate) mod ssi;
pub(crate) mod timer;
pub(crate) mod watchdog;
pub(crate) mod xip;
