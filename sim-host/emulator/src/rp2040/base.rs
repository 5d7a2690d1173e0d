//! Base addresses of the blocks (datasheet 2.2).

pub(crate) const CLOCKS: u32 = 0x4000_8000;
pub(crate) const RESETS: u32 = 0x4000_C000;
pub(crate) const PSM: u32 = 0x4001_0000;
pub(crate) const IO_BANK0: u32 = 0x4001_4000;
pub(crate) const IO_QSPI: u32 = 0x4001_8000;
pub(crate) const PADS_BANK0: u32 = 0x4001_C000;
pub(crate) const PADS_QSPI: u32 = 0x4002_0000;
pub(crate) const XOSC: u32 = 0x4002_4000;
pub(crate) const PLL_SYS: u32 = 0x4002_8000;
pub(crate) const PLL_USB: u32 = 0x4002_C000;
pub(crate) const I2C0: u32 = 0x4004_4000;
pub(crate) const ADC: u32 = 0x4004_C000;
pub(crate) const PWM: u32 = 0x4005_0000;
pub(crate) const TIMER: u32 = 0x4005_4000;
pub(crate) const WATCHDOG: u32 = 0x4005_8000;
pub(crate) const ROSC: u32 = 0x4006_0000;
pub(crate) const VREG_AND_CHIP_RESET: u32 = 0x4006_4000;
pub(crate) const DMA: u32 = 0x5000_0000;
pub(crate) const USB_MEMORY: u32 = 0x5010_0000;
pub(crate) const USB: u32 = 0x5011_0000;

/// Base of an address's block, for any of the four views of its registers.
pub(crate) const fn of(address: u32) -> u32 {
    address & !0x3FFF
}
