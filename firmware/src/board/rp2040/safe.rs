//! Safe state, and the panic and fault handlers that enter it.

#![allow(unsafe_code)]

use cortex_m_rt::{ExceptionFrame, exception};
use rp2040_pac::{IO_BANK0, RESETS, SIO};

use super::pins;
use super::reset::restart;
use crate::crash::{self, End};

/// Enters the safe state: switches the bridge off, independent of the rest of the firmware.
///
/// Uses only two hardware registers, may be called from anywhere, and takes less than 1.5 microseconds
/// when its code is cached.
pub fn bridge_off() {
    // SAFETY: clears three outputs and takes two pins from the PWM, in single writes on which no other
    // code depends.
    unsafe {
        let pins = 1 << pins::BRIDGE_ENABLE | 1 << pins::IN1 | 1 << pins::IN2;
        (*SIO::ptr()).gpio_out_clr().write(|w| w.bits(pins));
        // The pin functions below are left alone while their block is in reset, as at start-up: no block
        // then controls the pins.
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
