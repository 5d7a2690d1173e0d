//! `palpate`: the command-line tool of the sensor.

use std::process::ExitCode;

fn main() -> ExitCode {
    palpate::main(std::env::args_os())
}
