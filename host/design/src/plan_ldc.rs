//! `palpate plan-ldc`: register values for a board, or the exceeded limit.

use std::io::{self, Write};

use clap::{Args, ValueEnum};
use ldc161x::{
    Acquisition, BusAccess, Channel, Code28, LimitError, Model, Noise, Plan, Rate, Rcount,
    ReferenceClock, Request, Sensor, Sequence,
};
use palpate_cli::{failure::Failure, quantity};
use serde::Serialize;

/// Plan the clocks of an LDC161x: dividers, RCOUNT, SETTLECOUNT, deglitch filter and drive
/// current for a sensor and a rate, or the limit that refuses them.
#[derive(Args)]
#[command(after_help = "\
Exit code 1 when the plan is refused.

Example: four coils between 2.9 and 3.8 MHz, 500 frames a second, clock of 40 MHz
  palpate plan-ldc --clock 40M --sensor 2.9M..3.8M --channels 0-3 --rate 500")]
pub struct Arguments {
    #[command(flatten)]
    board: PlannedBoard,
    /// Print JSON instead of an explanation
    #[arg(long)]
    json: bool,
}

/// Board, and requested rate.
#[derive(Args)]
pub struct PlannedBoard {
    /// The chip
    #[arg(long, value_enum, default_value = "ldc1614")]
    chip: ChipChoice,
    /// Clock on CLKIN in Hz (40M), or `internal`
    #[arg(long, default_value = "40M", value_parser = clock)]
    clock: ReferenceClock,
    /// Resonance frequency in Hz, LOW..HIGH
    #[arg(long, default_value = "2.9M..3.8M", value_parser = quantity::range, value_name = "LOW..HIGH")]
    pub sensor: (u32, u32),
    /// One channel (0, 1, 2, 3), or autoscan over 0-1, 0-2 or 0-3
    #[arg(long, default_value = "0", value_parser = channels)]
    channels: Acquisition,
    /// Frames a second, or `bus` for as many as the bus carries with a check of one register after each
    #[arg(long, default_value = "bus", value_parser = rate, conflicts_with = "rcount", allow_negative_numbers = true)]
    rate: Rate,
    /// Length of the conversion, instead of a rate: RCOUNT, 9 to 65535
    #[arg(long, value_parser = rcount)]
    rcount: Option<Rate>,
    /// Highest quality factor of the sensor
    #[arg(long, default_value_t = 50)]
    pub quality: u16,
    /// Parallel resistance of the sensor in ohm, LOW..HIGH
    #[arg(long, default_value = "5k", value_parser = quantity::range, value_name = "LOW..HIGH")]
    pub resistance: (u32, u32),
    /// I2C clock in Hz
    #[arg(long, default_value = "400k", value_parser = quantity::whole)]
    pub bus: u32,
    /// What releases INTB in the chip. STATUS is read with each frame unless data does
    #[arg(long, value_enum, default_value = "status")]
    pub release: Release,
    /// White noise of the sensor beside quantisation, relative, in 1 ms
    #[arg(long, default_value_t = 0.0, value_parser = noise)]
    pub noise: f32,
}

#[derive(Clone, Copy, ValueEnum)]
enum ChipChoice {
    Ldc1612,
    Ldc1614,
}

/// What releases INTB.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Release {
    /// Reading STATUS only
    Status,
    /// Reading data, or STATUS
    Data,
}

fn clock(text: &str) -> Result<ReferenceClock, String> {
    if text == "internal" {
        return Ok(ReferenceClock::Internal);
    }
    quantity::whole(text).map(|hz| ReferenceClock::External { hz })
}

fn channels(text: &str) -> Result<Acquisition, String> {
    match text {
        "0" => Ok(Acquisition::Single(Channel::Zero)),
        "1" => Ok(Acquisition::Single(Channel::One)),
        "2" => Ok(Acquisition::Single(Channel::Two)),
        "3" => Ok(Acquisition::Single(Channel::Three)),
        "0-1" => Ok(Acquisition::Autoscan(Sequence::ZeroToOne)),
        "0-2" => Ok(Acquisition::Autoscan(Sequence::ZeroToTwo)),
        "0-3" => Ok(Acquisition::Autoscan(Sequence::ZeroToThree)),
        _ => Err("allowed: 0, 1, 2, 3, 0-1, 0-2, 0-3".into()),
    }
}

fn rate(text: &str) -> Result<Rate, String> {
    if text == "bus" {
        return Ok(Rate::AsTheBusAllows);
    }
    text.parse()
        .map(Rate::PerSecond)
        .map_err(|_| "allowed: a whole number, or bus".into())
}

fn rcount(text: &str) -> Result<Rate, String> {
    let count = text.parse().ok().and_then(Rcount::new);
    count
        .map(Rate::Conversion)
        .ok_or_else(|| "allowed: 9 to 65535".into())
}

fn noise(text: &str) -> Result<f32, String> {
    let value: f32 = text.parse().map_err(|_| "allowed: a number like 1e-6")?;
    if (0.0..0.1).contains(&value) {
        Ok(value)
    } else {
        Err("allowed: 0 to below 0.1".into())
    }
}

impl PlannedBoard {
    /// Model of the chip.
    pub fn model(&self) -> Model {
        match self.chip {
            ChipChoice::Ldc1612 => Model::Ldc1612,
            ChipChoice::Ldc1614 => Model::Ldc1614,
        }
    }

    /// Frequency of the external clock, Hz; `None` with the internal oscillator.
    pub fn external_clock_hz(&self) -> Option<u32> {
        match self.clock {
            ReferenceClock::External { hz } => Some(hz),
            ReferenceClock::Internal => None,
        }
    }

    /// Builds the request for a chip in which this event releases INTB.
    pub fn request(&self, release: Release) -> Request {
        let sensor = Sensor {
            lowest_hz: self.sensor.0,
            highest_hz: self.sensor.1,
            highest_quality_factor: self.quality,
            lowest_rp_ohm: self.resistance.0,
            highest_rp_ohm: self.resistance.1,
        };
        Request {
            rate: self.rcount.unwrap_or(self.rate),
            bus_hz: self.bus,
            access: BusAccess::FramePerTransaction,
            status_reads: release == Release::Status,
            noise: Noise {
                white_relative_in_1_ms: self.noise,
                comparator_duty: None,
            },
            ..Request::new(self.model(), self.clock, self.channels, sensor)
        }
    }
}

/// Outcome as JSON.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum PlanOutcome {
    Plan(Plan),
    Refusal {
        limit: &'static str,
        remedy: &'static str,
        text: String,
    },
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let request = arguments.board.request(arguments.board.release);
    let result = request.plan();
    let mut out = io::stdout().lock();
    if arguments.json {
        let outcome = match &result {
            Ok(plan) => PlanOutcome::Plan(*plan),
            Err(refusal) => PlanOutcome::Refusal {
                limit: refusal.limit(),
                remedy: refusal.remedy(),
                text: refusal.to_string(),
            },
        };
        serde_json::to_writer_pretty(&mut out, &outcome)?;
        writeln!(out)?;
    }
    let plan = result.map_err(refused)?;
    if !arguments.json {
        write!(out, "{}", explain(&request, &plan))?;
    }
    Ok(())
}

/// Failure for a plan that exceeds the limits of the chip.
pub fn refused(refusal: LimitError) -> Failure {
    Failure::Refused(format!("the plan is refused: {refusal}"))
}

fn explain(request: &Request, plan: &Plan) -> String {
    let mut text = String::new();
    for channel in plan.configuration.acquisition.channels() {
        text.push_str(&explain_channel(request, plan, channel));
    }
    text.push_str(&format!(
        "deglitch filter {}: the lowest bandwidth above the fastest sensor\n\
         frame every {:.1} us, {:.1} a second; {:.1} us of it on the bus at {} kHz ({:.0} %)\n",
        plan.configuration.deglitch,
        plan.frame_period_ns as f64 * 1e-3,
        plan.frames_per_second(),
        plan.frame_read_ns as f64 * 1e-3,
        request.bus_hz / 1_000,
        100.0 * plan.bus_load(),
    ));
    for (given, advice) in [
        (
            plan.advice.injection_lock,
            "the sensor may pass 1/3, 1/5 or 1/7 of the clock, where weak oscillation can lock to it",
        ),
        (
            plan.advice.low_amplitude,
            "below 1.2 V at the lowest resistance: more noise, and the amplitude flag up",
        ),
        (
            plan.advice.uncalibrated_clock,
            "the internal oscillator may have 35 to 55 MHz: calibrate absolute frequencies",
        ),
    ] {
        if given {
            text.push_str(&format!("note: {advice}\n"));
        }
    }
    text
}

fn explain_channel(request: &Request, plan: &Plan, channel: Channel) -> String {
    let settings = plan.configuration.channel(channel);
    let scale = plan.configuration.scale(channel);
    let reference_hz = scale.reference_hz();
    let lowest_hz = f64::from(request.sensors[usize::from(channel.number())].lowest_hz);
    let code = Code28::new((lowest_hz / scale.hz_per_lsb()) as u32).unwrap_or(Code28::OVER_RANGE);
    format!(
        "channel {channel}: reference {:.3} MHz (divider {}), sensor divider {}\n\
         \x20 RCOUNT {}: conversion {:.1} us, standard uncertainty {:.1e} of the frequency at its lowest\n\
         \x20 SETTLECOUNT {}: {:.1} us\n\
         \x20 drive {}\n",
        reference_hz * 1e-6,
        settings.dividers.reference(),
        settings.dividers.sensor(),
        settings.rcount.get(),
        scale.conversion_s() * 1e6,
        scale.relative_sigma(code),
        settings.settle_count.get(),
        f64::from(settings.settle_count.reference_periods()) / reference_hz * 1e6,
        settings.drive,
    )
}
