//! Set-up of the board, once, at the start.

#![allow(unsafe_code)]

use coil_hbridge::Supervisor;
use palpate_node::board::cycles;
use rp2040_pac::Peripherals;

use usb_device::bus::UsbBusAllocator;

use super::flash::Area;
use super::pins::{
    ANALOGUE, ANALOGUE_PAD, BRIDGE_ENABLE, BRIDGE_FAULT, BRIDGE_LIMIT, Function, IN1, IN2, INPUT,
    LED, PULL_UP, input, open_drain, output, set_function, set_pad, set_up_converter_pins,
};
use super::{clocks, coil, flash, i2c, usb, wait};

/// The initialised board.
pub struct Board {
    /// All clocks run as configured.
    pub clocks_run: bool,
    /// The timer, from which the monotonic clock is made.
    pub timer: rp2040_pac::TIMER,
    /// The reset controller, which the monotonic clock needs at its start.
    pub resets: rp2040_pac::RESETS,
    /// The watchdog, not started yet.
    pub watchdog: rp2040_pac::WATCHDOG,
    /// Manager of the coil's drive; `None` if a clock does not run.
    pub supervisor: Option<Supervisor>,
    /// Random number of this run, never 0.
    pub boot_id: u32,
    /// Unique number of the flash memory; 0 if it has none.
    pub unit: u64,
    /// Flash area for settings and calibration.
    pub area: Area,
    /// USB; `None` if a clock does not run.
    pub usb: Option<UsbBusAllocator<usb::Bus>>,
}

impl Board {
    /// Sets everything up: first switches the bridge off, then clocks, pins and counters.
    pub fn init(device: Peripherals) -> Self {
        let mut resets = device.RESETS;
        let mut regulator = device.VREG_AND_CHIP_RESET;
        // These blocks are reset since another program may have left them in any state.
        resets.reset().modify(|_, w| {
            w.io_bank0().set_bit();
            w.pads_bank0().set_bit();
            w.pwm().set_bit();
            w.adc().set_bit();
            w.dma().set_bit();
            w.timer().set_bit()
        });
        resets.reset().modify(|_, w| {
            w.io_bank0().clear_bit();
            w.pads_bank0().clear_bit();
            w.pwm().clear_bit();
            w.adc().clear_bit();
            w.dma().clear_bit()
        });
        let ready = wait(|| {
            let done = resets.reset_done().read();
            done.io_bank0().bit_is_set()
                && done.pads_bank0().bit_is_set()
                && done.pwm().bit_is_set()
                && done.adc().bit_is_set()
                && done.dma().bit_is_set()
        });
        open_drain(BRIDGE_LIMIT, false);
        set_pad(BRIDGE_LIMIT, INPUT);
        set_function(BRIDGE_LIMIT, Function::Sio);
        output(BRIDGE_ENABLE, false);
        output(IN1, false);
        output(IN2, false);
        // After a reset of the pads the digital inputs of the analogue pins are enabled (erratum
        // RP2040-E6).
        for pin in ANALOGUE {
            set_pad(pin, ANALOGUE_PAD);
        }
        let clocks_run = clocks::set_up(
            &mut resets,
            &device.CLOCKS,
            device.XOSC,
            device.PLL_SYS,
            device.PLL_USB,
            &mut regulator,
            &device.WATCHDOG,
        ) && ready;
        set_up_converter_pins();
        output(LED, false);
        input(BRIDGE_FAULT, PULL_UP);
        i2c::set_up();
        let usb = if clocks_run {
            usb::set_up(
                device.USBCTRL_REGS,
                device.USBCTRL_DPRAM,
                device.CLOCKS,
                &mut resets,
            )
        } else {
            None
        };
        Self {
            // Without all clocks the coil stays off: its PWM period would be undefined.
            supervisor: if clocks_run { coil::start() } else { None },
            clocks_run,
            timer: device.TIMER,
            resets,
            watchdog: device.WATCHDOG,
            boot_id: draw(&device.ROSC),
            unit: flash::number(),
            // SAFETY: `init` runs once, and nothing else reads or changes flash from now on.
            area: unsafe { Area::take() },
            usb,
        }
    }
}

/// Returns a random number from the jitter of the ring oscillator, waiting 26 of its periods per bit.
/// Never 0; not suitable for secrets.
fn draw(ring: &rp2040_pac::ROSC) -> u32 {
    let number = (0..32).fold(0_u32, |number, _| {
        cortex_m::asm::delay(cycles(8_000));
        number << 1 | ring.randombit().read().bits() & 1
    });
    number.max(1)
}
