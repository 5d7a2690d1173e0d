//! Tests of `palpate-storage` from outside: one program, whose modules are its parts.

mod bit_flips;
mod costs;
mod erasing;
mod garbage;
mod model;
mod power_cuts;
mod reading;
mod saving;
mod support;
mod versions;
mod wear;
