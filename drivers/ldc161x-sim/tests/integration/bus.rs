//! The bus: exact times, merged operations, the byte-level target, pins and delay.

use core::cell::RefCell;

use crate::common::*;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal::i2c::{Error, ErrorKind, I2c, NoAcknowledgeSource, Operation};
use ldc161x_sim::{
    Ack, ActiveWrite, BurstRead, Bus, Chip, Delay, EarlyTermination, I2cError, IntbPin, Settings,
    ShutdownPin, Switches, Time,
};

const W: u8 = ADDRESS << 1;
const R: u8 = ADDRESS << 1 | 1;
const T0: Time = Time::ZERO;

fn chip() -> Chip<[f64; 4]> {
    Chip::new(Settings::default(), [3e6; 4])
}

fn chip_with(change: impl FnOnce(&mut Switches)) -> Chip<[f64; 4]> {
    Chip::new(with_switches(Settings::default(), change), [3e6; 4])
}

/// Number of bit times, and time, of one transaction that reads these registers at 400 kHz.
fn cost(registers: &[u8]) -> (u64, Time) {
    let rig = ChipRig::new(Settings::default(), [3e6; 4]);
    let mut buffers = vec![[0; 2]; registers.len()];
    let pointers: Vec<[u8; 1]> = registers.iter().map(|&register| [register]).collect();
    let mut operations = Vec::new();
    for (pointer, buffer) in pointers.iter().zip(&mut buffers) {
        operations.push(Operation::Write(pointer));
        operations.push(Operation::Read(buffer));
    }
    rig.bus()
        .transaction(ADDRESS, &mut operations)
        .expect("an answer");
    let traffic = rig.chip.borrow().traffic();
    assert_eq!(traffic.transactions, 1);
    assert_eq!(traffic.stops, 1);
    (traffic.bit_times(), rig.now())
}

#[test]
fn frames_cost_what_the_reference_counts() {
    // Published costs: reference ldc1614.md 6.1.
    assert_eq!(cost(&[0x7E]), (48, us(120)));
    assert_eq!(cost(&[0x00, 0x01]), (95, Time::from_ns(237_500)));
    assert_eq!(cost(&[0x18, 0x00, 0x01]), (142, us(355)));
    assert_eq!(
        cost(&[0, 1, 2, 3, 4, 5, 6, 7]),
        (377, Time::from_ns(942_500))
    );
}

#[test]
fn a_register_write_costs_38_bits() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    rig.write(0x08, 0x1234);
    assert_eq!(rig.chip.borrow().traffic().bit_times(), 38);
    assert_eq!(rig.now(), us(95));
}

#[test]
fn adjacent_operations_of_one_kind_are_one_transfer() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    let (mut high, mut low, mut none) = ([0; 1], [0; 1], [0; 0]);
    rig.bus()
        .transaction(
            ADDRESS,
            &mut [
                Operation::Write(&[0x08]),
                Operation::Write(&[0x12]),
                Operation::Write(&[0x34]),
            ],
        )
        .expect("an answer");
    assert_eq!(rig.chip.borrow().traffic().bit_times(), 38);
    rig.bus()
        .transaction(
            ADDRESS,
            &mut [
                Operation::Write(&[0x08]),
                Operation::Read(&mut high),
                Operation::Read(&mut none),
                Operation::Read(&mut low),
            ],
        )
        .expect("an answer");
    assert_eq!((high, low), ([0x12], [0x34]));
    rig.bus()
        .transaction(
            ADDRESS,
            &mut [Operation::Read(&mut high), Operation::Read(&mut low)],
        )
        .expect("an answer");
    assert_eq!((high, low), ([0x12], [0x34]), "acknowledged in between");
    let traffic = rig.chip.borrow().traffic();
    assert_eq!(traffic.bit_times(), 38 + 48 + 29);
    assert_eq!(traffic.starts, 4);
    assert_eq!(
        rig.chip.borrow().misuse(),
        Default::default(),
        "no access was cut short"
    );
}

#[test]
fn the_clock_is_limited_to_the_datasheet() {
    for (requested_hz, bit_ns) in [
        (100_000, 10_000),
        (400_000, 2_500),
        (1_000_000, 2_500),
        (1, 100_000),
    ] {
        let chip = RefCell::new(chip());
        Bus::new(&chip, requested_hz)
            .write(ADDRESS, &[0x00])
            .expect("an answer");
        assert_eq!(
            chip.borrow().now(),
            Time::from_ns(20 * bit_ns),
            "{requested_hz} Hz"
        );
    }
}

#[test]
fn a_master_may_need_a_gap_between_transactions() {
    let chip = RefCell::new(chip());
    let mut bus = Bus::new(&chip, 400_000).with_gap(us(43));
    bus.write(ADDRESS, &[0x00]).expect("an answer");
    bus.write(ADDRESS, &[0x00]).expect("an answer");
    assert_eq!(chip.borrow().now(), us(2 * (50 + 43)));
    assert_eq!(chip.borrow().traffic().bit_times(), 40, "a gap is no bit");
}

#[test]
fn only_its_own_address_is_answered() {
    for high in [false, true] {
        let settings = Settings {
            address_pin_high: high,
            ..Settings::default()
        };
        let chip = RefCell::new(Chip::new(settings, [3e6]));
        let mut bus = Bus::new(&chip, 400_000);
        for address in 0..=0x7F {
            let answer = bus.write(address, &[]);
            if address == 0x2A + u8::from(high) {
                assert_eq!(answer, Ok(()));
            } else {
                let refused = I2cError::NoAcknowledge(NoAcknowledgeSource::Address);
                assert_eq!(answer, Err(refused));
                assert_eq!(
                    refused.kind(),
                    ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)
                );
            }
        }
    }
}

#[test]
fn the_address_pin_counts_in_shutdown_only() {
    let mut chip = chip();
    chip.set_address_pin(true);
    assert_eq!(chip.start(T0, W), Ack::Ack);
    chip.stop(T0);
    chip.set_shutdown(true);
    chip.set_address_pin(true);
    chip.set_shutdown(false);
    assert_eq!(chip.start(ms(3), W), Ack::Nack);
    assert_eq!(chip.start(ms(3), W + 2), Ack::Ack);
}

#[test]
fn two_chips_share_a_bus() {
    let at = |address_pin_high, hz| {
        let settings = Settings {
            address_pin_high,
            ..quiet(40e6)
        };
        RefCell::new(Chip::new(settings, [hz]))
    };
    let chips = [at(false, 3e6), at(true, 4e6)];
    let mut bus = Bus::shared(&chips, 400_000);
    bus.write(0x2A, &[0x08, 0x11, 0x11]).expect("an answer");
    bus.write(0x2B, &[0x08, 0x22, 0x22]).expect("an answer");
    let (mut first, mut second) = ([0; 2], [0; 2]);
    bus.write_read(0x2A, &[0x08], &mut first)
        .expect("an answer");
    bus.write_read(0x2B, &[0x08], &mut second)
        .expect("an answer");
    assert_eq!((first, second), ([0x11, 0x11], [0x22, 0x22]));
    Delay::shared(&chips).delay_ms(5);
    let times = chips.each_ref().map(|chip| chip.borrow().now());
    assert_eq!(times[0], times[1], "one time for all");
}

#[test]
fn the_pointer_outlives_the_transaction() {
    let mut chip = chip();
    chip.start(T0, W);
    chip.write(T0, 0x7F);
    chip.stop(T0);
    for _ in 0..2 {
        assert_eq!(chip.start(T0, R), Ack::Ack);
        assert_eq!(chip.read(T0, Ack::Ack), 0x30);
        assert_eq!(chip.read(T0, Ack::Nack), 0x55);
        chip.stop(T0);
    }
}

#[test]
fn a_write_takes_effect_with_its_second_byte() {
    let mut chip = chip();
    chip.start(T0, W);
    chip.write(T0, 0x08);
    chip.write(T0, 0x12);
    assert_eq!(chip.register(0x08), 0x0080);
    chip.write(T0, 0x34);
    assert_eq!(chip.register(0x08), 0x1234);
    chip.stop(T0);
}

#[test]
fn what_follows_the_two_bytes_of_a_read() {
    for &burst_read in BurstRead::VARIANTS {
        let rig = ChipRig::new(
            with_switches(Settings::default(), |s| s.burst_read = burst_read),
            [3e6],
        );
        let mut bytes = [0; 4];
        rig.bus()
            .write_read(ADDRESS, &[0x7E], &mut bytes)
            .expect("an answer");
        let expected = match burst_read {
            BurstRead::Released => [0x54, 0x49, 0xFF, 0xFF],
            BurstRead::Repeats => [0x54, 0x49, 0x54, 0x49],
            BurstRead::AutoIncrement => [0x54, 0x49, 0x30, 0x55],
        };
        assert_eq!(bytes, expected, "{burst_read:?}");
        let longer = rig.bus().write(ADDRESS, &[0x08, 0, 1, 0, 2]);
        match burst_read {
            BurstRead::AutoIncrement => {
                assert_eq!(longer, Ok(()));
                assert_eq!(rig.read(0x09), 2);
            }
            _ => assert_eq!(
                longer,
                Err(I2cError::NoAcknowledge(NoAcknowledgeSource::Data))
            ),
        }
        assert_eq!(
            rig.read(0x08),
            1,
            "the first two bytes are taken in any case"
        );
    }
}

#[test]
fn an_early_termination_may_corrupt_what_follows() {
    for &early_termination in EarlyTermination::VARIANTS {
        let corrupts = early_termination == EarlyTermination::CorruptsFollowing;
        let mut chip = chip_with(|s| s.early_termination = early_termination);
        // A write is broken off after its high byte.
        chip.start(T0, W);
        chip.write(T0, 0x08);
        chip.write(T0, 0x12);
        chip.stop(T0);
        assert_eq!(chip.misuse().early_terminations, 1);
        assert_eq!(chip.register(0x08), if corrupts { 0x1280 } else { 0x0080 });
        // The next transaction is shifted by one bit, the one after it is not.
        let identity = |chip: &mut Chip<[f64; 4]>| {
            chip.start(T0, W);
            chip.write(T0, 0x7E);
            chip.start(T0, R);
            let bytes = [chip.read(T0, Ack::Ack), chip.read(T0, Ack::Nack)];
            chip.stop(T0);
            u16::from_be_bytes(bytes)
        };
        assert_eq!(
            identity(&mut chip) == 0x5449,
            !corrupts,
            "{early_termination:?}"
        );
        assert_eq!(identity(&mut chip), 0x5449);
    }
}

#[test]
fn a_read_of_one_byte_is_an_early_termination() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    let mut byte = [0];
    rig.bus()
        .write_read(ADDRESS, &[0x7E], &mut byte)
        .expect("an answer");
    assert_eq!(byte, [0x54]);
    assert_eq!(rig.chip.borrow().misuse().early_terminations, 1);
    assert_ne!(rig.read(0x7E), 0x5449, "slipped");
    assert_eq!(rig.read(0x7E), 0x5449, "and in step again");
}

#[test]
fn probing_the_address_is_harmless() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    rig.bus().write(ADDRESS, &[]).expect("an answer");
    rig.bus().write(ADDRESS, &[0x7E]).expect("an answer");
    assert_eq!(rig.chip.borrow().misuse(), Default::default());
    assert_eq!(rig.read(0x7E), 0x5449);
}

#[test]
fn writes_while_converting() {
    for &active_write in ActiveWrite::VARIANTS {
        let settings = with_switches(quiet(40e6), |s| s.active_write = active_write);
        let rig = ChipRig::new(settings, [3e6]);
        rig.single(2500);
        rig.convert(0, 1);
        rig.write(0x08, 5000);
        assert_eq!(rig.chip.borrow().misuse().writes_while_active, 1);
        rig.convert(0, 1);
        let during = *rig.chip.borrow().last_conversion(0).expect("a conversion");
        rig.convert(0, 1);
        let after = *rig.chip.borrow().last_conversion(0).expect("a conversion");
        assert_eq!(
            during.end - during.start,
            ms(1),
            "the one under way keeps its length"
        );
        let taken = active_write != ActiveWrite::Ignored;
        assert_eq!(
            after.end - after.start,
            ms(if taken { 2 } else { 1 }),
            "{active_write:?}"
        );
        let corrupts = active_write == ActiveWrite::CorruptsConversion;
        assert_eq!(during.spoilt, corrupts);
        assert!(!after.spoilt);
        let reported_hz = f64::from(during.word) / 268_435_456.0 * 40e6;
        assert_eq!((reported_hz - 3e6).abs() > 1e3, corrupts, "{reported_hz}");
        assert!(
            (1.5e6..3.001e6).contains(&reported_hz),
            "half of the edges at worst"
        );
    }
}

#[test]
fn config_while_converting_can_always_sleep() {
    for &active_write in ActiveWrite::VARIANTS {
        let settings = with_switches(quiet(40e6), |s| s.active_write = active_write);
        let rig = ChipRig::new(settings, [3e6; 2]);
        rig.prepare(1, 2500, 20);
        rig.single(2500);
        rig.convert(0, 1);
        rig.write(0x1A, 0x5601); // channel 1, still awake
        let taken = active_write != ActiveWrite::Ignored;
        assert_eq!(rig.read(0x1A), if taken { 0x5601 } else { 0x1601 });
        rig.wait(ms(3));
        assert_eq!(rig.chip.borrow().conversions(1) > 0, taken);
        rig.write(0x1A, 0x3601);
        assert!(!rig.chip.borrow().is_converting());
        assert_eq!(rig.read(0x1A), 0x3601);
    }
}

// ---- pins and delay ----

#[test]
fn the_shutdown_pin_loses_the_registers_and_the_bus_for_two_milliseconds() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    let mut pin = ShutdownPin::new(&rig.chip);
    let mut delay = Delay::new(&rig.chip);
    let nack = Err(I2cError::NoAcknowledge(NoAcknowledgeSource::Address));
    rig.single(1000);
    rig.wait(ms(2));
    assert!(rig.intb_is_low());
    pin.set_high().expect("infallible");
    assert!(!rig.intb_is_low());
    delay.delay_us(10);
    assert_eq!(rig.try_read(0x7E), nack);
    pin.set_low().expect("infallible");
    let released = rig.now();
    delay.delay_us(1_900);
    assert_eq!(
        rig.try_read(0x7E),
        nack,
        "{} after release",
        rig.now() - released
    );
    delay.delay_us(100);
    assert_eq!(rig.read(0x7E), 0x5449);
    assert_eq!(rig.read(0x08), 0x0080);
    assert_eq!(rig.read(0x1A), 0x2801);
    assert!(!rig.chip.borrow().is_converting());
}

#[test]
fn the_interrupt_pin_follows_the_chip() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    let mut pin = IntbPin::new(&rig.chip);
    assert_eq!((pin.is_high(), pin.is_low()), (Ok(true), Ok(false)));
    rig.single(1000);
    rig.next_interrupt();
    assert_eq!((pin.is_high(), pin.is_low()), (Ok(false), Ok(true)));
}

#[test]
fn delays_take_their_time() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    let mut delay = Delay::new(&rig.chip);
    delay.delay_ns(1);
    delay.delay_us(2);
    delay.delay_ms(3);
    assert_eq!(rig.now(), Time::from_ns(3_002_001));
}

#[test]
fn errors_tell_what_they_are() {
    for (error, kind, text) in [
        (
            I2cError::ArbitrationLoss,
            ErrorKind::ArbitrationLoss,
            "arbitration",
        ),
        (I2cError::Bus, ErrorKind::Bus, "SDA"),
        (I2cError::Timeout, ErrorKind::Other, "SCL"),
        (I2cError::Borrowed, ErrorKind::Other, "borrowed"),
    ] {
        assert_eq!(error.kind(), kind);
        assert!(error.to_string().contains(text), "{error}");
    }
    assert!(ldc161x_sim::ScheduleFull.to_string().contains("16"));
    let errors = ldc161x_sim::Errors::WATCHDOG | ldc161x_sim::Errors::AMPLITUDE_LOW;
    assert_eq!(errors.to_string(), "WD+ALE");
    assert_eq!(ldc161x_sim::Errors::NONE.to_string(), "none");
    assert_eq!(ms(1_500).to_string(), "1.500000000 s");
}

#[test]
fn a_borrow_held_by_the_test_is_an_error_and_no_panic() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    let borrow = rig.chip.borrow_mut();
    assert_eq!(rig.try_read(0x7E), Err(I2cError::Borrowed));
    Delay::new(&rig.chip).delay_ms(1);
    assert_eq!(IntbPin::new(&rig.chip).is_low(), Ok(false));
    ShutdownPin::new(&rig.chip).set_high().expect("infallible");
    drop(borrow);
    assert_eq!(rig.read(0x7E), 0x5449);
}

#[cfg(feature = "async")]
mod asynchronous {
    use super::*;
    use core::future::Future;
    use core::pin::pin;
    use core::task::{Context, Poll, Waker};

    fn ready<T>(future: impl Future<Output = T>) -> T {
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(value) => value,
            Poll::Pending => panic!("simulated time needs no waiting"),
        }
    }

    #[test]
    fn the_same_bus_serves_asynchronous_drivers() {
        use embedded_hal_async::{delay::DelayNs, i2c::I2c};
        let rig = ChipRig::new(Settings::default(), [3e6]);
        let mut bytes = [0; 2];
        let mut bus = rig.bus();
        ready(I2c::write_read(&mut bus, ADDRESS, &[0x7E], &mut bytes)).expect("an answer");
        assert_eq!(bytes, [0x54, 0x49]);
        let before = rig.now();
        let mut delay = Delay::new(&rig.chip);
        ready(DelayNs::delay_ns(&mut delay, 5));
        ready(DelayNs::delay_us(&mut delay, 7));
        ready(DelayNs::delay_ms(&mut delay, 1));
        assert_eq!(rig.now(), before + Time::from_ns(1_007_005));
    }
}
