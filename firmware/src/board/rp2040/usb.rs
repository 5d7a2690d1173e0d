//! The USB controller, by the HAL's driver.
//!
//! Its voltage detection is overridden: a Pico has no pin for it (Raspberry Pi Pico datasheet, 4.1). A
//! cable that is pulled is then seen as a bus that rests.

#![allow(unsafe_code)]

use cortex_m::peripheral::NVIC;
use rp2040_hal::clocks::ClocksManager;
use rp2040_hal::usb::UsbBus;
use rp2040_pac::{CLOCKS, Interrupt, RESETS, USBCTRL_DPRAM, USBCTRL_REGS};
use usb_device::bus::UsbBusAllocator;

use super::wait;

/// The bus that USB's classes are written for.
pub type Bus = UsbBus;

const INTERRUPT: Interrupt = Interrupt::USBCTRL_IRQ;

/// Starts the controller, whose clock runs already. Nothing if it does not come out of its reset.
pub fn set_up(
    registers: USBCTRL_REGS,
    memory: USBCTRL_DPRAM,
    clocks: CLOCKS,
    resets: &mut RESETS,
) -> Option<UsbBusAllocator<Bus>> {
    resets.reset().modify(|_, w| w.usbctrl().set_bit());
    resets.reset().modify(|_, w| w.usbctrl().clear_bit());
    // The HAL waits for this as well, without a bound: it is done then.
    if !wait(|| resets.reset_done().read().usbctrl().bit_is_set()) {
        return None;
    }
    // Only for the proof that there is a clock; nothing of it is changed.
    let clock = ClocksManager::new(clocks).usb_clock;
    let bus = UsbBus::new(registers, memory, clock, true, resets);
    Some(UsbBusAllocator::new(bus))
}

/// Frames wait: the interrupt is to look after them.
pub fn call() {
    NVIC::pend(INTERRUPT);
}

/// Holds the interrupt back: what it would come for has to wait for room.
pub fn hold_back() {
    NVIC::mask(INTERRUPT);
}

/// Lets it through again.
pub fn let_through() {
    // SAFETY: it was enabled at the start. Called by a task of its own priority, outside of any
    // critical section.
    unsafe { NVIC::unmask(INTERRUPT) };
}
