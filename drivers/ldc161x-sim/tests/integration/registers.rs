//! The register file as seen over the bus, compared with a table that was typed from the datasheet
//! a second time.

use core::ops::RangeInclusive;

use crate::common::*;
use ldc161x_sim::{Misuse, Settings};

/// (addresses, reset value, value read after writing 0xFFFF, value read after writing 0x0000).
/// CONFIG is written with its sleep bit set both times. Writing RESET_DEV resets the chip; it reads
/// as 0.
const TABLE: [(RangeInclusive<u8>, u16, u16, u16); 11] = [
    (0x00..=0x07, 0, 0, 0),
    (0x08..=0x0B, 0x0080, 0xFFFF, 0),
    (0x0C..=0x17, 0, 0xFFFF, 0),
    (0x18..=0x18, 0, 0, 0),
    (0x19..=0x19, 0, 0xFFFF, 0),
    (0x1A..=0x1A, 0x2801, 0xFFFF, 0x2000),
    (0x1B..=0x1B, 0x020F, 0xFFFF, 0),
    (0x1C..=0x1C, 0, 0, 0),
    (0x1E..=0x1E, 0, 0xF83F, 0),
    (0x1F..=0x21, 0, 0xF800, 0),
    (0x7E..=0x7E, 0x5449, 0x5449, 0x5449),
];
const DEVICE: u16 = 0x3055;

fn rig() -> ChipRig<[f64; 4]> {
    ChipRig::new(Settings::default(), [3e6; 4])
}

#[test]
fn every_register_has_its_reset_value_and_its_writable_bits() {
    for (addresses, reset, ones, zeros) in TABLE {
        for address in addresses {
            let rig = rig();
            assert_eq!(rig.read(address), reset, "register {address:#04x}");
            rig.write(address, 0xFFFF);
            assert_eq!(rig.read(address), ones, "ones to {address:#04x}");
            rig.write(address, if address == 0x1A { 0x2000 } else { 0 });
            assert_eq!(rig.read(address), zeros, "zeros to {address:#04x}");
        }
    }
    assert_eq!(rig().read(0x7F), DEVICE);
}

#[test]
fn wrong_reserved_bits_and_writes_to_what_is_read_only_are_noted() {
    // The first seven are the values of datasheet section 8.2.5.
    for (address, value, reserved_bits, read_only_writes) in [
        (0x08, 0x04D6, 0, 0),
        (0x10, 0x000A, 0, 0),
        (0x14, 0x1002, 0, 0),
        (0x19, 0x0000, 0, 0),
        (0x1B, 0x020C, 0, 0),
        (0x1E, 0x9000, 0, 0),
        (0x1A, 0x1601, 0, 0),
        (0x14, 0x1402, 1, 0),
        (0x19, 0x0100, 1, 0),
        (0x19, 0x0002, 1, 0),
        (0x1A, 0x2801 ^ 0x0100, 1, 0),
        (0x1A, 0x2800, 1, 0),
        (0x1B, 0x000F, 1, 0),
        (0x1C, 0x0001, 1, 0),
        (0x1E, 0x0040, 1, 0),
        (0x1F, 0x0001, 1, 0),
        (0x00, 0, 0, 1),
        (0x07, 0, 0, 1),
        (0x18, 0, 0, 1),
        (0x7E, 0, 0, 1),
        (0x7F, 0, 0, 1),
    ] {
        let rig = rig();
        rig.write(address, value);
        let expected = Misuse {
            reserved_bits,
            read_only_writes,
            ..Misuse::default()
        };
        assert_eq!(
            rig.chip.borrow().misuse(),
            expected,
            "{value:#06x} to {address:#04x}"
        );
    }
}

#[test]
fn the_reset_register_restores_everything() {
    let rig = rig();
    rig.single(128);
    rig.wait(ms(2));
    assert!(rig.intb_is_low());
    rig.write(0x1C, 0x8000);
    assert!(!rig.intb_is_low());
    for (addresses, reset, ..) in TABLE {
        for address in addresses {
            assert_eq!(rig.read(address), reset, "register {address:#04x}");
        }
    }
    rig.write(0x08, 0x1234);
    rig.write(0x1C, 0x0000);
    assert_eq!(rig.read(0x08), 0x1234, "only bit 15 resets");
}
