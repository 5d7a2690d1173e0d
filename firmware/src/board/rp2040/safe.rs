//! The safe state, and what leads to it: a panic, a fault.

#![allow(unsafe_code)]

use cortex_m_rt::{ExceptionFrame, exception};
use rp2040_pac::{IO_BANK0, RESETS, SIO};

use super::pins;
use super::reset::restart;
use crate::crash::{self, End};

/// The safe state: the bridge is off, whatever the rest of the firmware does or has done.
///
/// It needs nothing but two registers of the hardware, may be called from anywhere, and takes less
/// than a microsecond and a half of cached code.
pub fn bridge_off() {
    // SAFETY: clears three outputs and takes two pins from the PWM; both are single writes that
    // nothing else depends on.
    unsafe {
        let pins = 1 << pins::BRIDGE_ENABLE | 1 << pins::IN1 | 1 << pins::IN2;
        (*SIO::ptr()).gpio_out_clr().write(|w| w.bits(pins));
        // In reset, as at the start, no block has the pins.
        if (*RESETS::ptr())
            .reset_done()
            .read()
            .io_bank0()
            .bit_is_clear()
        {
            return;
        }
        let io = &*IO_BANK0::ptr();
        let plain = pins::Function::Sio as u32;
        io.gpio(pins::IN1).gpio_ctrl().write(|w| w.bits(plain));
        io.gpio(pins::IN2).gpio_ctrl().write(|w| w.bits(plain));
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    bridge_off();
    let (file, line) = info
        .location()
        .map_or(("", 0), |location| (location.file(), location.line()));
    crash::keep(&End::Panic { file, line });
    restart()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    bridge_off();
    crash::keep(&End::HardFault {
        program_counter: frame.pc(),
        link_register: frame.lr(),
    });
    restart()
}
