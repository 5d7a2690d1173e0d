//! The image at a USB host, with a second PC at the probe.
//!
//! Short form; the long form is the campaign `image-usb`.

use palpate_emulator::Time;
use palpate_emulator::usb::{ControlOutcome, ControlTransfer};
use palpate_procedure::Link;
use palpate_wire::code::{FaultCode, Outcome};
use palpate_wire::{Command, Record};

use crate::common::usb::control::{disturb_control, outcome};
use crate::common::usb::descriptors::reviewed;
use crate::common::usb::links::{flood, silent_link};
use crate::common::usb::restarts::{ask_for_restart, reboot, replug};
use crate::common::usb::streams::{LATEST_PACKET, stopped_reader, stream_in_trains};
use crate::common::usb::{Chance, INTERRUPT, UsbBench, missing, plugged};
use crate::common::{Crash, time_to_off};

/// Longest allowed delay from an edge of INTB to START while the bus is free.
const LATENCY: Time = Time::from_us(10);

#[test]
fn the_device_describes_itself_as_reviewed_and_its_serial_number_is_the_boards() {
    let mut bench = plugged();
    let of_flash = u64::from_be_bytes(bench.probe.board.flash().unique_id());
    let description = bench.probe.board.usb().description();
    assert_eq!(description, Some(&reviewed(of_flash)));
    let unit = |record: &Record| match record {
        Record::Hello(hello) => Some(hello.unit),
        _ => None,
    };
    assert_eq!(bench.ask(&Command::Identify, unit).1, of_flash);
}

#[test]
fn control_transfers_of_any_kind_end_and_disturb_neither_stream_nor_coil() {
    let mut bench = plugged();
    let found = disturb_control(&mut bench, 500, 1);
    println!("{found:?}");
    assert_eq!(found.hung, []);
    assert_eq!(found.wrong, 0);
    assert!(found.done > 50 && found.stalled > 100);
    // Each kind has occurred; the counts depend on the timing of the USB interrupt.
    assert!(found.cancelled > 0 && found.overtaken > 0);
    assert!(found.levels.written > 10_000);
    assert_eq!(found.levels.late, 0);
    assert!(found.levels.longest_gap < Time::from_us(24));
    assert!(found.edge_to_start <= LATENCY, "{}", found.edge_to_start);
    assert_eq!(bench.probe.board.usb_rewritten(), 0);
    assert_eq!(bench.probe.board.resets().watchdog, 0);
    assert_eq!(bench.command(&Command::GetSettings), Outcome::Accepted);
}

/// SET_CONTROL_LINE_STATE announces no data, so data sent with it must be refused.
#[test]
fn data_that_a_request_does_not_announce_are_refused() {
    let mut bench = plugged();
    let setup = [0x21, 0x22, 3, 0, 0, 0, 0, 0];
    for length in [0, 1, 64, 100] {
        let id = bench.submit(ControlTransfer::with_data(setup, &vec![7; length]));
        bench.run(Time::from_ms(5));
        let results = bench.probe.board.usb_mut().take_results();
        let expected = match length {
            0 => ControlOutcome::Done(Vec::new()),
            _ => ControlOutcome::Stalled,
        };
        assert_eq!(results, [(id, expected)], "{length} bytes");
    }
}

const GET_DEVICE_DESCRIPTOR: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 18, 0];

/// Outcome of a correct request for the device descriptor.
fn device_descriptor(bench: &UsbBench) -> ControlOutcome {
    let description = bench.probe.board.usb().description().unwrap();
    ControlOutcome::Done(description.device.clone())
}

/// When the data are refused, the status stage still waits, and the next transfer starts before the
/// USB interrupt runs. The next transfer must succeed.
#[test]
fn a_request_whose_data_were_too_many_leaves_nothing_to_the_next_one() {
    let mut bench = plugged();
    let line_state = [0x21, 0x22, 3, 0, 0, 0, 0, 0];
    let expected = device_descriptor(&bench);
    for round in 0..400 {
        bench.submit(ControlTransfer::with_data(line_state, &[7; 64]));
        let id = bench.submit(ControlTransfer::new(GET_DEVICE_DESCRIPTOR));
        assert_eq!(outcome(&mut bench, id), expected, "round {round}");
    }
}

/// The driver makes room again when it reads a full packet. More data may then arrive before the
/// status stage: host and device must still agree about the address.
#[test]
fn an_address_that_comes_with_too_many_data_is_set_or_refused() {
    let mut bench = plugged();
    let expected = device_descriptor(&bench);
    let mut chance = Chance::new(1);
    let mut refused = 0;
    for round in 0..300_u16 {
        let address = 2 + (round % 50) as u8;
        let set_address = [0, 5, address, 0, 0, 0, 64, 0];
        let length = 65 + chance.below(64) as usize;
        let apart = Time::from_ns(u64::from(chance.below(1_000_000)));
        bench.probe.board.run_for(apart).unwrap();
        let former = bench.submit(ControlTransfer::with_data(set_address, &vec![7; length]));
        refused += u32::from(outcome(&mut bench, former) == ControlOutcome::Stalled);
        let id = bench.submit(ControlTransfer::new(GET_DEVICE_DESCRIPTOR));
        assert_eq!(outcome(&mut bench, id), expected, "round {round}");
    }
    assert_eq!(refused, 300);
}

/// A packet of the refused request may arrive during the refusal. It is discarded only when the
/// next setup packet is there; that next request must not be refused.
#[test]
fn a_request_that_is_refused_does_not_take_the_next_one_with_it() {
    let mut bench = plugged();
    let longer_than_any = [0x40, 0, 0, 0, 0, 0, 192, 0];
    let expected = device_descriptor(&bench);
    for round in 0..4_000 {
        bench.submit(ControlTransfer::with_data(longer_than_any, &[7; 80]));
        let id = bench.submit(ControlTransfer::new(GET_DEVICE_DESCRIPTOR));
        assert_eq!(outcome(&mut bench, id), expected, "round {round}");
    }
}

/// Until the USB interrupt runs, a request's data go into the buffer on which the previous transfer
/// waits. If that transfer received one packet, it expects DATA0, and the request's DATA1 is
/// dropped. The data may end at any point of the interrupt: lengths and stuffed bits shift the end.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_request_is_not_left_waiting_for_data_that_came_to_a_transfer_given_up() {
    let line_coding = [0x21, 0x20, 0, 0, 0, 0, 7, 0];
    let of_two_packets = [0x21, 0x20, 0, 0, 0, 0, 84, 0];
    let without_data = ControlTransfer {
        deadline: Time::from_us(1),
        ..ControlTransfer::new(line_coding)
    };
    let of_one_packet = ControlTransfer {
        deadline: Time::from_ms(5),
        ..ControlTransfer::with_data(of_two_packets, &[0; 64])
    };
    for former in [without_data, of_one_packet] {
        let mut bench = plugged();
        let mut done = 0;
        for round in 0..400_usize {
            bench.submit(former.clone());
            let mut right = ControlTransfer::with_data(line_coding, &[0, 194, 1, 0, 0, 0, 8]);
            if round % 2 == 1 {
                let length = 1 + round % 64;
                let mut data = [0; 64];
                data.iter_mut()
                    .take(round / 64 * 10)
                    .for_each(|byte| *byte = 0xFF);
                let of_length = [0x21, 0x20, 0, 0, 0, 0, length as u8, 0];
                right = ControlTransfer::with_data(of_length, &data[..length]);
            }
            right.deadline = Time::from_ms(20);
            let id = bench.submit(right);
            let outcome = outcome(&mut bench, id);
            assert!(
                matches!(outcome, ControlOutcome::Done(_) | ControlOutcome::Stalled),
                "round {round} after {former:?}: {outcome}"
            );
            done += u32::from(outcome.data().is_some());
        }
        assert!(done > 0);
    }
}

/// The USB interrupt may handle a packet of the former transfer when the next setup packet has just
/// arrived. The next transfer's data must not go unnoticed into the buffer that the former one had: the
/// device would wait for them. Only a few in ten thousand rounds meet the few microseconds that matter.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn data_of_a_request_are_not_lost_in_the_buffer_of_the_former_one() {
    let line_coding = ControlTransfer {
        deadline: Time::from_ms(20),
        ..ControlTransfer::with_data([0x21, 0x20, 0, 0, 0, 0, 64, 0], &[8; 64])
    };
    let longer_than_any = [0x40, 0, 0, 0, 0, 0, 192, 0];
    for is_refused in [true, false] {
        let mut bench = plugged();
        bench.probe.board.usb_mut().give_up_within_frame(true);
        let mut chance = Chance::new(1);
        let mut done = 0;
        for round in 0..8_000 {
            let apart = Time::from_ns(u64::from(chance.below(300_000)));
            bench.probe.board.run_for(apart).unwrap();
            bench.submit(if is_refused {
                let length = 64 + chance.below(16) as usize;
                ControlTransfer::with_data(longer_than_any, &vec![7; length])
            } else {
                ControlTransfer {
                    deadline: Time::from_us(u64::from(50 + chance.below(200))),
                    ..line_coding.clone()
                }
            });
            let id = bench.submit(line_coding.clone());
            let outcome = outcome(&mut bench, id);
            assert!(
                matches!(outcome, ControlOutcome::Done(_) | ControlOutcome::Stalled),
                "round {round}, former refused: {is_refused}: {outcome}"
            );
            done += u32::from(outcome.data().is_some());
        }
        println!("{done} done");
        assert!(done > 7_000);
    }
}

/// The next setup packet may arrive while the previous one is copied (its flag is cleared
/// afterwards) or while its answer is prepared. An answer that is already available is sent to the
/// next request: software cannot prevent that (docs/firmware.md, errata).
#[test]
fn a_request_that_is_given_up_at_any_time_does_not_take_the_next_one_with_it() {
    let mut bench = plugged();
    bench.probe.board.usb_mut().give_up_within_frame(true);
    let expected = device_descriptor(&bench);
    let mut chance = Chance::new(1);
    let mut answered_before = 0;
    for round in 0..600 {
        let mut former = match chance.below(3) {
            0 => ControlTransfer::new([0x80, 6, 0, 3, 0, 0, 255, 0]),
            1 => ControlTransfer::new([0x21, 0x22, 3, 0, 0, 0, 0, 0]),
            _ => ControlTransfer::new([0x21, 0x20, 0, 0, 0, 0, 7, 0]),
        };
        former.deadline = Time::from_ns(u64::from(chance.below(60_000)));
        let apart = Time::from_ns(u64::from(chance.below(300_000)));
        bench.probe.board.run_for(apart).unwrap();
        bench.submit(former.clone());
        let id = bench.submit(ControlTransfer::new(GET_DEVICE_DESCRIPTOR));
        let before = bench.probe.board.usb_answered_before();
        let outcome = outcome(&mut bench, id);
        if bench.probe.board.usb_answered_before() > before {
            answered_before += 1;
        } else {
            assert_eq!(outcome, expected, "round {round} after {former:?}");
        }
    }
    println!("{answered_before} came when the answer to the former was available");
    assert!(answered_before < 300, "most show something");
}

/// A PC that configures the device again or clears a halt expects DATA0 next (USB 2.0 9.1.1.5,
/// 9.4.5). A device that ignores this loses or repeats a packet.
#[test]
fn a_device_that_is_configured_again_loses_no_packet() {
    let requests: [[u8; 8]; 4] = [
        // SET_CONFIGURATION, SET_INTERFACE of the data, CLEAR_FEATURE of both bulk endpoints.
        [0x00, 9, 1, 0, 0, 0, 0, 0],
        [0x01, 11, 0, 0, 1, 0, 0, 0],
        [0x02, 1, 0, 0, 0x82, 0, 0, 0],
        [0x02, 1, 0, 0, 0x01, 0, 0, 0],
    ];
    let mut bench = plugged();
    bench.port.begin_account();
    // The number of packets between two requests alternates between odd and even.
    for (round, setup) in (0..).zip([requests; 4].concat()) {
        bench.probe.board.usb_mut().set_reading(false);
        bench.run(Time::from_us(1_300 + 70 * round));
        let id = bench.submit(ControlTransfer::new(setup));
        bench.run(Time::from_ms(2));
        let results = bench.probe.board.usb_mut().take_results();
        assert_eq!(results, [(id, ControlOutcome::Done(Vec::new()))]);
        bench.probe.board.usb_mut().set_reading(true);
        for _ in 0..=round % 3 {
            assert_eq!(bench.command(&Command::GetSettings), Outcome::Accepted);
        }
    }
    assert_eq!(missing(&bench.port.tally()), (0, 0));
    assert_eq!(bench.port.damaged, 0);
    assert_eq!(bench.probe.board.usb().counts().repeated, 0);
}

#[test]
fn nothing_is_lost_over_both_links_while_the_coil_is_in_its_train() {
    for (channels, rate_hz) in [(0b0001, 1_000.0), (0b1111, 500.0)] {
        let mut bench = plugged();
        let found = stream_in_trains(&mut bench, channels, rate_hz, Time::from_ms(600));
        println!("{found:?}");
        assert_eq!((found.scans_lost, found.samples_after_gap), (0, 0));
        assert_eq!((found.missing, found.missing_by_rtt), ((0, 0), 0));
        assert_eq!((found.damaged, found.restarts), (0, 0));
        assert!(found.scans > 250 && found.samples + 30 > found.scans);
        assert!(found.levels.written > 20_000);
        assert_eq!(found.levels.late, 0);
        assert!(found.levels.longest_gap < Time::from_us(24));
        assert!(found.edge_to_start <= LATENCY, "{}", found.edge_to_start);
        assert!(found.load_in_train > 0.1 && found.load_in_train <= 0.55);
        let latest = bench.probe.board.usb_latest_bulk();
        println!("latest packet {latest} after the start of its frame");
        assert!(latest > Time::from_us(300) && latest < LATEST_PACKET);
    }
}

/// Asserts that the device dropped and reported all missing records, and that the rest is right.
fn assert_exact(bench: &UsbBench, tally: &palpate_wire::loss::Tally, cut: u32) {
    let (missing, dropped) = missing(tally);
    let (samples, strange) = bench.strange_samples();
    println!(
        "missing {missing}, dropped {dropped}, cut {}",
        bench.port.damaged
    );
    assert!(bench.port.damaged <= cut, "{} are cut", bench.port.damaged);
    assert_eq!(missing, dropped);
    assert_eq!(strange, 0, "of {samples}");
    assert!(samples > 200);
}

#[test]
fn a_reader_that_stops_misses_what_the_device_counts() {
    let mut bench = plugged();
    let tally = stopped_reader(&mut bench, Time::from_ms(400));
    assert_exact(&bench, &tally, 0);
    assert!(tally.missing() > 200);
}

#[test]
fn a_closed_port_misses_what_the_device_counts() {
    let mut bench = plugged();
    for _ in 0..4 {
        let tally = bench.close_and_open(Time::from_ms(50));
        assert_exact(&bench, &tally, 1);
        assert!(tally.missing() > 30);
    }
}

/// A packet of a backlog ends within a frame; opening the port again discards the rest of that
/// frame.
#[test]
fn a_port_that_was_closed_within_a_frame_begins_with_its_end() {
    let mut bench = plugged();
    bench.probe.board.usb_mut().set_reading(false);
    bench.run(Time::from_ms(200));
    // The PC reads a few packets of many.
    bench.probe.board.usb_mut().set_reading(true);
    bench.run(Time::from_us(600));
    bench.probe.board.usb_mut().set_reading(false);
    bench.set_open(false);
    bench.run(Time::from_ms(10));
    bench.probe.board.usb_mut().set_reading(true);
    let tally = bench.close_and_open(Time::from_ms(10));
    assert_exact(&bench, &tally, 1);
    assert_eq!(
        bench.port.damaged, 1,
        "the port was closed between two frames"
    );
}

#[test]
fn a_suspended_bus_misses_what_the_device_counts() {
    let mut bench = plugged();
    let tally = bench.suspend_and_resume(Time::from_ms(300));
    assert_exact(&bench, &tally, 0);
    assert!(tally.missing() > 100);
}

#[test]
fn a_cable_that_is_pulled_and_plugged_again_loses_what_the_device_counts() {
    let mut bench = plugged();
    bench.port.begin_account();
    for round in 0..6 {
        let took = replug(&mut bench, Time::from_us(5_000 + 7_310 * round));
        println!("open after {took}");
    }
    bench.run(Time::from_ms(250));
    let tally = bench.port.tally();
    assert_exact(&bench, &tally, 6);
    assert_eq!(bench.probe.board.resets().watchdog, 0);
}

#[test]
fn a_board_that_starts_anew_opens_its_port_by_itself() {
    let mut bench = plugged();
    let mut runs = Vec::new();
    for _ in 0..2 {
        let (took, [before, after]) = reboot(&mut bench);
        println!("{before:08x} {after:08x}: open after {took}");
        runs.extend([before, after]);
    }
    assert_eq!(runs[1], runs[2]);
    assert!(runs[0] != runs[1] && runs[2] != runs[3]);
}

#[test]
fn a_current_ends_when_its_own_link_is_silent_whatever_the_other_one_says() {
    for by in Link::ALL {
        let mut bench = plugged();
        let took = silent_link(&mut bench, by).expect("it ends");
        println!("{by:?}: off after {took}");
        assert!(
            took > Time::from_ms(95) && took < Time::from_ms(103),
            "{took}"
        );
        bench.run(Time::from_ms(5));
        let fault = bench.probe.faults().pop().expect("a fault");
        assert_eq!(fault.code, FaultCode::HostSilent);
    }
}

#[test]
fn rubbish_as_fast_as_a_host_can_send_it_disturbs_nothing() {
    let mut bench = plugged();
    let found = flood(&mut bench, 50_000, 1);
    println!("{found:?}");
    assert_eq!(found.answered, found.commands);
    assert_eq!(
        (found.scans_lost, found.missing, found.restarts),
        (0, (0, 0), 0)
    );
    assert!(found.scans > 50);
}

/// The packets of the commands wait for the instrument's task; ends of frames must be recognised.
#[test]
fn commands_without_a_pause_are_answered_and_hang_nothing() {
    let mut bench = plugged();
    let before = bench.status();
    let end = bench.probe.board.now() + Time::from_ms(1_500);
    let mut asked = 0;
    while bench.probe.board.now() < end {
        while bench.probe.board.usb().unwritten() < 2_000 {
            bench.send(&Command::Identify);
            asked += 1;
        }
        bench.run(Time::from_ms(1));
    }
    let latest = bench.probe.board.usb_latest_bulk();
    println!("{asked} commands; the latest packet was made available at {latest}");
    assert_eq!(bench.probe.board.usb().halted(), []);
    assert!(latest < Time::from_us(800), "{latest}");
    let written = |bench: &mut UsbBench| bench.probe.board.usb().unwritten() == 0;
    bench
        .until(Time::from_ms(2_000), written)
        .expect("all are taken");
    let after = bench.status();
    assert_eq!(after.conversions_lost, before.conversions_lost);
    assert_eq!(bench.probe.board.resets().watchdog, 0);
}

#[test]
fn the_reset_interface_starts_the_boot_loader_and_the_firmware() {
    for (request, value, in_train) in [
        (1, 0, false),
        (1, 0x3301, true),
        (2, 0, false),
        (2, 0, true),
    ] {
        let mut bench = plugged();
        if in_train {
            bench.begin_train();
        }
        let found = ask_for_restart(&mut bench, request, value);
        println!("{request} {value:#06x}, in the train: {in_train}: {found:?}");
        assert_eq!(found.outcome, Some(ControlOutcome::Done(Vec::new())));
        assert_eq!(found.in_boot_loader, request == 1);
        assert!(found.off_first);
        assert_eq!(found.off.is_some(), in_train);
        assert!(found.off.unwrap_or_default() <= Time::from_ms(60));
        assert_eq!(bench.probe.board.current_a(), 0.0);
        if request == 2 {
            bench.until_open(Time::from_ms(800));
            assert!(bench.probe.faults().is_empty());
        }
    }
}

#[test]
fn a_crash_or_a_hang_in_the_interrupt_of_usb_switches_the_bridge_off() {
    let mut snapshot = plugged();
    snapshot.begin_train();
    for (crash, limit, code) in [
        (Crash::HardFault, Time::from_ms(1), FaultCode::HardFault),
        (Crash::Loop, Time::from_ms(60), FaultCode::Watchdog),
    ] {
        let mut bench = snapshot.clone();
        let took = crash
            .in_exception(&mut bench.probe, INTERRUPT)
            .expect("it goes off");
        println!("{code:?}: off after {took}");
        assert!(took <= limit, "{took}");
        assert_eq!(bench.probe.board.resets().watchdog, 1);
        assert!(time_to_off(&mut bench.probe).is_some(), "it stays off");
        assert!(bench.probe.faults().iter().any(|fault| fault.code == code));
        bench.until_open(Time::from_ms(800));
    }
}
