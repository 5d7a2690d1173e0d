//! Tests of the views at usual terminal sizes.

use palpate_wire::code::{Contact, FaultCode, State, TouchVerdict};
use palpate_wire::record::{Conversion, Estimate, Sample, Status};
use palpate_wire::{Frame, Header, Message, Record};

use super::known::Known;
use super::view::View;

fn frame(time_s: f64, message: Record) -> Frame<Record> {
    let header = Header {
        boot_id: 7,
        sequence: 0,
        time_us: (1e6 * time_s) as u64,
        dropped: 0,
    };
    Frame { header, message }
}

fn sample(deformation_m: f32) -> Record {
    let conversion = Conversion {
        channel: 0,
        offset_us: 0,
        word: 0x0123_4567,
        frequency_hz: 3_059_491.7,
        sigma_hz: 1.0,
        deformation_m: Some(deformation_m),
        deformation_sigma_m: Some(0.2e-6),
        extrapolated: false,
    };
    Record::Sample(Sample {
        sensor: 0,
        missed: 0,
        gap: false,
        channels: [conversion].into_iter().collect(),
        contact: Contact::Held,
        force_n: Some(6e3 * deformation_m),
        force_sigma_n: Some(1.2e-3),
        current_a: Some(0.004),
        ripple_a: None,
    })
}

/// A record of the protocol's fixture, with arbitrary values.
pub(crate) fn fixture(kind: &str) -> Record {
    let lines = include_str!("../../../../../firmware/wire/fixture/v2-records.jsonl").lines();
    let mut records = lines.filter_map(|line| {
        let line: serde_json::Value = serde_json::from_str(line).ok()?;
        serde_json::from_value(line.get("message")?.clone()).ok()
    });
    let found = records.find(|record: &Record| record.name() == kind);
    found.unwrap_or_else(|| panic!("no {kind} in the fixture"))
}

/// A board during its second press.
fn known() -> Known {
    let mut known = Known::of("/dev/ttyACM0");
    for ms in (0..20_000).step_by(10) {
        let time_s = f64::from(ms) * 1e-3;
        // Five seconds lifted, five pressed, with rising depth.
        let part = (time_s % 10.0 - 5.0).max(0.0);
        known.take(&frame(time_s, sample((80e-6 * part) as f32)));
    }
    let Record::State(mut change) = fixture("state") else {
        panic!("no state");
    };
    (change.state, change.armed) = (State::Contact, true);
    known.take(&frame(20.0, Record::State(change)));
    let Record::Status(status) = fixture("status") else {
        panic!("no status");
    };
    let status = Status {
        temperature_c: Some(25.3),
        supply_v: Some(11.9),
        processor_load: Some(0.243),
        conversions_lost: 0,
        second_conversions_lost: 0,
        ..status
    };
    known.take(&frame(20.0, Record::Status(status)));
    let Record::Estimate(estimate) = fixture("estimate") else {
        panic!("no estimate");
    };
    let estimate = Estimate {
        stiffness_n_per_m: Some(8402.0),
        lower_n_per_m: 7881.0,
        upper_n_per_m: Some(8998.0),
        force_n: 2.12,
        ..estimate
    };
    known.take(&frame(16.2, Record::Estimate(estimate)));
    known.take(&frame(20.0, sample(400e-6)));
    known.received = 20_000;
    known
}

fn shown(known: &Known, size: (u16, u16), colour: bool) -> String {
    let lines = View::new(size, colour).lines(known);
    assert_eq!(lines.len(), usize::from(size.0) - 1);
    lines.join("\n")
}

#[test]
fn a_view_of_80_by_24() {
    let text = shown(&known(), (24, 80), false);
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
    insta::assert_snapshot!(text);
}

#[test]
fn a_view_of_160_by_50() {
    let text = shown(&known(), (50, 160), false);
    assert!(text.lines().all(|line| line.chars().count() <= 160));
    insta::assert_snapshot!(text);
}

#[test]
fn a_view_with_a_fault_and_losses_in_colour() {
    let mut known = known();
    known.faults.push(FaultCode::SensorSilent);
    known.missing = 12;
    insta::assert_snapshot!(shown(&known, (24, 80), true).replace('\u{1b}', "ESC"));
}

#[test]
fn a_touch_on_an_array_stands_with_its_errors_or_with_what_it_does_not_claim() {
    let mut known = known();
    assert!(!shown(&known, (24, 100), false).contains("radius"));
    let mut touch = fixture("touch");
    known.take(&frame(20.0, touch.clone()));
    let text = shown(&known, (24, 100), false);
    let line = "x 1.200 ± 0.020 mm, y -3.400 ± 0.030 mm, 0.800 ± 0.008 N, radius 2.50 ± 0.12 mm";
    assert!(text.contains(line), "{text}");
    if let Record::Touch(of) = &mut touch {
        (of.verdict, of.x_m) = (TouchVerdict::DoesNotFit, None);
    }
    known.take(&frame(20.0, touch));
    assert!(shown(&known, (24, 100), false).contains("does not fit"));
}

#[test]
fn a_small_terminal_has_no_chart_and_no_line_too_many() {
    let text = shown(&known(), (10, 40), false);
    assert!(!text.contains('█'), "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 40),
        "{text}"
    );
}

#[test]
fn the_cause_of_an_interval_stands_below_its_measurement_alone() {
    let mut known = known();
    known.take(&frame(20.0, fixture("uncertainty_budget")));
    known.take(&frame(20.0, fixture("estimate")));
    assert!(shown(&known, (24, 80), false).contains("temperature, +4.9 K"));
    known.take(&frame(21.0, fixture("refusal")));
    assert!(!shown(&known, (24, 80), false).contains("+4.9 K"));
}

#[test]
fn a_board_that_is_gone_says_so() {
    let mut known = known();
    known.lost("/dev/ttyACM0: the board is gone");
    assert!(shown(&known, (24, 80), false).contains("the board is gone"));
    known.take(&frame(20.0, sample(0.0)));
    assert!(!shown(&known, (24, 80), false).contains("gone"));
}

#[test]
fn what_a_board_said_before_it_started_anew_is_forgotten() {
    let mut known = known();
    known.faults.push(FaultCode::SensorSilent);
    let mut first = frame(0.1, sample(0.0));
    first.header.boot_id += 1;
    known.take(&first);
    assert!(known.faults.is_empty() && known.result.is_none() && known.state.is_none());
    assert_eq!(known.deformation.last(9).count(), 0);
    assert!(known.samples[0].is_some() && known.board == "/dev/ttyACM0");
}

#[test]
fn a_touch_is_seen_once() {
    let mut known = known();
    let Record::State(mut change) = fixture("state") else {
        panic!("no state");
    };
    change.state = State::Contact;
    assert!(!known.take(&frame(21.0, Record::State(change.clone()))));
    change.state = State::Watching;
    assert!(!known.take(&frame(22.0, Record::State(change.clone()))));
    change.state = State::Contact;
    assert!(known.take(&frame(23.0, Record::State(change))));
}
