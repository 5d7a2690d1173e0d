//! The bus: addresses, half accesses, writes at the wrong time, pins and delay.

use core::cell::RefCell;

use crate::common::*;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal::i2c::{I2c, NoAcknowledgeSource};
use ldc161x_sim::{
    Ack, ActiveWrite, Bus, Chip, Delay, EarlyTermination, I2cError, IntbPin, Settings, ShutdownPin,
    Time,
};

const W: u8 = ADDRESS << 1;
const R: u8 = ADDRESS << 1 | 1;
const T0: Time = Time::ZERO;
const ADDRESS_NACK: I2cError = I2cError::NoAcknowledge(NoAcknowledgeSource::Address);

#[test]
fn only_its_own_address_is_answered_which_the_pin_sets_in_shutdown() {
    let chip = RefCell::new(Chip::new(Settings::default(), [3e6]));
    let answers = || {
        let mut bus = Bus::new(&chip, 400_000);
        (0..=0x7F_u8)
            .filter(|address| match bus.write(*address, &[]) {
                Ok(()) => true,
                refused => {
                    assert_eq!(refused, Err(ADDRESS_NACK));
                    false
                }
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(answers(), [0x2A]);
    chip.borrow_mut().set_address_pin(true);
    assert_eq!(answers(), [0x2A]);
    chip.borrow_mut().set_shutdown(true);
    chip.borrow_mut().set_address_pin(true);
    chip.borrow_mut().set_shutdown(false);
    Delay::new(&chip).delay_ms(3);
    assert_eq!(answers(), [0x2B]);
}

#[test]
fn an_early_termination_may_corrupt_what_follows() {
    for (early_termination, stored, slips) in [
        (EarlyTermination::CorruptsFollowing, 0x1280, true),
        (EarlyTermination::Harmless, 0x0080, false),
    ] {
        let settings = with_switches(Settings::default(), |s| {
            s.early_termination = early_termination
        });
        let mut chip = Chip::new(settings, [3e6]);
        // A write takes effect with its second byte; this one is broken off after the first.
        chip.start(T0, W);
        chip.write(T0, 0x08);
        chip.write(T0, 0x12);
        assert_eq!(chip.register(0x08), 0x0080);
        chip.stop(T0);
        assert_eq!(chip.register(0x08), stored);
        // The next transaction is shifted by one bit; the transaction after that is not.
        let identity = |chip: &mut Chip<[f64; 1]>| {
            chip.start(T0, W);
            chip.write(T0, 0x7E);
            chip.start(T0, R);
            let bytes = [chip.read(T0, Ack::Ack), chip.read(T0, Ack::Nack)];
            chip.stop(T0);
            u16::from_be_bytes(bytes)
        };
        assert_eq!(
            identity(&mut chip) != 0x5449,
            slips,
            "{early_termination:?}"
        );
        assert_eq!(identity(&mut chip), 0x5449);
        assert_eq!(chip.misuse().early_terminations, 1);
        // A read of one byte counts too; a probe of the address or the pointer does not.
        let chip = RefCell::new(chip);
        let mut bus = Bus::new(&chip, 400_000);
        let mut byte = [0];
        for outcome in [
            bus.write_read(ADDRESS, &[0x7E], &mut byte),
            bus.write(ADDRESS, &[]),
            bus.write(ADDRESS, &[0x7E]),
        ] {
            assert_eq!(outcome, Ok(()));
        }
        assert_eq!(byte, [0x54]);
        assert_eq!(chip.borrow().misuse().early_terminations, 2);
    }
}

#[test]
fn writes_while_converting() {
    for (active_write, taken, corrupts) in [
        (ActiveWrite::CorruptsConversion, true, true),
        (ActiveWrite::Accepted, true, false),
        (ActiveWrite::Ignored, false, false),
    ] {
        let settings = with_switches(quiet(40e6), |s| s.active_write = active_write);
        let rig = ChipRig::new(settings, [3e6; 2]);
        rig.prepare(1, 2500, 20);
        rig.single(2500);
        rig.convert(0, 1);
        rig.write(0x08, 5000);
        assert_eq!(rig.chip.borrow().misuse().writes_while_active, 1);
        rig.convert(0, 1);
        let during = rig.last(0);
        rig.convert(0, 1);
        let after = rig.last(0);
        assert_eq!(
            during.end - during.start,
            ms(1),
            "the one under way keeps its length"
        );
        let length = after.end - after.start;
        assert_eq!(length, ms(if taken { 2 } else { 1 }), "{active_write:?}");
        assert_eq!((during.spoilt, after.spoilt), (corrupts, false));
        let reported_hz = f64::from(during.word) / 268_435_456.0 * 40e6;
        assert_eq!((reported_hz - 3e6).abs() > 1e3, corrupts, "{reported_hz}");
        // At worst half of the edges are lost.
        assert!((1.5e6..3.001e6).contains(&reported_hz));
        // A new active channel is accepted or lost like the new RCOUNT; the sleep bit always works.
        rig.write(0x1A, 0x5601);
        rig.wait(ms(4));
        assert_eq!(rig.chip.borrow().conversions(1) > 0, taken);
        rig.write(0x1A, 0x3601);
        assert_eq!(rig.read(0x1A), 0x3601);
        assert!(!rig.chip.borrow().is_converting());
    }
}

// ---- pins and delay ----

#[test]
fn the_shutdown_pin_loses_the_registers_and_the_bus_for_two_milliseconds() {
    let rig = ChipRig::new(Settings::default(), [3e6]);
    let mut shutdown = ShutdownPin::new(&rig.chip);
    let mut intb = IntbPin::new(&rig.chip);
    let mut delay = Delay::new(&rig.chip);
    rig.single(1000);
    assert_eq!((intb.is_high(), intb.is_low()), (Ok(true), Ok(false)));
    rig.wait(ms(2));
    assert_eq!((intb.is_high(), intb.is_low()), (Ok(false), Ok(true)));
    shutdown.set_high().expect("infallible");
    assert!(!rig.intb_is_low());
    delay.delay_us(10);
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
    shutdown.set_low().expect("infallible");
    delay.delay_us(1_900);
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
    delay.delay_ns(100_000);
    for (register, value) in [(0x7E, 0x5449), (0x08, 0x0080), (0x1A, 0x2801)] {
        assert_eq!(rig.read(register), value);
    }
}

#[cfg(feature = "async")]
#[test]
fn the_same_bus_serves_asynchronous_drivers() {
    use core::future::Future;
    use core::task::{Context, Poll, Waker};
    use embedded_hal_async::{delay::DelayNs, i2c::I2c};

    fn ready<T>(future: impl Future<Output = T>) -> T {
        match core::pin::pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(value) => value,
            Poll::Pending => panic!("simulated time needs no waiting"),
        }
    }
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
