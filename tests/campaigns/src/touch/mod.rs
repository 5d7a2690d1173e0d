//! `cargo campaign touch`: place, force and radius of presses on simulated touch sensors, each calibrated
//! on its own bench with errors, against the truth.
//!
//! The simulated sensors (`palpate_sim::touch`) share no function with calibration and estimate.

mod array;
mod judge;
mod rig;
mod worlds;

use clap::Args;
use judge::{Outcome, judged, row};
use palpate_cli::failure::Failure;
use palpate_cli::progress::Progress;
use palpate_simulate::touch::SCANS_PER_S;
use palpate_simulate::touch::bench::{Kind, TouchBench};
use rayon::prelude::*;
use rig::{Manner, Rig};

use crate::evidence;

/// Presses of each sensor that are judged.
const PRESSES: u32 = 20;

/// Calibrate drawn touch sensors, press each 20 times, and compare the estimates with the truth
#[derive(Args)]
#[command(after_help = "\
Prints Markdown. Exit code 1 when an array misses a limit: errors of a place \
of 0.1 mm (median) and 0.4 mm (95 %), 3 % of the force and, without a declared indenter, 15 % of radii from 2 mm \
up (RMS); 93 to 97 % of the 95 % regions cover the truth; one press in 1,000 is off by more than four of its \
sigmas; 0.8 of the Cramer-Rao bound.")]
pub(crate) struct Arguments {
    /// Number of sensors of each array
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    sensors: u64,
    /// Seed of the first sensor; the next sensors have the next seeds
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=u64::MAX / 2))]
    seed: u64,
    /// Number of these that are also pressed in changed worlds
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u64).range(0..=100_000))]
    worlds: u64,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let sensors = arguments.sensors as usize;
    let worlds = arguments.worlds.min(arguments.sensors) as usize;
    let progress = Progress::new(2 * sensors + 2 * worlds);
    let mut table = String::new();
    let mut held = Vec::new();
    for (name, kind) in Kind::NAMED {
        let found = each(arguments.seed, sensors, kind, &progress, of_sensor)?;
        let (text, is_held) = row(kind, &found);
        let limits = if is_held { "all" } else { "not all" };
        table += &format!("| `{}` | {limits} | {text}\n", name);
        held.push(is_held);
    }
    let mut changed = String::new();
    for (name, kind) in Kind::NAMED {
        let found = each(arguments.seed, worlds, kind, &progress, worlds::of_sensor)?;
        changed += &worlds::rows(name, &found);
    }
    progress.finish();
    let kept = held.iter().filter(|held| **held).count();
    evidence::print(&format!(
        "{kept} of 2 arrays keep all limits.\n\n\
         {sensors} sensors of each array from seed {}, all disturbances, each calibrated by 50 presses on its own bench; then \
         {PRESSES} presses each by pins and balls with contacts of 1 to 5 mm. Depths of 0.15 to 0.4 mm, {rate} scans/s, one scan. `three-around-one` has an indenter declared within 5 %. \
         Efficiency: one over the mean square of errors over the root of the Cramer-Rao bound, which has noise, the calibration's \
         covariance and what the form of its profile leaves out.\n\n\
         | array | limits kept | claimed | place, median and 95 % | force, RMS | radius from 2 mm, RMS | \
         95 % regions cover place, force, radius | beyond 4 sigmas | efficiency, place and force |\n\
         |---|---|---|---|---|---|---|---|---|\n{table}\n\
         Worlds that the calibration did not see, {worlds} sensors each; covered is place and force at once:\n\n\
         | world | array | refused | claimed | covered | beyond 4 sigmas |\n|---|---|---|---|---|---|\n{changed}",
        arguments.seed,
        rate = SCANS_PER_S,
    ));
    if kept == 2 {
        return Ok(());
    }
    Err(Failure::Refused(format!(
        "{} of 2 arrays miss a limit",
        2 - kept
    )))
}

/// Draws sensors and does the same with each.
fn each<T: Send>(
    seed: u64,
    sensors: usize,
    kind: Kind,
    progress: &Progress,
    with: impl Fn(&mut Rig<'_>) -> T + Sync,
) -> Result<Vec<T>, Failure> {
    let of_seed = |index: usize| {
        let bench = TouchBench::drawn(kind, seed + index as u64, SCANS_PER_S)?;
        let found = with(&mut Rig::new(&bench));
        progress.step();
        Ok(found)
    };
    (0..sensors).into_par_iter().map(of_seed).collect()
}

fn of_sensor(rig: &mut Rig<'_>) -> Vec<Outcome> {
    let calibrated = rig.calibrated();
    let press = |_| {
        let (calibration, array) = calibrated.as_ref().map_err(Clone::clone)?;
        let pressed = rig.anywhere(&Manner::default());
        judged(&pressed.estimate(array), &pressed, calibration)
    };
    (0..PRESSES).map(press).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_presses_of_a_sensor_are_claimed_and_near() {
        let bench = TouchBench::drawn(Kind::Seven, 101, SCANS_PER_S).unwrap();
        let outcomes = of_sensor(&mut Rig::new(&bench));
        let claimed = outcomes.iter().flatten().count();
        assert!(claimed >= 15, "{claimed}");
        let far = outcomes.iter().flatten().filter(|of| of.is_far()).count();
        assert!(far <= 1, "{far}");
    }
}
