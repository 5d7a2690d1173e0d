//! The firmware's image on the emulated board.

pub(crate) mod coil_current;
#[path = "../../../../sim-host/emulator/tests/integration/common/mod.rs"]
mod common;
pub(crate) mod cost;
pub(crate) mod faults;
pub(crate) mod rates;
pub(crate) mod starts;
pub(crate) mod storage;
pub(crate) mod usb;
