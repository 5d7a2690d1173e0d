//! Boards, one folder each: what names a microcontroller lies there and nowhere else. The rest of
//! the firmware knows a board by the names below.

mod rp2040;

pub use rp2040::{
    ASLEEP_US, Board, Watchdog, coil, flash, i2c, pins, reset, safe, sleep, stack_used, usb,
    vectors,
};
