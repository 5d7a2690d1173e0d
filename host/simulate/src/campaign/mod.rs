//! `palpate campaign`: statistics of errors and intervals over many sensors of a design.

pub mod counted;
pub mod coverage;
pub mod press;
mod rows;
mod shards;
pub mod world;

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::progress::Progress;
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use serde::Serialize;

use self::counted::Counted;
use self::coverage::Coverage;
use self::press::{PlantResult, Press};
use self::rows::Rows;
pub use self::rows::WriteParquet;
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::quantity::within;

use self::world::World;
use crate::instrument::{BenchTask, CalibratedInstrument, ContactArguments, default_settings};

/// Press springs upon many sensors, each calibrated on its own bench, and count errors and how often
/// intervals contain the truth
#[derive(Args)]
#[command(after_help = "\
Prints Markdown: a line for each sensor as it is done, then a table for each world, and of several worlds the \
totals; with --json an object \
for each world. An interrupted run has its lines, and with --rows every press of the sensors that were done. \
The file gets its name at the end of the run; until then the rows are in FILE.partial, as CSV, and those of a \
FILE.parquet in FILE.parquet.csv. An interrupted run leaves them there.

Intervals of 95 % pass at a load when the lower bound of their coverage is at least 92 %, and fail when its upper \
bound is below 95 % (exact 95 % bounds, sensors are the units: those of 12 sensors decide nothing). The errors \
over their own standard errors should have a root mean square of 0.85 to 1.15.

On many computers: the same command with --seed and --plants for some of the sensors and --shard FILE, as often as \
there are such parts, and at last with --seed and --plants for all sensors and --merge FILE... It prints what one \
run of all sensors prints. A shard gets its name when it is complete; a call whose shard is complete ends at once.

Exit code 1 when intervals fail at a load of the calibrated world, and when there is no estimate at all.

Example: presses in a hand, and 30 K warmer than the bench, on 20 sensors

  palpate campaign --plants 20 --world calibrated,hand,warmer-30-k")]
pub struct Arguments {
    /// Number of sensors
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    plants: u64,
    /// The first sensor; the following have the following seeds
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "ultrasoft")]
    stack: String,
    /// How deep the loads are pressed, in units of the depth that the sensor was drawn for; the
    /// bench presses 0.6 to 1.4 deep
    #[arg(long, default_value_t = 1.0, value_parser = within(0.1, 2.0, ""))]
    depth: f64,
    /// The loads, in units of c_S, or `block`
    #[arg(long, value_delimiter = ',', default_value = "0.2,0.5,1,2,5", value_parser = load)]
    loads: Vec<f64>,
    /// Changes since the bench; each sensor is pressed in all worlds that are named here
    #[arg(long, value_enum, value_delimiter = ',', default_value = "calibrated")]
    world: Vec<World>,
    /// Press in all worlds whose contact is centred and flat
    #[arg(long, conflicts_with = "world")]
    all_worlds: bool,
    /// At how many temperatures each sensor is calibrated: at the second, 20 K above, the bench finds how the
    /// layers change, and the instrument corrects by it
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    temperatures: u8,
    /// Check each calibration in its world first, by a train without a press: it corrects the current's
    /// effect on the reading, and states the change as an uncertainty of the stiffening
    #[arg(long)]
    check_untouched: bool,
    /// Check each calibration in its world, by a spring of c_S that is known to 1 %: it corrects the
    /// size of the stiffening, or refuses the calibration
    #[arg(long)]
    check_spring: bool,
    #[command(flatten)]
    contact: ContactArguments,
    /// One JSON object for each world
    #[arg(long)]
    json: bool,
    /// Write every press to this file, as CSV, or as Parquet if its name ends in .parquet
    #[arg(long, value_name = "FILE")]
    rows: Option<PathBuf>,
    /// Write the results of these sensors to this file, for --merge, unless it has them already
    #[arg(long, value_name = "FILE", conflicts_with_all = ["merge", "rows", "json"])]
    shard: Option<PathBuf>,
    /// Take the results from these files of --shard, which have each sensor of the campaign once
    #[arg(long, value_name = "FILE", num_args = 1..)]
    merge: Vec<PathBuf>,
}

impl Arguments {
    /// Draws a sensor and calibrates it.
    fn calibrated(
        &self,
        stack: &Stack,
        disturbances: &Disturbances,
        seed: u64,
    ) -> Result<CalibratedInstrument, Failure> {
        let plant = draw(stack, disturbances, seed);
        let all = Switches::all();
        let mut task = BenchTask::of(&plant, stack, all, &default_settings());
        task.plan.contact = self.contact.plan();
        if self.temperatures > 1 {
            CalibratedInstrument::twice_on_bench(task, plant, all)
        } else {
            CalibratedInstrument::on_bench(task, plant, all)
        }
    }

    /// Seed of a sensor.
    const fn seed_of(&self, index: usize) -> u64 {
        self.seed.saturating_add(index as u64)
    }

    fn worlds(&self) -> Vec<World> {
        if self.all_worlds {
            let all = World::value_variants().iter().copied();
            all.filter(|world| world.has_contact_of_bench()).collect()
        } else {
            self.world.clone()
        }
    }
}

fn load(text: &str) -> Result<f64, String> {
    if text == "block" {
        return Ok(f64::INFINITY);
    }
    within(0.01, 1e3, "")(text).map_err(|allowed| format!("{allowed}, or block"))
}

/// Runs the verb. `parquet` writes Parquet; `None` in a program that cannot.
///
/// # Errors
/// Refusals and failures, with a remedy, and a coverage that is too low.
pub fn run(arguments: &Arguments, parquet: Option<WriteParquet>) -> Result<(), Failure> {
    let stack = Stack::named(&arguments.stack, Path::new(""))?;
    if let Some(file) = &arguments.shard {
        return shards::write(arguments, &stack, file);
    }
    let plants = presses(arguments, &stack, parquet)?;
    let all: Vec<&Press> = plants.iter().flatten().flatten().collect();
    let results: Vec<WorldResult> = arguments
        .worlds()
        .into_iter()
        .map(|world| WorldResult::of(world, arguments, &stack.name, &plants))
        .collect();
    if arguments.json {
        let mut out = io::stdout().lock();
        for result in &results {
            writeln!(out, "{}", serde_json::to_string(result)?)?;
        }
    } else {
        print(arguments, &stack.name, &results, &plants)?;
    }
    if all.iter().all(|press| press.outcome.is_err()) {
        return Err(Failure::Refused(
            "no press gave an estimate, so there are no intervals to count".to_owned(),
        ));
    }
    let calibrated = results
        .iter()
        .filter(|result| result.world == World::Calibrated.name());
    for bin in calibrated.flat_map(|result| &result.bins) {
        bin.counted.coverage().required(&bin.load)?;
    }
    Ok(())
}

/// Calibrates every sensor and presses with it, or takes the presses from shards.
fn presses(
    arguments: &Arguments,
    stack: &Stack,
    parquet: Option<WriteParquet>,
) -> Result<Vec<PlantResult>, Failure> {
    let merged = shards::merged(arguments, stack)?;
    let rows = arguments.rows.as_deref();
    let mut rows = rows
        .map(|path| Rows::create(path, Path::new(&arguments.stack), parquet))
        .transpose()?;
    let mut plants: Vec<PlantResult> = Vec::new();
    let mut receive = |seed, plant| {
        if let Some(rows) = &mut rows {
            rows.write(seed, &plant)?;
        }
        plants.push(plant);
        if arguments.json {
            return Ok(());
        }
        say(seed, &plants)
    };
    match merged {
        None => simulate(arguments, stack, &mut receive)?,
        Some(merged) => {
            for (index, plant) in merged.into_iter().enumerate() {
                receive(arguments.seed_of(index), plant)?;
            }
        }
    }
    rows.map_or(Ok(()), Rows::finish)?;
    Ok(plants)
}

/// Calibrates every sensor and presses with it. Passes on each seed with its result, in order.
fn simulate(
    arguments: &Arguments,
    stack: &Stack,
    mut receive: impl FnMut(u64, PlantResult) -> Result<(), Failure> + Send,
) -> Result<(), Failure> {
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let progress = Progress::new(arguments.plants as usize);
    let plant = |index| -> PlantResult {
        let presses = of_sensor(arguments, stack, &disturbances, arguments.seed_of(index));
        presses.map_err(|failure| failure.to_string())
    };
    in_order(arguments.plants as usize, plant, |index, plant| {
        receive(arguments.seed_of(index), plant)?;
        progress.step();
        Ok(())
    })?;
    progress.finish();
    Ok(())
}

fn of_sensor(
    arguments: &Arguments,
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
) -> Result<Vec<Press>, Failure> {
    let instrument = arguments.calibrated(stack, disturbances, seed)?;
    let mut presses = Vec::new();
    for world in arguments.worlds() {
        presses.extend(press::in_world(
            &instrument,
            world,
            &arguments.loads,
            arguments.depth,
            (arguments.check_untouched, arguments.check_spring),
        )?);
    }
    Ok(presses)
}

/// Prints a line for the last sensor, with the sums over all so far.
fn say(seed: u64, plants: &[PlantResult]) -> Result<(), Failure> {
    let of_last = match plants.last() {
        Some(Ok(presses)) => {
            let counted = Counted::of(presses.iter());
            let (covered, estimated) = (counted.covered(), counted.accepted);
            format!("{covered} of {estimated} intervals contain the truth")
        }
        Some(Err(reason)) => reason.clone(),
        None => return Ok(()),
    };
    let counted = Counted::of(plants.iter().flatten().flatten());
    let (covered, estimated) = (counted.covered(), counted.accepted);
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "seed {seed}: {of_last}; {covered} of {estimated} so far, {} sensors",
        plants.len()
    )?;
    Ok(out.flush()?)
}

/// Statistics of all sensors in one world.
#[derive(Serialize)]
struct WorldResult {
    world: String,
    stack: String,
    plants: u64,
    seed: u64,
    depth: f64,
    temperatures: u8,
    check_untouched: bool,
    check_spring: bool,
    /// Tolerance of the contact on the bench.
    contact_within_m: f64,
    contact_tilt_rad: f64,
    /// Sensors that could not be calibrated.
    not_calibrated: usize,
    overall: Counted,
    bins: Vec<Bin>,
}

/// Statistics of one load.
#[derive(Serialize)]
pub struct Bin {
    /// Load as c_L/c_S; `None` for a block.
    pub ratio: Option<f64>,
    /// The load, in words.
    #[serde(skip)]
    pub load: String,
    /// Statistics of its presses.
    #[serde(flatten)]
    pub counted: Counted,
}

impl WorldResult {
    fn of(world: World, arguments: &Arguments, stack: &str, plants: &[PlantResult]) -> Self {
        let presses: Vec<&Press> = plants
            .iter()
            .flatten()
            .flatten()
            .filter(|press| press.world == world)
            .collect();
        let bin = |ratio: &f64| {
            let of_load: Vec<&Press> = presses
                .iter()
                .filter(|press| press.ratio == *ratio)
                .copied()
                .collect();
            Bin {
                ratio: ratio.is_finite().then_some(*ratio),
                load: press::load_name(*ratio),
                counted: Counted::of(of_load.into_iter()),
            }
        };
        Self {
            world: world.name(),
            stack: stack.to_owned(),
            plants: arguments.plants,
            seed: arguments.seed,
            depth: arguments.depth,
            temperatures: arguments.temperatures,
            check_untouched: arguments.check_untouched,
            check_spring: arguments.check_spring,
            contact_within_m: arguments.contact.plan().within_m,
            contact_tilt_rad: arguments.contact.plan().tilt_rad,
            not_calibrated: plants.iter().filter(|plant| plant.is_err()).count(),
            bins: arguments.loads.iter().map(bin).collect(),
            overall: Counted::of(presses.into_iter()),
        }
    }
}

fn print(
    arguments: &Arguments,
    stack: &str,
    results: &[WorldResult],
    plants: &[PlantResult],
) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let of_worlds = if let [world] = results {
        writeln!(out, "{BEGIN}\n{}\n", figure(world))?;
        table(world).to_string()
    } else {
        for result in results {
            writeln!(out, "## {}\n\n{}\n", result.world, table(result))?;
        }
        writeln!(out, "{BEGIN}\n{}\n", figure_of_worlds(results))?;
        worlds(results)
    };
    writeln!(
        out,
        "{} sensors of the stack {stack} from seed {}, all disturbances, each calibrated on its own \
         simulated bench{}{}{}{} and pressed to {}.\n\n{of_worlds}\n",
        arguments.plants,
        arguments.seed,
        if arguments.temperatures > 1 {
            " at two temperatures"
        } else {
            ""
        },
        if arguments.check_untouched {
            ", checked by a train without a press"
        } else {
            ""
        },
        if arguments.check_spring {
            ", checked by a known spring of c_S"
        } else {
            ""
        },
        arguments.contact.words(),
        in_working_depths(arguments.depth)
    )?;
    Ok(writeln!(
        out,
        "{}\n{END}",
        without_estimate(&reasons(plants))
    )?)
}

/// Describes a press depth, given in units of the working depth, in words.
pub fn in_working_depths(depth: f64) -> String {
    if depth == 1.0 {
        "its working depth".to_owned()
    } else {
        format!("{depth} of its working depth")
    }
}

/// Describes the result of one world in a sentence.
fn figure(WorldResult { overall, bins, .. }: &WorldResult) -> String {
    let errors = bins.iter().filter_map(|bin| {
        let error = bin.counted.rms_ln?;
        Some(format!("{:.1} % at {}", error * 100.0, bin.load))
    });
    format!(
        "{} of {} intervals contain the truth, {} estimates are narrow and wrong; RMS errors (ln) of \
         {}.",
        overall.covered(),
        overall.accepted,
        overall.narrow_and_wrong(),
        errors.collect::<Vec<_>>().join(", ")
    )
}

/// Describes the sum over all worlds except the bench's in a sentence.
fn figure_of_worlds(results: &[WorldResult]) -> String {
    let bench = World::Calibrated.name();
    let changed = results.iter().filter(|result| result.world != bench);
    let sums = changed.fold([0; 5], |[worlds, refused, covered, all, sure], result| {
        let of = &result.overall;
        [
            worlds + 1,
            refused + of.refused,
            covered + of.covered(),
            all + of.accepted,
            sure + of.narrow_and_wrong(),
        ]
    });
    let [worlds, refused, covered, all, sure] = sums;
    format!(
        "In {worlds} changed worlds {refused} presses are refused; {covered} of {all} intervals \
         contain the truth, and {sure} estimates are narrow and wrong."
    )
}

/// Table of the worlds with missed intervals, the worst first, and lists of the other worlds.
fn worlds(results: &[WorldResult]) -> String {
    let mut missing = Vec::new();
    let (mut whole, mut refused) = (Vec::new(), Vec::new());
    for WorldResult { world, overall, .. } in results {
        let (all, covered) = (overall.accepted, overall.covered());
        match all {
            0 => refused.push(world.clone()),
            _ if covered == all => whole.push(format!("{world} ({all})")),
            _ => missing.push((
                world,
                [all, overall.refused, covered, overall.narrow_and_wrong()],
            )),
        }
    }
    missing.sort_by_key(|(_, [all, _, covered, sure])| Reverse((*sure, all - covered)));
    let mut text = String::from(
        "| world | estimated | refused | contain the truth | narrow and wrong \
         |\n|---|---|---|---|---|\n",
    );
    for (world, counts) in missing {
        text += &format!(
            "| {world} | {} |\n",
            counts.map(|count| count.to_string()).join(" | ")
        );
    }
    let list = |worlds: &[String]| match worlds {
        [] => "none".to_owned(),
        worlds => worlds.join(", "),
    };
    format!(
        "{text}\nWorlds with estimates whose intervals all contain the truth: {}.\n\nWorlds with all presses refused: {}.",
        list(&whole),
        list(&refused)
    )
}

/// Describes why presses gave no estimate, with the number of presses for each reason.
pub fn without_estimate(reasons: &BTreeMap<String, usize>) -> String {
    let reasons = reasons.iter().map(|(reason, count)| {
        let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ");
        format!("{reason} ({count})")
    });
    format!(
        "Presses without an estimate, by reason: {}.",
        reasons.collect::<Vec<_>>().join("; ")
    )
}

/// Formats a part in percent; empty for `None`.
pub fn percent(part: Option<f64>) -> String {
    part.map_or(String::new(), |part| format!("{:.1} %", part * 100.0))
}

/// Formats a number; empty for `None` and where it is infinite.
fn number(value: Option<f64>) -> String {
    let finite = value.filter(|value| value.is_finite());
    finite.map_or(String::new(), |value| format!("{value:.2}"))
}

/// Formats the bounds of a coverage with its judgement.
fn bounds(coverage: &Coverage) -> String {
    let part = |bound: f64| bound * 100.0;
    let (lower, upper) = (part(coverage.lower), part(coverage.upper));
    format!(
        "{lower:.1} to {upper:.1} %, {}",
        coverage.judgement().word()
    )
}

fn table(result: &WorldResult) -> Table {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header([
        "load",
        "true c_L/c_S",
        "estimated",
        "refused",
        "hold",
        "bounds",
        "RMS error, ln",
        "mean error",
        "error over standard error",
        "median half width",
        "interval score",
        "narrow and wrong",
        "RMS, two-state formula",
    ]);
    for bin in &result.bins {
        let counted = &bin.counted;
        table.add_row([
            bin.load.clone(),
            number(counted.true_ratio),
            counted.accepted.to_string(),
            counted.refused.to_string(),
            percent(counted.coverage95),
            bounds(&counted.coverage()),
            percent(counted.rms_ln),
            percent(counted.bias_ln),
            number(counted.rms_over_standard_error),
            percent(counted.half_width_ln),
            percent(counted.interval_score_ln),
            percent(counted.narrow_and_wrong_part),
            percent(counted.plain_rms_ln),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Counts the refused results by reason, without the numbers in the reasons.
fn reasons(plants: &[PlantResult]) -> BTreeMap<String, usize> {
    let of_plants = plants.iter().filter_map(|plant| plant.as_ref().err());
    let presses = plants.iter().flatten().flatten();
    let of_presses = presses.filter_map(|press| press.outcome.as_ref().err());
    counts_of_reasons(of_plants.chain(of_presses))
}

/// Counts equal reasons. The numbers behind the colon of a reason are ignored.
pub fn counts_of_reasons<'r>(reasons: impl Iterator<Item = &'r String>) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for reason in reasons {
        let kind = reason
            .split_once(": ")
            .map_or(reason.as_str(), |(kind, _)| kind);
        *counts.entry(kind.to_owned()).or_default() += 1;
    }
    counts
}
