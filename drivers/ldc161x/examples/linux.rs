//! Reads an LDC1612 with a 40 MHz oscillator at its CLKIN on an I2C bus of Linux, for example of a
//! Raspberry Pi or of a USB adapter. INTB is not connected: STATUS shows whether a result is ready.
//! Prints time, frequency and standard uncertainty of channel 0, one text line per reading.
//!
//! ```text
//! cargo run -p ldc161x --example linux -- /dev/i2c-1
//! ```

#[cfg(not(target_os = "linux"))]
fn main() {
    println!("a program for Linux");
}

#[cfg(target_os = "linux")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use std::time::{Duration, Instant};

    use ldc161x::{
        Acquisition, Address, Channel, Ldc161x, Model, Rate, ReferenceClock, Request, Sensor,
    };
    use linux_embedded_hal::{Delay, I2cdev};

    let Some(bus) = std::env::args().nth(1) else {
        return Err("name the bus, as in `linux /dev/i2c-1`".into());
    };
    let plan = Request::new(
        Model::Ldc1612,
        ReferenceClock::External { hz: 40_000_000 },
        Acquisition::Single(Channel::Zero),
        Sensor::new(2_900_000, 3_800_000),
    )
    .rate(Rate::PerSecond(50))
    .plan()?;
    let mut driver = Ldc161x::new(I2cdev::new(&bus)?, Model::Ldc1612, Address::AddrLow);
    driver.start(&plan.configuration)?;
    driver.calibrate_drive_current(&mut Delay)?;

    let start = Instant::now();
    loop {
        if let Some(frame) = driver.read_frame_if_ready()? {
            for reading in frame.readings().iter().filter(|it| it.is_good()) {
                let (time_s, sigma_hz) = (start.elapsed().as_secs_f64(), reading.sigma_hz);
                println!(
                    "{time_s:.3} s  {:.1} Hz  +- {sigma_hz:.1} Hz",
                    reading.frequency_hz
                );
            }
            driver.check_canary()?;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
