//! Faults of the wires, the chip, its supply and its clock: effects on the bus, and ends.

use crate::common::*;
use embedded_hal::i2c::{Error, ErrorKind, I2c, NoAcknowledgeSource, Operation};
use ldc161x_sim::{ChipFault, ExternalClock, FaultEvent, I2cError, Lost, Path, Strike, Time};

const T0: Time = Time::ZERO;
const ADDRESS_NACK: I2cError = I2cError::NoAcknowledge(NoAcknowledgeSource::Address);
const DATA_NACK: I2cError = I2cError::NoAcknowledge(NoAcknowledgeSource::Data);

fn rig() -> ChipRig<[f64; 4]> {
    ChipRig::new(quiet(40e6), [3e6; 4])
}

// ---- the wires ----

#[test]
fn nack_after_each_number_of_bytes() {
    // A register write consists of address, pointer, high byte and low byte.
    for after_bytes in 0..4 {
        let rig = rig();
        rig.in_next(2, ChipFault::Nack { after_bytes });
        let expected = if after_bytes == 0 {
            ADDRESS_NACK
        } else {
            DATA_NACK
        };
        for _ in 0..2 {
            assert_eq!(rig.try_write(0x08, 0x1234), Err(expected), "{after_bytes}");
            assert_eq!(rig.chip.borrow().register(0x08), 0x0080);
        }
        assert_eq!(rig.try_write(0x08, 0x1234), Ok(()), "two transactions only");
        assert_eq!(rig.read(0x08), 0x1234);
        // A byte that the chip refuses is no early termination by the master.
        assert_eq!(rig.chip.borrow().misuse(), Default::default());
    }
    // S a p S a d d S a (START, address, pointer, data): the sixth byte, the third address, is refused.
    let rig = rig();
    rig.in_next(1, ChipFault::Nack { after_bytes: 5 });
    let (mut high, mut low) = ([0; 2], [0; 2]);
    let mut operations = [
        Operation::Write(&[0x7E]),
        Operation::Read(&mut high),
        Operation::Write(&[0x7F]),
        Operation::Read(&mut low),
    ];
    let outcome = rig.bus().transaction(ADDRESS, &mut operations);
    assert_eq!((outcome, high), (Err(ADDRESS_NACK), [0x54, 0x49]));
    assert_eq!(rig.read(0x7F), 0x3055, "one transaction from START to STOP");
}

#[test]
fn lines_that_are_held_block_until_the_deadline_or_delay() {
    let sda = ChipFault::SdaStuck { clocks: None };
    for (fault, error, kind) in [
        (sda, I2cError::Bus, ErrorKind::Bus),
        (ChipFault::SclStuck, I2cError::Timeout, ErrorKind::Other),
    ] {
        let rig = rig();
        rig.for_time(ms(50), fault);
        assert_eq!(rig.chip.borrow_mut().sda_held_low(T0), fault == sda);
        let held_until = rig.chip.borrow_mut().scl_held_until(T0);
        assert_eq!(held_until, (fault != sda).then_some(ms(50)));
        let mut bus = rig.bus().with_deadline(ms(5));
        assert_eq!(bus.write(ADDRESS, &[0x00]), Err(error));
        assert_eq!(error.kind(), kind);
        assert!((ms(5)..ms(6)).contains(&rig.now()), "{}", rig.now());
        rig.wait(ms(50));
        assert_eq!(rig.read(0x7E), 0x5449);
        // A line held for less than the deadline delays the read.
        let begin = rig.now();
        rig.for_time(us(100), fault);
        assert_eq!(rig.read(0x7E), 0x5449);
        assert_eq!(rig.now(), begin + us(100 + 120));
    }
    // SDA stuck within the high byte of a write, whose pointer byte ends at 47.5 us; and within the
    // data of a read, which start at 72.5 us.
    let rig = rig();
    rig.schedule(FaultEvent::at(us(50), sda, us(60)));
    assert_eq!(rig.try_write(0x08, 0x1234), Err(I2cError::ArbitrationLoss));
    let rig = self::rig();
    rig.schedule(FaultEvent::at(us(80), sda, us(60)));
    assert_eq!(rig.read(0x7E), 0x5400);
    // SCL held low within a read stretches the transfer.
    let rig = self::rig();
    rig.schedule(FaultEvent::at(us(50), ChipFault::SclStuck, us(500)));
    assert_eq!(rig.read(0x7E), 0x5449);
    assert!(rig.now() > us(500), "{}", rig.now());
}

#[test]
fn nine_clocks_free_sda_where_they_can() {
    for (needed, freed) in [(Some(9), true), (Some(10), false), (None, false)] {
        let rig = rig();
        rig.for_time(ms(500), ChipFault::SdaStuck { clocks: needed });
        let mut bus = rig.bus();
        bus.clock_pulses(9).expect("not borrowed");
        assert_eq!(bus.write(ADDRESS, &[0x00]).is_ok(), freed, "{needed:?}");
    }
}

#[test]
fn bit_flips_strike_the_chosen_byte() {
    let rig = rig();
    let flip_next = |path, byte| {
        let strike = Strike::Byte(byte);
        rig.in_next(1, ChipFault::BitFlip { path, strike });
    };
    // A bit flip in each data byte that the chip sends, and in one that it receives.
    for (byte, of_byte) in [(0, 0xFF00), (1, 0x00FF)] {
        flip_next(Path::ReadData, byte);
        let flipped = rig.read(0x7E) ^ 0x5449;
        assert!(flipped.is_power_of_two() && flipped & of_byte != 0);
        assert_eq!(rig.read(0x7E), 0x5449);
    }
    flip_next(Path::WriteData, 1);
    rig.write(0x08, 0x1234);
    let flipped = rig.read(0x08) ^ 0x1234;
    assert!(flipped.is_power_of_two() && flipped < 0x100);
    // A bit flip in the pointer: another register is written.
    flip_next(Path::Pointer, 0);
    rig.write(0x09, 0x5555);
    assert_eq!(rig.read(0x09), 0x0080);
    // Random bit flips: one of the two bytes of a read with a probability of 1 - 0.9^2 = 0.19.
    // These draws do not affect the noise of the conversions.
    let strike = Strike::Probability(0.1);
    let path = Path::ReadData;
    rig.in_next(u32::MAX, ChipFault::BitFlip { path, strike });
    let wrong = (0..5_000).filter(|_| rig.read(0x7E) != 0x5449).count();
    assert!((850..1_050).contains(&wrong), "{wrong} of 5000");
}

#[test]
fn an_early_stop_cuts_the_transaction() {
    let rig = rig();
    rig.in_next(1, ChipFault::EarlyStop { after_bytes: 3 });
    assert_eq!(rig.try_write(0x08, 0x1234), Err(DATA_NACK));
    assert_eq!(rig.chip.borrow().register(0x08), 0x1280, "half written");
    let misuse = rig.chip.borrow().misuse();
    assert_eq!(misuse, Default::default(), "the master did no wrong");
    assert_ne!(rig.read(0x7E), 0x5449, "the next transaction is slipped");
    assert_eq!(rig.read(0x7E), 0x5449);
    // A STOP within a read: the line floats high afterwards.
    rig.in_next(1, ChipFault::EarlyStop { after_bytes: 4 });
    assert_eq!(rig.read(0x7E), 0x54FF);
}

#[test]
fn an_absent_chip_and_a_foreign_one() {
    let rig = rig();
    let foreign = ChipFault::WrongIdentity {
        manufacturer: 0x5449,
        device: 0x3054,
    };
    rig.in_next(2, foreign);
    assert_eq!((rig.read(0x7E), rig.read(0x7F)), (0x5449, 0x3054));
    assert_eq!(rig.read(0x7F), 0x3055);
    rig.for_time(ms(1), ChipFault::Absent);
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
    rig.wait(ms(1));
    assert_eq!(rig.read(0x7E), 0x5449);
}

// ---- chip, supply and clock ----

#[test]
fn a_brown_out_loses_all_registers_or_the_chosen_ones() {
    let rig = rig();
    rig.single(1000);
    rig.wait(ms(2));
    rig.for_time(T0, ChipFault::BrownOut(Lost::Everything));
    assert!(!rig.intb_is_low());
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK), "it has to wake up");
    rig.wait(ms(2));
    assert_eq!((rig.read(0x08), rig.read(0x1A)), (0x0080, 0x2801));

    rig.single(1000);
    // These registers are reset: RCOUNT0, ERROR_CONFIG and DRIVE_CURRENT0.
    let which = 1 << 0x08 | 1 << 0x19 | 1 << 0x1E;
    rig.for_time(T0, ChipFault::BrownOut(Lost::Registers(which)));
    for (register, value) in [
        (0x08, 0x0080),
        (0x19, 0),
        (0x1E, 0),
        (0x10, 16),
        (0x1A, 0x1601),
    ] {
        assert_eq!(rig.read(register), value, "{register:#04x}");
    }
    let done = rig.chip.borrow().conversions(0);
    rig.wait(ms(2));
    assert!(rig.chip.borrow().conversions(0) > done);
    // If CONFIG is among the registers that are reset, the chip falls asleep.
    rig.for_time(T0, ChipFault::BrownOut(Lost::Registers(1 << 0x1A)));
    assert!(!rig.chip.borrow().is_converting());
}

#[test]
fn an_upset_register_stays_upset() {
    let upset = |address, bits| ChipFault::RegisterUpset { address, bits };
    let rig = rig();
    rig.single(2500);
    rig.schedule(FaultEvent::at(ms(3), upset(0x08, 0x0400), T0));
    rig.wait(ms(1));
    assert_eq!(rig.read(0x08), 2500);
    rig.wait(ms(3));
    assert_eq!(rig.read(0x08), 2500 ^ 0x0400);
    // The sleep bit of CONFIG puts the chip to sleep, and wakes it.
    rig.for_time(T0, upset(0x1A, 0x2000));
    assert!(!rig.chip.borrow().is_converting());
    rig.for_time(T0, upset(0x1A, 0x2000));
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
    assert_eq!(rig.chip.borrow().interrupts(), 1, "the chip did its part");
    rig.wait(ms(5));
    assert!(rig.intb_is_low());
}

#[test]
fn a_lost_clock_stops_what_counts_with_it_until_it_returns() {
    // CONFIG with the clock at CLKIN, and with the internal clock.
    for (config, conversions) in [(0x1601, 0..=0), (0x1401, 11..=12)] {
        let rig = rig();
        rig.single(2500);
        rig.configure(&[(0x1A, config | 0x2000), (0x1A, config)]);
        rig.convert(0, 1);
        rig.read(0x18);
        rig.wait(us(300));
        rig.for_time(ms(12), ChipFault::ClockLoss);
        let done = rig.chip.borrow().conversions(0);
        rig.wait(ms(11));
        let since = rig.chip.borrow().conversions(0) - done;
        assert!(conversions.contains(&since), "{config:#06x}: {since}");
        let aborted = rig.read(0x18) & 0x0800 != 0;
        assert_eq!(aborted, config == 0x1601, "the watchdog notices");
        rig.wait(ms(2));
        rig.convert(0, 1);
        assert!(rig.last(0).errors.is_empty() && !rig.last(0).spoilt);
    }
    // With another clock at CLKIN, the next conversion counts that clock.
    let rig = rig();
    rig.single(2500);
    rig.convert(0, 1);
    let at_40_mhz = f64::from(rig.last(0).word);
    let slower = Some(ExternalClock::exact(20e6));
    rig.chip.borrow_mut().set_external_clock(slower);
    rig.convert(0, 1);
    let ratio = f64::from(rig.last(0).word) / at_40_mhz;
    assert!((ratio - 2.0).abs() < 1e-3, "{ratio}");
}

// ---- the schedule ----

#[test]
fn a_fault_begins_at_its_time_and_lasts_until_it_is_cleared() {
    let rig = rig();
    rig.schedule(FaultEvent::from(ms(1), ChipFault::Absent));
    rig.schedule(FaultEvent::from(ms(900), ChipFault::Absent));
    assert_eq!(rig.chip.borrow().next_event(), Some(ms(1)));
    assert_eq!(rig.read(0x7E), 0x5449);
    rig.wait(ms(500));
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
    rig.chip.borrow_mut().clear_faults();
    rig.wait(ms(500));
    assert_eq!(rig.read(0x7E), 0x5449, "what waited is forgotten too");
    // A fault whose start time has passed starts at once.
    rig.schedule(FaultEvent::at(ms(1), ChipFault::Absent, ms(1)));
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
}
