//! `palpate`: the command-line tool of the sensor.

// A tool that is built without a part has no use for all that its parts share.
#![cfg_attr(
    not(all(
        feature = "field",
        feature = "live",
        feature = "recording",
        feature = "serial"
    )),
    allow(dead_code)
)]

#[cfg(feature = "emulator")]
mod acceptance;
#[cfg(feature = "emulator")]
mod bring_up;
mod calibrate;
mod campaign;
#[cfg(feature = "emulator")]
mod check;
mod chip;
#[cfg(feature = "emulator")]
mod coil;
#[cfg(feature = "emulator")]
mod configuration;
#[cfg(feature = "emulator")]
mod confirmation;
mod decode;
mod demo;
#[cfg(feature = "emulator")]
mod devices;
#[cfg(feature = "emulator")]
mod doctor;
mod efficiency;
#[cfg(feature = "emulator")]
mod emulated;
mod encode;
mod engine;
mod evidence;
#[cfg(feature = "recording")]
mod export;
mod faults;
#[cfg(feature = "field")]
mod field;
#[cfg(feature = "emulator")]
mod flash;
#[cfg(feature = "emulator")]
mod image;
#[cfg(feature = "emulator")]
mod image_cost;
#[cfg(feature = "recording")]
mod info;
mod instrument;
mod jsonl;
#[cfg(any(feature = "live", feature = "recording"))]
mod line;
#[cfg(feature = "emulator")]
mod link;
#[cfg(feature = "live")]
mod live;
#[cfg(feature = "emulator")]
mod log;
#[cfg(feature = "emulator")]
mod log_table;
#[cfg(feature = "emulator")]
mod measure;
mod misfit;
#[cfg(feature = "packaging")]
mod packaging;
#[cfg(feature = "parquet")]
mod parquet_file;
mod plan;
mod plan_ldc;
mod press;
#[cfg(feature = "recording")]
mod record;
#[cfg(feature = "recording")]
mod recorded_report;
#[cfg(feature = "recording")]
mod recording;
#[cfg(feature = "recording")]
mod recording_trials;
#[cfg(feature = "recording")]
mod replay;
mod report;
mod results;
#[cfg(feature = "emulator")]
mod rig_gauge;
#[cfg(feature = "emulator")]
mod serve;
#[cfg(feature = "emulator")]
mod settings;
mod simulate;
mod springs;
mod stack;
#[cfg(feature = "emulator")]
mod storage;
mod switches;
#[cfg(feature = "emulator")]
mod tool;
mod verdict;
#[cfg(feature = "emulator")]
mod watch;
mod words;

use std::process::ExitCode;

#[cfg(feature = "packaging")]
use clap::CommandFactory;
use clap::{Parser, Subcommand};
use palpate_cli::failure::Failure;
use palpate_cli::notice;

/// Firmware tool of a tactile sensor that feels how far it is pressed, and how stiff the
/// pressing thing is.
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
    #[cfg(feature = "emulator")]
    BringUp(bring_up::Arguments),
    #[cfg(feature = "emulator")]
    Coil(coil::Arguments),
    #[cfg(feature = "emulator")]
    Calibrate(calibrate::verb::Arguments),
    #[cfg(feature = "emulator")]
    Watch(watch::Arguments),
    #[cfg(feature = "live")]
    Live(live::Arguments),
    #[cfg(feature = "emulator")]
    Measure(measure::Arguments),
    #[cfg(feature = "emulator")]
    Check(check::Arguments),
    #[cfg(feature = "emulator")]
    Flash(flash::Arguments),
    #[cfg(feature = "emulator")]
    Devices(devices::Arguments),
    #[cfg(feature = "emulator")]
    Doctor(doctor::Arguments),
    #[cfg(feature = "emulator")]
    Settings(settings::Arguments),
    Faults(faults::Arguments),
    #[cfg(feature = "recording")]
    Record(record::Arguments),
    #[cfg(feature = "recording")]
    Info(info::Arguments),
    #[cfg(feature = "recording")]
    Replay(replay::Arguments),
    #[cfg(feature = "recording")]
    Report(recorded_report::Arguments),
    #[cfg(feature = "recording")]
    Export(export::Arguments),
    #[cfg(feature = "recording")]
    #[command(hide = true)]
    Recordings(recording_trials::Arguments),
    Decode(decode::Arguments),
    Encode(encode::Arguments),
    Demo(demo::Arguments),
    Simulate(simulate::Arguments),
    Campaign(campaign::Arguments),
    Plan(plan::Arguments),
    Stack(stack::Arguments),
    #[command(hide = true)]
    Efficiency(efficiency::Arguments),
    #[command(hide = true)]
    Misfit(misfit::Arguments),
    #[cfg(feature = "emulator")]
    #[command(hide = true)]
    Acceptance(acceptance::Arguments),
    #[command(hide = true)]
    Springs(springs::Arguments),
    #[cfg(feature = "field")]
    Field(field::Arguments),
    #[cfg(feature = "emulator")]
    ImageCost(image_cost::Arguments),
    #[cfg(feature = "emulator")]
    LogTable(log_table::Arguments),
    #[cfg(feature = "emulator")]
    ServeEmulated(serve::Arguments),
    #[cfg(feature = "emulator")]
    #[command(hide = true)]
    RigGauge(rig_gauge::Arguments),
    #[cfg(feature = "packaging")]
    Completions(packaging::Completions),
    #[cfg(feature = "packaging")]
    Man(packaging::Manual),
}

fn main() -> ExitCode {
    let result = match Cli::parse().verb {
        Verb::Words(arguments) => words::run(&arguments),
        Verb::PlanLdc(arguments) => plan_ldc::run(&arguments),
        Verb::Chip(arguments) => chip::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::BringUp(arguments) => bring_up::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Coil(arguments) => coil::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Calibrate(arguments) => calibrate::verb::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Watch(arguments) => watch::run(&arguments),
        #[cfg(feature = "live")]
        Verb::Live(arguments) => live::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Measure(arguments) => measure::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Check(arguments) => check::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Flash(arguments) => flash::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Devices(arguments) => devices::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Doctor(arguments) => doctor::run(&arguments),
        Verb::Faults(arguments) => faults::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Settings(arguments) => settings::run(&arguments),
        #[cfg(feature = "recording")]
        Verb::Record(arguments) => record::run(&arguments),
        #[cfg(feature = "recording")]
        Verb::Info(arguments) => info::run(&arguments),
        #[cfg(feature = "recording")]
        Verb::Replay(arguments) => replay::run(&arguments),
        #[cfg(feature = "recording")]
        Verb::Recordings(arguments) => recording_trials::run(&arguments),
        #[cfg(feature = "recording")]
        Verb::Report(arguments) => recorded_report::run(&arguments),
        #[cfg(feature = "recording")]
        Verb::Export(arguments) => export::run(&arguments),
        Verb::Decode(arguments) => decode::run(&arguments),
        Verb::Encode(arguments) => encode::run(&arguments),
        Verb::Demo(arguments) => demo::run(&arguments),
        Verb::Simulate(arguments) => simulate::run(&arguments),
        Verb::Campaign(arguments) => campaign::run(&arguments),
        Verb::Plan(arguments) => plan::run(&arguments),
        Verb::Stack(arguments) => stack::run(&arguments),
        Verb::Efficiency(arguments) => efficiency::run(&arguments),
        Verb::Misfit(arguments) => misfit::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::Acceptance(arguments) => acceptance::run(&arguments),
        Verb::Springs(arguments) => springs::run(&arguments),
        #[cfg(feature = "field")]
        Verb::Field(arguments) => field::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::ImageCost(arguments) => image_cost::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::LogTable(arguments) => log_table::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::ServeEmulated(arguments) => serve::run(&arguments),
        #[cfg(feature = "emulator")]
        Verb::RigGauge(arguments) => rig_gauge::run(&arguments),
        #[cfg(feature = "packaging")]
        Verb::Completions(arguments) => packaging::completions(&arguments, Cli::command()),
        #[cfg(feature = "packaging")]
        Verb::Man(arguments) => packaging::manual(&arguments, Cli::command()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // A reader that went away (`palpate ... | head`) is no failure.
        Err(Failure::Output(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => {
            ExitCode::SUCCESS
        }
        Err(failure) => {
            notice::say(format_args!("palpate: {failure}"));
            failure.exit_code()
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::{Command, CommandFactory};

    use super::Cli;

    /// What a help text says behind its options, and those of the verbs below.
    fn texts(command: &Command) -> Vec<(String, String)> {
        let name = command.get_name().to_owned();
        let text = command
            .get_after_help()
            .map(|text| (name, text.to_string()));
        let below = command.get_subcommands().flat_map(texts);
        text.into_iter().chain(below).collect()
    }

    /// A paragraph is one line, which is wrapped to the width of the terminal; what is indented stays as it is.
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
            // Beyond that clap wraps it.
            assert_eq!(
                examples.find(|line| line.chars().count() > 96),
                None,
                "{verb}"
            );
        }
    }
}
