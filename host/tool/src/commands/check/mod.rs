//! `palpate check`: whether a board's calibration is still valid, by a train without a press and by
//! a known spring.

mod arguments;
mod in_force;
mod spring;
mod untouched;

pub(crate) use arguments::Arguments;
use palpate_cli::failure::Failure;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.untouched {
        Some(session) => untouched::run(arguments, session),
        None => spring::run(arguments),
    }
}
