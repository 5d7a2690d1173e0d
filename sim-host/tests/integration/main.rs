//! External tests of `palpate-sim`: one program, with one module per area.

mod balance;
mod changed_worlds;
mod chip;
mod clock;
mod coil_drive;
mod coil_guards;
mod common;
mod disturbances;
mod energy;
mod links;
mod native;
mod pwm_coupling;
mod relaxation;
mod rig;
mod robust;
mod sensing_coil;
mod springs;
mod stacks;
