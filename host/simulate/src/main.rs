//! `palpate-simulate`: the verbs of `palpate` that need no board, emulator or field solver.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use palpate_cli::failure;
use palpate_simulate::engine::NativeOnly;
use palpate_simulate::{campaign, demo, scenario};

/// Simulated tactile sensors, with measurements compared with the truth
#[derive(Parser)]
#[command(version, max_term_width = 96)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    Demo(demo::Arguments<NativeOnly>),
    Simulate(scenario::Arguments<NativeOnly>),
    Campaign(campaign::Arguments),
}

fn main() -> ExitCode {
    failure::exit(match Cli::parse().verb {
        Verb::Demo(arguments) => demo::run(&arguments),
        Verb::Simulate(arguments) => scenario::run(&arguments),
        Verb::Campaign(arguments) => campaign::run(&arguments, None),
    })
}
