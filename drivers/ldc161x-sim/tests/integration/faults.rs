//! Faults of the chip, its supply and its clock, and how a test observes each of them.

use crate::common::*;
use embedded_hal::i2c::NoAcknowledgeSource;
use ldc161x_sim::{
    Ack, ChipFault, ExternalClock, FAULT_SLOTS, FaultEvent, FaultState, I2cError, Lost, Path,
    ScheduleFull, Settings, Span, Strike, Time, Trigger,
};

const T0: Time = Time::ZERO;
const ADDRESS_NACK: I2cError = I2cError::NoAcknowledge(NoAcknowledgeSource::Address);

fn rig() -> ChipRig<[f64; 4]> {
    ChipRig::new(quiet(40e6), [3e6; 4])
}

#[test]
fn a_full_brown_out_is_a_power_on_reset() {
    let rig = rig();
    rig.single(1000);
    rig.wait(ms(2));
    let fault = rig.for_time(T0, ChipFault::BrownOut(Lost::Everything));
    assert!(!rig.intb_is_low());
    assert!(!rig.chip.borrow().is_converting());
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK), "it has to wake up");
    rig.wait(ms(2));
    assert_eq!(rig.read(0x08), 0x0080);
    assert_eq!(rig.read(0x1A), 0x2801);
    let state = rig.chip.borrow().fault_state(fault);
    assert!(matches!(state, Some(FaultState::Over { since, until }) if since == until));
}

#[test]
fn a_partial_brown_out_changes_the_chosen_registers_alone() {
    let rig = rig();
    rig.single(1000);
    rig.convert(0, 1);
    let done = rig.chip.borrow().conversions(0);
    // These registers are reset: RCOUNT0, ERROR_CONFIG and DRIVE_CURRENT0.
    let which = 1 << 0x08 | 1 << 0x19 | 1 << 0x1E;
    rig.for_time(T0, ChipFault::BrownOut(Lost::Registers(which)));
    assert_eq!(rig.read(0x08), 0x0080);
    assert_eq!(rig.read(0x19), 0x0000);
    assert_eq!(rig.read(0x1E), 0x0000);
    assert_eq!(rig.read(0x10), 16, "settling is kept");
    assert_eq!(rig.read(0x1A), 0x1601, "and it goes on converting");
    rig.wait(ms(2));
    assert!(rig.chip.borrow().conversions(0) > done);
    // If CONFIG is among the registers that are reset, the chip falls asleep.
    rig.for_time(T0, ChipFault::BrownOut(Lost::Registers(1 << 0x1A)));
    assert!(!rig.chip.borrow().is_converting());
}

#[test]
fn the_supply_can_dip_by_hand() {
    let rig = rig();
    rig.single(1000);
    rig.chip.borrow_mut().brown_out();
    rig.wait(ms(2));
    assert_eq!(rig.read(0x1A), 0x2801);
}

#[test]
fn an_upset_register_stays_upset() {
    let rig = rig();
    rig.single(2500);
    let event = FaultEvent::at(
        ms(3),
        ChipFault::RegisterUpset {
            address: 0x08,
            bits: 0x0400,
        },
        T0,
    );
    rig.schedule(event);
    rig.wait(ms(1));
    assert_eq!(rig.read(0x08), 2500);
    rig.wait(ms(3));
    assert_eq!(rig.read(0x08), 2500 ^ 0x0400);
    // Flipping the sleep bit of CONFIG puts the chip to sleep.
    rig.for_time(
        T0,
        ChipFault::RegisterUpset {
            address: 0x1A,
            bits: 0x2000,
        },
    );
    assert!(!rig.chip.borrow().is_converting());
    // Flipping it again wakes the chip.
    rig.for_time(
        T0,
        ChipFault::RegisterUpset {
            address: 0x1A,
            bits: 0x2000,
        },
    );
    rig.convert(0, 1);
}

#[test]
fn a_stuck_interrupt_line() {
    let rig = rig();
    rig.for_time(ms(1), ChipFault::IntbStuck { low: true });
    assert!(rig.intb_is_low());
    rig.wait(ms(1));
    assert!(!rig.intb_is_low());
    rig.single(1000);
    rig.for_time(ms(5), ChipFault::IntbStuck { low: false });
    rig.convert(0, 1);
    assert!(!rig.intb_is_low());
    assert_eq!(
        rig.chip.borrow().interrupts(),
        1,
        "the chip itself did its part"
    );
    rig.wait(ms(5));
    assert!(rig.intb_is_low());
}

#[test]
fn a_lost_clock_aborts_the_conversion_and_its_return_restarts_it() {
    let rig = rig();
    rig.single(2500);
    rig.convert(0, 1);
    rig.read(0x18);
    rig.wait(us(300));
    rig.for_time(ms(12), ChipFault::ClockLoss);
    let done = rig.chip.borrow().conversions(0);
    rig.wait(ms(11));
    assert_eq!(rig.chip.borrow().conversions(0), done);
    assert_eq!(rig.read(0x18) & 0x0800, 0x0800, "the watchdog notices");
    rig.wait(ms(2));
    rig.convert(0, 1);
    let truth = *rig.chip.borrow().last_conversion(0).expect("a conversion");
    assert!(truth.errors.is_empty() && !truth.spoilt);
    assert_eq!(truth.end - truth.start, ms(1));
}

#[test]
fn a_lost_clkin_does_not_matter_to_the_internal_oscillator() {
    let rig = rig();
    rig.single(2500);
    rig.write(0x1A, 0x3401);
    rig.write(0x1A, 0x1401);
    rig.convert(0, 1);
    let done = rig.chip.borrow().conversions(0);
    rig.for_time(ms(10), ChipFault::ClockLoss);
    rig.wait(ms(5));
    assert!(rig.chip.borrow().conversions(0) >= done + 4);
}

#[test]
fn the_test_can_know_when_a_fault_acts() {
    let rig = rig();
    let event = FaultEvent::at(ms(1), ChipFault::Absent, ms(2));
    let fault = rig.schedule(event);
    let state = || rig.chip.borrow().fault_state(fault);
    assert_eq!(state(), Some(FaultState::Waiting));
    assert!(!rig.chip.borrow().is_disturbed());
    assert_eq!(rig.chip.borrow().next_event(), Some(ms(1)));
    rig.wait(ms(2));
    assert_eq!(state(), Some(FaultState::Active { since: ms(1) }));
    assert!(rig.chip.borrow().is_disturbed());
    rig.wait(ms(2));
    assert_eq!(
        state(),
        Some(FaultState::Over {
            since: ms(1),
            until: ms(3)
        })
    );
    let log = rig.chip.borrow().disturbances();
    assert_eq!((log.begun, log.ended), (1, 1));
    let over = state();
    rig.chip.borrow_mut().clear_faults();
    assert_eq!(state(), over, "what is over is remembered");
}

#[test]
fn faults_last_until_cleared() {
    let rig = rig();
    rig.schedule(FaultEvent::from(ms(1), ChipFault::Absent));
    rig.schedule(FaultEvent::from(ms(900), ChipFault::Absent));
    rig.schedule(FaultEvent {
        trigger: Trigger::At(T0),
        span: Span::Forever,
        fault: ChipFault::ClockLoss,
    });
    rig.wait(ms(500));
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
    rig.chip.borrow_mut().clear_faults();
    assert!(!rig.chip.borrow().is_disturbed());
    rig.wait(ms(500));
    assert_eq!(rig.read(0x7E), 0x5449, "what waited is forgotten too");
}

#[test]
fn the_schedule_is_bounded_and_reuses_what_is_over() {
    let rig = rig();
    let far = FaultEvent::from(ms(1_000), ChipFault::Absent);
    for _ in 0..FAULT_SLOTS {
        rig.schedule(far);
    }
    assert_eq!(rig.chip.borrow_mut().schedule(far), Err(ScheduleFull));
    rig.chip.borrow_mut().clear_faults();
    let first = rig.schedule(FaultEvent::at(rig.now(), ChipFault::Absent, us(1)));
    rig.wait(us(10));
    for _ in 0..FAULT_SLOTS {
        rig.schedule(FaultEvent::at(rig.now(), ChipFault::Absent, us(1)));
        rig.wait(us(10));
    }
    assert_eq!(
        rig.chip.borrow().fault_state(first),
        None,
        "its slot was needed"
    );
    assert_eq!(
        rig.chip.borrow().disturbances().ended,
        FAULT_SLOTS as u64 + 1
    );
}

#[test]
fn faults_draw_nothing_from_the_noise() {
    let words = |with_fault: bool| {
        let rig = ChipRig::new(Settings::default(), [3e6; 4]);
        if with_fault {
            let strike = Strike::Probability(0.5);
            let fault = ChipFault::BitFlip {
                path: Path::ReadData,
                strike,
            };
            rig.schedule(FaultEvent::from(ms(5), fault));
        }
        rig.single(500);
        (0..50)
            .map(|_| {
                rig.convert(0, 1);
                rig.frame(0);
                let chip = rig.chip.borrow();
                chip.last_conversion(0).expect("a conversion").word
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(words(false), words(true));
}

#[test]
fn a_dip_amid_a_transaction_leaves_it_one_transaction() {
    let rig = rig();
    rig.in_next(1, ChipFault::IntbStuck { low: true });
    let mut chip = rig.chip.borrow_mut();
    chip.start(T0, ADDRESS << 1);
    chip.brown_out();
    assert_eq!(chip.write(T0, 0x7E), Ack::Nack, "not addressed any more");
    assert_eq!(chip.start(ms(3), ADDRESS << 1), Ack::Ack);
    assert!(chip.is_disturbed());
    chip.stop(ms(3));
    assert!(!chip.is_disturbed());
    assert_eq!(chip.traffic().transactions, 1);
}

#[test]
fn a_late_fault_begins_at_once() {
    let rig = rig();
    rig.wait(ms(5));
    let event = FaultEvent::at(ms(1), ChipFault::Absent, ms(1));
    let fault = rig.chip.borrow_mut().schedule(event).expect("a free slot");
    assert_eq!(
        rig.chip.borrow().fault_state(fault),
        Some(FaultState::Active { since: ms(5) })
    );
}

#[cfg(feature = "serde")]
#[test]
fn settings_and_faults_can_be_written_down() {
    let settings = Settings {
        seed: 5,
        ..Settings::ideal()
    };
    let text = serde_json::to_string(&settings).expect("text");
    assert_eq!(
        serde_json::from_str::<Settings>(&text).expect("settings"),
        settings
    );
    let partial: Settings = serde_json::from_str(r#"{"seed": 9}"#).expect("the rest is default");
    assert_eq!(
        partial,
        Settings {
            seed: 9,
            ..Settings::default()
        }
    );
    let event = FaultEvent::at(ms(1), ChipFault::Nack { after_bytes: 2 }, ms(2));
    let text = serde_json::to_string(&event).expect("text");
    assert_eq!(
        serde_json::from_str::<FaultEvent>(&text).expect("an event"),
        event
    );
}

#[test]
fn another_clock_at_clkin_is_counted_with_from_then_on() {
    let rig = rig();
    rig.single(2_500);
    rig.convert(0, 1);
    let word = || rig.chip.borrow().last_conversion(0).unwrap().word;
    let at_40_mhz = f64::from(word());
    let slower = Some(ExternalClock::exact(20e6));
    rig.chip.borrow_mut().set_external_clock(slower);
    rig.convert(0, 1);
    let ratio = f64::from(word()) / at_40_mhz;
    assert!((ratio - 2.0).abs() < 1e-3, "{ratio}");
    rig.chip.borrow_mut().set_external_clock(None);
    let before = rig.chip.borrow().conversions(0);
    let later = rig.chip.borrow().now() + ms(4);
    rig.chip.borrow_mut().advance_to(later);
    assert_eq!(rig.chip.borrow().conversions(0), before);
}
