//! Driver and simulated chip together: modes, bus costs, probes, calibration.

use std::cell::RefCell;

use embedded_hal::i2c::I2c;
use ldc161x::{
    Acquisition, Address, BusAccess, Channel, Error, InterruptRelease, Ldc161x, Model, Plan,
    Quality, Rate, ReferenceClock, Request, Sensor, Sequence,
};
use ldc161x_sim::{Bus, Chip, Delay, IntbPin, Sensors, Settings, ShutdownPin, Switches, Time};

const SENSORS_HZ: [f64; 4] = [3.1e6, 3.2e6, 3.3e6, 3.4e6];

fn plan(acquisition: Acquisition) -> Plan {
    let sensor = Sensor {
        highest_quality_factor: 25,
        lowest_rp_ohm: 3_000,
        highest_rp_ohm: 3_000,
        ..Sensor::new(2_900_000, 3_600_000)
    };
    Request::new(
        Model::Ldc1614,
        ReferenceClock::External { hz: 40_000_000 },
        acquisition,
        sensor,
    )
    .rate(Rate::PerSecond(400))
    .plan()
    .unwrap()
}

const MODES: [Acquisition; 7] = [
    Acquisition::Single(Channel::Zero),
    Acquisition::Single(Channel::One),
    Acquisition::Single(Channel::Two),
    Acquisition::Single(Channel::Three),
    Acquisition::Autoscan(Sequence::ZeroToOne),
    Acquisition::Autoscan(Sequence::ZeroToTwo),
    Acquisition::Autoscan(Sequence::ZeroToThree),
];

fn driver<S: Sensors>(chip: &RefCell<Chip<S>>) -> Ldc161x<Bus<'_, S>> {
    Ldc161x::new(Bus::new(chip, 400_000), Model::Ldc1614, Address::AddrLow)
}

/// In every mode and under every switch, the words are the chip's, the frequencies the sensors'.
#[test]
fn frequencies_are_read_in_every_mode_under_every_switch() {
    for switches in Switches::one_at_a_time() {
        for acquisition in MODES {
            let settings = Settings {
                switches,
                ..Settings::ideal()
            };
            let chip = RefCell::new(Chip::new(settings, SENSORS_HZ));
            let mut driver = driver(&chip);
            let (mut interrupt, mut delay) = (IntbPin::new(&chip), Delay::new(&chip));
            let started = driver.start(&plan(acquisition).configuration);
            if started.is_err() {
                // A chip that loses its registers at wake-up does so once.
                driver.recover(&mut delay).unwrap();
            }
            driver
                .probe_interrupt_release(&mut interrupt, &mut delay)
                .unwrap();
            let mut read_before = [None; 4];
            for _ in 0..5 {
                driver
                    .wait_for_interrupt(&mut interrupt, &mut delay)
                    .unwrap();
                let frame = driver.read_frame().unwrap();
                assert!(frame.covers(acquisition));
                for reading in frame.readings() {
                    let truth = *chip.borrow().last_read(reading.channel.number()).unwrap();
                    assert_eq!(reading.word.code().get(), truth.word, "{switches:?}");
                    let error = reading.frequency_hz - truth.oscillation_hz;
                    let lsb = 40e6 / 268_435_456.0;
                    assert!(
                        error.abs() <= 0.51 * lsb,
                        "{switches:?} {acquisition:?} {error}"
                    );
                    let last = &mut read_before[usize::from(reading.channel.number())];
                    let expected = match reading.quality() {
                        _ if frame.marks.gap => true,
                        Quality::Repeated => *last == Some(truth.number),
                        quality => quality == Quality::Good,
                    };
                    assert!(expected, "{switches:?} {reading:?}");
                    *last = Some(truth.number);
                }
            }
            assert_eq!(
                chip.borrow().misuse(),
                ldc161x_sim::Misuse::default(),
                "{switches:?}"
            );
        }
    }
}

/// Bit times of one frame, counted by the simulated chip.
fn cost(acquisition: Acquisition, release: InterruptRelease, access: BusAccess) -> u64 {
    let chip = RefCell::new(Chip::new(Settings::ideal(), SENSORS_HZ));
    let mut driver = driver(&chip);
    driver.set_interrupt_release(release);
    driver.set_access(access);
    driver.start(&plan(acquisition).configuration).unwrap();
    let before = chip.borrow().traffic().bit_times();
    driver.read_frame().unwrap();
    let after = chip.borrow().traffic().bit_times();
    after - before
}

#[test]
fn frames_cost_what_the_plan_counts_on() {
    use BusAccess::{FramePerTransaction, RegisterPerTransaction, SeparateTransfers};
    use InterruptRelease::{ByData, ByStatusOnly};
    let single = Acquisition::Single(Channel::Zero);
    let four = Acquisition::Autoscan(Sequence::ZeroToThree);
    assert_eq!(cost(single, ByData, FramePerTransaction), 95);
    assert_eq!(cost(four, ByData, FramePerTransaction), 377);
    assert_eq!(cost(single, ByStatusOnly, FramePerTransaction), 142);
    assert_eq!(cost(single, ByData, RegisterPerTransaction), 96);
    assert_eq!(cost(single, ByData, SeparateTransfers), 98);
    for access in [
        FramePerTransaction,
        RegisterPerTransaction,
        SeparateTransfers,
    ] {
        for (release, status) in [(ByData, 0), (ByStatusOnly, 1)] {
            for acquisition in MODES {
                let registers = 2 * u32::from(acquisition.channel_count()) + status;
                let planned = u64::from(access.bit_times(registers));
                assert_eq!(cost(acquisition, release, access), planned);
            }
        }
    }
}

#[test]
fn the_probe_finds_what_releases_the_interrupt() {
    for (silicon, expected) in [
        (
            ldc161x_sim::InterruptRelease::StatusOrData,
            InterruptRelease::ByData,
        ),
        (
            ldc161x_sim::InterruptRelease::StatusOnly,
            InterruptRelease::ByStatusOnly,
        ),
    ] {
        for acquisition in MODES {
            let switches = Switches {
                interrupt_release: silicon,
                ..Switches::default()
            };
            let settings = Settings {
                switches,
                ..Settings::default()
            };
            let chip = RefCell::new(Chip::new(settings, SENSORS_HZ));
            let (mut interrupt, mut delay) = (IntbPin::new(&chip), Delay::new(&chip));
            let mut driver = driver(&chip);
            driver.start(&plan(acquisition).configuration).unwrap();
            let found = driver
                .probe_interrupt_release(&mut interrupt, &mut delay)
                .unwrap();
            assert_eq!(found, expected, "{acquisition:?}");
        }
    }
}

/// Without INTB, each conversion is read exactly once.
#[test]
fn polling_reads_each_conversion_once() {
    for switches in Switches::one_at_a_time() {
        let settings = Settings {
            switches,
            ..Settings::ideal()
        };
        let chip = RefCell::new(Chip::new(settings, SENSORS_HZ));
        let mut driver = driver(&chip);
        let acquisition = Acquisition::Single(Channel::Zero);
        if driver.start(&plan(acquisition).configuration).is_err() {
            driver.recover(&mut Delay::new(&chip)).unwrap();
        }
        let mut numbers = Vec::new();
        while numbers.len() < 20 {
            let now = chip.borrow().now();
            chip.borrow_mut().advance_to(now + Time::from_us(50));
            if let Some(frame) = driver.read_frame_if_ready().unwrap() {
                assert!(
                    frame.marks.gap || frame.readings()[0].is_good(),
                    "{switches:?}"
                );
                numbers.push(chip.borrow().last_read(0).unwrap().number);
            }
        }
        let steps: Vec<_> = numbers.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(!steps.is_empty(), "{switches:?}");
        assert!(
            steps.iter().all(|step| *step == 1),
            "{switches:?} {steps:?}"
        );
    }
}

/// Sensors whose losses differ from channel to channel.
#[derive(Clone)]
struct Lossy;

impl Sensors for Lossy {
    fn frequency_hz(&self, channel: usize, _time_s: f64) -> f64 {
        SENSORS_HZ[channel]
    }
    fn parallel_resistance_ohm(&self, channel: usize, _time_s: f64) -> f64 {
        [2_000.0, 4_000.0, 8_000.0, 16_000.0][channel]
    }
}

/// The planned current suits 3 kiloohm: it is wrong for every one of these sensors, the chip
/// reports it, and calibration corrects it.
#[test]
fn calibration_brings_every_amplitude_into_its_range() {
    let chip = RefCell::new(Chip::new(Settings::default(), Lossy));
    let (mut interrupt, mut delay) = (IntbPin::new(&chip), Delay::new(&chip));
    let mut driver = driver(&chip);
    driver
        .start(&plan(Acquisition::Autoscan(Sequence::ZeroToThree)).configuration)
        .unwrap();
    driver
        .probe_interrupt_release(&mut interrupt, &mut delay)
        .unwrap();
    let mut flagged = |driver: &mut Ldc161x<Bus<'_, Lossy>>| {
        for _ in 0..3 {
            driver
                .wait_for_interrupt(&mut interrupt, &mut delay)
                .unwrap();
            driver.read_frame().unwrap();
        }
        driver
            .wait_for_interrupt(&mut interrupt, &mut delay)
            .unwrap();
        let frame = driver.read_frame().unwrap();
        frame
            .readings()
            .iter()
            .map(|reading| reading.word.flags().amplitude)
            .collect::<Vec<_>>()
    };
    assert_eq!(flagged(&mut driver), [true; 4]);
    let found = driver
        .calibrate_drive_current(&mut Delay::new(&chip))
        .unwrap();
    assert_eq!(flagged(&mut driver), [false; 4], "{found:?}");
    // 1.2 to 1.8 V at 2, 4, 8 and 16 kiloohm, by Equation 12.
    for (code, ohm) in found.iter().zip([2e3, 4e3, 8e3, 16e3]) {
        let volt = 4.0 * ohm * f64::from(code.unwrap().current_ua()) * 1e-6 / std::f64::consts::PI;
        assert!((1.2..=1.8).contains(&volt), "{volt}");
    }
}

#[test]
fn a_step_of_the_drive_is_marked_and_changes_the_current() {
    let chip = RefCell::new(Chip::new(Settings::default(), SENSORS_HZ));
    let mut driver = driver(&chip);
    driver
        .start(&plan(Acquisition::Single(Channel::Zero)).configuration)
        .unwrap();
    assert!(!driver.read_frame().unwrap().marks.drive_step);
    let weaker = ldc161x::DriveCode::new(20).unwrap();
    driver.set_drive_current(Channel::Zero, weaker).unwrap();
    assert!(driver.read_frame().unwrap().marks.drive_step);
    assert!(!driver.read_frame().unwrap().marks.drive_step);
    assert_eq!(
        driver.read_drive_current(Channel::Zero).unwrap().drive,
        weaker
    );
    // No register was written during a conversion.
    assert_eq!(chip.borrow().misuse(), ldc161x_sim::Misuse::default());
}

#[test]
fn a_chip_that_is_reset_behind_the_drivers_back_is_found_and_recovered() {
    let chip = RefCell::new(Chip::new(Settings::default(), SENSORS_HZ));
    let (mut interrupt, mut delay) = (IntbPin::new(&chip), Delay::new(&chip));
    let mut shutdown = ShutdownPin::new(&chip);
    let mut driver = driver(&chip);
    driver
        .start(&plan(Acquisition::Single(Channel::Zero)).configuration)
        .unwrap();
    chip.borrow_mut().brown_out();
    let now = chip.borrow().now();
    chip.borrow_mut().advance_to(now + Time::from_ms(5));
    let waited = driver.wait_for_interrupt(&mut interrupt, &mut delay);
    assert!(matches!(waited, Err(Error::NoInterrupt { .. })));
    assert!(matches!(driver.verify(), Err(Error::RegistersLost { .. })));
    driver
        .recover_by_shutdown(&mut shutdown, &mut delay)
        .unwrap();
    driver
        .probe_interrupt_release(&mut interrupt, &mut delay)
        .unwrap();
    driver
        .wait_for_interrupt(&mut interrupt, &mut delay)
        .unwrap();
    assert!(driver.read_frame().unwrap().marks.gap);
    driver
        .wait_for_interrupt(&mut interrupt, &mut delay)
        .unwrap();
    assert!(driver.read_frame().unwrap().readings()[0].is_good());
}

/// An absent chip causes an error at once, and every wait has a deadline.
#[test]
fn nothing_on_the_bus_is_an_error_with_advice() {
    let chip = RefCell::new(Chip::new(Settings::default(), SENSORS_HZ));
    let mut driver = Ldc161x::new(Bus::new(&chip, 400_000), Model::Ldc1614, Address::AddrHigh);
    let error = driver.identify().unwrap_err();
    assert!(
        error.to_string().contains("ADDR low is 0x2A, high 0x2B"),
        "{error}"
    );
}

/// The probe of `ldc1614.md` section 7: the driver does not rely on burst reads anywhere.
#[test]
fn the_driver_never_reads_more_than_one_register_at_a_pointer() {
    struct Watching<B>(B);
    impl<B: embedded_hal::i2c::ErrorType> embedded_hal::i2c::ErrorType for Watching<B> {
        type Error = B::Error;
    }
    impl<B: I2c> I2c for Watching<B> {
        fn transaction(
            &mut self,
            address: u8,
            operations: &mut [embedded_hal::i2c::Operation<'_>],
        ) -> Result<(), Self::Error> {
            for operation in operations.iter() {
                if let embedded_hal::i2c::Operation::Read(bytes) = operation {
                    assert_eq!(bytes.len(), 2);
                }
            }
            self.0.transaction(address, operations)
        }
    }
    let chip = RefCell::new(Chip::new(Settings::default(), SENSORS_HZ));
    let bus = Watching(Bus::new(&chip, 400_000));
    let mut driver = Ldc161x::new(bus, Model::Ldc1614, Address::AddrLow);
    driver
        .start(&plan(Acquisition::Autoscan(Sequence::ZeroToThree)).configuration)
        .unwrap();
    driver.read_frame().unwrap();
}
