//! Reads an LDC1614 on an STM32F411 (Black Pill): SCL PB6, SDA PB7, INTB PA0, SD PA1, CLKIN from a
//! 40 MHz oscillator. Keeps the frequency of channel 0 in a static for a debugger to read.
//!
//! ```text
//! rustup target add thumbv7em-none-eabihf
//! cargo build -p ldc161x --example stm32f411 --target thumbv7em-none-eabihf
//! ```
//!
//! On any other target the program only prints which target it needs, because the tests build all
//! examples for the PC as well.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    println!("a program for an STM32F411: build it for thumbv7em-none-eabihf");
}

#[cfg(target_os = "none")]
mod board {
    use core::sync::atomic::{AtomicU32, Ordering};

    use cortex_m_rt::entry;
    use embedded_hal::delay::DelayNs;
    use ldc161x::{
        Acquisition, Address, Channel, Error, Ldc161x, Model, Plan, Rate, ReferenceClock, Request,
        Sensor,
    };
    use panic_halt as _;
    use stm32f4xx_hal::{i2c::I2c, pac, prelude::*, rcc::Config};

    /// The plan, computed at compile time: if it breaks a limit of the chip, the program does not
    /// compile.
    const PLAN: Plan = match Request::new(
        Model::Ldc1614,
        ReferenceClock::External { hz: 40_000_000 },
        Acquisition::Single(Channel::Zero),
        Sensor::new(2_900_000, 3_800_000),
    )
    .rate(Rate::PerSecond(500))
    .plan()
    {
        Ok(plan) => plan,
        Err(_) => panic!("the plan breaks a limit of the chip"),
    };

    /// Last good frequency in hertz, for a debugger to read.
    static FREQUENCY_HZ: AtomicU32 = AtomicU32::new(0);

    #[entry]
    fn main() -> ! {
        let (Some(device), Some(core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take())
        else {
            panic!("the peripherals are taken once, at reset");
        };
        let mut rcc = device.RCC.freeze(Config::hsi().sysclk(84.MHz()));
        let mut delay = core.SYST.delay(&rcc.clocks);
        let pins_a = device.GPIOA.split(&mut rcc);
        let pins_b = device.GPIOB.split(&mut rcc);
        let mut interrupt = pins_a.pa0.into_floating_input();
        let mut shutdown = pins_a.pa1.into_push_pull_output();
        let i2c = I2c::new(device.I2C1, (pins_b.pb6, pins_b.pb7), 400.kHz(), &mut rcc);
        let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
        let mut running = driver.start(&PLAN.configuration);
        // Without a calibrated drive current, all readings of a sensor other than the planned one
        // are flagged, and none is good.
        if running.is_ok() {
            running = driver.calibrate_drive_current(&mut delay).map(drop);
        }
        loop {
            if running.is_err() {
                running = driver.recover_by_shutdown(&mut shutdown, &mut delay);
                if running.is_ok() {
                    running = driver.calibrate_drive_current(&mut delay).map(drop);
                }
                delay.delay_ms(10);
                continue;
            }
            running = driver
                .wait_for_interrupt(&mut interrupt, &mut delay)
                .and_then(|()| measure(&mut driver));
        }
    }

    /// Reads one frame, and compares one register with its expected value.
    fn measure<I2C: embedded_hal::i2c::I2c>(
        driver: &mut Ldc161x<I2C>,
    ) -> Result<(), Error<I2C::Error>> {
        for reading in driver.read_frame()?.readings() {
            if reading.is_good() {
                FREQUENCY_HZ.store(reading.frequency_hz as u32, Ordering::Relaxed);
            }
        }
        driver.check_canary().map(drop)
    }
}
