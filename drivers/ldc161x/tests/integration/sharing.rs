//! Two chips on one bus, shared through embedded-hal-bus; and the bus returned by `release`.

use std::cell::RefCell;

use crate::common::*;
use embedded_hal::i2c::I2c;
use embedded_hal_bus::i2c::RefCellDevice;
use embedded_hal_mock::eh1::i2c::Transaction;
use ldc161x::{Address, Ldc161x, Model};

#[test]
fn two_chips_share_a_bus() {
    let (i2c, mut check) = bus(&[
        Transaction::write_read(0x2A, vec![0x7E], vec![0x54, 0x49]),
        Transaction::write_read(0x2A, vec![0x7F], vec![0x30, 0x55]),
        Transaction::write_read(0x2B, vec![0x7E], vec![0x54, 0x49]),
        Transaction::write_read(0x2B, vec![0x7F], vec![0x30, 0x55]),
    ]);
    let shared = RefCell::new(i2c);
    let mut low = Ldc161x::new(
        RefCellDevice::new(&shared),
        Model::Ldc1614,
        Address::AddrLow,
    );
    let mut high = Ldc161x::new(
        RefCellDevice::new(&shared),
        Model::Ldc1614,
        Address::AddrHigh,
    );
    low.identify().unwrap();
    high.identify().unwrap();
    check.done();
}

#[test]
fn the_bus_is_handed_back() {
    let (i2c, mut check) = bus(&[Transaction::write(0x50, vec![1])]);
    let chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    let mut i2c = chip.release();
    i2c.write(0x50, &[1]).unwrap();
    check.done();
}
