//! Controller and host, driven by hand-written register accesses.

mod bench;
mod class;
pub(super) mod device;

use bench::{
    ABORT, ABORT_DONE, BUFFERS, CONTROL, ENABLE, FORCE, INTERRUPTS, Idle, MAIN, RAW, REFUSED,
    RESET, SOF, STATUS, UsbTestBench, WHICH,
};
use device::{CONFIGURATION, DEVICE, Data, Device, INPUT, INPUT_BUFFER, OUTPUT, OUTPUT_BUFFER};
use ldc161x_sim::Time;

use super::memory::buffer;
use super::wire::{Reply, Transaction, TransactionKind};
use super::{ControlOutcome, ControlTransfer, UsbState};

const DEVICE_DESCRIPTOR: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 18, 0];

/// A bench with the device at address 0.
fn plugged(data: Data) -> (UsbTestBench, Device) {
    let mut device = Device::new(data);
    let mut bench = UsbTestBench::attached();
    Device::listen(&mut bench);
    bench.usb.host.plug();
    bench.run_until(&mut device, |it| it.usb.host.state() == UsbState::Default);
    (bench, device)
}

fn configured(data: Data) -> (UsbTestBench, Device) {
    let (mut bench, mut device) = plugged(data);
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
fn nothing_happens_while_nothing_is_plugged_in() {
    let mut bench = UsbTestBench::new();
    assert_eq!(bench.usb.next_event(), None);
    bench.run(Time::from_ms(500), &mut Idle);
    assert_eq!(bench.usb.host.state(), UsbState::Unplugged);
    assert!(!bench.usb.line());
    assert_eq!(bench.usb.host.counts().frames, 0);
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
    for (register, value) in [
        (CONTROL, 0),
        (bench::POWER, 0),
        (MAIN, 0),
        (bench::MUXING, 0),
    ] {
        let mut bench = UsbTestBench::attached();
        bench.write(register, value);
        bench.usb.host.plug();
        bench.run(Time::from_ms(200), &mut Idle);
        assert_eq!(bench.usb.host.state(), UsbState::Powered, "{register:#x}");
    }
}

#[test]
fn a_device_is_enumerated_with_all_that_it_says() {
    let (bench, device) = configured(Data::Echo);
    let description = bench.usb.host.description().unwrap();
    assert_eq!(description.device, DEVICE);
    assert_eq!(description.configuration, CONFIGURATION);
    assert!(description.refused_qualifier);
    let strings = [1, 2, 3, 4].map(|index| description.string(index).unwrap());
    assert_eq!(strings, ["maker", "sensor", "1", "port"]);
    assert_eq!(description.vendor_interface(), Some(2));
    let cdc = description.cdc().unwrap();
    assert_eq!((cdc.control_interface, cdc.data_interface), (0, 1));
    assert_eq!((cdc.input.address, cdc.output.address), (0x82, 0x02));
    assert_eq!(cdc.notification.unwrap().interval, 16);
    // The host resets the device before the enumeration, and after its first request.
    assert_eq!(device.resets, 3);
    assert_eq!(device.control_data, [0x00, 0xC2, 0x01, 0x00, 0, 0, 8]);
    assert_eq!(device.setups.last(), Some(&[0x21, 0x22, 3, 0, 0, 0, 0, 0]));
    assert_eq!(bench.usb.races(), 0);
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
        let (mut bench, mut device) = configured(Data::Untouched);
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
        bench.arm(INPUT, 0, buffer::FULL | 1);
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
fn a_short_first_question_does_as_well() {
    let (mut bench, mut device) = plugged(Data::Echo);
    bench.usb.host.settings_mut().first_request = 8;
    bench.usb.host.enumerate();
    bench.run_until(&mut device, |it| it.usb.host.enumerated().is_some());
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
}

#[test]
fn control_data_of_any_length_arrive_whole() {
    let (mut bench, mut device) = configured(Data::Echo);
    for length in [1, 8, 63, 64, 65, 127, 128, 200, 255] {
        let transfer = ControlTransfer::new([0xC0, 1, length, 0, 0, 0, 255, 0]);
        let expected: Vec<u8> = (0..length).collect();
        let outcome = ask(&mut bench, &mut device, transfer);
        assert_eq!(outcome, ControlOutcome::Done(expected), "{length}");
        device.control_data.clear();
        let sent: Vec<u8> = (0..length).rev().collect();
        let setup = [0x40, 2, 0, 0, 0, 0, length, 0];
        let transfer = ControlTransfer::with_data(setup, &sent);
        let outcome = ask(&mut bench, &mut device, transfer);
        assert_eq!(outcome, ControlOutcome::Done(Vec::new()), "{length}");
        assert_eq!(device.control_data, sent, "{length}");
    }
}

#[test]
fn a_refused_request_stalls_and_the_next_one_does_not() {
    let (mut bench, mut device) = plugged(Data::Echo);
    for _ in 0..2 {
        let unknown = ControlTransfer::new([0x80, 99, 0, 0, 0, 0, 2, 0]);
        let outcome = ask(&mut bench, &mut device, unknown);
        assert_eq!(outcome, ControlOutcome::Stalled);
        // The stall bits stay set, but are not armed any more.
        let known = ControlTransfer::new(DEVICE_DESCRIPTOR);
        let outcome = ask(&mut bench, &mut device, known);
        assert_eq!(outcome.data(), Some(&DEVICE[..]));
    }
}

#[test]
fn a_request_without_an_answer_times_out_after_its_naks() {
    let (mut bench, mut device) = plugged(Data::Echo);
    device.deaf_to = Some(6);
    let begin_ps = bench.now_ps;
    let transfer = ControlTransfer {
        deadline: Time::from_ms(50),
        ..ControlTransfer::new(DEVICE_DESCRIPTOR)
    };
    let outcome = ask(&mut bench, &mut device, transfer);
    assert_eq!(outcome, ControlOutcome::TimedOut);
    let took_ms = (bench.now_ps - begin_ps) / 1_000_000_000;
    assert!((50..=62).contains(&took_ms), "{took_ms} ms");
    let refused = bench.usb.host.counts().refused;
    assert!((16 * 48..=16 * 52).contains(&refused), "{refused} NAKs");
    device.deaf_to = None;
    let outcome = ask(
        &mut bench,
        &mut device,
        ControlTransfer::new(DEVICE_DESCRIPTOR),
    );
    assert_eq!(outcome.data(), Some(&DEVICE[..]));
}

#[test]
fn an_address_that_is_not_its_own_gets_no_answer() {
    let (mut bench, mut device) = plugged(Data::Echo);
    bench.write(0x00, 9);
    let outcome = ask(
        &mut bench,
        &mut device,
        ControlTransfer::new(DEVICE_DESCRIPTOR),
    );
    assert_eq!(outcome, ControlOutcome::Silent);
    assert_eq!(bench.usb.host.counts().silent, 3);
}

#[test]
fn the_port_sends_back_what_it_gets_in_order() {
    let (mut bench, mut device) = configured(Data::Echo);
    let sent: Vec<u8> = (0..1000_u32).map(|index| (index * 7) as u8).collect();
    bench.usb.host.write(&sent);
    bench.run(Time::from_ms(30), &mut device);
    assert_eq!(device.received, sent);
    assert_eq!(bench.usb.host.read(), sent);
    assert_eq!(bench.usb.host.unwritten(), 0);
    assert_eq!(bench.usb.host.counts().repeated, 0);
}

#[test]
fn a_host_that_does_not_read_leaves_the_packet_where_it_is() {
    let (mut bench, mut device) = configured(Data::Echo);
    bench.usb.host.set_reading(false);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(20), &mut device);
    assert_ne!(bench.half(INPUT, 0) & buffer::AVAILABLE, 0);
    assert!(bench.usb.host.read().is_empty());
    bench.usb.host.set_reading(true);
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.read(), b"abc");
    assert_eq!(bench.half(INPUT, 0) & buffer::AVAILABLE, 0);
}

#[test]
fn a_packet_with_the_wrong_pid_is_acknowledged_and_dropped() {
    let (mut bench, mut device) = configured(Data::Untouched);
    bench.arm(OUTPUT, 0, buffer::DATA1 | 64);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 0);
    assert_ne!(bench.half(OUTPUT, 0) & buffer::AVAILABLE, 0);
    assert_ne!(bench.read(STATUS) & 1 << 31, 0);
    assert_ne!(bench.read(RAW) & 1 << 5, 0);
    bench.write(STATUS, 1 << 31);
    assert_eq!(bench.read(RAW) & 1 << 5, 0);
    // The other direction: an initial DATA1 is a repetition to the host.
    bench.set_bytes(INPUT_BUFFER, b"xyz");
    bench.arm(INPUT, 0, buffer::FULL | buffer::DATA1 | 3);
    bench.run(Time::from_ms(2), &mut device);
    assert!(bench.usb.host.read().is_empty());
    assert_eq!(bench.usb.host.counts().repeated, 1);
}

#[test]
fn an_endpoint_without_a_buffer_refuses_and_says_so() {
    let (mut bench, mut device) = configured(Data::Untouched);
    let control = 0x08 + 4 * (OUTPUT - 2);
    let settings = bench.usb.read_memory(control).unwrap();
    bench.usb.host.set_reading(false);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(1), &mut device);
    assert_eq!(bench.read(REFUSED), 0, "not asked to");
    bench.set_word(control, settings | 1 << 16);
    bench.run(Time::from_ms(1), &mut device);
    assert_eq!(bench.read(REFUSED), 1 << OUTPUT);
    assert_ne!(bench.read(RAW) & 1 << 19, 0);
    let before = bench.usb.host.counts().refused;
    bench.run(Time::from_ms(10), &mut device);
    let naks = bench.usb.host.counts().refused - before;
    assert!((150..=170).contains(&naks), "{naks} in 10 frames");
    assert_eq!(bench.usb.host.unwritten(), 3);
}

#[test]
fn a_stalled_endpoint_halts_its_pipe_until_the_host_clears_it() {
    let (mut bench, mut device) = configured(Data::Untouched);
    bench.set_word(0x80 + 4 * OUTPUT, u32::from(buffer::STALL));
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.halted(), [0x02]);
    bench.set_word(0x80 + 4 * OUTPUT, 0);
    bench.arm(OUTPUT, 0, 64);
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 3, "it is left alone");
    let clear = ControlTransfer::new([2, 1, 0, 0, 0x02, 0, 0, 0]);
    // The device does not know the request: the host stays halted.
    assert_eq!(ask(&mut bench, &mut device, clear), ControlOutcome::Stalled);
    assert_eq!(bench.usb.host.halted(), [0x02]);
    let configure = ControlTransfer::new([0, 9, 1, 0, 0, 0, 0, 0]);
    ask(&mut bench, &mut device, configure);
    bench.arm(OUTPUT, 0, 64);
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 0);
}

#[test]
fn an_endpoint_that_is_not_enabled_does_not_answer() {
    let (mut bench, mut device) = configured(Data::Untouched);
    bench.set_word(0x08 + 4 * (OUTPUT - 2), 0);
    bench.arm(OUTPUT, 0, 64);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.halted(), [0x02]);
    assert_eq!(bench.usb.host.counts().silent, 3);
}

/// Sets up endpoint 2 with two buffers per direction, and an interrupt for each of them or for
/// both.
fn doubled(bench: &mut UsbTestBench, interrupt: u32) {
    for (index, at) in [(INPUT, INPUT_BUFFER), (OUTPUT, OUTPUT_BUFFER)] {
        let settings = 1 << 31 | 1 << 30 | interrupt | 2 << 26 | at;
        bench.set_word(0x08 + 4 * (index - 2), settings);
    }
}

#[test]
fn two_buffers_are_filled_in_turn_and_wait_both_to_be_cleared() {
    let (mut bench, _) = configured(Data::Untouched);
    bench.write(ENABLE, 0);
    doubled(&mut bench, 1 << 29);
    bench.arm(OUTPUT, 0, 64);
    bench.arm(OUTPUT, 1, buffer::DATA1 | 64);
    let sent: Vec<u8> = (0..150).collect();
    bench.usb.host.write(&sent);
    bench.run(Time::from_ms(2), &mut Idle);
    assert_eq!(
        bench.usb.host.unwritten(),
        22,
        "there was room for two packets"
    );
    assert_eq!(bench.bytes(OUTPUT_BUFFER, 128), sent[..128]);
    for which in 0..2 {
        let done = bench.half(OUTPUT, which);
        assert_eq!(done & (buffer::FULL | buffer::AVAILABLE), buffer::FULL);
        assert_eq!(done & buffer::LENGTH, 64);
    }
    assert_eq!(bench.read(BUFFERS), 1 << OUTPUT);
    assert_eq!(bench.read(WHICH), 0, "the first one first");
    bench.write(BUFFERS, 1 << OUTPUT);
    assert_eq!(
        bench.read(BUFFERS),
        1 << OUTPUT,
        "the second one shows at once"
    );
    assert_eq!(bench.read(WHICH), 1 << OUTPUT);
    bench.write(BUFFERS, 1 << OUTPUT);
    assert_eq!(bench.read(BUFFERS), 0);
    bench.arm(OUTPUT, 0, 64);
    bench.run(Time::from_ms(2), &mut Idle);
    assert_eq!(bench.usb.host.unwritten(), 0);
    assert_eq!(bench.half(OUTPUT, 0) & buffer::LENGTH, 22);
}

#[test]
fn two_full_buffers_go_out_one_behind_the_other_and_reset_begins_with_the_first() {
    let (mut bench, _) = configured(Data::Untouched);
    bench.write(ENABLE, 0);
    doubled(&mut bench, 1 << 28);
    bench.set_bytes(INPUT_BUFFER, b"one");
    bench.set_bytes(INPUT_BUFFER + 64, b"two");
    bench.arm(INPUT, 0, buffer::FULL | 3);
    bench.run(Time::from_ms(2), &mut Idle);
    assert_eq!(bench.usb.host.read(), b"one");
    assert_eq!(bench.read(BUFFERS), 0, "an interrupt for both only");
    bench.arm(INPUT, 1, buffer::FULL | buffer::DATA1 | buffer::LAST | 3);
    bench.run(Time::from_ms(2), &mut Idle);
    assert_eq!(bench.usb.host.read(), b"two");
    assert_eq!(bench.read(BUFFERS), 1 << INPUT);
    assert_ne!(bench.read(STATUS) & 1 << 18, 0, "the last one");
    bench.arm(INPUT, 0, buffer::FULL | 3);
    bench.run(Time::from_ms(2), &mut Idle);
    assert_eq!(bench.usb.host.read(), b"one");
    // Without RESET, the second buffer would be next.
    bench.arm(INPUT, 0, buffer::RESET | buffer::FULL | buffer::DATA1 | 3);
    bench.run(Time::from_ms(2), &mut Idle);
    assert_eq!(bench.usb.host.read(), b"one");
    assert_eq!(bench.half(INPUT, 0) & buffer::RESET, 0);
}

#[test]
fn a_reset_in_mid_transfer_cancels_it_and_leaves_the_buffer() {
    let (snapshot, _) = configured(Data::Untouched);
    let mut ended = Vec::new();
    for at_us in (0..3_000).step_by(37) {
        let mut bench = snapshot.clone();
        let mut device = Device::new(Data::Untouched);
        bench.set_bytes(INPUT_BUFFER, b"abc");
        bench.arm(INPUT, 0, buffer::FULL | 3);
        bench.usb.host.set_reading(false);
        let setup = [0xC0, 1, 250, 0, 0, 0, 255, 0];
        bench.usb.host.submit(ControlTransfer::new(setup));
        bench.run(Time::from_us(at_us), &mut device);
        bench.usb.host.reset();
        bench.usb.service(bench.now_ps);
        assert_eq!(bench.usb.host.state(), UsbState::Resetting, "{at_us} us");
        let results = bench.usb.host.take_results();
        ended.extend(results.into_iter().map(|(_, outcome)| outcome));
        assert_ne!(bench.half(INPUT, 0) & buffer::AVAILABLE, 0);
        bench.run_until(&mut device, |it| it.usb.host.enumerated().is_some());
        assert_eq!(bench.usb.host.state(), UsbState::Configured, "{at_us} us");
    }
    let cancelled = |outcome: &&ControlOutcome| **outcome == ControlOutcome::Cancelled;
    let count = ended.iter().filter(cancelled).count();
    assert!(
        (5..ended.len() - 5).contains(&count),
        "{count} of {}",
        ended.len()
    );
}

#[test]
fn an_idle_bus_suspends_the_device_after_three_milliseconds_and_resumes_it() {
    let (mut bench, mut device) = configured(Data::Echo);
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
    bench.usb.host.write(b"abc");
    bench.usb.host.resume();
    bench.run(Time::from_ms(5), &mut device);
    assert_eq!(bench.read(STATUS) >> 2 & 0b11, 2, "K");
    assert_ne!(bench.read(RAW) & 1 << 15, 0);
    assert_eq!(bench.read(STATUS) & 1 << 4, 0);
    bench.write(STATUS, 1 << 11 | 1 << 4);
    assert_eq!(bench.read(RAW) & (1 << 15 | 1 << 14), 0);
    bench.run(Time::from_ms(40), &mut device);
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
    assert_eq!(bench.usb.host.read(), b"abc");
}

#[test]
fn a_device_wakes_a_suspended_host() {
    let (mut bench, mut device) = configured(Data::Echo);
    bench.usb.host.suspend();
    bench.run(Time::from_ms(10), &mut device);
    let control = bench.read(CONTROL);
    bench.write(CONTROL, control | 1 << 12);
    assert_eq!(bench.read(CONTROL), control, "RESUME clears itself");
    bench.run(Time::from_ms(40), &mut device);
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
}

#[test]
fn a_pulled_cable_cancels_all_and_suspends_the_device() {
    let (mut bench, mut device) = configured(Data::Echo);
    device.deaf_to = Some(6);
    let first = bench
        .usb
        .host
        .submit(ControlTransfer::new(DEVICE_DESCRIPTOR));
    let second = bench
        .usb
        .host
        .submit(ControlTransfer::new(DEVICE_DESCRIPTOR));
    bench.run(Time::from_us(300), &mut device);
    bench.usb.host.unplug();
    bench.run(Time::from_ms(4), &mut device);
    let cancelled = [first, second].map(|id| (id, ControlOutcome::Cancelled));
    assert_eq!(bench.usb.host.take_results(), cancelled);
    assert_eq!(bench.usb.host.state(), UsbState::Unplugged);
    assert_ne!(bench.read(STATUS) & 1 << 4, 0);
    device.deaf_to = None;
    bench.usb.host.plug();
    bench.run_until(&mut device, |it| it.usb.host.enumerated().is_some());
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
}

#[test]
fn a_device_that_goes_is_noticed_and_enumerated_when_it_comes_back() {
    let (mut bench, mut device) = configured(Data::Echo);
    let control = bench.read(CONTROL);
    bench.write(CONTROL, 0);
    assert_eq!(bench.usb.host.state(), UsbState::Powered);
    bench.run(Time::from_ms(5), &mut device);
    bench.write(CONTROL, control);
    bench.run_until(&mut device, |it| it.usb.host.enumerated().is_some());
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
    bench.usb.reset(bench.now_ps);
    assert_eq!(bench.usb.host.state(), UsbState::Powered);
}

#[test]
fn frames_come_every_millisecond_with_their_numbers() {
    let mut bench = UsbTestBench::plugged(&mut Idle);
    assert_ne!(bench.read(RAW) & 1 << 17, 0);
    let first = bench.read(SOF);
    assert_eq!(bench.read(RAW) & 1 << 17, 0, "read is cleared");
    bench.run(Time::from_ms(100), &mut Idle);
    assert_eq!(bench.read(SOF), first + 100);
}

#[test]
fn an_interrupt_is_raised_where_it_is_enabled_or_forced() {
    let mut bench = UsbTestBench::plugged(&mut Idle);
    bench.run(Time::from_ms(2), &mut Idle);
    assert!(!bench.usb.line());
    bench.write(ENABLE, 1 << 12);
    assert!(bench.usb.line());
    assert_eq!(bench.read(INTERRUPTS), 1 << 12);
    bench.write(STATUS, RESET);
    assert!(!bench.usb.line());
    bench.write(FORCE, 1 << 3);
    assert!(bench.usb.line());
    assert_eq!(bench.read(INTERRUPTS), 1 << 3);
}

#[test]
fn a_bit_that_a_one_clears_is_cleared_by_two_views_of_it() {
    for view in [0, 3] {
        let mut bench = UsbTestBench::plugged(&mut Idle);
        assert_ne!(bench.read(STATUS) & RESET, 0);
        bench
            .usb
            .write(view, STATUS, 1 << 17, bench.now_ps)
            .unwrap();
        assert_ne!(bench.read(STATUS) & RESET, 0, "another bit");
        bench.usb.write(view, STATUS, RESET, bench.now_ps).unwrap();
        assert_eq!(bench.read(STATUS) & RESET, 0);
    }
    let mut bench = UsbTestBench::new();
    bench.usb.write(2, ENABLE, 0b101, 0).unwrap();
    bench.usb.write(1, ENABLE, 0b110, 0).unwrap();
    bench.usb.write(3, ENABLE, 0b010, 0).unwrap();
    assert_eq!(bench.read(ENABLE), 0b001);
}

#[test]
fn what_a_device_does_not_use_is_refused() {
    let mut bench = UsbTestBench::new();
    let refused = [
        (MAIN, 0b11),
        (MAIN, 1 << 31),
        (CONTROL, 1),
        (CONTROL, 1 << 26),
        (0x04, 1),
        (0x54, 1),
        (bench::MUXING, 0b0100),
        (0x00, 1 << 16),
    ];
    for (register, value) in refused {
        let written = bench.usb.write(0, register, value, 0);
        assert_eq!(written, None, "{register:#x} = {value:#x}");
    }
    for register in (0..=0x98).step_by(4) {
        assert_eq!(
            bench.usb.write(0, register, 0, 0),
            Some(()),
            "{register:#x}"
        );
    }
}

#[test]
fn an_aborted_buffer_refuses_until_it_is_given_back() {
    let (mut bench, mut device) = configured(Data::Untouched);
    bench.usb.host.set_reading(false);
    bench.arm(OUTPUT, 0, 64);
    bench.write(ABORT, 1 << OUTPUT);
    assert_eq!(bench.read(ABORT_DONE), 1 << OUTPUT);
    bench.write(ABORT_DONE, 1 << OUTPUT);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 3);
    bench.write(ABORT, 0);
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 0);
}

#[test]
fn a_clone_goes_on_as_the_original() {
    let (mut bench, mut device) = configured(Data::Untouched);
    bench.usb.host.write(&[7; 300]);
    bench.run(Time::from_us(1_234), &mut device);
    let mut clone = bench.clone();
    for copy in [&mut bench, &mut clone] {
        copy.arm(OUTPUT, 0, 64);
        copy.run(Time::from_ms(5), &mut Idle);
    }
    assert_eq!(bench.usb.host.counts(), clone.usb.host.counts());
    assert_eq!(bench.bytes(0, 4096), clone.bytes(0, 4096));
}

#[test]
fn a_setup_packet_disarms_the_stall_of_endpoint_0() {
    let (mut bench, mut device) = plugged(Data::Echo);
    let unknown = ControlTransfer::new([0x80, 99, 0, 0, 0, 0, 2, 0]);
    let outcome = ask(&mut bench, &mut device, unknown);
    assert_eq!(outcome, ControlOutcome::Stalled);
    assert_eq!(bench.read(bench::STALL_ARM), 0b11);
    // The device leaves its stall bits set and does not answer.
    device.deaf_to = Some(6);
    let transfer = ControlTransfer {
        deadline: Time::from_ms(20),
        ..ControlTransfer::new(DEVICE_DESCRIPTOR)
    };
    let outcome = ask(&mut bench, &mut device, transfer);
    assert_eq!(outcome, ControlOutcome::TimedOut);
    assert_eq!(bench.read(bench::STALL_ARM), 0);
}

#[test]
fn a_buffer_that_is_available_and_not_full_has_nothing_to_send() {
    let (mut bench, mut device) = configured(Data::Untouched);
    bench.arm(INPUT, 0, 3);
    bench.run(Time::from_ms(2), &mut device);
    assert_ne!(bench.half(INPUT, 0) & buffer::AVAILABLE, 0);
    bench.set_bytes(INPUT_BUFFER, b"abc");
    bench.arm(INPUT, 0, buffer::FULL | 3);
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.read(), b"abc");
}

#[test]
fn a_buffer_that_is_available_and_full_has_no_room() {
    let (mut bench, mut device) = configured(Data::Untouched);
    bench.arm(OUTPUT, 0, buffer::FULL | 64);
    bench.usb.host.write(b"abc");
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 3);
    bench.arm(OUTPUT, 0, 64);
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(bench.usb.host.unwritten(), 0);
}

#[test]
fn nothing_is_asked_of_a_device_for_ten_milliseconds_after_its_reset() {
    let (mut bench, mut device) = plugged(Data::Echo);
    bench
        .usb
        .host
        .submit(ControlTransfer::new(DEVICE_DESCRIPTOR));
    bench.run(Time::from_us(9_900), &mut device);
    assert_eq!(bench.usb.host.counts().frames, 10);
    assert!(device.setups.is_empty());
    bench.run(Time::from_ms(2), &mut device);
    assert_eq!(device.setups, [DEVICE_DESCRIPTOR]);
}
