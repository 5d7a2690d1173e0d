//! The stated standard uncertainty against the scatter, in full; see `system_tests::sigma`.

use std::{fmt::Write, ops::RangeInclusive, process::ExitCode};

use clap::Args;
use ldc161x_sim::Counter;
use system_tests::sigma::{ConverterCase, accepted_plans, cases, measure, measure_plan};

use crate::evidence::conclude;

/// Compare stated standard uncertainties with the scatter about the truth.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Number of readings of each channel in each case
    #[arg(long, default_value_t = 20_000)]
    readings: u32,
    /// Number of random plans to run
    #[arg(long, default_value_t = 200)]
    plans: usize,
    /// Seed of the simulated chip
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// One claim about a group of cases.
struct Claim {
    heading: &'static str,
    counter: Counter,
    duty_is_known: bool,
    lowest: f64,
    highest: f64,
}

const CLAIMS: [Claim; 3] = [
    Claim {
        heading: "Two gates, duty of the comparator known: within 10 % at every phase",
        counter: Counter::TwoGates,
        duty_is_known: true,
        lowest: 0.9,
        highest: 1.1,
    },
    Claim {
        heading: "Two gates, duty not known: within a factor of 1.42 at any one phase",
        counter: Counter::TwoGates,
        duty_is_known: false,
        lowest: 1.0 / 1.45,
        highest: 1.45,
    },
    Claim {
        heading: "Half periods in one gate: the statement is an upper bound",
        counter: Counter::HalfPeriods,
        duty_is_known: true,
        lowest: 0.45,
        highest: 1.1,
    },
];

pub(crate) fn run(arguments: &Arguments) -> ExitCode {
    let mut table = String::new();
    let mut holds = true;
    let mut ranges = Vec::new();
    for claim in &CLAIMS {
        let range = report(claim, arguments);
        let (lowest, highest) = range.unwrap_or((f64::NAN, f64::NAN));
        holds &= lowest >= claim.lowest && highest <= claim.highest;
        let _ = writeln!(
            table,
            "| {} | {lowest:.3} | {highest:.3} | {:.2} to {:.2} |",
            claim.heading, claim.lowest, claim.highest
        );
        ranges.push(format!("{lowest:.3} to {highest:.3}"));
    }
    let mut plans = String::new();
    holds &= report_plans(&mut plans, arguments);
    let text = format!(
        "The root mean square of error over stated sigma is {} with the duty known, {} with the duty not known, {} with half periods \
         in one gate.\n\n\
         Error: reading less true mean frequency of its conversion; 1 where the statement is right. RCOUNT of 100 to 65535, single \
         channels and autoscan, noise of 0 and 1e-6 in 1 ms. Sensors sweep over 1 % of their frequency; four phases between the edges of \
         sensor and reference.\n\n\
         | case | least | greatest | claimed |\n|---|---|---|---|\n{table}\n{plans}",
        ranges[0], ranges[1], ranges[2]
    );
    conclude(&text, holds)
}

/// The least and the greatest ratio of a claim's cases; prints every case.
fn report(claim: &Claim, arguments: &Arguments) -> Option<(f64, f64)> {
    println!(
        "\n## {}\n\n| RCOUNT | mode | noise in 1 ms | rms of error / sigma, channels 0 to 3 |\n\
         |---|---|---|---|",
        claim.heading
    );
    let (mut lowest, mut highest) = (f64::INFINITY, 0.0_f64);
    for case in cases(claim.counter, claim.duty_is_known) {
        match measure(&case, arguments.readings, arguments.seed) {
            Ok(scatter) => {
                let ratios: Vec<_> = scatter.iter().map(|channel| channel.rms).collect();
                lowest = ratios.iter().copied().fold(lowest, f64::min);
                highest = ratios.iter().copied().fold(highest, f64::max);
                print_row(&case, &ratios);
            }
            Err(error) => {
                println!("\n{case:?}: {error}");
                return None;
            }
        }
    }
    Some((lowest, highest))
}

fn print_row(case: &ConverterCase, ratios: &[f64]) {
    let mode = if case.autoscan { "autoscan" } else { "single" };
    let list: Vec<_> = ratios.iter().map(|ratio| format!("{ratio:.3}")).collect();
    println!(
        "| {} | {mode} | {:e} | {} |",
        case.rcount,
        case.noise_in_1_ms,
        list.join(", ")
    );
}

/// Number of readings of each channel by each random plan: they determine a standard deviation to
/// 1.6 %.
const READINGS_OF_A_PLAN: u32 = 2_000;
/// Claimed range of the ratio of scatter to stated uncertainty of every random plan.
const OF_A_PLAN: RangeInclusive<f64> = 0.9..=1.1;
/// Limits of the sensors' frequency decades, Hz.
const DECADES_HZ: [f64; 5] = [1e3, 1e4, 1e5, 1e6, 1e7];

fn report_plans(text: &mut String, arguments: &Arguments) -> bool {
    let plans = accepted_plans(arguments.seed).take(arguments.plans);
    let mut ratios = Vec::new();
    for (number, (request, plan)) in plans.enumerate() {
        let seed = arguments.seed + number as u64;
        match measure_plan(&request, &plan, READINGS_OF_A_PLAN, seed) {
            Ok(scatter) => {
                let hz = f64::from(request.sensors[0].lowest_hz);
                ratios.extend(scatter.iter().map(|of| (hz, of.rms)));
            }
            Err(error) => {
                let _ = writeln!(text, "\n{request:?}: {error}");
                return false;
            }
        }
    }
    let _ = writeln!(
        text,
        "{} random plans that the planner accepts, claimed within 10 %: \
         clocks of 2 to 40 MHz and the internal one, one to four channels, sensors of 1 kHz to 10 MHz \
         with a quality of 5 to 200, by rate, by RCOUNT and as the bus allows. Two gates, duty known.\n\n\
         | sensor | channels measured | rms of error / sigma, least | median | greatest |\n\
         |---|---|---|---|---|",
        arguments.plans
    );
    for decade in DECADES_HZ.windows(2) {
        let [low, high] = [decade[0], decade[1]];
        let within = |(hz, _): &&(f64, f64)| (low..high).contains(hz);
        let mut found: Vec<_> = ratios.iter().filter(within).map(|(_, rms)| *rms).collect();
        found.sort_by(f64::total_cmp);
        if let [least, .., greatest] = *found {
            let median = found[found.len() / 2];
            let _ = writeln!(
                text,
                "| {low:e} to {high:e} Hz | {} | {least:.3} | {median:.3} | {greatest:.3} |",
                found.len()
            );
        }
    }
    !ratios.is_empty() && ratios.iter().all(|(_, rms)| OF_A_PLAN.contains(rms))
}
