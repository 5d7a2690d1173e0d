//! Boards, one folder each. Only these folders name a microcontroller; the rest of the firmware uses a
//! board through the names below.

mod rp2040;

pub use rp2040::{
    ASLEEP_US, Board, Watchdog, coil, flash, i2c, pins, reset, safe, sleep, stack_used, usb,
    vectors,
};
