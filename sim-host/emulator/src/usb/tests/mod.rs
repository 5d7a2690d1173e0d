//! Controller and host, driven by hand-written register accesses: a wrong driver must fail here as
//! on the chip. The tests with the image cover a correct driver.

mod bench;
mod device;

use bench::{CONTROL, Idle, MAIN, MUXING, POWER, RAW, RESET, STATUS, UsbTestBench};
use device::{Device, INPUT, INPUT_BUFFER, OUTPUT};
use ldc161x_sim::Time;

use super::memory::buffer;
use super::wire::{Reply, Transaction, TransactionKind};
use super::{ControlOutcome, ControlTransfer, UsbState};

const DEVICE_DESCRIPTOR: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 18, 0];

/// A bench with a configured device.
fn configured() -> (UsbTestBench, Device) {
    let mut device = Device::default();
    let mut bench = UsbTestBench::attached();
    Device::listen(&mut bench);
    bench.usb.host.plug();
    bench.usb.host.enumerate();
    bench.run_until(&mut device, |it| it.usb.host.enumerated().is_some());
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
    (bench, device)
}

/// Submits a transfer and returns its outcome.
fn ask(bench: &mut UsbTestBench, device: &mut Device, transfer: ControlTransfer) -> ControlOutcome {
    let id = bench.usb.host.submit(transfer);
    let end_ps = bench.now_ps + Time::from_ms(6_000).as_ps();
    loop {
        if let Some((ended, outcome)) = bench.usb.host.take_results().pop() {
            assert_eq!(ended, id);
            return outcome;
        }
        assert!(bench.now_ps < end_ps, "no result");
        bench.run(Time::from_us(100), device);
    }
}

#[test]
fn a_device_is_reset_a_tenth_of_a_second_after_it_shows_itself() {
    let mut bench = UsbTestBench::attached();
    bench.usb.host.plug();
    bench.run(Time::from_ms(99), &mut Idle);
    assert_eq!(bench.usb.host.state(), UsbState::Attached);
    assert_eq!(bench.read(STATUS) & RESET, 0);
    bench.run(Time::from_ms(2), &mut Idle);
    assert_eq!(bench.usb.host.state(), UsbState::Resetting);
    assert_eq!(bench.read(STATUS) & (RESET | 0b1100), RESET, "SE0");
    bench.run(Time::from_ms(10), &mut Idle);
    assert_eq!(bench.usb.host.state(), UsbState::Default);
    assert_eq!(bench.read(STATUS) >> 2 & 0b11, 1, "J");
    assert_ne!(bench.read(STATUS) & 1 << 16, 0, "connected");
}

#[test]
fn a_device_without_pull_up_vbus_or_enable_is_not_seen() {
    for (register, value) in [(CONTROL, 0), (POWER, 0), (MAIN, 0), (MUXING, 0)] {
        let mut bench = UsbTestBench::attached();
        bench.write(register, value);
        bench.usb.host.plug();
        bench.run(Time::from_ms(200), &mut Idle);
        assert_eq!(bench.usb.host.state(), UsbState::Powered, "{register:#x}");
    }
}

/// Erratum E15: a bulk packet armed in the last fifth of a frame and requested in that frame.
#[test]
fn a_bulk_packet_that_meets_the_end_of_a_frame_hangs_the_controller() {
    for (armed_us, asked_us, hangs) in [
        (100, 900, false),
        (780, 900, false),
        (850, 900, true),
        (850, 1_000, false),
    ] {
        let (mut bench, mut device) = configured();
        let controller = &mut bench.usb.controller;
        controller.can_hang = true;
        let transaction = Transaction {
            address: controller.read(0).unwrap() as u8,
            endpoint: 2,
            kind: TransactionKind::In,
        };
        let frame_ps = bench.now_ps;
        let at_ps = |us: u64| frame_ps + Time::from_us(us).as_ps();
        bench.usb.controller.start_of_frame(1, frame_ps);
        bench.now_ps = at_ps(armed_us);
        bench.set_bytes(INPUT_BUFFER, &[7]);
        bench.arm(INPUT, buffer::FULL | 1);
        if asked_us >= 1_000 {
            bench.usb.controller.start_of_frame(2, at_ps(1_000));
        }
        let reply = bench.usb.controller.begin(&transaction, at_ps(asked_us));
        assert_eq!(reply == Reply::Silence, hangs, "{armed_us}, {asked_us}");
        // No endpoint answers any more, and no bus reset helps.
        bench.now_ps = at_ps(2_000);
        bench.usb.host.reset();
        bench.run(Time::from_ms(50), &mut device);
        let transfer = ControlTransfer::new(DEVICE_DESCRIPTOR);
        let outcome = ask(&mut bench, &mut device, transfer);
        let answers = matches!(outcome, ControlOutcome::Done(_));
        assert_eq!(answers, !hangs, "{armed_us}, {asked_us}: {outcome:?}");
    }
}

#[test]
fn an_address_that_is_not_its_own_gets_no_answer() {
    let (mut bench, mut device) = configured();
    bench.write(0x00, 9);
    let transfer = ControlTransfer::new(DEVICE_DESCRIPTOR);
    let outcome = ask(&mut bench, &mut device, transfer);
    assert_eq!(outcome, ControlOutcome::Silent);
}

#[test]
fn a_packet_with_the_wrong_pid_is_acknowledged_and_dropped() {
    let (mut bench, mut device) = configured();
    bench.arm(OUTPUT, buffer::DATA1 | 64);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 0);
    assert_ne!(bench.half(OUTPUT) & buffer::AVAILABLE, 0);
    assert_ne!(bench.read(STATUS) & 1 << 31, 0);
    assert_ne!(bench.read(RAW) & 1 << 5, 0);
    bench.write(STATUS, 1 << 31);
    assert_eq!(bench.read(RAW) & 1 << 5, 0);
    // The other direction: an initial DATA1 is a repetition to the host.
    bench.set_bytes(INPUT_BUFFER, b"xyz");
    bench.arm(INPUT, buffer::FULL | buffer::DATA1 | 3);
    bench.run(Time::from_ms(2), &mut device);
    assert!(bench.usb.host.read().is_empty());
    assert_eq!(bench.usb.host.counts().repeated, 1);
}

#[test]
fn an_endpoint_that_stalls_or_is_not_enabled_halts_its_pipe() {
    let control = 0x08 + 4 * (OUTPUT - 2);
    for (at, word) in [(0x80 + 4 * OUTPUT, buffer::STALL), (control, 0)] {
        let (mut bench, mut device) = configured();
        bench.arm(OUTPUT, 64);
        bench.set_word(at, word.into());
        bench.usb.host.write(b"abc");
        bench.run(Time::from_ms(2), &mut device);
        assert_eq!(bench.usb.host.halted(), [0x02], "{at:#x}");
        assert_eq!(bench.usb.host.unwritten(), 3, "{at:#x}");
    }
}

#[test]
fn an_idle_bus_suspends_the_device_after_three_milliseconds_and_resumes_it() {
    let (mut bench, mut device) = configured();
    bench.write(STATUS, 1 << 4);
    bench.usb.host.suspend();
    bench.run(Time::from_us(2_900), &mut device);
    assert_eq!(bench.read(RAW) & 1 << 14, 0);
    bench.run(Time::from_us(1_200), &mut device);
    assert_eq!(bench.usb.host.state(), UsbState::Suspended);
    assert_ne!(bench.read(RAW) & 1 << 14, 0);
    assert_ne!(bench.read(STATUS) & 1 << 4, 0);
    bench.write(STATUS, 1 << 4);
    assert_eq!(bench.read(RAW) & 1 << 14, 0);
    bench.usb.host.resume();
    bench.run(Time::from_ms(5), &mut device);
    assert_eq!(bench.read(STATUS) >> 2 & 0b11, 2, "K");
    assert_ne!(bench.read(RAW) & 1 << 15, 0);
    assert_eq!(bench.read(STATUS) & 1 << 4, 0);
    bench.write(STATUS, 1 << 11 | 1 << 4);
    assert_eq!(bench.read(RAW) & (1 << 15 | 1 << 14), 0);
    bench.run(Time::from_ms(40), &mut device);
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
}

#[test]
fn what_a_device_does_not_use_is_refused() {
    let mut bench = UsbTestBench::new();
    for (register, value) in [
        (MAIN, 0b11),
        (MAIN, 1 << 31),
        (CONTROL, 1),
        (CONTROL, 1 << 26),
        (0x04, 1),
        (0x54, 1),
        (0x60, 1),
        (MUXING, 0b0100),
        (0x00, 1 << 16),
    ] {
        let written = bench.usb.write(0, register, value, 0);
        assert_eq!(written, None, "{register:#x} = {value:#x}");
    }
    for register in (0..=0x98).step_by(4) {
        let written = bench.usb.write(0, register, 0, 0);
        assert_eq!(written, Some(()), "{register:#x}");
    }
}

#[test]
fn an_in_buffer_has_to_be_full_and_an_out_buffer_empty() {
    let (mut bench, mut device) = configured();
    bench.set_bytes(INPUT_BUFFER, b"xyz");
    bench.arm(INPUT, 3);
    bench.arm(OUTPUT, buffer::FULL | 64);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(2), &mut device);
    for index in [INPUT, OUTPUT] {
        assert_ne!(bench.half(index) & buffer::AVAILABLE, 0, "{index}");
    }
    bench.arm(INPUT, buffer::FULL | 3);
    bench.arm(OUTPUT, 64);
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.read(), b"xyz");
    assert_eq!(bench.usb.host.unwritten(), 0);
}
