//! The register map, typed a second time from the datasheet's register list, as plain numbers.
//! Using none of the driver's constants, it also reveals typing errors in those.
#![allow(dead_code, unreachable_pub)]

use embedded_hal_mock::eh1::i2c::{Mock, Transaction};

pub const ADDRESS: u8 = 0x2A;

pub const STATUS: u8 = 0x18;
pub const ERROR_CONFIG: u8 = 0x19;
pub const CONFIG: u8 = 0x1A;
pub const MUX_CONFIG: u8 = 0x1B;
pub const RESET_DEV: u8 = 0x1C;
pub const MANUFACTURER: u8 = 0x7E;
pub const DEVICE: u8 = 0x7F;

/// Address of the register of channel 0; add the channel's number.
pub const RCOUNT: u8 = 0x08;
pub const OFFSET: u8 = 0x0C;
pub const SETTLECOUNT: u8 = 0x10;
pub const CLOCK_DIVIDERS: u8 = 0x14;
pub const DRIVE_CURRENT: u8 = 0x1E;

pub fn read(register: u8, value: u16) -> Transaction {
    Transaction::write_read(ADDRESS, vec![register], value.to_be_bytes().to_vec())
}

pub fn write(register: u8, value: u16) -> Transaction {
    let [high, low] = value.to_be_bytes();
    Transaction::write(ADDRESS, vec![register, high, low])
}

pub fn identity() -> Vec<Transaction> {
    vec![read(0x7E, 0x5449), read(0x7F, 0x3055)]
}

/// The transfers of one frame: pointer and two bytes for each register, joined by repeated starts.
pub fn frame(registers: &[(u8, u16)]) -> Vec<Transaction> {
    let mut list = vec![Transaction::transaction_start(ADDRESS)];
    for (register, value) in registers {
        list.push(Transaction::write(ADDRESS, vec![*register]));
        list.push(Transaction::read(ADDRESS, value.to_be_bytes().to_vec()));
    }
    list.push(Transaction::transaction_end(ADDRESS));
    list
}

/// Transfers when the driver is started with these settings: identity, sleep, settings, read-back,
/// wake, every register again, and STATUS, which releases INTB.
pub fn start(asleep: u16, awake: u16, settings: &[(u8, u16)]) -> Vec<Transaction> {
    let mut list = identity();
    list.extend([write(CONFIG, asleep), read(CONFIG, asleep)]);
    list.extend(
        settings
            .iter()
            .map(|(register, value)| write(*register, *value)),
    );
    list.extend(
        settings
            .iter()
            .map(|(register, value)| read(*register, *value)),
    );
    list.extend([write(CONFIG, awake), read(CONFIG, awake)]);
    list.extend(
        settings
            .iter()
            .map(|(register, value)| read(*register, *value)),
    );
    list.extend([read(CONFIG, awake), read(STATUS, 0x0048)]);
    list
}

/// A mock that expects `transactions`, and a handle to check that all of them occurred.
pub fn bus(transactions: &[Transaction]) -> (Mock, Mock) {
    let mock = Mock::new(transactions);
    (mock.clone(), mock)
}
