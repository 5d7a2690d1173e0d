//! Drives a coil with a Raspberry Pi Pico: IN1 GP16, IN2 GP17, nSLEEP GP18, nFAULT GP19, current at
//! GP26 (0.125 V/A about 1.65 V). Tests the coil, then drives one train of falling ramps.
//!
//! ```text
//! cargo build -p coil-hbridge --example rp2040 --target thumbv6m-none-eabi
//! ```
//!
//! The interrupt handler waits for the middle of the PWM period, which keeps the program short but
//! takes half of the processor's time; a converter paced by DMA leaves that time free.
//!
//! On any other target the program only prints which target it needs, because the tests build all
//! examples for the PC as well.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    println!("a program for a Raspberry Pi Pico: build it for thumbv6m-none-eabi");
}

#[cfg(target_os = "none")]
use panic_halt as _;

#[cfg(target_os = "none")]
#[rtic::app(device = rp_pico::hal::pac)]
mod app {
    use coil_hbridge::{
        Averages, CurrentLine, Decay, Drive, DriveState, Hardware, Limits, Supervisor,
    };
    use embedded_hal::delay::DelayNs;
    use embedded_hal::digital::{InputPin, OutputPin};
    use embedded_hal::pwm::SetDutyCycle;
    use rp_pico::XOSC_CRYSTAL_FREQ;
    use rp_pico::hal::adc::{Adc, AdcPin};
    use rp_pico::hal::clocks::init_clocks_and_plls;
    use rp_pico::hal::gpio::bank0::{Gpio18, Gpio19};
    use rp_pico::hal::gpio::{FunctionSioInput, FunctionSioOutput, Pin, Pins, PullDown, PullUp};
    use rp_pico::hal::pwm::{FreeRunning, Pwm0, Slice, Slices};
    use rp_pico::hal::{Sio, Timer, Watchdog};

    /// Steps of the PWM from the start of a period to its middle.
    const FULL_LEVEL: u16 = 2000;
    /// PWM period in microseconds: 2 `FULL_LEVEL` counts at 62.5 MHz, half of the system clock of
    /// 125 MHz.
    const PERIOD_US: u32 = 64;
    /// Supply voltage. A board with a divider at a converter input measures it instead.
    const SUPPLY_V: f32 = 12.0;

    const HARDWARE: Hardware = Hardware {
        period_s: PERIOD_US as f32 * 1e-6,
        full_level: FULL_LEVEL,
        ampere_per_count: 3.3 / 4096.0 / 0.125,
        zero_count: 2048,
        zero_tolerance: 64,
        greatest_count: 4095,
        diode_v: 0.8,
        decay: Decay::Fast,
        wake_s: 2e-3,
        reduced_limit_a: None,
    };
    const LIMITS: Limits = Limits {
        setpoint_a: 3.0,
        trip_a: 4.0,
        duty: 0.98,
        on_time_s: 10.0,
        energy_j: 10.0,
        continuous_w: 1.0,
        supply_v: [4.5, 14.0],
        resistance_ohm: [0.15, 3.0],
        inductance_h: [100e-6, 2e-3],
    };

    /// Current lines of one ramp (rise, hold, fall): current at the end of the line, A, and
    /// duration, s.
    const RAMP: [(f32, f32); 3] = [(2.5, 5e-3), (2.5, 10e-3), (0.5, 50e-3)];
    const RAMPS: usize = 8;

    static AVERAGES: Averages<512> = Averages::new();

    #[shared]
    struct Shared {
        bridge: Bridge,
    }

    #[local]
    struct Local {
        supervisor: Supervisor,
        delay: Timer,
    }

    /// Peripherals and drive that the interrupt handler uses.
    pub struct Bridge {
        drive: Drive,
        pwm: Slice<Pwm0, FreeRunning>,
        adc: Adc,
        sleep: Pin<Gpio18, FunctionSioOutput, PullDown>,
        fault: Pin<Gpio19, FunctionSioInput, PullUp>,
    }

    impl Bridge {
        /// Runs one PWM period: samples at its start and in its middle, and sets the levels of the
        /// next period.
        fn period(&mut self) {
            self.pwm.clear_interrupt();
            let first = self.adc.read_single();
            let is_faulty = self.fault.is_low() == Ok(true);
            let output = self.drive.tick(is_faulty, || {
                while self.pwm.get_counter() < FULL_LEVEL - 100 {}
                Some([first, self.adc.read_single()])
            });
            self.write(output.levels.in1, output.levels.in2, output.awake);
            if self.drive.account(&AVERAGES) {
                self.write(0, 0, false);
            }
        }

        /// Writes the bridge's inputs. The pins of an RP2040 do not fail.
        fn write(&mut self, in1: u16, in2: u16, awake: bool) {
            let _ = self.sleep.set_state(awake.into());
            let _ = self.pwm.channel_a.set_duty_cycle(in1);
            let _ = self.pwm.channel_b.set_duty_cycle(in2);
        }
    }

    #[init]
    fn init(cx: init::Context) -> (Shared, Local) {
        let mut device = cx.device;
        let Ok((supervisor, drive)) = Supervisor::new(HARDWARE, LIMITS) else {
            panic!("the limits contradict each other");
        };
        let clocks = init_clocks_and_plls(
            XOSC_CRYSTAL_FREQ,
            device.XOSC,
            device.CLOCKS,
            device.PLL_SYS,
            device.PLL_USB,
            &mut device.RESETS,
            &mut Watchdog::new(device.WATCHDOG),
        );
        let Ok(clocks) = clocks else {
            panic!("the crystal does not start");
        };
        let delay = Timer::new(device.TIMER, &mut device.RESETS, &clocks);
        let pins = Pins::new(
            device.IO_BANK0,
            device.PADS_BANK0,
            Sio::new(device.SIO).gpio_bank0,
            &mut device.RESETS,
        );
        let mut pwm = Slices::new(device.PWM, &mut device.RESETS).pwm0;
        pwm.set_ph_correct();
        pwm.set_div_int(2);
        pwm.set_top(FULL_LEVEL - 1);
        pwm.channel_a.output_to(pins.gpio16);
        pwm.channel_b.output_to(pins.gpio17);
        let mut adc = Adc::new(device.ADC, &mut device.RESETS);
        if let Ok(current) = AdcPin::new(pins.gpio26.into_floating_input()) {
            adc.free_running(&current);
        }
        pwm.enable_interrupt();
        pwm.enable();
        let bridge = Bridge {
            drive,
            pwm,
            adc,
            sleep: pins.gpio18.into_push_pull_output(),
            fault: pins.gpio19.into_pull_up_input(),
        };
        (Shared { bridge }, Local { supervisor, delay })
    }

    #[task(binds = PWM_IRQ_WRAP, shared = [bridge])]
    fn period(mut cx: period::Context) {
        cx.shared.bridge.lock(Bridge::period);
    }

    #[idle(shared = [bridge], local = [supervisor, delay])]
    fn idle(mut cx: idle::Context) -> ! {
        let supervisor = cx.local.supervisor;
        let mut is_tested = false;
        let mut lines = core::iter::repeat_n(RAMP, RAMPS).flatten();
        loop {
            cx.local.delay.delay_ms(1);
            let report = cx.shared.bridge.lock(|bridge| bridge.drive.report());
            let order = supervisor.attend(&report, SUPPLY_V, 1_000);
            cx.shared.bridge.lock(|bridge| bridge.drive.apply(&order));
            let order = match report.state {
                DriveState::Off { tested: false } if !is_tested => {
                    is_tested = true;
                    supervisor.test(&report, SUPPLY_V)
                }
                DriveState::Off { tested: true } | DriveState::Driving if report.holds => {
                    match lines.next() {
                        Some((to_a, over_s)) => {
                            let line = CurrentLine::at_once(to_a, over_s);
                            supervisor.follow(&report, &line, || 0)
                        }
                        // Otherwise the current of the last line would continue to flow.
                        None => Ok(Supervisor::stop()),
                    }
                }
                _ => continue,
            };
            // A program with a user interface would report a refused order.
            if let Ok(order) = order {
                cx.shared.bridge.lock(|bridge| bridge.drive.apply(&order));
            }
        }
    }
}
