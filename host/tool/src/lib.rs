//! `palpate`: the command-line tool of the sensor, as a library function.

pub mod board;
mod commands;
mod interrupt;
pub mod library;
pub mod recording;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use commands::{
    bring_up, calibrate, calibrate_touch, campaign, check, chip, coil, decode, devices, doctor,
    encode, export, faults, flash, info, live, log_table, measure, packaging, record, replay,
    report, rig_gauge, serve, settings, watch,
};
use palpate_cli::failure;
use palpate_design::{field, plan, plan_ldc, plan_touch, stack, words};
use palpate_simulate::{demo, scenario};

/// Command-line tool of a tactile sensor that measures its deformation and the stiffness of the pressed object
#[derive(Parser)]
#[command(version, max_term_width = 96, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

const EXIT_CODES: &str = "\
Exit codes:
  0  done
  1  a refusal or a failure of what was run; the reason is printed
  2  bad input or arguments; the message names the location and what is allowed";

#[derive(Subcommand)]
enum Verb {
    Words(words::Arguments),
    PlanLdc(plan_ldc::Arguments),
    Chip(chip::Arguments),
    BringUp(bring_up::Arguments),
    Coil(coil::Arguments),
    Calibrate(calibrate::verb::Arguments),
    CalibrateTouch(calibrate_touch::Arguments),
    Watch(watch::Arguments),
    Live(live::Arguments),
    Measure(measure::Arguments),
    Check(check::Arguments),
    Flash(flash::Arguments),
    Devices(devices::Arguments),
    Doctor(doctor::Arguments),
    Settings(settings::Arguments),
    Faults(faults::Arguments),
    Record(record::Arguments),
    Info(info::Arguments),
    Replay(replay::Arguments),
    Report(report::Arguments),
    Export(export::Arguments),
    Decode(decode::Arguments),
    Encode(encode::Arguments),
    Demo(demo::Arguments<board::engine::Arguments>),
    Simulate(scenario::Arguments<board::engine::Arguments>),
    Campaign(palpate_simulate::campaign::Arguments),
    Plan(plan::Arguments),
    PlanTouch(plan_touch::Arguments),
    Stack(stack::Arguments),
    Field(field::Arguments),
    LogTable(log_table::Arguments),
    ServeEmulated(serve::Arguments),
    #[command(hide = true)]
    RigGauge(rig_gauge::Arguments),
    Completions(packaging::Completions),
    Man(packaging::Manual),
}

/// Runs the tool with these arguments; the first is its name.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    failure::exit(match Cli::parse_from(arguments).verb {
        Verb::Words(arguments) => words::run(&arguments),
        Verb::PlanLdc(arguments) => plan_ldc::run(&arguments),
        Verb::Chip(arguments) => chip::run(&arguments),
        Verb::BringUp(arguments) => bring_up::run(&arguments),
        Verb::Coil(arguments) => coil::run(&arguments),
        Verb::Calibrate(arguments) => calibrate::verb::run(&arguments),
        Verb::CalibrateTouch(arguments) => calibrate_touch::run(&arguments),
        Verb::Watch(arguments) => watch::run(&arguments),
        Verb::Live(arguments) => live::run(&arguments),
        Verb::Measure(arguments) => measure::run(&arguments),
        Verb::Check(arguments) => check::run(&arguments),
        Verb::Flash(arguments) => flash::run(&arguments),
        Verb::Devices(arguments) => devices::run(&arguments),
        Verb::Doctor(arguments) => doctor::run(&arguments),
        Verb::Faults(arguments) => faults::run(&arguments),
        Verb::Settings(arguments) => settings::run(&arguments),
        Verb::Record(arguments) => record::run(&arguments),
        Verb::Info(arguments) => info::run(&arguments),
        Verb::Replay(arguments) => replay::run(&arguments),
        Verb::Report(arguments) => report::run(&arguments),
        Verb::Export(arguments) => export::run(&arguments),
        Verb::Decode(arguments) => decode::run(&arguments),
        Verb::Encode(arguments) => encode::run(&arguments),
        Verb::Demo(arguments) => demo::run(&arguments),
        Verb::Simulate(arguments) => scenario::run(&arguments),
        Verb::Campaign(arguments) => campaign::run(&arguments),
        Verb::Plan(arguments) => plan::run(&arguments),
        Verb::PlanTouch(arguments) => plan_touch::run(&arguments),
        Verb::Stack(arguments) => stack::run(&arguments),
        Verb::Field(arguments) => field::run(&arguments),
        Verb::LogTable(arguments) => log_table::run(&arguments),
        Verb::ServeEmulated(arguments) => serve::run(&arguments),
        Verb::RigGauge(arguments) => rig_gauge::run(&arguments),
        Verb::Completions(arguments) => packaging::completions(&arguments, Cli::command()),
        Verb::Man(arguments) => packaging::manual(&arguments, Cli::command()),
    })
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory};

    use super::Cli;

    /// Help texts after the options, of this command and its subcommands.
    fn texts(command: &Command) -> Vec<(String, String)> {
        let name = command.get_name().to_owned();
        let text = command
            .get_after_help()
            .map(|text| (name, text.to_string()));
        let below = command.get_subcommands().flat_map(texts);
        text.into_iter().chain(below).collect()
    }

    /// A paragraph is one line, which clap wraps to the width of the terminal; indented lines stay
    /// as they are.
    #[test]
    fn no_help_text_is_wrapped_twice() {
        let texts = texts(&Cli::command());
        assert!(texts.len() > 20);
        for (verb, text) in texts {
            let is_prose = |line: &str| !line.is_empty() && !line.starts_with(' ');
            let mut pairs = text.lines().zip(text.lines().skip(1));
            let wrapped = pairs.find(|(line, next)| is_prose(line) && is_prose(next));
            assert_eq!(wrapped, None, "{verb}");
            let mut examples = text.lines().filter(|line| line.starts_with(' '));
            // clap wraps longer lines.
            assert_eq!(
                examples.find(|line| line.chars().count() > 96),
                None,
                "{verb}"
            );
        }
    }
}
