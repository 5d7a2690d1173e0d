//! Calls every method of the driver on a bus whose answers the compiler cannot foresee. It is
//! linked for a Cortex-M0+, so that the image contains all code that can be reached; `cargo xtask
//! ci --only panic-free` searches the image for panics. With `--cfg planted_panic` the program
//! contains one, to show that the search finds it.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    println!("a program for a Cortex-M0+: see cargo xtask ci --only panic-free");
}

#[cfg(target_os = "none")]
mod image {
    use core::{
        hint::black_box,
        sync::atomic::{AtomicU32, Ordering},
    };

    use cortex_m_rt::entry;
    use embedded_hal::{
        delay::DelayNs,
        digital::{self, InputPin, OutputPin},
        i2c::{self, ErrorType, I2c, Operation},
    };
    use ldc161x::{
        Acquisition, Address, BusAccess, Channel, DriveCode, Error, Frame, InterruptRelease,
        Ldc161x, Model, PlausibilityCount, Rate, RatioOfSums, ReferenceClock, Register, Request,
        Sensor, Sequence,
    };
    use panic_halt as _;

    /// Returns a number that the compiler cannot foresee.
    fn anything() -> u32 {
        static WORD: AtomicU32 = AtomicU32::new(0);
        black_box(WORD.load(Ordering::Relaxed))
    }

    struct NoBus;

    impl ErrorType for NoBus {
        type Error = i2c::ErrorKind;
    }

    impl I2c for NoBus {
        fn transaction(
            &mut self,
            _address: u8,
            operations: &mut [Operation<'_>],
        ) -> Result<(), Self::Error> {
            for operation in operations {
                if let Operation::Read(bytes) = operation {
                    bytes.fill(anything() as u8);
                }
            }
            if anything() == 0 {
                Ok(())
            } else {
                Err(i2c::ErrorKind::Bus)
            }
        }
    }

    struct Pin;

    impl digital::ErrorType for Pin {
        type Error = digital::ErrorKind;
    }

    impl InputPin for Pin {
        fn is_high(&mut self) -> Result<bool, Self::Error> {
            if anything() == 1 {
                Err(digital::ErrorKind::Other)
            } else {
                Ok(anything() == 0)
            }
        }
        fn is_low(&mut self) -> Result<bool, Self::Error> {
            self.is_high().map(|high| !high)
        }
    }

    impl OutputPin for Pin {
        fn set_low(&mut self) -> Result<(), Self::Error> {
            if anything() == 1 {
                Err(digital::ErrorKind::Other)
            } else {
                Ok(())
            }
        }
        fn set_high(&mut self) -> Result<(), Self::Error> {
            self.set_low()
        }
    }

    struct NoDelay;

    impl DelayNs for NoDelay {
        fn delay_ns(&mut self, ns: u32) {
            black_box(ns);
        }
    }

    fn request() -> Request {
        let acquisition = match anything() {
            0 => Acquisition::Single(Channel::Three),
            1 => Acquisition::Autoscan(Sequence::ZeroToTwo),
            _ => Acquisition::Autoscan(Sequence::ZeroToThree),
        };
        let sensor = Sensor {
            lowest_hz: anything(),
            highest_hz: anything(),
            highest_quality_factor: anything() as u16,
            lowest_rp_ohm: anything(),
            highest_rp_ohm: anything(),
        };
        let reference = match anything() {
            0 => ReferenceClock::Internal,
            hz => ReferenceClock::External { hz },
        };
        let rate = match anything() {
            0 => Rate::AsTheBusAllows,
            rate => Rate::PerSecond(rate),
        };
        Request {
            bus_hz: anything(),
            status_reads: anything() == 0,
            read_twice: anything() == 0,
            ..Request::new(Model::Ldc1614, reference, acquisition, sensor)
        }
        .sensor(Channel::Two, sensor)
        .rate(rate)
    }

    fn look_at(frame: &Frame) {
        let mut count = PlausibilityCount::default();
        let mut sums = RatioOfSums::default();
        for reading in frame.readings() {
            black_box((reading.quality(), reading.frequency_hz, reading.sigma_hz));
            let ratio = request().plan().map(|plan| {
                plan.configuration
                    .scale(reading.channel)
                    .rational(reading.word.code())
            });
            if let Ok(ratio) = ratio {
                count.add(&ratio);
                sums.add(&ratio);
            }
        }
        black_box((count.hypothesis(), sums.ratio(), frame.of(Channel::One)));
    }

    fn exercise(driver: &mut Ldc161x<NoBus>) -> Result<(), Error<i2c::ErrorKind>> {
        let access = [BusAccess::FramePerTransaction, BusAccess::SeparateTransfers];
        driver.set_access(if anything() == 0 {
            access[0]
        } else {
            access[1]
        });
        driver.set_read_twice(anything() == 0);
        driver.set_interrupt_release(InterruptRelease::ByData);
        match request().plan() {
            Ok(plan) => {
                black_box((plan.frames_per_second(), plan.bus_load()));
                driver.start(&plan.configuration)?;
            }
            Err(refusal) => {
                black_box((refusal.limit(), refusal.remedy()));
            }
        }
        black_box(driver.probe_interrupt_release(&mut Pin, &mut NoDelay)?);
        black_box(driver.calibrate_drive_current(&mut NoDelay)?);
        driver.set_drive_current(Channel::One, DriveCode::STRONGEST)?;
        driver.wait_for_interrupt(&mut Pin, &mut NoDelay)?;
        look_at(&driver.read_frame()?);
        if let Some(frame) = driver.read_frame_if_ready()? {
            look_at(&frame);
        }
        black_box((
            driver.check_canary()?,
            driver.verify()?,
            driver.read_status()?,
        ));
        black_box(driver.read_drive_current(Channel::Zero)?);
        black_box(driver.read_register(Register::Config)?);
        driver.sleep()?;
        driver.wake()?;
        driver.recover(&mut NoDelay)?;
        driver.recover_by_shutdown(&mut Pin, &mut NoDelay)
    }

    #[entry]
    fn main() -> ! {
        let mut driver = Ldc161x::new(NoBus, Model::Ldc1614, Address::AddrLow);
        loop {
            if let Err(error) = exercise(&mut driver) {
                black_box(error.advice());
            }
            #[cfg(planted_panic)]
            assert!(anything() != 7, "planted");
        }
    }
}
