//! A campaign in shards, whose numbers are the seeds.

use std::ops::RangeInclusive;
use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_cli::notice::say;
use palpate_sim::stack::Stack;
use palpate_wire::crc32;
use serde_json::{Map, Value, json};

use super::Arguments;
use super::press::{PlantResult, load_name};
use super::world::World;
use crate::shard::Run;

/// Computes the sensors of the arguments and writes their shard, unless it is complete.
pub(super) fn write(arguments: &Arguments, stack: &Stack, file: &Path) -> Result<(), Failure> {
    let run = run_of(arguments, stack)?;
    let Some(shard) = run.shard(file, &arguments.seeds()?)? else {
        say(format_args!("{}: is complete", file.display()));
        return Ok(());
    };
    let mut plants: Vec<PlantResult> = Vec::new();
    super::simulate(arguments, stack, |seed, plant| {
        plants.push(plant);
        // The shard is the result: it is written even if the reader of the lines has gone.
        let _ = super::say(seed, &plants);
        Ok(())
    })?;
    shard.write(&plants)
}

/// Reads the sensors of the arguments from the shards of `--merge`; `None` without any.
pub(super) fn merged(
    arguments: &Arguments,
    stack: &Stack,
) -> Result<Option<Vec<PlantResult>>, Failure> {
    if arguments.merge.is_empty() {
        return Ok(None);
    }
    let run = run_of(arguments, stack)?;
    run.merged(&arguments.merge, &arguments.seeds()?).map(Some)
}

fn run_of(arguments: &Arguments, stack: &Stack) -> Result<Run, Failure> {
    Run::new("campaign", "seed", settings(arguments, stack), |seeds| {
        let plants = seeds.end() - seeds.start() + 1;
        format!("--seed {} --plants {plants}", seeds.start())
    })
}

/// All that the presses of a seed depend on, apart from the program.
fn settings(arguments: &Arguments, stack: &Stack) -> Map<String, Value> {
    let contact = arguments.contact.plan();
    let loads = arguments.loads.iter().copied().map(load_name);
    let settings: [(&str, Value); 10] = [
        ("stack", json!(stack.name)),
        ("checksum of the stack", json!(checksum(stack))),
        ("--depth", json!(arguments.depth)),
        ("--loads", loads.collect()),
        (
            "--world",
            arguments.worlds().into_iter().map(World::name).collect(),
        ),
        ("--temperatures", json!(arguments.temperatures)),
        ("--check-untouched", json!(arguments.check_untouched)),
        ("--check-spring", json!(arguments.check_spring)),
        ("--contact-within, m", json!(contact.within_m)),
        ("--contact-tilt, rad", json!(contact.tilt_rad)),
    ];
    Map::from_iter(settings.map(|(name, value)| (name.to_owned(), value)))
}

/// Checksum of a stack's values. `Debug` writes each number so that it can be read back exactly.
fn checksum(stack: &Stack) -> String {
    format!("{:08x}", crc32(format!("{stack:?}").as_bytes()))
}

impl Arguments {
    /// Seeds of all sensors.
    fn seeds(&self) -> Result<RangeInclusive<u64>, Failure> {
        let last = self.seed.checked_add(self.plants - 1);
        last.map(|last| self.seed..=last).ok_or_else(|| {
            Failure::Argument(format!(
                "--seed {} --plants {}: allowed are seeds up to {}",
                self.seed,
                self.plants,
                u64::MAX
            ))
        })
    }
}
