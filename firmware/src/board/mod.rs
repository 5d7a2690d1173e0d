//! Boards, one folder each. Only these folders use a microcontroller's registers and HAL; the rest of
//! the firmware uses a board through the names below and the traits of `palpate-node`: `CoilHardware`,
//! `EdgeReader`, `Port` and `Hardware`, of which the last two are implemented in `src/tasks`. A second
//! implementation of the traits is `sim-host/src/native`, on a PC. `docs/porting.md` lists what another
//! board has to give, and the files outside of its folder that it changes.

mod rp2040;

pub use rp2040::{
    ASLEEP_US, Board, Watchdog, coil, flash, i2c, pins, reset, safe, sleep, stack_used, usb,
    vectors,
};
