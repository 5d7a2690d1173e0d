//! Campaigns: long runs over many sensors, boards and faults, whose results are the pages of docs/evidence.

mod ablation;
mod acceptance;
mod drawn;
mod efficiency;
mod image_cost;
mod misfit;
mod recordings;
mod series;
mod springs;
mod tool;

use std::env;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use palpate_cli::failure;

/// Run a campaign; `cargo xtask evidence NAME` writes its page
#[derive(Parser)]
#[command(max_term_width = 96)]
struct Cli {
    #[command(subcommand)]
    campaign: Campaign,
}

#[derive(Subcommand)]
enum Campaign {
    Ablation(ablation::Arguments),
    Acceptance(acceptance::Arguments),
    Efficiency(efficiency::Arguments),
    ImageCost(image_cost::Arguments),
    Misfit(misfit::Arguments),
    Recordings(recordings::Arguments),
    Series(series::Arguments),
    Springs(springs::Arguments),
}

fn main() -> ExitCode {
    if env::args().nth(1).is_some_and(|name| name == tool::TOOL) {
        return palpate::main(env::args_os().skip(1));
    }
    failure::exit(match Cli::parse().campaign {
        Campaign::Ablation(arguments) => ablation::run(&arguments),
        Campaign::Acceptance(arguments) => acceptance::run(&arguments),
        Campaign::Efficiency(arguments) => efficiency::run(&arguments),
        Campaign::ImageCost(arguments) => image_cost::run(&arguments),
        Campaign::Misfit(arguments) => misfit::run(&arguments),
        Campaign::Recordings(arguments) => recordings::run(&arguments),
        Campaign::Series(arguments) => series::run(&arguments),
        Campaign::Springs(arguments) => springs::run(&arguments),
    })
}
