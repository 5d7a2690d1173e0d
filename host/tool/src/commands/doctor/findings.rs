//! Findings from the data that a board reports.

use palpate_cli::finding::Finding;
use palpate_wire::code::{Chip, Contact, FaultCode, ResetCause, StorageState};
use palpate_wire::record::{Fault, Hello, Sample, Storage};
use palpate_wire::{MINOR_VERSION, SCHEMA_HASH, VERSION};

use super::examination::{Examination, LISTEN_S, Losses};
use crate::commands::faults::meaning;

/// Smallest supply of the coil, V: `DRIVE_LIMITS` of the firmware (firmware/node/src/board.rs).
const LEAST_SUPPLY_V: f32 = 4.5;

/// All findings, the one to fix first at the front.
pub(super) fn of(found: &Examination) -> Vec<Finding> {
    let mut findings = Vec::new();
    findings.extend(of_version(&found.hello));
    findings.extend(of_start(found));
    findings.extend(of_converters(&found.hello));
    findings.extend(found.faults.iter().map(of_fault));
    findings.extend(found.ended().map(of_flapping_fault));
    if found.stands && found.faults.is_empty() {
        findings.push(earlier_fault());
    }
    findings.extend(of_supply(found));
    findings.extend(found.storage.iter().filter_map(of_storage));
    findings.extend(of_calibration(found));
    findings.extend(found.sample.as_ref().and_then(of_contact));
    findings.extend(of_losses(found.losses));
    let damaged = found.status.as_ref().map_or(0, |of| of.commands_damaged);
    if damaged > 0 {
        findings.push(Finding::new(
            "commands_damaged",
            format!("{damaged} commands arrived damaged since the board started"),
            "Use a shorter cable, and no hub",
        ));
    }
    findings
}

fn of_version(hello: &Hello) -> Option<Finding> {
    if hello.schema_hash == SCHEMA_HASH {
        return None;
    }
    let action =
        "Flash the image that belongs to this tool, or use the tool that belongs to the firmware";
    if hello.minor_version != MINOR_VERSION {
        let cause = format!(
            "the firmware has version {VERSION}.{} of the protocol, and this tool \
             {VERSION}.{MINOR_VERSION}: what only one of them has does not work",
            hello.minor_version
        );
        return Some(Finding::new("other_minor_version", cause, action));
    }
    let cause = format!(
        "firmware and tool have the same version of the protocol and were built from different sources \
         (schema hash {:08x}, tool's {SCHEMA_HASH:08x})",
        hello.schema_hash
    );
    Some(Finding::new("other_sources", cause, action))
}

fn of_start(found: &Examination) -> Option<Finding> {
    let cause = found.hello.reset_cause;
    if !matches!(
        cause,
        ResetCause::Watchdog
            | ResetCause::Panic
            | ResetCause::HardFault
            | ResetCause::Unexplained
            | ResetCause::Unknown(_)
    ) {
        return None;
    }
    let place = found.crash.as_ref().map_or_else(String::new, |crash| {
        format!(" (at {}, line {})", crash.file, crash.line)
    });
    Some(Finding::new(
        "crashed",
        format!(
            "the last run of the firmware ended with {cause}{place}: {}",
            cause.meaning().trim()
        ),
        "Keep this output and report it; the next start without a crash ends this",
    ))
}

fn of_converters(hello: &Hello) -> Vec<Finding> {
    let converters = [("first", hello.chip), ("second", hello.second_chip)];
    let findings = converters
        .into_iter()
        .filter_map(|(which, chip)| of_converter(which, chip));
    findings.collect()
}

/// Finding for one of the converters. The second converter may be absent.
fn of_converter(which: &str, chip: Chip) -> Option<Finding> {
    match chip {
        Chip::Ldc161x => None,
        Chip::Absent if which == "second" => None,
        Chip::Absent => Some(Finding::new(
            "converter_absent",
            "no converter answers at the first address",
            "Check the converter's supply, SDA and SCL, and that ADDR is low; then restart the board",
        )),
        Chip::Ldc131x => Some(Finding::new(
            "converter_unsupported",
            format!("the {which} converter is an LDC1312 or LDC1314, of 12 bits"),
            "Fit an LDC1612 or LDC1614",
        )),
        Chip::Foreign | Chip::Unknown(_) => Some(Finding::new(
            "converter_foreign",
            format!("the chip at the {which} converter's address is not an LDC161x"),
            "Check which part is fitted, and that nothing else on the bus has this address",
        )),
    }
}

fn of_fault(fault: &Fault) -> Finding {
    let number = |of: Option<f32>| of.map_or_else(|| "not given".to_owned(), |of| of.to_string());
    Finding::new(
        "fault",
        format!(
            "{} ({}) at {}: {} Value {}, limit {}",
            fault.code,
            fault.code.number(),
            fault.location,
            meaning(fault.code),
            number(fault.value),
            number(fault.limit)
        ),
        format!(
            "See docs/faults.md, {}. Once its cause has gone, `palpate doctor --clear` clears it",
            fault.code
        ),
    )
}

fn of_flapping_fault((fault, times): &(Fault, u32)) -> Finding {
    Finding::new(
        "fault_flaps",
        format!(
            "{} ({}) at {} came and went within {LISTEN_S} s ({times} times): {}",
            fault.code,
            fault.code.number(),
            fault.location,
            meaning(fault.code),
        ),
        format!(
            "See docs/faults.md, {}: its cause comes and goes, like a loose contact",
            fault.code
        ),
    )
}

fn earlier_fault() -> Finding {
    Finding::new(
        "earlier_fault",
        "a fault is active that began before this program connected; its code is unknown",
        "`palpate doctor --clear` clears it, names it, and says whether it comes again",
    )
}

fn of_supply(found: &Examination) -> Option<Finding> {
    let supply_v = found.status.as_ref()?.supply_v?;
    (supply_v < LEAST_SUPPLY_V).then(|| {
        Finding::new(
            "supply_missing",
            format!(
                "the coil's supply has {supply_v:.1} V, and {LEAST_SUPPLY_V} V at least are needed"
            ),
            "Switch the supply of the bridge on, and check its wires. Without it the board senses, and \
             measures no stiffness",
        )
    })
}

fn of_storage(storage: &Storage) -> Option<Finding> {
    let differs = storage.stored_crc != storage.in_force_crc;
    match storage.state {
        StorageState::Damaged => Some(Finding::new(
            "storage_damaged",
            meaning(FaultCode::StorageDamaged),
            "`palpate settings import FILE --store` restores an export; without one calibrate again, \
             with `palpate calibrate sensor`",
        )),
        StorageState::Newer => Some(Finding::new(
            "storage_newer",
            "a later firmware has stored the configuration, and this one cannot read it",
            "Flash the later firmware again, or erase the stored configuration: `palpate settings \
             erase`",
        )),
        StorageState::Unavailable | StorageState::Unknown(_) => Some(Finding::new(
            "storage_unavailable",
            "the board's flash memory did not answer, so nothing can be stored",
            "Restart the board; if the fault remains, replace the board",
        )),
        StorageState::Whole if storage.refused_items > 0 => Some(Finding::new(
            "stored_refused",
            format!(
                "{} of {} stored items are beyond this board's limits, and not active",
                storage.refused_items, storage.items
            ),
            "Compare `palpate settings get` with what you need, set it, and store: `palpate settings store`",
        )),
        StorageState::Whole if storage.unknown_items > 0 => Some(Finding::new(
            "stored_unknown",
            format!(
                "{} of {} stored items are of another version of the firmware, and not active",
                storage.unknown_items, storage.items
            ),
            "Flash the firmware that stored them, or store again: `palpate settings store`",
        )),
        StorageState::Whole | StorageState::Empty if differs => Some(Finding::new(
            "not_stored",
            "the active configuration is not the stored one, and is lost at power-off",
            "Store it with `palpate settings store`, or restart the board to discard it",
        )),
        StorageState::Whole | StorageState::Empty => None,
    }
}

fn of_calibration(found: &Examination) -> Option<Finding> {
    if found.missing.is_empty() {
        return None;
    }
    let missing: Vec<_> = found.missing.iter().map(ToString::to_string).collect();
    Some(Finding::new(
        "not_calibrated",
        format!(
            "the board cannot measure a stiffness without {}",
            missing.join(", ")
        ),
        "Calibrate it with `palpate calibrate sensor`, or restore an export with `palpate settings \
         import`",
    ))
}

/// Finding for a contact. The baseline takes half a second, so a contact that still settles after
/// two seconds means a sensor that reads below the rest of its calibration.
fn of_contact(sample: &Sample) -> Option<Finding> {
    let channel = sample.channels.first()?;
    let deformation_m = channel.deformation_m?;
    match sample.contact {
        Contact::Began | Contact::Held => Some(Finding::new(
            "touched",
            format!(
                "something touches the sensor, by {:.0} µm, or its rest position has moved since the \
                 calibration",
                deformation_m * 1e6
            ),
            "Lift the object off the sensor. If there is none, calibrate it with `palpate calibrate \
             sensor`",
        )),
        Contact::Settling => Some(Finding::new(
            "rest_moved",
            format!(
                "the untouched sensor reads another frequency than at its calibration, {:.1} Hz, so \
                 deformations have no valid zero",
                channel.frequency_hz
            ),
            "Check that no metal is near the sensor, and that it is mounted as on the bench; then \
             calibrate it with `palpate calibrate sensor`",
        )),
        _ => None,
    }
}

fn of_losses(losses: Losses) -> Option<Finding> {
    let Losses {
        missing,
        dropped,
        unreadable,
    } = losses;
    if missing == 0 && unreadable == 0 {
        return None;
    }
    let cause = format!(
        "{missing} records are missing, of which the board dropped {dropped}; {unreadable} arrived \
         damaged or are of an unknown kind"
    );
    let action = if dropped > 0 {
        "Send less: a greater `decimation`, fewer channels or a lower `rate_hz` with `palpate settings set`. \
         Close programs that load this computer"
    } else {
        "Use a shorter cable, and no hub"
    };
    Some(Finding::new("losses", cause, action))
}

#[cfg(test)]
mod tests {
    use palpate_wire::code::{Board, Location, Part, StorageAction};
    use palpate_wire::record::{Conversion, Status};

    use super::*;

    /// A board without any finding.
    fn sound() -> Examination {
        Examination {
            hello: Hello {
                minor_version: MINOR_VERSION,
                schema_hash: SCHEMA_HASH,
                firmware_major: 0,
                firmware_minor: 1,
                firmware_patch: 0,
                commit: 0,
                dirty: false,
                simulated: false,
                board: Board::Pico,
                unit: 1,
                reset_cause: ResetCause::PowerOn,
                chip: Chip::Ldc161x,
                second_chip: Chip::Absent,
                configuration_crc: 5,
            },
            status: Some(Status {
                conversions: 1,
                conversions_lost: 0,
                conversions_flagged: 0,
                second_conversions: 0,
                second_conversions_lost: 0,
                second_conversions_flagged: 0,
                bus_errors: 0,
                recoveries: 0,
                logs_dropped: 0,
                commands_damaged: 0,
                commands_refused: 0,
                measurements: 0,
                refusals: 0,
                temperature_c: None,
                supply_v: Some(12.0),
                processor_load: None,
                stack_bytes: 0,
            }),
            storage: Some(Storage {
                action: StorageAction::Inspect,
                succeeded: true,
                state: StorageState::Whole,
                generation: 1,
                stored_crc: 5,
                in_force_crc: 5,
                items: 9,
                unknown_items: 0,
                refused_items: 0,
                calibration_id: None,
                calibrated_at_s: None,
                calibrated_at_c: None,
                calibration_hash: None,
                took_s: 0.0,
            }),
            crash: None,
            faults: Vec::new(),
            begun: Vec::new(),
            stands: false,
            missing: Vec::new(),
            sample: None,
            losses: Losses::default(),
        }
    }

    /// Names of the findings of a board with a defect.
    fn names(spoil: impl FnOnce(&mut Examination)) -> Vec<&'static str> {
        let mut found = sound();
        spoil(&mut found);
        let findings = of(&found);
        for finding in &findings {
            assert!(!finding.cause.is_empty() && !finding.action.is_empty());
        }
        findings.iter().map(|finding| finding.finding).collect()
    }

    fn storage(found: &mut Examination) -> &mut Storage {
        found.storage.as_mut().unwrap()
    }

    #[test]
    fn of_a_sound_board_nothing_is_found() {
        assert_eq!(names(|_| ()), [""; 0]);
        // Without a bridge there is no supply to measure.
        let bare = names(|found| found.status.as_mut().unwrap().supply_v = None);
        assert_eq!(bare, [""; 0]);
    }

    #[test]
    fn each_converter_that_cannot_be_used_is_a_finding() {
        let first = |chip| names(|found| found.hello.chip = chip);
        assert_eq!(first(Chip::Absent), ["converter_absent"]);
        assert_eq!(first(Chip::Ldc131x), ["converter_unsupported"]);
        assert_eq!(first(Chip::Foreign), ["converter_foreign"]);
        let second = |chip| names(|found| found.hello.second_chip = chip);
        assert_eq!(second(Chip::Ldc161x), [""; 0]);
        assert_eq!(second(Chip::Ldc131x), ["converter_unsupported"]);
    }

    #[test]
    fn a_fault_is_a_finding_with_its_meaning_and_an_earlier_one_without() {
        let fault = Fault {
            code: FaultCode::SensorNotOscillating,
            location: Location::Sensor,
            active: true,
            value: Some(0.0),
            limit: None,
        };
        let mut found = sound();
        found.stands = true;
        assert_eq!(of(&found)[0].finding, "earlier_fault");
        found.faults.push(fault);
        let findings = of(&found);
        assert_eq!(findings.len(), 1);
        assert_eq!(findings[0].finding, "fault");
        let cause = &findings[0].cause;
        assert!(
            cause.contains("sensor_not_oscillating (12)") && cause.contains("does not oscillate"),
            "{cause}"
        );
    }

    #[test]
    fn a_fault_that_came_and_went_is_a_finding_and_one_that_stands_is_the_fault_alone() {
        let fault = Fault {
            code: FaultCode::Clock,
            location: Location::Sensor,
            active: true,
            value: None,
            limit: None,
        };
        let mut found = sound();
        found.begun.push((fault.clone(), 28));
        let findings = of(&found);
        assert_eq!(findings.len(), 1);
        assert_eq!(findings[0].finding, "fault_flaps");
        let cause = &findings[0].cause;
        assert!(
            cause.contains("clock") && cause.contains("28 times"),
            "{cause}"
        );
        found.faults.push(fault);
        let findings: Vec<_> = of(&found).iter().map(|of| of.finding).collect();
        assert_eq!(findings, ["fault"]);
    }

    #[test]
    fn each_state_of_the_storage_that_is_not_right_is_a_finding() {
        let state = |state| names(|found| storage(found).state = state);
        assert_eq!(state(StorageState::Damaged), ["storage_damaged"]);
        assert_eq!(state(StorageState::Newer), ["storage_newer"]);
        assert_eq!(state(StorageState::Unavailable), ["storage_unavailable"]);
        assert_eq!(
            names(|of| storage(of).refused_items = 1),
            ["stored_refused"]
        );
        assert_eq!(
            names(|of| storage(of).unknown_items = 1),
            ["stored_unknown"]
        );
        assert_eq!(names(|of| storage(of).in_force_crc = 6), ["not_stored"]);
    }

    #[test]
    fn versions_starts_supply_calibration_and_losses_are_findings() {
        assert_eq!(names(|of| of.hello.schema_hash ^= 1), ["other_sources"]);
        let minor = names(|of| {
            of.hello.schema_hash ^= 1;
            of.hello.minor_version += 1;
        });
        assert_eq!(minor, ["other_minor_version"]);
        let crashed = names(|of| of.hello.reset_cause = ResetCause::HardFault);
        assert_eq!(crashed, ["crashed"]);
        let supply = names(|of| of.status.as_mut().unwrap().supply_v = Some(0.1));
        assert_eq!(supply, ["supply_missing"]);
        assert_eq!(names(|of| of.missing.push(Part::Coil)), ["not_calibrated"]);
        assert_eq!(names(|of| of.losses.unreadable = 1), ["losses"]);
        let contact = |contact| {
            names(|of| {
                of.sample = Some(Sample {
                    sensor: 0,
                    missed: 0,
                    gap: false,
                    channels: [Conversion {
                        channel: 0,
                        offset_us: 0,
                        word: 0,
                        frequency_hz: 3e6,
                        sigma_hz: 0.1,
                        deformation_m: Some(2e-5),
                        deformation_sigma_m: None,
                        extrapolated: false,
                    }]
                    .into_iter()
                    .collect(),
                    contact,
                    force_n: None,
                    force_sigma_n: None,
                    current_a: None,
                    ripple_a: None,
                });
            })
        };
        assert_eq!(contact(Contact::Held), ["touched"]);
        assert_eq!(contact(Contact::Settling), ["rest_moved"]);
        assert!(contact(Contact::Clear).is_empty());
        let damaged = names(|of| of.status.as_mut().unwrap().commands_damaged = 2);
        assert_eq!(damaged, ["commands_damaged"]);
    }

    #[test]
    fn who_dropped_records_decides_what_is_to_be_done() {
        let losses = |dropped| Losses {
            missing: 3,
            dropped,
            unreadable: 0,
        };
        assert!(of_losses(losses(3)).unwrap().action.contains("decimation"));
        assert!(of_losses(losses(0)).unwrap().action.contains("cable"));
    }
}
