//! Results, STATUS and INTB, in each position of the related switches.

use crate::common::*;
use ldc161x_sim::{
    Errors, FlagRead, InterruptRelease, Overwrite, Sensors, Settings, ShadowLatch, StatusReporting,
    Switches, UnreadCleared,
};

const DRDY: u16 = 0x0040;

fn single(change: impl FnOnce(&mut Switches)) -> ChipRig<[f64; 4]> {
    let rig = ChipRig::new(with_switches(quiet(40e6), change), [3e6; 4]);
    rig.single(2500);
    rig
}

/// A sensor whose frequency rises, so that no two results are equal.
fn rising(_: usize, time_s: f64) -> f64 {
    3e6 + 1e7 * time_s
}

#[test]
fn results_arrive_with_the_interrupt_after_the_last_channel_and_read_as_they_are() {
    for last in 0..=3 {
        let rig = ChipRig::new(quiet(40e6), [3.0e6, 3.1e6, 3.2e6, 3.3e6]);
        if last == 0 {
            rig.single(2500);
        } else {
            rig.autoscan(last, 2500, 20);
            rig.convert(0, 1);
            let early = rig.chip.borrow().register(0x18);
            assert_eq!(early, 0x0008, "unread before the sequence ends");
        }
        let edge = rig.next_interrupt();
        assert_eq!(edge, rig.last(last).end);
        assert_eq!(rig.chip.borrow().conversions(0), 1);
        // The UNREADCONV bits are in reverse order: channel 0 has bit 3.
        let unread = (0..=last).fold(0, |bits, channel| bits | 0x0008 >> channel);
        assert_eq!(rig.chip.borrow().register(0x18), DRDY | unread);
        assert_eq!(rig.read(0x18), DRDY | unread, "looking changed nothing");
        for channel in (0..=last).rev() {
            let truth = rig.last(channel);
            assert_eq!(rig.frame(channel), (0, truth.word));
            assert_eq!(rig.chip.borrow().last_read(channel), Some(&truth));
            let hz = 3.0e6 + 0.1e6 * f64::from(channel);
            assert!((f64::from(truth.word) / 268_435_456.0 * 40e6 - hz).abs() < 200.0);
        }
    }
}

#[test]
fn which_reads_release_the_interrupt_and_clear_unread() {
    for &release in InterruptRelease::VARIANTS {
        let rig = single(|s| s.interrupt_release = release);
        rig.next_interrupt();
        rig.read(0x01);
        assert!(rig.intb_is_low(), "the low half releases nothing");
        rig.frame(0);
        let released = release == InterruptRelease::StatusOrData;
        assert_eq!(rig.intb_is_low(), !released, "{release:?} after DATA");
        let ready = rig.read(0x18) & DRDY != 0;
        assert_eq!(ready, !released, "DRDY goes with the pin");
        assert!(!rig.intb_is_low(), "STATUS releases it in any case");
        // After that, the next conversion causes a new edge of INTB.
        let edges = rig.chip.borrow().interrupts();
        rig.convert(0, 1);
        assert_eq!(rig.chip.borrow().interrupts(), edges + 1);
    }
    for (cleared, after_status) in [
        (UnreadCleared::DataOnly, 0x0008),
        (UnreadCleared::DataOrStatus, 0),
    ] {
        let rig = single(|s| s.unread_cleared = cleared);
        rig.next_interrupt();
        rig.read(0x01);
        assert_eq!(
            rig.read(0x18) & 0x000F,
            0x0008,
            "the low half clears nothing"
        );
        assert_eq!(rig.read(0x18) & 0x000F, after_status, "{cleared:?}");
        rig.convert(0, 1);
        rig.frame(0);
        assert_eq!(rig.read(0x18) & 0x000F, 0, "DATA clears it in any case");
    }
}

#[test]
fn an_overwritten_result_makes_no_new_edge_and_is_counted() {
    let rig = single(|_| {});
    rig.next_interrupt();
    rig.convert(0, 3);
    assert_eq!(rig.chip.borrow().interrupts(), 1);
    assert_eq!(rig.chip.borrow().overwritten(0), 3);
    // A read of STATUS may clear UNREADCONV0, but it does not prevent the overwriting of the
    // result.
    rig.read(0x18);
    rig.convert(0, 1);
    assert_eq!(rig.chip.borrow().overwritten(0), 4);
    assert_eq!(rig.frame(0).1, rig.last(0).word);
}

#[test]
fn the_low_half_is_latched_by_the_high_one() {
    for &latch in ShadowLatch::VARIANTS {
        let settings = with_switches(quiet(40e6), |s| s.shadow_latch = latch);
        let rig = ChipRig::new(settings, rising);
        rig.single(2500);
        rig.convert(0, 1);
        let first = rig.last(0).word;
        let high = rig.read(0x00);
        rig.convert(0, 1);
        let second = rig.last(0).word;
        let low = rig.read(0x01);
        assert_ne!(first & 0xFFFF, second & 0xFFFF);
        let latched = latch == ShadowLatch::OnMsbRead;
        let expected = if latched { first } else { second };
        assert_eq!(u32::from(high), first >> 16);
        assert_eq!(u32::from(low), expected & 0xFFFF, "{latch:?}");
        assert_eq!(rig.read(0x01), low, "reading the low half alone repeats it");
    }
}

#[test]
fn results_of_a_cycle_reach_data_one_by_one_or_together() {
    for &overwrite in Overwrite::VARIANTS {
        let settings = with_switches(quiet(40e6), |s| s.overwrite = overwrite);
        let rig = ChipRig::new(settings, rising);
        rig.autoscan(1, 2500, 16);
        rig.next_interrupt();
        let first = rig.frame(0).1;
        rig.frame(1);
        assert_eq!(rig.chip.borrow().overwritten(0), 0);
        // In the next cycle channel 0 has ended, channel 1 has not.
        rig.convert(0, 1);
        let newest = rig.last(0);
        assert_ne!(newest.word, first);
        let at_once = overwrite == Overwrite::ByChannel;
        assert_eq!(rig.frame(0).1, if at_once { newest.word } else { first });
        assert_eq!(rig.chip.borrow().last_read(0) == Some(&newest), at_once);
        rig.convert(1, 1);
        assert_eq!(rig.frame(0).1, newest.word, "{overwrite:?}");
        // An unread result is overwritten as soon as the next result of its channel reaches DATA.
        rig.convert(0, 2);
        let lost = rig.chip.borrow().overwritten(0);
        assert_eq!(lost, u64::from(at_once), "{overwrite:?}");
    }
}

#[test]
fn flags_in_data_are_cleared_by_reading_or_not() {
    for (flag_read, kept) in [(FlagRead::Clears, 0), (FlagRead::Keeps, 0x1000)] {
        let settings = with_switches(quiet(40e6), |s| s.flag_read = flag_read);
        let rig = ChipRig::new(settings, [3e6]);
        // Code 20 with 3 kohm gives an amplitude of 1.13 V, which is low.
        rig.single_with(2500, &[(0x1E, 0xA000)]);
        rig.convert(0, 1);
        let (flags, word) = rig.frame(0);
        assert_eq!(flags, 0x1000);
        assert_eq!(rig.frame(0), (kept, word), "{flag_read:?}");
        rig.convert(0, 1);
        assert_eq!(rig.frame(0).0, 0x1000, "the next result brings its own");
    }
}

#[test]
fn flags_need_their_2out_bit_and_are_not_sticky_and_those_of_status_are() {
    let fast_once = |_: usize, time_s: f64| if time_s < 2e-3 { 12e6 } else { 3e6 };
    for (error_config, flag, status) in [
        (0xF8FD, 0x4000, 0x1000),
        (0x4000, 0x4000, 0),
        (0xB8FD, 0, 0x1000),
    ] {
        let rig = ChipRig::new(quiet(10e6), fast_once);
        rig.single_with(200, &[(0x19, error_config), (0x1B, 0x020F)]);
        rig.convert(0, 1);
        assert_eq!(rig.frame(0), (flag, 0xFFF_FFFF), "{error_config:#06x}");
        rig.wait(ms(3));
        rig.convert(0, 1);
        assert_eq!(rig.frame(0).0, 0, "gone with the cause");
        assert_eq!(rig.read(0x18) & 0x1000, status, "OR of long ago");
    }
}

/// An autoscan at 10 MHz with errors on two channels: channel 1 is over-range, channel 2 is silent.
fn erring(settings: Settings, error_config: u16) -> ChipRig<impl Sensors> {
    let rig = ChipRig::new(settings, [3e6, 12e6, 0.0, 3e6]);
    rig.autoscan(3, 500, 100);
    rig.write(0x1A, 0x3601);
    rig.configure(&[(0x19, error_config), (0x1B, 0xC20F), (0x1A, 0x1601)]);
    rig
}

#[test]
fn status_keeps_the_first_channel_with_an_error_until_it_is_read() {
    let rig = erring(quiet(10e6), 0xF8FD);
    rig.convert(3, 1);
    let status = rig.read(0x18);
    assert_eq!(status, 0x4000 | 0x1000 | DRDY | 0x000F, "channel 1, OR");
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
fn status_shows_only_what_is_enabled_or_all_and_intb_only_what_is_enabled() {
    let always = StatusReporting::Always;
    for &reporting in StatusReporting::VARIANTS {
        let shown = |bits| if reporting == always { bits } else { 0 };
        let settings = with_switches(quiet(10e6), |s| s.status_reporting = reporting);
        // ERROR_CONFIG with flags in DATA, and DRDY alone on INTB.
        let rig = erring(settings, 0xF801);
        rig.convert(1, 1);
        assert!(!rig.intb_is_low());
        assert_eq!(rig.read(0x18) & 0xFF00, shown(0x5000), "{reporting:?}");
        // ERROR_CONFIG without any report.
        let rig = ChipRig::new(settings, [2e6]);
        rig.single_with(2500, &[(0x19, 0x0000)]);
        rig.convert(0, 1);
        assert!(!rig.intb_is_low());
        assert_eq!(rig.read(0x18), 0x0008 | shown(DRDY), "{reporting:?}");
    }
}

#[test]
fn an_error_interrupts_before_the_sequence_ends_and_is_cleared_with_the_pin() {
    for &release in InterruptRelease::VARIANTS {
        let settings = with_switches(quiet(10e6), |s| s.interrupt_release = release);
        let rig = erring(settings, 0xF8FD);
        rig.next_interrupt();
        assert_eq!(rig.chip.borrow().conversions(1), 1);
        assert_eq!(rig.chip.borrow().conversions(2), 0);
        assert!(rig.last(1).errors.contains(Errors::OVER_RANGE));
        rig.convert(3, 1);
        rig.read(0x00);
        let kept = || rig.chip.borrow().register(0x18) & 0x3F00;
        assert_eq!(kept(), 0x1000, "channel 0 is not the erring one");
        rig.read(0x02);
        let stays = release == InterruptRelease::StatusOnly;
        assert_eq!(kept(), if stays { 0x1000 } else { 0 }, "{release:?}");
    }
}

#[test]
fn intb_dis_holds_the_pin_high() {
    let rig = single(|_| {});
    rig.configure(&[(0x1A, 0x3601), (0x1A, 0x1681)]);
    rig.convert(0, 2);
    assert!(!rig.intb_is_low());
    assert_eq!(rig.chip.borrow().interrupts(), 0);
    assert_eq!(rig.read(0x18) & DRDY, DRDY, "STATUS still reports it");
}
