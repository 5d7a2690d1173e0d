//! Bus traffic of the driver in every mode, compared with a register map that was typed
//! independently.

use crate::common::*;
use embedded_hal::i2c::{ErrorKind, NoAcknowledgeSource};
use embedded_hal_mock::eh1::{
    delay::NoopDelay,
    digital::{Mock as PinMock, State, Transaction as PinTransaction},
    i2c::Transaction,
};
use ldc161x::{
    Acquisition, Address, BusAccess, Channel, ChannelSettings, ClockDividers, Config,
    Configuration, Deglitch, DriveCode, Error, ErrorConfig, InterruptRelease, Ldc161x, Model,
    MuxConfig, Noise, Quality, Rcount, ReferenceClock, Register, Sequence, SettleCount,
};

/// Settings that differ between channels and from every reset value.
fn configuration(acquisition: Acquisition) -> Configuration {
    let channel = |number: u16| ChannelSettings {
        rcount: Rcount::new(0x0500 + number).unwrap(),
        settle_count: SettleCount::new(0x0020 + number).unwrap(),
        dividers: ClockDividers::new(1 + number as u8, 3 + 2 * number).unwrap(),
        offset: 0x1100 + number,
        drive: DriveCode::new(17 + number as u8).unwrap(),
    };
    Configuration {
        acquisition,
        reference: ReferenceClock::External { hz: 40_000_000 },
        channels: [channel(0), channel(1), channel(2), channel(3)],
        deglitch: Deglitch::Mhz10,
        errors: ErrorConfig::DATA_READY,
        low_power_activation: false,
        noise: Noise::default(),
    }
}

/// The settings of `configuration` as hexadecimal numbers, worked out by hand from the datasheet's
/// bit tables.
fn channel_words(channel: u8) -> Vec<(u8, u16)> {
    let dividers = [0x1003, 0x2005, 0x3007, 0x4009];
    let drives = [0x8800, 0x9000, 0x9800, 0xA000];
    let n = usize::from(channel);
    vec![
        (RCOUNT + channel, 0x0500 + u16::from(channel)),
        (OFFSET + channel, 0x1100 + u16::from(channel)),
        (SETTLECOUNT + channel, 0x0020 + u16::from(channel)),
        (CLOCK_DIVIDERS + channel, dividers[n]),
        (DRIVE_CURRENT + channel, drives[n]),
    ]
}

/// For every mode: CONFIG asleep, CONFIG awake, channels, MUX_CONFIG.
const MODES: [(Acquisition, u16, u16, &[u8], u16); 7] = [
    (
        Acquisition::Single(Channel::Zero),
        0x3601,
        0x1601,
        &[0],
        0x020D,
    ),
    (
        Acquisition::Single(Channel::One),
        0x7601,
        0x5601,
        &[1],
        0x020D,
    ),
    (
        Acquisition::Single(Channel::Two),
        0xB601,
        0x9601,
        &[2],
        0x020D,
    ),
    (
        Acquisition::Single(Channel::Three),
        0xF601,
        0xD601,
        &[3],
        0x020D,
    ),
    (
        Acquisition::Autoscan(Sequence::ZeroToOne),
        0x3601,
        0x1601,
        &[0, 1],
        0x820D,
    ),
    (
        Acquisition::Autoscan(Sequence::ZeroToTwo),
        0x3601,
        0x1601,
        &[0, 1, 2],
        0xA20D,
    ),
    (
        Acquisition::Autoscan(Sequence::ZeroToThree),
        0x3601,
        0x1601,
        &[0, 1, 2, 3],
        0xC20D,
    ),
];

fn settings(channels: &[u8], mux: u16) -> Vec<(u8, u16)> {
    let mut list: Vec<_> = channels
        .iter()
        .flat_map(|channel| channel_words(*channel))
        .collect();
    list.extend([(ERROR_CONFIG, 0xF801), (MUX_CONFIG, mux)]);
    list
}

/// Number of words that a register accepts, and of those that it writes as they were read.
fn accepted<T>(from_bits: fn(u16) -> Option<T>, to_bits: fn(T) -> u16) -> [usize; 2] {
    let read = |word| from_bits(word).map(|settings| to_bits(settings) == word);
    let same: Vec<bool> = (0..=u16::MAX).filter_map(read).collect();
    [same.len(), same.iter().filter(|same| **same).count()]
}

#[test]
fn every_accepted_word_is_written_as_it_was_read() {
    let config = accepted(Config::from_bits, Config::to_bits);
    assert_eq!(config, [1 << 9, 1 << 9], "nine bits are free");
    let errors = accepted(ErrorConfig::from_bits, ErrorConfig::to_bits);
    assert_eq!(errors, [1 << 12, 1 << 12], "twelve bits are free");
    // Three bits of autoscan have four meanings, each written in one way; four filters are known.
    let mux = accepted(MuxConfig::from_bits, MuxConfig::to_bits);
    assert_eq!(mux, [8 * 4, 4 * 4]);
}

#[test]
fn every_mode_starts_asleep_and_ends_with_config() {
    for (acquisition, asleep, awake, channels, mux) in MODES {
        let (i2c, mut check) = bus(&start(asleep, awake, &settings(channels, mux)));
        let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
        chip.start(&configuration(acquisition)).unwrap();
        check.done();
    }
}

#[test]
fn a_frame_is_one_transaction_with_msb_before_lsb() {
    for (acquisition, asleep, awake, channels, mux) in MODES {
        let mut expected = start(asleep, awake, &settings(channels, mux));
        let data: Vec<_> = channels
            .iter()
            .flat_map(|n| {
                [
                    (2 * n, 0x0240 + u16::from(*n)),
                    (2 * n + 1, 0x9E8B + u16::from(*n)),
                ]
            })
            .collect();
        expected.extend(frame(&data));
        let (i2c, mut check) = bus(&expected);
        let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
        chip.set_interrupt_release(InterruptRelease::ByData);
        chip.start(&configuration(acquisition)).unwrap();
        let frame = chip.read_frame().unwrap();
        assert!(frame.covers(acquisition) && frame.marks.gap && frame.status.is_none());
        for (reading, n) in frame.readings().iter().zip(channels) {
            let expected = 0x0240_9E8B + 0x1_0001 * u32::from(*n);
            assert_eq!(reading.word.code().get(), expected);
            assert_eq!(reading.quality(), Quality::AfterGap);
            // Expected frequency by the datasheet's Equation 6, with this test's own numbers.
            let reference = 40e6 / f64::from(3 + 2 * n);
            let offset = f64::from(0x1100 + u16::from(*n)) / 65_536.0;
            let ratio = f64::from(expected) / 268_435_456.0 + offset;
            let hz = f64::from(1 + n) * reference * ratio;
            assert!(
                (reading.frequency_hz - hz).abs() < 1e-3,
                "{} {hz}",
                reading.frequency_hz
            );
        }
        check.done();
    }
}

#[test]
fn status_comes_first_where_only_status_releases_the_interrupt() {
    let (acquisition, asleep, awake, channels, mux) = MODES[0];
    let mut expected = start(asleep, awake, &settings(channels, mux));
    expected.extend(frame(&[(STATUS, 0x0048), (0, 0x0240), (1, 0x9E8B)]));
    expected.extend(frame(&[(STATUS, 0x0040), (0, 0x0240), (1, 0x9E8B)]));
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    chip.start(&configuration(acquisition)).unwrap();
    let first = chip.read_frame().unwrap();
    assert_eq!(
        first.of(Channel::Zero).unwrap().quality(),
        Quality::AfterGap
    );
    let second = chip.read_frame().unwrap();
    assert_eq!(
        second.of(Channel::Zero).unwrap().quality(),
        Quality::Repeated
    );
    check.done();
}

#[test]
fn without_an_interrupt_pin_status_decides_whether_there_is_a_frame() {
    let (acquisition, asleep, awake, channels, mux) = MODES[0];
    let mut expected = start(asleep, awake, &settings(channels, mux));
    expected.push(read(STATUS, 0x0000));
    expected.push(read(STATUS, 0x0048));
    expected.extend(frame(&[(0, 0x0240), (1, 0x9E8B)]));
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    chip.start(&configuration(acquisition)).unwrap();
    assert!(chip.read_frame_if_ready().unwrap().is_none());
    assert!(chip.read_frame_if_ready().unwrap().is_some());
    check.done();
}

#[test]
fn every_error_flag_travels_with_its_word() {
    let (acquisition, asleep, awake, channels, mux) = MODES[0];
    let cases = [
        (0x8140, Quality::UnderRange),
        (0x4140, Quality::OverRange),
        (0x2140, Quality::Watchdog),
        (0x1140, Quality::Amplitude),
        (0x0440, Quality::AboveQuarterReference),
        (0x0140, Quality::Good),
    ];
    let mut expected = start(asleep, awake, &settings(channels, mux));
    // The first frame follows the gap of the start.
    expected.extend(frame(&[(0, 0x0140), (1, 0)]));
    for (msb, _) in cases {
        expected.extend(frame(&[(0, msb), (1, 0x9E8B)]));
    }
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    chip.set_interrupt_release(InterruptRelease::ByData);
    chip.start(&configuration(acquisition)).unwrap();
    chip.read_frame().unwrap();
    for (msb, quality) in cases {
        let frame = chip.read_frame().unwrap();
        let reading = frame.of(Channel::Zero).unwrap();
        assert_eq!(reading.quality(), quality, "{msb:#06x}");
        assert_eq!(reading.word.flags().any(), msb >> 12 != 0, "{msb:#06x}");
        assert_eq!(
            reading.word.code().get(),
            u32::from(msb & 0x0FFF) << 16 | 0x9E8B
        );
    }
    check.done();
}

#[test]
fn registers_can_be_fetched_one_by_one_or_without_transactions() {
    let (acquisition, asleep, awake, channels, mux) = MODES[0];
    let mut expected = start(asleep, awake, &settings(channels, mux));
    expected.extend([read(0, 0x0140), read(1, 0x9E8B)]);
    for (register, value) in [(0_u8, 0x0140_u16), (1, 0x9E8C)] {
        expected.push(Transaction::write(ADDRESS, vec![register]));
        expected.push(Transaction::read(ADDRESS, value.to_be_bytes().to_vec()));
    }
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    chip.set_interrupt_release(InterruptRelease::ByData);
    chip.start(&configuration(acquisition)).unwrap();
    chip.set_access(BusAccess::RegisterPerTransaction);
    assert_eq!(
        chip.read_frame().unwrap().readings()[0].word.bits(),
        0x0140_9E8B
    );
    chip.set_access(BusAccess::SeparateTransfers);
    assert_eq!(
        chip.read_frame().unwrap().readings()[0].word.bits(),
        0x0140_9E8C
    );
    check.done();
}

#[test]
fn words_read_twice_have_to_agree() {
    let (acquisition, asleep, awake, channels, mux) = MODES[0];
    let mut expected = start(asleep, awake, &settings(channels, mux));
    expected.extend(frame(&[(0, 0x0140), (1, 0x9E8B), (0, 0x0140), (1, 0x9E8B)]));
    // The first read clears the flags in the chip, so only the codes of both reads are compared.
    expected.extend(frame(&[(0, 0x1140), (1, 0x9E8B), (0, 0x0140), (1, 0x9E8B)]));
    expected.extend(frame(&[(0, 0x0140), (1, 0x9E8B), (0, 0x0141), (1, 0x9E8B)]));
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    chip.set_interrupt_release(InterruptRelease::ByData);
    chip.set_read_twice(true);
    chip.start(&configuration(acquisition)).unwrap();
    let mut qualities = Vec::new();
    for _ in 0..3 {
        qualities.push(chip.read_frame().unwrap().readings()[0].quality());
    }
    assert_eq!(
        qualities,
        [Quality::AfterGap, Quality::Amplitude, Quality::Differs]
    );
    check.done();
}

#[test]
fn a_foreign_chip_is_refused_with_its_identity() {
    let (i2c, mut check) = bus(&[read(MANUFACTURER, 0x5449), read(DEVICE, 0x3054)]);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    let error = chip.start(&configuration(MODES[0].0)).unwrap_err();
    assert_eq!(
        error,
        Error::WrongIdentity {
            manufacturer: 0x5449,
            device: 0x3054
        }
    );
    assert!(error.to_string().contains("LDC131x"));
    check.done();
}

#[test]
fn a_register_that_does_not_take_its_value_is_named() {
    let (_, asleep, awake, channels, mux) = MODES[0];
    let healthy = start(asleep, awake, &settings(channels, mux));
    let words = settings(channels, mux);
    // The read-backs during sleep follow the identity, two transfers of CONFIG, and the writes.
    for (index, (register, value)) in words.iter().enumerate() {
        let at = 4 + words.len() + index;
        let mut expected = healthy[..at].to_vec();
        expected.push(read(*register, value ^ 0x1000));
        let (i2c, mut check) = bus(&expected);
        let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
        match chip.start(&configuration(MODES[0].0)).unwrap_err() {
            Error::ReadBack {
                register: named,
                written,
                read,
            } => {
                assert_eq!(named.address(), *register);
                assert_eq!((written, read), (*value, value ^ 0x1000));
            }
            other => panic!("{other:?}"),
        }
        assert_eq!(chip.read_frame().unwrap_err(), Error::NotRunning);
        check.done();
    }
}

#[test]
fn registers_lost_on_waking_are_found_before_the_first_frame() {
    let (_, asleep, awake, channels, mux) = MODES[0];
    let healthy = start(asleep, awake, &settings(channels, mux));
    let words = settings(channels, mux);
    // After this point only the last comparison follows: all registers, CONFIG, and STATUS.
    let at = healthy.len() - words.len() - 2;
    let mut expected = healthy[..at].to_vec();
    expected.push(read(RCOUNT, 0x0080));
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    let lost = Error::RegistersLost {
        register: Register::Rcount(Channel::Zero),
        expected: 0x0500,
        found: 0x0080,
    };
    assert_eq!(chip.start(&configuration(MODES[0].0)).unwrap_err(), lost);
    check.done();
}

#[test]
fn reserved_bits_of_config_that_read_as_zero_are_no_loss() {
    let (_, asleep, awake, channels, mux) = MODES[0];
    let mut expected = start(asleep, awake, &settings(channels, mux));
    for (index, transaction) in expected.clone().iter().enumerate() {
        if *transaction == read(CONFIG, asleep) {
            expected[index] = read(CONFIG, asleep & !1);
        } else if *transaction == read(CONFIG, awake) {
            expected[index] = read(CONFIG, awake & !1);
        }
    }
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    chip.start(&configuration(MODES[0].0)).unwrap();
    check.done();
}

#[test]
fn channels_that_the_chip_has_not_got_are_refused_before_anything_is_sent() {
    for acquisition in [
        Acquisition::Single(Channel::Two),
        Acquisition::Single(Channel::Three),
        Acquisition::Autoscan(Sequence::ZeroToTwo),
        Acquisition::Autoscan(Sequence::ZeroToThree),
    ] {
        let (i2c, mut check) = bus(&[]);
        let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
        assert_eq!(
            chip.start(&configuration(acquisition)).unwrap_err(),
            Error::NoSuchChannel
        );
        check.done();
    }
}

#[test]
fn nothing_is_read_before_a_start() {
    let (i2c, mut check) = bus(&[]);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    assert_eq!(chip.read_frame().unwrap_err(), Error::NotStarted);
    assert_eq!(chip.check_canary().unwrap_err(), Error::NotStarted);
    assert_eq!(chip.recover(&mut NoopDelay).unwrap_err(), Error::NotStarted);
    check.done();
}

#[test]
fn the_other_address_is_used() {
    let (i2c, mut check) = bus(&[
        Transaction::write_read(0x2B, vec![0x7E], vec![0x54, 0x49]),
        Transaction::write_read(0x2B, vec![0x7F], vec![0x30, 0x55]),
    ]);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrHigh);
    chip.identify().unwrap();
    chip.release();
    check.done();
}

#[test]
fn recovery_resets_and_replays_the_requested_configuration() {
    let (acquisition, asleep, awake, channels, mux) = MODES[6];
    let once = start(asleep, awake, &settings(channels, mux));
    let mut expected = once.clone();
    expected.push(write(RESET_DEV, 0x8000));
    expected.extend(once.clone());
    expected.extend(once);
    let (i2c, mut check) = bus(&expected);
    let mut shutdown = PinMock::new(&[
        PinTransaction::set(State::High),
        PinTransaction::set(State::Low),
    ]);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    chip.start(&configuration(acquisition)).unwrap();
    chip.recover(&mut NoopDelay).unwrap();
    chip.recover_by_shutdown(&mut shutdown, &mut NoopDelay)
        .unwrap();
    shutdown.done();
    check.done();
}

#[test]
fn canaries_go_round_all_registers_and_confirm_the_frames_before() {
    let (acquisition, asleep, awake, channels, mux) = MODES[0];
    let words = settings(channels, mux);
    let mut expected = start(asleep, awake, &words);
    expected.extend(frame(&[(0, 0x0140), (1, 0)]));
    expected.extend(
        words
            .iter()
            .map(|(register, value)| read(*register, *value)),
    );
    expected.push(read(CONFIG, awake));
    // A new round confirms the frame; then the first register is found at its reset value.
    expected.extend(
        words
            .iter()
            .map(|(register, value)| read(*register, *value)),
    );
    expected.push(read(CONFIG, awake));
    expected.push(read(RCOUNT, 0x0080));
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    chip.set_interrupt_release(InterruptRelease::ByData);
    chip.start(&configuration(acquisition)).unwrap();
    let number = chip.read_frame().unwrap().number;
    // The current round started before the frame was read, so it does not confirm that frame.
    for _ in &words {
        assert_eq!(chip.check_canary().unwrap().confirmed, None);
    }
    assert_eq!(chip.check_canary().unwrap().confirmed, Some(number - 1));
    assert_eq!(chip.verify().unwrap().confirmed, Some(number));
    assert!(matches!(
        chip.check_canary().unwrap_err(),
        Error::RegistersLost { .. }
    ));
    assert_eq!(chip.read_frame().unwrap_err(), Error::NotRunning);
    check.done();
}

#[test]
fn after_a_failed_transfer_the_identity_is_asked_before_the_next_frame() {
    let (acquisition, asleep, awake, channels, mux) = MODES[0];
    let mut expected = start(asleep, awake, &settings(channels, mux));
    let error = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
    expected.extend([read(0, 0x0140), read(1, 0)]);
    // The chip cleared the flags of this word, but its answer did not arrive: the flags are lost.
    expected.extend([read(0, 0x0140), read(1, 0).with_error(error)]);
    expected.extend(identity());
    expected.push(read(CONFIG, awake));
    expected.extend([read(0, 0x0140), read(1, 1)]);
    expected.extend([read(0, 0x0140), read(1, 2)]);
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    // The mock cannot let a transfer fail within a transaction.
    chip.set_access(BusAccess::RegisterPerTransaction);
    chip.set_interrupt_release(InterruptRelease::ByData);
    chip.start(&configuration(acquisition)).unwrap();
    chip.read_frame().unwrap();
    assert!(matches!(chip.read_frame().unwrap_err(), Error::Bus { .. }));
    let after = chip.read_frame().unwrap();
    assert!(after.marks.gap && !after.readings()[0].is_good());
    assert!(chip.read_frame().unwrap().readings()[0].is_good());
    check.done();
}

#[test]
fn drive_calibration_reads_what_the_chip_found_and_programs_it() {
    let (acquisition, asleep, awake, channels, mux) = MODES[4];
    let before = settings(channels, mux);
    let mut after = before.clone();
    for (register, value) in &mut after {
        match *register {
            0x1E => *value = 0xA800,
            0x1F => *value = 0x0800,
            _ => {}
        }
    }
    let mut expected = start(asleep, awake, &before);
    expected.extend([write(CONFIG, asleep), read(CONFIG, asleep)]);
    expected.extend(
        before
            .iter()
            .map(|(register, value)| write(*register, *value)),
    );
    expected.extend(
        before
            .iter()
            .map(|(register, value)| read(*register, *value)),
    );
    // RP_OVERRIDE_EN and AUTO_AMP_DIS are off in this value of CONFIG.
    expected.extend([write(CONFIG, 0x0201), read(CONFIG, 0x0201)]);
    expected.extend([read(0x1E, 0x8800 | 21 << 6), read(0x1F, 0x9000 | 1 << 6)]);
    expected.extend(start(asleep, awake, &after));
    expected.extend(frame(&[(0, 0x0140), (1, 0), (2, 0x0140), (3, 0)]));
    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    chip.set_interrupt_release(InterruptRelease::ByData);
    chip.start(&configuration(acquisition)).unwrap();
    let found = chip.calibrate_drive_current(&mut NoopDelay).unwrap();
    assert_eq!(
        found.map(|code| code.map(DriveCode::code)),
        [Some(21), Some(1), None, None]
    );
    let frame = chip.read_frame().unwrap();
    assert!(frame.marks.drive_step && frame.marks.gap);
    check.done();
}
