//! External tests of `palpate-emulator`: one program, with one module per area.

mod acquisition;
mod coil;
mod common;
mod current;
mod every_fault;
mod faults;
mod flash;
mod planted;
mod profile;
mod rates;
mod second_converter;
mod starts;
mod storage;
mod time_stamps;
mod trace;

mod usb;
