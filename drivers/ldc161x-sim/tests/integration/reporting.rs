//! Results, STATUS and INTB, in each position of the related switches.

use crate::common::*;
use embedded_hal::i2c::I2c;
use ldc161x_sim::{
    Errors, FlagRead, InterruptRelease, Overwrite, Sensors, Settings, ShadowLatch, StatusReporting,
    UnreadCleared,
};

const DRDY: u16 = 0x0040;

fn single(settings: Settings) -> ChipRig<[f64; 4]> {
    let rig = ChipRig::new(settings, [3e6; 4]);
    rig.single(2500);
    rig
}

fn settings_with(change: impl FnOnce(&mut ldc161x_sim::Switches)) -> Settings {
    with_switches(quiet(40e6), change)
}

fn slow(change: impl FnOnce(&mut ldc161x_sim::Switches)) -> Settings {
    with_switches(quiet(10e6), change)
}

#[test]
fn a_result_arrives_with_the_interrupt_and_reads_as_it_is() {
    let rig = single(quiet(40e6));
    let edge = rig.next_interrupt();
    let truth = *rig.chip.borrow().last_conversion(0).expect("a conversion");
    assert_eq!(edge, truth.end);
    assert_eq!(rig.read(0x18), 0x0048, "DRDY and UNREADCONV0");
    let (flags, word) = rig.frame(0);
    assert_eq!((flags, word), (0, truth.word));
    assert_eq!(rig.chip.borrow().last_read(0), Some(&truth));
}

#[test]
fn every_channel_has_its_own_result() {
    let rig = ChipRig::new(quiet(40e6), [3.0e6, 3.1e6, 3.2e6, 3.3e6]);
    rig.autoscan(3, 2500, 20);
    rig.next_interrupt();
    for channel in [2, 0, 3, 1] {
        let truth = *rig
            .chip
            .borrow()
            .last_conversion(channel)
            .expect("a conversion");
        assert_eq!(rig.frame(channel), (0, truth.word));
        assert_eq!(rig.chip.borrow().last_read(channel), Some(&truth));
        let hz = 3.0e6 + 0.1e6 * f64::from(channel);
        assert!((f64::from(truth.word) / 268_435_456.0 * 40e6 - hz).abs() < 200.0);
    }
}

#[test]
fn data_ready_and_its_interrupt_need_their_bit() {
    for &reporting in StatusReporting::VARIANTS {
        let rig = ChipRig::new(settings_with(|s| s.status_reporting = reporting), [3e6]);
        rig.single(2500);
        rig.write(0x1A, 0x3601);
        rig.write(0x19, 0x0000);
        rig.write(0x1A, 0x1601);
        rig.convert(0, 1);
        assert!(!rig.intb_is_low());
        let shown = if reporting == StatusReporting::Always {
            DRDY
        } else {
            0
        };
        assert_eq!(rig.read(0x18), 0x0008 | shown, "{reporting:?}");
    }
}

#[test]
fn data_ready_in_autoscan_waits_for_the_last_channel() {
    for last in 1..=3 {
        let rig = ChipRig::new(quiet(40e6), [3e6; 4]);
        rig.autoscan(last, 500, 20);
        let edge = rig.next_interrupt();
        let chip = rig.chip.borrow();
        assert_eq!(edge, chip.last_conversion(last).expect("a conversion").end);
        assert_eq!(chip.conversions(0), 1);
        drop(chip);
        let unread = (0..=last).fold(0, |bits, channel| bits | 0x0008 >> channel);
        assert_eq!(
            rig.read(0x18),
            DRDY | unread,
            "UNREADCONV bits run backwards"
        );
    }
}

#[test]
fn unread_flags_show_single_channels_before_the_sequence_ends() {
    let rig = ChipRig::new(quiet(40e6), [3e6; 4]);
    rig.autoscan(3, 2500, 20);
    rig.convert(1, 1);
    assert_eq!(rig.read(0x18), 0x000C);
}

#[test]
fn which_reads_release_the_interrupt() {
    for &release in InterruptRelease::VARIANTS {
        let rig = single(settings_with(|s| s.interrupt_release = release));
        rig.next_interrupt();
        rig.frame(0);
        let released = release == InterruptRelease::StatusOrData;
        assert_eq!(rig.intb_is_low(), !released, "{release:?} after DATA");
        assert_eq!(
            rig.read(0x18) & DRDY != 0,
            !released,
            "DRDY goes with the pin"
        );
        assert!(!rig.intb_is_low(), "STATUS releases it in any case");
        // After that, the next conversion causes a new edge of INTB.
        let edges = rig.chip.borrow().interrupts();
        rig.convert(0, 1);
        assert_eq!(rig.chip.borrow().interrupts(), edges + 1);
    }
}

#[test]
fn the_low_half_alone_releases_nothing() {
    for &release in InterruptRelease::VARIANTS {
        let rig = single(settings_with(|s| s.interrupt_release = release));
        rig.next_interrupt();
        rig.read(0x01);
        assert!(rig.intb_is_low());
        assert_eq!(rig.read(0x18) & 0x0008, 0x0008, "still unread");
    }
}

#[test]
fn which_reads_clear_unread() {
    for &cleared in UnreadCleared::VARIANTS {
        let rig = single(settings_with(|s| s.unread_cleared = cleared));
        rig.next_interrupt();
        assert_eq!(rig.read(0x18) & 0x000F, 0x0008);
        let after_status = match cleared {
            UnreadCleared::DataOnly => 0x0008,
            UnreadCleared::DataOrStatus => 0,
        };
        assert_eq!(rig.read(0x18) & 0x000F, after_status, "{cleared:?}");
        rig.convert(0, 1);
        rig.frame(0);
        assert_eq!(rig.read(0x18) & 0x000F, 0, "DATA clears it in any case");
    }
}

#[test]
fn an_overwritten_result_makes_no_new_edge_and_is_counted() {
    let rig = single(quiet(40e6));
    rig.next_interrupt();
    rig.convert(0, 3);
    let chip = rig.chip.borrow();
    assert_eq!(chip.interrupts(), 1);
    assert_eq!(chip.overwritten(0), 3);
    drop(chip);
    // A read of STATUS may clear UNREADCONV0, but it does not prevent the overwriting of the
    // result.
    rig.read(0x18);
    rig.convert(0, 1);
    assert_eq!(rig.chip.borrow().overwritten(0), 4);
    let (_, word) = rig.frame(0);
    let newest = rig
        .chip
        .borrow()
        .last_conversion(0)
        .expect("a conversion")
        .word;
    assert_eq!(word, newest);
}

#[test]
fn the_low_half_is_latched_by_the_high_one() {
    for &latch in ShadowLatch::VARIANTS {
        let rig = ChipRig::new(
            settings_with(|s| s.shadow_latch = latch),
            |_: usize, t: f64| 3e6 + 1e7 * t,
        );
        rig.single(2500);
        rig.convert(0, 1);
        let first = rig
            .chip
            .borrow()
            .last_conversion(0)
            .expect("a conversion")
            .word;
        let high = rig.read(0x00);
        rig.convert(0, 1);
        let second = rig
            .chip
            .borrow()
            .last_conversion(0)
            .expect("a conversion")
            .word;
        let low = rig.read(0x01);
        assert_ne!(first & 0xFFFF, second & 0xFFFF);
        let expected = if latch == ShadowLatch::OnMsbRead {
            first
        } else {
            second
        };
        assert_eq!(u32::from(high), first >> 16);
        assert_eq!(u32::from(low), expected & 0xFFFF, "{latch:?}");
        assert_eq!(rig.read(0x01), low, "reading the low half alone repeats it");
    }
}

#[test]
fn results_of_a_cycle_reach_data_one_by_one_or_together() {
    for &overwrite in Overwrite::VARIANTS {
        let settings = with_switches(quiet(40e6), |s| s.overwrite = overwrite);
        let rig = ChipRig::new(settings, |_: usize, t: f64| 3e6 + 1e7 * t);
        rig.autoscan(1, 2500, 16);
        rig.next_interrupt();
        let first = rig.frame(0).1;
        rig.frame(1);
        assert_eq!(rig.chip.borrow().overwritten(0), 0);
        // In the next cycle channel 0 has ended, channel 1 has not.
        rig.convert(0, 1);
        let newest = rig.chip.borrow().last_conversion(0).copied().unwrap();
        assert_ne!(newest.word, first);
        let at_once = overwrite == Overwrite::ByChannel;
        assert_eq!(rig.frame(0).1, if at_once { newest.word } else { first });
        assert_eq!(rig.chip.borrow().last_read(0) == Some(&newest), at_once);
        rig.convert(1, 1);
        assert_eq!(rig.frame(0).1, newest.word, "{overwrite:?}");
        // If the result is not read, the next cycle overwrites it when its own result is available.
        rig.convert(0, 2);
        let lost = if at_once { 1 } else { 0 };
        assert_eq!(rig.chip.borrow().overwritten(0), lost, "{overwrite:?}");
    }
}

#[test]
fn flags_in_data_are_cleared_by_reading_or_not() {
    for &flag_read in FlagRead::VARIANTS {
        // Code 20 with 3 kohm gives an amplitude of 1.13 V, which is low.
        let rig = ChipRig::new(settings_with(|s| s.flag_read = flag_read), [3e6]);
        rig.single(2500);
        rig.write(0x1A, 0x3601);
        rig.write(0x1E, 0xA000);
        rig.write(0x1A, 0x1601);
        rig.convert(0, 1);
        let (flags, word) = rig.frame(0);
        assert_eq!(flags, 0x1000);
        let again = rig.frame(0);
        let kept = if flag_read == FlagRead::Clears {
            0
        } else {
            0x1000
        };
        assert_eq!(again, (kept, word), "{flag_read:?}");
        rig.convert(0, 1);
        assert_eq!(rig.frame(0).0, 0x1000, "the next result brings its own");
    }
}

#[test]
fn flags_need_their_2out_bit_and_are_not_sticky() {
    let low_once = |_: usize, t: f64| if t < 2e-3 { 12e6 } else { 3e6 };
    for (error_config, flag) in [(0xF800, 0x4000), (0x4000, 0x4000), (0xB8FD, 0)] {
        let rig = ChipRig::new(quiet(10e6), low_once);
        rig.single(200);
        rig.write(0x1A, 0x3601);
        rig.write(0x19, error_config);
        rig.write(0x1B, 0x020F);
        rig.write(0x1A, 0x1601);
        rig.convert(0, 1);
        assert_eq!(rig.frame(0), (flag, 0xFFF_FFFF), "{error_config:#06x}");
        rig.wait(ms(3));
        rig.convert(0, 1);
        assert_eq!(rig.frame(0).0, 0, "gone with the cause");
    }
}

/// An autoscan at 10 MHz with errors on two channels: channel 1 is over-range, channel 2 is silent.
fn erring(settings: Settings) -> ChipRig<impl Sensors> {
    let rig = ChipRig::new(settings, [3e6, 12e6, 0.0, 3e6]);
    rig.autoscan(3, 500, 100);
    rig.write(0x1A, 0x3601);
    rig.write(0x1B, 0xC20F);
    rig.write(0x1A, 0x1601);
    rig
}

#[test]
fn status_keeps_the_first_channel_with_an_error_until_it_is_read() {
    let rig = erring(quiet(10e6));
    rig.convert(3, 1);
    assert_eq!(
        rig.read(0x18),
        0x4000 | 0x1000 | DRDY | 0x000F,
        "channel 1, OR"
    );
    assert_eq!(rig.read(0x18) & 0xFF40, 0, "cleared by the read");
    // The error of channel 2 is shown next only if STATUS has been read after that of channel 1.
    rig.convert(1, 1);
    rig.read(0x18);
    rig.convert(2, 1);
    let status = rig.read(0x18);
    assert_eq!(status & 0xC000, 0x8000);
    assert_eq!(status & 0x3F00, 0x0300, "ALE and ZC");
}

#[test]
fn status_is_sticky() {
    let rig = ChipRig::new(
        quiet(8e6),
        |_: usize, t: f64| if t < 2e-3 { 9e6 } else { 3e6 },
    );
    rig.single(200);
    rig.convert(0, 30);
    assert_eq!(rig.read(0x18) & 0x1000, 0x1000, "OR of long ago");
}

#[test]
fn status_shows_only_what_is_enabled_or_all() {
    for &reporting in StatusReporting::VARIANTS {
        let rig = erring(slow(|s| s.status_reporting = reporting));
        rig.write(0x1A, 0x3601);
        rig.write(0x19, 0xF801); // DRDY alone
        rig.write(0x1A, 0x1601);
        rig.convert(1, 1);
        assert!(
            !rig.intb_is_low(),
            "the 2INT bits govern the pin in any case"
        );
        let shown = if reporting == StatusReporting::Always {
            0x5000
        } else {
            0
        };
        assert_eq!(rig.read(0x18) & 0xFF00, shown, "{reporting:?}");
    }
}

#[test]
fn an_error_interrupts_before_the_sequence_ends() {
    let rig = erring(quiet(10e6));
    rig.next_interrupt();
    let chip = rig.chip.borrow();
    assert_eq!(chip.conversions(1), 1);
    assert_eq!(chip.conversions(2), 0);
    let truth = chip.last_conversion(1).expect("a conversion");
    assert!(truth.errors.contains(Errors::OVER_RANGE));
}

#[test]
fn reading_the_erring_channel_clears_status_where_data_releases_the_pin() {
    for &release in InterruptRelease::VARIANTS {
        let rig = erring(slow(|s| s.interrupt_release = release));
        rig.convert(3, 1);
        rig.read(0x00);
        let kept = rig.chip.borrow().register(0x18) & 0x3F00;
        assert_eq!(kept, 0x1000, "channel 0 is not the erring one");
        rig.read(0x02);
        let kept = rig.chip.borrow().register(0x18) & 0x3F00;
        let expected = if release == InterruptRelease::StatusOnly {
            0x1000
        } else {
            0
        };
        assert_eq!(kept, expected, "{release:?}");
    }
}

#[test]
fn intb_dis_holds_the_pin_high() {
    let rig = single(quiet(40e6));
    rig.write(0x1A, 0x3601);
    rig.write(0x1A, 0x1681);
    rig.convert(0, 2);
    assert!(!rig.intb_is_low());
    assert_eq!(rig.chip.borrow().interrupts(), 0);
    assert_eq!(rig.read(0x18) & DRDY, DRDY, "STATUS still reports it");
}

#[test]
fn looking_changes_nothing() {
    let rig = single(quiet(40e6));
    rig.next_interrupt();
    let chip = rig.chip.borrow();
    for address in 0..=0x7F {
        let _ = chip.register(address);
    }
    assert!(chip.intb_is_low());
    assert_eq!(chip.register(0x18), 0x0048);
}

#[test]
fn an_interrupt_can_be_awaited_at_once_or_never() {
    let rig = single(quiet(40e6));
    let edge = rig.next_interrupt();
    rig.wait(us(10));
    let mut chip = rig.chip.borrow_mut();
    let now = chip.now();
    assert_eq!(
        chip.advance_to_interrupt(now + ms(9)),
        Some(now),
        "low already"
    );
    drop(chip);
    rig.write(0x1A, 0x3601);
    let limit = rig.now() + ms(10);
    assert_eq!(rig.chip.borrow_mut().advance_to_interrupt(limit), None);
    assert_eq!(rig.now(), limit);
    assert_eq!(rig.chip.borrow().last_interrupt(), Some(edge));
    let mut unused = [0; 2];
    rig.bus()
        .write_read(ADDRESS, &[0x7E], &mut unused)
        .expect("an answer");
}
