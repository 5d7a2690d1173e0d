//! Faults on the wires of the bus: their effects while active, and their end.

use crate::common::*;
use embedded_hal::i2c::{Error, ErrorKind, I2c, NoAcknowledgeSource, Operation};
use ldc161x_sim::{Bus, ChipFault, FaultEvent, FaultState, I2cError, Path, Strike, Time};

const T0: Time = Time::ZERO;
const ADDRESS_NACK: I2cError = I2cError::NoAcknowledge(NoAcknowledgeSource::Address);
const DATA_NACK: I2cError = I2cError::NoAcknowledge(NoAcknowledgeSource::Data);

fn rig() -> ChipRig<[f64; 4]> {
    ChipRig::new(quiet(40e6), [3e6; 4])
}

#[test]
fn nack_after_each_number_of_bytes() {
    // A register write consists of address, pointer, high byte and low byte.
    for after_bytes in 0..4 {
        let rig = rig();
        let fault = rig.in_next(2, ChipFault::Nack { after_bytes });
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
        assert_eq!(
            rig.read(0x08),
            0x1234,
            "no early termination: the chip itself refused"
        );
        assert_eq!(rig.chip.borrow().disturbances().nacks, 2);
        assert!(matches!(
            rig.chip.borrow().fault_state(fault),
            Some(FaultState::Over { .. })
        ));
        assert_eq!(rig.chip.borrow().misuse(), Default::default());
    }
}

#[test]
fn nack_within_a_combined_read() {
    // A read sends address, pointer, and the address again: this third byte is refused.
    let rig = rig();
    rig.in_next(1, ChipFault::Nack { after_bytes: 2 });
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
    assert_eq!(rig.read(0x7E), 0x5449);
}

#[test]
fn an_absent_chip_does_not_answer() {
    let rig = rig();
    rig.for_time(ms(1), ChipFault::Absent);
    assert_eq!(rig.try_read(0x7E), Err(ADDRESS_NACK));
    rig.wait(ms(1));
    assert_eq!(rig.read(0x7E), 0x5449);
}

#[test]
fn a_stuck_sda_blocks_the_start_until_the_deadline() {
    let rig = rig();
    rig.for_time(ms(50), ChipFault::SdaStuck { clocks: None });
    let start = rig.now();
    let mut bus = rig.bus().with_deadline(ms(5));
    let error = bus.write(ADDRESS, &[0x00]).expect_err("stuck");
    assert_eq!(error, I2cError::Bus);
    assert_eq!(error.kind(), ErrorKind::Bus);
    let waited = rig.now() - start;
    assert!((ms(5)..ms(6)).contains(&waited), "{waited}");
    assert!(rig.chip.borrow_mut().sda_held_low(start));
    rig.wait(ms(50));
    assert_eq!(rig.read(0x7E), 0x5449);
}

#[test]
fn a_short_hold_of_sda_only_delays() {
    let rig = rig();
    rig.for_time(us(100), ChipFault::SdaStuck { clocks: None });
    assert_eq!(rig.read(0x7E), 0x5449);
    assert_eq!(rig.now(), us(100 + 120));
}

#[test]
fn sda_stuck_amid_a_transfer_loses_arbitration_or_reads_zeros() {
    let rig = rig();
    // Starts within the high byte of a write: its pointer byte ends at 47.5 us.
    rig.schedule(FaultEvent::at(
        us(50),
        ChipFault::SdaStuck { clocks: None },
        us(60),
    ));
    assert_eq!(rig.try_write(0x08, 0x1234), Err(I2cError::ArbitrationLoss));
    let rig = self::rig();
    // Starts within the data of a read, which start at 72.5 us: the second byte is lost.
    rig.schedule(FaultEvent::at(
        us(80),
        ChipFault::SdaStuck { clocks: None },
        us(60),
    ));
    assert_eq!(rig.read(0x7E), 0x5400);
}

#[test]
fn nine_clocks_free_sda_where_they_can() {
    for (needed, freed) in [(Some(9), true), (Some(10), false), (None, false)] {
        let rig = rig();
        rig.for_time(ms(500), ChipFault::SdaStuck { clocks: needed });
        let mut bus: Bus<'_, _> = rig.bus();
        bus.clock_pulses(9).expect("not borrowed");
        assert_eq!(bus.write(ADDRESS, &[0x00]).is_ok(), freed, "{needed:?}");
        assert_eq!(rig.chip.borrow().is_disturbed(), !freed);
    }
}

#[test]
fn a_held_scl_times_out_at_the_deadline() {
    let rig = rig();
    rig.for_time(ms(50), ChipFault::SclStuck);
    assert_eq!(rig.chip.borrow_mut().scl_held_until(T0), Some(ms(50)));
    let start = rig.now();
    let error = rig
        .bus()
        .with_deadline(ms(2))
        .write(ADDRESS, &[0x00])
        .expect_err("held");
    assert_eq!(error, I2cError::Timeout);
    assert_eq!(error.kind(), ErrorKind::Other);
    assert!(rig.now() - start >= ms(2) && rig.now() - start < ms(3));
    rig.wait(ms(50));
    // Starts within a transfer and is shorter than the deadline: the transfer is stretched.
    let begin = rig.now();
    rig.schedule(FaultEvent::at(begin + us(50), ChipFault::SclStuck, us(500)));
    assert_eq!(rig.read(0x7E), 0x5449);
    assert!(rig.now() - begin > us(500), "{}", rig.now() - begin);
}

fn one_bit(difference: u16) -> bool {
    difference.count_ones() == 1
}

#[test]
fn bit_flips_strike_the_chosen_byte() {
    let flip = |path, strike| ChipFault::BitFlip { path, strike };
    // A flip in a data byte that the chip sends.
    let rig = rig();
    rig.in_next(1, flip(Path::ReadData, Strike::Byte(0)));
    let read = rig.read(0x7E);
    assert!(one_bit(read ^ 0x5449) && read & 0xFF == 0x49, "{read:#06x}");
    assert_eq!(rig.read(0x7E), 0x5449);
    rig.in_next(1, flip(Path::ReadData, Strike::Byte(1)));
    let read = rig.read(0x7E);
    assert!(one_bit(read ^ 0x5449) && read >> 8 == 0x54, "{read:#06x}");
    // A flip in a data byte that the chip receives.
    rig.in_next(1, flip(Path::WriteData, Strike::Byte(1)));
    rig.write(0x08, 0x1234);
    let written = rig.read(0x08);
    assert!(
        one_bit(written ^ 0x1234) && written >> 8 == 0x12,
        "{written:#06x}"
    );
    // A flip in the pointer: another register is written.
    rig.in_next(1, flip(Path::Pointer, Strike::Byte(0)));
    rig.write(0x09, 0x5555);
    assert_eq!(rig.read(0x09), 0x0080);
    assert_eq!(rig.chip.borrow().disturbances().flipped_bytes, 4);
}

#[test]
fn bit_flips_can_be_counted_through_a_frame() {
    // Byte 2 of the four data bytes of a frame is the high byte of DATA0_LSB.
    let rig = rig();
    rig.single(2500);
    rig.convert(0, 1);
    let fault = ChipFault::BitFlip {
        path: Path::ReadData,
        strike: Strike::Byte(2),
    };
    rig.in_next(1, fault);
    let (_, word) = rig.frame(0);
    let truth = rig.chip.borrow().last_read(0).expect("read").word;
    let difference = word ^ truth;
    assert!(
        difference.count_ones() == 1 && difference & 0xFF00 == difference,
        "{difference:#x}"
    );
}

#[test]
fn bit_flips_by_chance_keep_to_their_probability() {
    let rig = rig();
    let strike = Strike::Probability(0.1);
    rig.in_next(
        u32::MAX,
        ChipFault::BitFlip {
            path: Path::ReadData,
            strike,
        },
    );
    let wrong = (0..5_000).filter(|_| rig.read(0x7E) != 0x5449).count();
    // A read has two bytes, each flipped with probability 0.1: 1 - 0.9^2 = 0.19.
    assert!((850..1_050).contains(&wrong), "{wrong} of 5000");
    let flipped = rig.chip.borrow().disturbances().flipped_bytes;
    assert!((900..1_100).contains(&flipped), "{flipped} of 10000");
}

#[test]
fn a_wrong_identity() {
    let rig = rig();
    let fault = ChipFault::WrongIdentity {
        manufacturer: 0x5449,
        device: 0x3054,
    };
    rig.in_next(2, fault);
    assert_eq!(rig.read(0x7E), 0x5449);
    assert_eq!(rig.read(0x7F), 0x3054);
    assert_eq!(rig.read(0x7F), 0x3055);
    assert_eq!(rig.chip.borrow().disturbances().forged_identities, 2);
}

#[test]
fn an_early_stop_cuts_the_transaction() {
    let rig = rig();
    rig.in_next(1, ChipFault::EarlyStop { after_bytes: 3 });
    assert_eq!(rig.try_write(0x08, 0x1234), Err(DATA_NACK));
    assert_eq!(rig.chip.borrow().register(0x08), 0x1280, "half written");
    assert_eq!(rig.chip.borrow().disturbances().early_stops, 1);
    assert_eq!(
        rig.chip.borrow().misuse(),
        Default::default(),
        "the master did no wrong"
    );
    assert_ne!(rig.read(0x7E), 0x5449, "the next transaction is slipped");
    assert_eq!(rig.read(0x7E), 0x5449);
    // Within a read: the line floats high afterwards.
    rig.in_next(1, ChipFault::EarlyStop { after_bytes: 4 });
    assert_eq!(rig.read(0x7E), 0x54FF);
}

#[test]
fn a_transaction_is_one_from_start_to_stop() {
    let rig = rig();
    rig.in_next(1, ChipFault::Nack { after_bytes: 5 });
    let (mut high, mut low) = ([0; 2], [0; 2]);
    // S a p S a d d S <- this is the sixth byte that the master sends, and the eighth of all.
    let outcome = rig.bus().transaction(
        ADDRESS,
        &mut [
            Operation::Write(&[0x7E]),
            Operation::Read(&mut high),
            Operation::Write(&[0x7F]),
            Operation::Read(&mut low),
        ],
    );
    assert_eq!(outcome, Err(ADDRESS_NACK));
    assert_eq!(high, [0x54, 0x49]);
    assert_eq!(rig.chip.borrow().traffic().transactions, 1);
    assert!(!rig.chip.borrow().is_disturbed());
}
