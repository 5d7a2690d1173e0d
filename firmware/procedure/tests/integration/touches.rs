//! Presses on an array of coils.

use crate::support::calibration::{array, array_numbers, calibration, contact, settings};
use crate::support::{BOOT, Rig, board};
use ldc161x::{Channel, Reading, Word};
use palpate_model::touch::{BASE, BENT, BY_RADIUS, Coefficients, Profile};
use palpate_model::units::{Metre, Newton};
use palpate_procedure::event::Conversion;
use palpate_procedure::storage::{StorageOrder, StorageReport, Stored};
use palpate_procedure::{Action, Duration, Event, Scan};
use palpate_wire::Command;
use palpate_wire::code::{RefusalReason, State, StorageState, TouchVerdict};
use palpate_wire::command::Settings;
use palpate_wire::record::{Estimate, Refusal, Touch};

/// Code of an untouched coil.
const AT_REST: f64 = 24_637_172.0;

fn of_the_array() -> Settings {
    settings(|of| {
        of.channels = 0b1111;
        of.rate_hz = 250.0;
    })
}

fn rig() -> Rig {
    let mut rig = Rig::started();
    set_up(&mut rig);
    rig
}

fn set_up(rig: &mut Rig) {
    rig.accepted(Command::SetSettings(of_the_array()));
    let commands = array(&array_numbers());
    commands.into_iter().for_each(|of| rig.accepted(of));
}

/// Relative changes of the coils' inductances by a press of a pin of 2 mm.
fn pressed(x: f32, y: f32, force_n: f32) -> [f64; 4] {
    let numbers = array_numbers();
    let table = |from: usize, count: usize| &numbers[from..from + count];
    let profile = Profile::new(Coefficients {
        spacing: Metre(numbers[13]),
        least_radius: Metre(numbers[14]),
        greatest_radius: Metre(numbers[15]),
        greatest_force: Newton(numbers[16]),
        base: table(17, BASE).try_into().unwrap(),
        linear: table(17 + BASE, BY_RADIUS).try_into().unwrap(),
        quadratic: table(17 + BASE + BY_RADIUS, BY_RADIUS).try_into().unwrap(),
        bent: [0, 1, 2].map(|of| table(36 + of * BENT, BENT).try_into().unwrap()),
    });
    let profile = profile.unwrap();
    core::array::from_fn(|coil| {
        let [coil_x, coil_y] = [numbers[48 + 4 * coil], numbers[49 + 4 * coil]];
        let distance = Metre((x - coil_x).hypot(y - coil_y));
        f64::from(profile.reading(force_n, distance, Metre(2e-3)))
    })
}

/// Conversions of four channels with these changes of inductance.
fn read(scan: &mut Scan, sensor: u8, changes: [f64; 4]) {
    scan.sensor = sensor;
    let conversion = |(channel, change): (&Channel, f64)| {
        let code = (AT_REST / (1.0 + change).sqrt()) as u32;
        let reading = Reading {
            channel: *channel,
            word: Word::from_registers((code >> 16) as u16, code as u16),
            frequency_hz: 3e6,
            ..Reading::default()
        };
        Conversion {
            reading,
            offset: Duration::from_ticks(0),
        }
    };
    let conversions = Channel::ALL.iter().zip(changes).map(conversion);
    scan.conversions = conversions.collect();
}

/// Result of one scan with these changes.
fn touch(rig: &mut Rig, changes: [f64; 4]) -> Touch {
    rig.records.clear();
    rig.convert_with(|scan| read(scan, 0, changes));
    rig.last()
}

/// Learns the untouched sensor: half a second.
fn rested(rig: &mut Rig) {
    for _ in 0..125 {
        assert_eq!(touch(rig, [0.0; 4]).verdict, TouchVerdict::Settling);
    }
    assert_eq!(touch(rig, [0.0; 4]).verdict, TouchVerdict::Clear);
}

#[test]
fn a_press_is_found_after_rest_and_its_rest_stays_for_as_long_as_it_lasts() {
    let mut rig = rig();
    rested(&mut rig);
    let places = [[1e-3, 5e-4], [1.1e-3, 5e-4], [-2e-3, 1e-3]];
    for [x, y] in places {
        for scan in 0..200 {
            let found = touch(&mut rig, pressed(x, y, 0.8));
            // A place that is far from the last one is found within six scans.
            if scan < 6 && found.verdict == TouchVerdict::NotConverged {
                continue;
            }
            assert_eq!(found.verdict, TouchVerdict::Inside, "{found:?}");
            let off = (found.x_m.unwrap() - x).hypot(found.y_m.unwrap() - y);
            assert!(off < 2e-5, "{found:?}");
            assert!((found.force_n.unwrap() - 0.8).abs() < 5e-3, "{found:?}");
            // The uncertainty includes 2 um, which the array states as common to all places.
            assert!(found.x_sigma_m.unwrap() > 2e-3 * 1e-3, "{found:?}");
        }
    }
    assert_eq!(touch(&mut rig, [0.0; 4]).verdict, TouchVerdict::Clear);
    let outside = (0..6).map(|_| touch(&mut rig, pressed(5e-3, 0.0, 0.8)));
    let outside = outside.last().unwrap();
    assert_eq!(
        (outside.verdict, outside.x_m),
        (TouchVerdict::BeyondArray, None)
    );
}

#[test]
fn what_is_below_rest_or_flagged_is_no_touch_and_slow_drift_is_rest() {
    let mut rig = rig();
    rested(&mut rig);
    let below = touch(&mut rig, [0.0, -1e-3, 0.0, 0.0]);
    assert_eq!(below.verdict, TouchVerdict::BelowRest);
    rig.records.clear();
    rig.convert_with(|scan| {
        read(scan, 0, [0.0; 4]);
        scan.conversions[2].reading.word = Word::from_registers(0x1177, 1);
    });
    let flagged: Touch = rig.last();
    assert_eq!(flagged.verdict, TouchVerdict::NotReadable);
    // The drift is twenty thresholds in 40 s.
    for scan in 0..10_000 {
        let drift = touch(&mut rig, [1e-7 * f64::from(scan); 4]);
        assert_eq!(drift.verdict, TouchVerdict::Clear, "{scan}");
    }
    rig.accepted(Command::SetSettings(of_the_array()));
    rested(&mut rig);
}

/// Coils on channels 2 and 3 of both converters: a result for each pair of scans.
#[test]
fn the_scans_of_two_converters_make_one_result() {
    let mut two = board();
    two.channels = [0b1111, 0b1111];
    let mut rig = Rig::started_as(two);
    rig.accepted(Command::SetSettings(of_the_array()));
    let mut numbers = array_numbers();
    numbers[0] = 12.0 + 16.0 * 12.0;
    array(&numbers).into_iter().for_each(|of| rig.accepted(of));
    let mut pair = |[first, second, third, fourth]: [f64; 4]| {
        rig.records.clear();
        rig.convert_with(|scan| read(scan, 0, [0.0, 0.0, first, second]));
        assert_eq!(rig.all::<Touch>(), []);
        rig.convert_with(|scan| read(scan, 1, [0.0, 0.0, third, fourth]));
        rig.last::<Touch>()
    };
    for _ in 0..125 {
        assert_eq!(pair([0.0; 4]).verdict, TouchVerdict::Settling);
    }
    let found = (0..6)
        .map(|_| pair(pressed(1e-3, 5e-4, 0.8)))
        .last()
        .unwrap();
    assert_eq!(found.verdict, TouchVerdict::Inside);
    assert!((found.x_m.unwrap() - 1e-3).abs() < 2e-5, "{found:?}");
}

/// A sensor with a whole calibration, whose array is on the second converter.
struct Both {
    rig: Rig,
    /// Relative changes of the coils' inductances.
    changes: [f64; 4],
}

impl Both {
    /// Armed, with the untouched sensor learnt.
    fn armed(tolerance: Option<Command>) -> Self {
        let mut board = board();
        board.channels = [0b1111, 0b1111];
        let mut rig = Rig::started_as(board);
        rig.temperature(25.0);
        rig.accepted(Command::SetSettings(settings(|_| {})));
        let mut numbers = array_numbers();
        numbers[0] = 240.0;
        let all = calibration(&rig.sensor.clone()).into_iter();
        all.chain(tolerance)
            .chain(array(&numbers))
            .for_each(|of| rig.accepted(of));
        rig.accepted(Command::Arm);
        let changes = [0.0; 4];
        let mut both = Self { rig, changes };
        both.scan(1_500);
        assert_eq!(both.rig.state(), State::Watching);
        both
    }

    /// Pairs of scans of both converters.
    fn scan(&mut self, pairs: usize) {
        for _ in 0..pairs {
            self.rig.convert();
            self.rig.convert_with(|scan| read(scan, 1, self.changes));
        }
    }

    /// Presses at a place and measures; returns the refusals and the number of estimates.
    fn measured(&mut self, [x, y]: [f32; 2]) -> (Vec<Refusal>, usize) {
        self.measured_by(pressed(x, y, 0.8))
    }

    /// As [`measured`](Self::measured), with these changes of the coils' inductances.
    fn measured_by(&mut self, changes: [f64; 4]) -> (Vec<Refusal>, usize) {
        self.rig.records.clear();
        self.changes = changes;
        self.rig.sensor.press(3e-4);
        self.scan(200);
        self.rig.accepted(Command::Measure);
        self.scan(3_000);
        let found = (self.rig.refusals(), self.rig.all::<Estimate>().len());
        self.changes = [0.0; 4];
        self.rig.sensor.depth_m = 0.0;
        self.scan(1_500);
        found
    }
}

#[test]
fn stiffness_is_refused_off_the_centre_by_more_than_the_stated_tolerance() {
    // The tolerance is 1 mm.
    let mut both = Both::armed(Some(contact(4e-3, 2e-6)));
    assert_eq!(both.measured([0.5e-3, -0.6e-3]), (vec![], 1));
    for (place, distance_m) in [([1.2e-3, 0.9e-3], 1.5e-3), ([-5e-3, 0.0], 5e-3)] {
        let (refusals, estimates) = both.measured(place);
        let [refusal] = refusals.as_slice() else {
            panic!("{refusals:?}");
        };
        assert_eq!((refusal.reason, estimates), (RefusalReason::OffCentre, 0));
        assert!(
            (refusal.value.unwrap() - distance_m).abs() < 5e-5,
            "{refusal:?}"
        );
        assert_eq!(refusal.limit, Some(1e-3));
    }
    // That press and its place are over. The readings of the next press give no place.
    let [most, ..] = pressed(0.0, 0.0, 0.8);
    assert_eq!(both.measured_by([most; 4]), (vec![], 1));
    // The next press is in the centre.
    assert_eq!(both.measured([0.0, 0.2e-3]), (vec![], 1));
    let mut without = Both::armed(None);
    assert_eq!(without.measured([1.2e-3, 0.9e-3]), (vec![], 1));
}

/// The estimate runs from flash, which cannot be read while it is erased.
#[test]
fn nothing_is_estimated_while_the_storage_works() {
    let mut stored = board();
    stored.storage = true;
    let mut rig = Rig::started_as(stored);
    rig.wait(1_000);
    rig.step(&Event::Storage(&StorageReport::Done {
        failure: None,
        stored: Stored {
            state: StorageState::Empty,
            ..Stored::UNAVAILABLE
        },
    }));
    set_up(&mut rig);
    rested(&mut rig);
    let actions = rig.command(Command::Store, BOOT);
    assert!(actions.contains(&Action::Storage(StorageOrder::Begin)));
    rig.records.clear();
    rig.convert_with(|scan| read(scan, 0, pressed(0.0, 0.0, 0.8)));
    assert_eq!(rig.all::<Touch>(), []);
}
