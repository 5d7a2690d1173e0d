//! Campaigns: long runs over many sensors, boards and faults. Their results are the pages of
//! docs/evidence.

mod ablation;
mod acceptance;
mod budget;
mod coil_guards;
mod drawn;
mod efficiency;
mod enclosed_coil;
mod evidence;
mod fault_schedules;
mod field_accuracy;
mod field_front;
mod field_peers;
mod hostile_bytes;
mod image;
mod misfit;
mod modulus;
mod python;
mod recordings;
mod relaxation;
mod series;
mod sigma;
mod springs;
mod storage;
mod tool;
mod touch;
mod touch_peers;

use std::env;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use palpate_cli::failure;

/// Run a campaign; `cargo xtask evidence NAME` keeps its result
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
    Budget(budget::Arguments),
    /// The coil's current as the image drives it, over resistance, inductance and supply
    CoilCurrent,
    CoilGuards(coil_guards::Arguments),
    Efficiency(efficiency::Arguments),
    EnclosedCoil(enclosed_coil::Arguments),
    FaultSchedules(fault_schedules::Arguments),
    /// The field solver on every built-in design: estimated against true errors
    FieldAccuracy,
    FieldFront(field_front::Arguments),
    /// The field solver beside NGSolve and GetDP, which it installs: agreement and time
    FieldPeers,
    HostileBytes(hostile_bytes::Arguments),
    ImageCost(image::cost::Arguments),
    /// Faults of bus and converter and crashes in mid-ramp, on the image
    ImageFaults,
    /// Rates, latencies and losses of the image
    ImageRates,
    /// Time stamps of the image after restarts of the converter and changes of settings
    ImageStarts,
    /// Settings and calibration in the flash of the image: power cuts, flipped bits
    ImageStorage,
    /// The image at a USB host: streams, interruptions, control transfers, restarts
    ImageUsb(drawn::Seed),
    Misfit(misfit::Arguments),
    Modulus(modulus::Arguments),
    Recordings(recordings::Arguments),
    Relaxation(relaxation::Arguments),
    Series(series::Arguments),
    Sigma(sigma::Arguments),
    Springs(springs::Arguments),
    /// Settings and calibration in the flash: flipped bits, garbage, power cuts, wear
    Storage(drawn::Seed),
    Touch(touch::Arguments),
    /// Contacts of touch sensors beside ContactMechanics, which it installs, and published solutions
    TouchPeers,
}

fn main() -> ExitCode {
    if env::args().nth(1).is_some_and(|name| name == tool::TOOL) {
        return palpate::main(env::args_os().skip(1));
    }
    match Cli::parse().campaign {
        Campaign::Ablation(arguments) => failure::exit(ablation::run(&arguments)),
        Campaign::Acceptance(arguments) => failure::exit(acceptance::run(&arguments)),
        Campaign::Budget(arguments) => failure::exit(budget::run(&arguments)),
        Campaign::CoilCurrent => image::coil_current::run(),
        Campaign::CoilGuards(arguments) => coil_guards::run(&arguments),
        Campaign::Efficiency(arguments) => failure::exit(efficiency::run(&arguments)),
        Campaign::EnclosedCoil(arguments) => failure::exit(enclosed_coil::run(&arguments)),
        Campaign::FaultSchedules(arguments) => fault_schedules::run(&arguments),
        Campaign::FieldAccuracy => field_accuracy::run(),
        Campaign::FieldFront(arguments) => failure::exit(field_front::run(&arguments)),
        Campaign::FieldPeers => failure::exit(field_peers::run()),
        Campaign::HostileBytes(arguments) => hostile_bytes::run(&arguments),
        Campaign::ImageCost(arguments) => failure::exit(image::cost::run(&arguments)),
        Campaign::ImageFaults => image::faults::run(),
        Campaign::ImageRates => image::rates::run(),
        Campaign::ImageStarts => image::starts::run(),
        Campaign::ImageStorage => image::storage::run(),
        Campaign::ImageUsb(seed) => image::usb::run(&seed),
        Campaign::Misfit(arguments) => failure::exit(misfit::run(&arguments)),
        Campaign::Modulus(arguments) => failure::exit(modulus::run(&arguments)),
        Campaign::Recordings(arguments) => failure::exit(recordings::run(&arguments)),
        Campaign::Relaxation(arguments) => failure::exit(relaxation::run(&arguments)),
        Campaign::Series(arguments) => failure::exit(series::run(&arguments)),
        Campaign::Sigma(arguments) => sigma::run(&arguments),
        Campaign::Springs(arguments) => failure::exit(springs::run(&arguments)),
        Campaign::Storage(seed) => storage::run(&seed),
        Campaign::Touch(arguments) => failure::exit(touch::run(&arguments)),
        Campaign::TouchPeers => failure::exit(touch_peers::run()),
    }
}
