//! Integration tests of `palpate-storage`: one program, one module per subject.

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
