//! `palpate field`: the magnetic field of the actuated layer.

mod ac;
mod candidate;
mod compare;
mod drive;
pub(crate) mod export;
mod figures;
mod forces;
mod front;
mod inductances;
mod input;
mod magnets;
mod mse;
mod optimise;
mod profile;
mod quantities;
mod rows;
mod search;
mod sensing;
mod solution;
mod solve;
mod stack;
mod sweep;
mod tables;

use clap::{Args, Subcommand};
use palpate_cli::failure::Failure;

pub use solution::Solution;

/// Solve and design the magnetic field of the actuated layer.
#[derive(Args)]
#[command(after_help = "\
DESIGN is a file, or a built-in design: air, A, A0, A10, B1, B2, B3, C1in, C1out, C3in, CAin, \
backplates, pot, closed; with a sensing coil, for `ac`: sensing, A-sensing, closed-sensing; \
with a magnet: holder. \
`palpate field show A` prints one to start from.")]
pub struct Arguments {
    #[command(subcommand)]
    task: FieldTask,
}

#[derive(Subcommand)]
enum FieldTask {
    Show(input::Show),
    Solve(solve::Arguments),
    Ac(ac::Arguments),
    Profile(profile::Arguments),
    Figures(figures::Arguments),
    Export(export::Arguments),
    Sweep(sweep::Arguments),
    Optimise(optimise::Arguments),
    Front(front::Arguments),
    Compare(compare::Arguments),
    Stack(stack::Arguments),
    Sensing(sensing::Arguments),
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.task {
        FieldTask::Show(arguments) => input::show(arguments),
        FieldTask::Solve(arguments) => solve::run(arguments),
        FieldTask::Ac(arguments) => ac::run(arguments),
        FieldTask::Profile(arguments) => profile::run(arguments),
        FieldTask::Export(arguments) => export::run(arguments),
        FieldTask::Figures(arguments) => figures::run(arguments),
        FieldTask::Sweep(arguments) => sweep::run(arguments),
        FieldTask::Optimise(arguments) => optimise::run(arguments),
        FieldTask::Front(arguments) => front::run(arguments),
        FieldTask::Compare(arguments) => compare::run(arguments),
        FieldTask::Stack(arguments) => stack::run(arguments),
        FieldTask::Sensing(arguments) => sensing::run(arguments),
    }
}
