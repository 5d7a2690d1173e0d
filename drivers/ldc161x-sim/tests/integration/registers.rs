//! The register file as seen over the bus, compared with a table that was typed from the datasheet
//! a second time.

use crate::common::*;
use ldc161x_sim::registers::{REGISTERS, describe};
use ldc161x_sim::{ConfigReadback, Settings};

/// (address, reset value, value read after writing 0xFFFF, value read after writing 0x0000). CONFIG
/// is written with its sleep bit set both times. Writing RESET_DEV resets the chip; it reads as 0.
const TABLE: [(u8, u16, u16, u16); 35] = [
    (0x00, 0, 0, 0),
    (0x01, 0, 0, 0),
    (0x02, 0, 0, 0),
    (0x03, 0, 0, 0),
    (0x04, 0, 0, 0),
    (0x05, 0, 0, 0),
    (0x06, 0, 0, 0),
    (0x07, 0, 0, 0),
    (0x08, 0x0080, 0xFFFF, 0),
    (0x09, 0x0080, 0xFFFF, 0),
    (0x0A, 0x0080, 0xFFFF, 0),
    (0x0B, 0x0080, 0xFFFF, 0),
    (0x0C, 0, 0xFFFF, 0),
    (0x0D, 0, 0xFFFF, 0),
    (0x0E, 0, 0xFFFF, 0),
    (0x0F, 0, 0xFFFF, 0),
    (0x10, 0, 0xFFFF, 0),
    (0x11, 0, 0xFFFF, 0),
    (0x12, 0, 0xFFFF, 0),
    (0x13, 0, 0xFFFF, 0),
    (0x14, 0, 0xFFFF, 0),
    (0x15, 0, 0xFFFF, 0),
    (0x16, 0, 0xFFFF, 0),
    (0x17, 0, 0xFFFF, 0),
    (0x18, 0, 0, 0),
    (0x19, 0, 0xFFFF, 0),
    (0x1A, 0x2801, 0xFFFF, 0x2000),
    (0x1B, 0x020F, 0xFFFF, 0),
    (0x1C, 0, 0, 0),
    (0x1E, 0, 0xF83F, 0),
    (0x1F, 0, 0xF800, 0),
    (0x20, 0, 0xF800, 0),
    (0x21, 0, 0xF800, 0),
    (0x7E, 0x5449, 0x5449, 0x5449),
    (0x7F, 0x3055, 0x3055, 0x3055),
];

fn rig() -> ChipRig<[f64; 4]> {
    ChipRig::new(Settings::default(), [3e6; 4])
}

#[test]
fn reset_values() {
    let rig = rig();
    for (address, reset, _, _) in TABLE {
        assert_eq!(rig.read(address), reset, "register {address:#04x}");
        assert_eq!(
            describe(address).map(|register| register.reset),
            Some(reset)
        );
    }
    assert_eq!(REGISTERS.len(), TABLE.len());
}

#[test]
fn writable_bits() {
    for (address, _, ones, zeros) in TABLE {
        let rig = rig();
        rig.write(address, 0xFFFF);
        assert_eq!(rig.read(address), ones, "ones to {address:#04x}");
        rig.write(address, if address == 0x1A { 0x2000 } else { 0 });
        assert_eq!(rig.read(address), zeros, "zeros to {address:#04x}");
    }
}

#[test]
fn there_is_nothing_at_the_other_addresses() {
    let rig = rig();
    for address in (0..=0xFF).filter(|address| describe(*address).is_none()) {
        rig.write(address, 0xFFFF);
        assert_eq!(rig.read(address), 0, "{address:#04x}");
    }
    assert_eq!(rig.chip.borrow().misuse().unknown_registers, 2 * (256 - 35));
}

#[test]
fn wrong_reserved_bits_are_noted_and_right_ones_are_not() {
    // These are the register values of datasheet section 8.2.5.
    let clean = [
        (0x08, 0x04D6),
        (0x10, 0x000A),
        (0x14, 0x1002),
        (0x19, 0x0000),
        (0x1B, 0x020C),
        (0x1E, 0x9000),
        (0x1A, 0x1601),
    ];
    let rig = rig();
    for (address, value) in clean {
        rig.write(address, value);
    }
    assert_eq!(rig.chip.borrow().misuse(), Default::default());

    for (address, value) in [
        (0x14, 0x1402),
        (0x19, 0x0100),
        (0x19, 0x0002),
        (0x1A, 0x2801 ^ 0x0100),
        (0x1A, 0x2800),
        (0x1B, 0x000F),
        (0x1C, 0x0001),
        (0x1E, 0x0040),
        (0x1F, 0x0001),
    ] {
        let rig = self::rig();
        rig.write(address, value);
        let noted = rig.chip.borrow().misuse().reserved_bits;
        assert_eq!(noted, 1, "{value:#06x} to {address:#04x}");
    }
}

#[test]
fn config_reads_back_in_both_ways() {
    for &readback in ConfigReadback::VARIANTS {
        let settings = with_switches(Settings::default(), |switches| {
            switches.config_readback = readback;
        });
        let rig = ChipRig::new(settings, [3e6]);
        let reserved = match readback {
            ConfigReadback::AsWritten => 0x0001,
            ConfigReadback::ReservedAsZero => 0x0000,
        };
        assert_eq!(rig.read(0x1A), 0x2800 | reserved);
        rig.write(0x1A, 0x3601);
        assert_eq!(rig.read(0x1A), 0x3600 | reserved);
    }
}

#[test]
fn writes_to_read_only_registers_are_noted() {
    let rig = rig();
    for address in [0x00, 0x07, 0x18, 0x7E, 0x7F] {
        rig.write(address, 0);
    }
    assert_eq!(rig.chip.borrow().misuse().read_only_writes, 5);
}

#[test]
fn the_reset_register_restores_everything() {
    let rig = rig();
    rig.single(128);
    rig.wait(ms(2));
    assert!(rig.intb_is_low());
    rig.write(0x1C, 0x8000);
    assert!(!rig.intb_is_low());
    for (address, reset, _, _) in TABLE {
        assert_eq!(rig.read(address), reset, "register {address:#04x}");
    }
    rig.write(0x1C, 0x0000);
    rig.write(0x08, 0x1234);
    rig.write(0x1C, 0x0000);
    assert_eq!(rig.read(0x08), 0x1234, "only bit 15 resets");
}
