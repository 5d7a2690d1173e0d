//! Tests of `palpate-sim` from outside: one program, whose modules are its parts.

mod balance;
mod board;
mod chip;
mod clock;
mod coil;
mod coil_drive;
mod coil_guards;
mod common;
mod disturbances;
mod energy;
mod pwm_coupling;
mod rig;
mod robust;
mod springs;
mod stacks;
