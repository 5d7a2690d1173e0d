//! `cargo campaign ablation`: the benefit of each part of the chain, from the same presses with one
//! part left out or added.

use std::io::{self, Write};
use std::path::Path;

use clap::Args;
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_calibration::session::Session;
use palpate_calibration::{Calibration, Known};
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::progress::Progress;
use palpate_sim::parameters::{Parameters, draw};
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_simulate::campaign::counted::Counted;
use palpate_simulate::campaign::press::{self, Press};
use palpate_simulate::campaign::world::World;
use palpate_simulate::campaign::{Bin, in_working_depths, percent};
use palpate_simulate::instrument::{BenchTask, CalibratedInstrument, default_settings};
use palpate_wire::Command;
use palpate_wire::code::Drift;
use serde::Serialize;

use crate::drawn::DrawnSensors;

/// Depth of the presses, in units of the working depth.
const DEPTH: f64 = 1.0;

/// Number of variants that leave no part out; they are the first ones.
const WHOLE: usize = 4;

/// A variant of calibration and press. The instrument itself is always the same: a part is left out
/// of the settings and of the calibration that it receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variant {
    OneTemperature,
    TwoTemperatures,
    CheckSpring,
    TwoTemperaturesAndCheckSpring,
    SpringsAlone,
    OneRamp,
    NoDrift,
    NoCrosstalkGrowth,
    NoCrosstalk,
    NoAttraction,
    NoTemperatureInInterval,
}

impl Variant {
    const ALL: [Self; 11] = [
        Self::OneTemperature,
        Self::TwoTemperatures,
        Self::CheckSpring,
        Self::TwoTemperaturesAndCheckSpring,
        Self::SpringsAlone,
        Self::OneRamp,
        Self::NoDrift,
        Self::NoCrosstalkGrowth,
        Self::NoCrosstalk,
        Self::NoAttraction,
        Self::NoTemperatureInInterval,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::OneTemperature => "one temperature",
            Self::TwoTemperatures => "two temperatures",
            Self::CheckSpring => "one temperature, check spring",
            Self::TwoTemperaturesAndCheckSpring => "two temperatures, check spring",
            Self::SpringsAlone => "without the load cell",
            Self::OneRamp => "one ramp",
            Self::NoDrift => "without the fit of drift",
            Self::NoCrosstalkGrowth => "without the cross-talk's growth",
            Self::NoCrosstalk => "without cross-talk",
            Self::NoAttraction => "without attraction",
            Self::NoTemperatureInInterval => "without the temperature in the interval",
        }
    }

    const fn is_checked(self) -> bool {
        matches!(
            self,
            Self::CheckSpring | Self::TwoTemperaturesAndCheckSpring
        )
    }

    /// Removes the variant's part from a command to the instrument.
    fn leave_out(self, command: &mut Command) {
        match (self, command) {
            (Self::OneRamp, Command::SetSettings(settings)) => settings.ramps = 1,
            (Self::NoDrift, Command::SetSettings(settings)) => settings.drift = Drift::None,
            (Self::NoCrosstalkGrowth, Command::SetCrosstalk(crosstalk)) => {
                crosstalk.growth_per_m = 0.0;
            }
            (Self::NoCrosstalk, Command::SetCrosstalk(crosstalk)) => {
                crosstalk.apparent_m_per_a2 = 0.0;
            }
            (Self::NoAttraction, Command::SetAttraction(attraction)) => {
                attraction.attraction_n_per_a2 = 0.0;
            }
            (Self::NoTemperatureInInterval, Command::SetTemperatureEffect(effect)) => {
                effect.springs_uncertainty_per_k = 0.0;
                effect.rise_uncertainty_per_k = 0.0;
            }
            _ => {}
        }
    }
}

struct Ablated {
    variant: Variant,
    press: Press,
}

/// Results of all sensors with one variant and one load.
#[derive(Serialize)]
struct Row {
    variant: &'static str,
    #[serde(flatten)]
    bin: Bin,
}

/// Press with parts of the chain added or left out: a bench at two temperatures, a check, the load
/// cell, ramps, corrections of the instrument
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    drawn: DrawnSensors,
}

pub(crate) fn run(Arguments { drawn }: &Arguments) -> Result<(), Failure> {
    let stack = &Stack::named(&drawn.stack, Path::new(""))?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let progress = Progress::new(drawn.plants as usize);
    let seed_of = |index: usize| drawn.seed.saturating_add(index as u64);
    let sensor = |index| {
        let presses = of_sensor(drawn, stack, &disturbances, seed_of(index));
        presses.map_err(|failure| failure.to_string())
    };
    let mut presses: Vec<Ablated> = Vec::new();
    in_order(drawn.plants as usize, sensor, |index, of_sensor| {
        progress.step();
        match of_sensor {
            Ok(of_sensor) => presses.extend(of_sensor),
            Err(reason) => {
                palpate_cli::notice::say(format_args!("seed {}: {reason}", seed_of(index)))
            }
        }
        Ok(())
    })?;
    progress.finish();
    let rows: Vec<Row> = Variant::ALL
        .iter()
        .flat_map(|variant| drawn.loads.iter().map(|ratio| (*variant, *ratio)))
        .map(|(variant, ratio)| row(&presses, variant, ratio))
        .collect();
    print(drawn, &stack.name, &rows)?;
    if presses.iter().all(|of| of.press.outcome.is_err()) {
        return Err(Failure::Refused(
            "no press came to an estimate, so that there is nothing to compare".to_owned(),
        ));
    }
    Ok(())
}

/// Presses of all variants of one sensor, each on all loads.
fn of_sensor(
    drawn: &DrawnSensors,
    stack: &Stack,
    disturbances: &Disturbances,
    seed: u64,
) -> Result<Vec<Ablated>, Failure> {
    let plant = draw(stack, disturbances, seed);
    let bench = TwoSessions::of(
        BenchTask::of(&plant, stack, Switches::all(), &default_settings()),
        &plant,
    )?;
    let mut presses = Vec::new();
    for variant in Variant::ALL {
        let instrument = CalibratedInstrument::with(
            bench.calibration(variant)?,
            bench.first(),
            bench.task.clone(),
            plant.clone(),
            Switches::all(),
        )?;
        let of_variant = press::in_world(
            &instrument,
            World::Calibrated,
            &drawn.loads,
            DEPTH,
            (false, variant.is_checked()),
        )?;
        presses.extend(
            of_variant
                .into_iter()
                .map(|press| Ablated { variant, press }),
        );
    }
    Ok(presses)
}

/// Bench data of one sensor, at both temperatures.
struct TwoSessions {
    task: BenchTask,
    sessions: [Session; 2],
}

impl TwoSessions {
    fn of(task: BenchTask, plant: &Parameters) -> Result<Self, Failure> {
        let sessions = task.both_sessions(plant, Switches::all())?;
        Ok(Self { task, sessions })
    }

    /// Session on which the calibration is based.
    const fn first(&self) -> &Session {
        let [first, _] = &self.sessions;
        first
    }

    fn calibration(&self, variant: Variant) -> Result<Calibration, Failure> {
        let [first, second] = &self.sessions;
        let known = &self.task.known;
        let calibration = match variant {
            Variant::TwoTemperatures | Variant::TwoTemperaturesAndCheckSpring => {
                palpate_calibration::evaluate_both(first, second, known)
            }
            Variant::SpringsAlone => {
                let known = Known {
                    load_cell_gain: None,
                    ..known.clone()
                };
                palpate_calibration::evaluate(&first.clone().without_load_cell(), &known)
            }
            _ => palpate_calibration::evaluate(first, known),
        };
        let mut calibration = calibration.map_err(|error| {
            Failure::Refused(format!("calibration, {}: {error}", variant.name()))
        })?;
        for command in &mut calibration.commands {
            variant.leave_out(command);
        }
        Ok(calibration)
    }
}

fn row(presses: &[Ablated], variant: Variant, ratio: f64) -> Row {
    let of_row = || {
        let of_variant = presses.iter().filter(move |of| of.variant == variant);
        of_variant
            .map(|of| &of.press)
            .filter(move |press| press.ratio == ratio)
    };
    Row {
        variant: variant.name(),
        bin: Bin {
            ratio: ratio.is_finite().then_some(ratio),
            load: press::load_name(ratio),
            counted: Counted::of(of_row()),
        },
    }
}

fn print(drawn: &DrawnSensors, stack: &str, rows: &[Row]) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if drawn.json {
        for row in rows {
            writeln!(out, "{}", serde_json::to_string(row)?)?;
        }
        return Ok(());
    }
    let loads = drawn.loads.len();
    let middle = loads / 2;
    let whole = rows
        .chunks(loads)
        .take(WHOLE)
        .filter_map(|of| of.get(middle));
    let whole =
        whole.map(|Row { variant, bin }| format!("{} ({variant})", percent(bin.counted.rms_ln)));
    writeln!(
        out,
        "{BEGIN}\nThe RMS error (ln) at {} is {}.\n\n{} sensors of the stack {stack} from seed {}, all disturbances, each calibrated on its own simulated \
         bench and pressed to {}, with parts of the chain added or left out. Those that are left \
         out are so with a bench at one temperature and without a check.\n\n{}\n{END}",
        rows.get(middle).map_or("", |row| &row.bin.load),
        whole.collect::<Vec<_>>().join(", "),
        drawn.plants,
        drawn.seed,
        in_working_depths(DEPTH),
        table(rows, loads)
    )?;
    Ok(())
}

/// A line for each variant.
fn table(rows: &[Row], loads: usize) -> Table {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    let names = rows.iter().take(loads).map(|row| row.bin.load.as_str());
    let errors = format!("RMS error, ln, at {}", names.collect::<Vec<_>>().join(", "));
    table.set_header([
        "variant",
        "estimated",
        "refused",
        "hold",
        "narrow and wrong",
        &errors,
    ]);
    for of_variant in rows.chunks(loads) {
        let sum = |of: fn(&Counted) -> usize| -> String {
            let counts = of_variant.iter().map(|row| of(&row.bin.counted));
            counts.sum::<usize>().to_string()
        };
        let errors = of_variant.iter().map(|row| match row.bin.counted.rms_ln {
            None => "-".to_owned(),
            error => percent(error),
        });
        table.add_row([
            of_variant[0].variant.to_owned(),
            sum(|of| of.accepted),
            sum(|of| of.refused),
            sum(Counted::covered),
            sum(Counted::narrow_and_wrong),
            errors.collect::<Vec<_>>().join(", "),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

#[cfg(test)]
mod tests {
    use std::mem::discriminant;

    use super::*;

    #[test]
    #[ignore = "long: `cargo xtask ci` runs it"]
    fn every_variant_but_the_first_changes_what_is_sent_or_checked() {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let plant = draw(&stack, &Disturbances::builtin().unwrap(), 3);
        let task = BenchTask::of(&plant, &stack, Switches::all(), &default_settings());
        let bench = TwoSessions::of(task, &plant).unwrap();
        let whole = bench.calibration(Variant::OneTemperature).unwrap();
        for variant in Variant::ALL {
            let sent = bench.calibration(variant).unwrap().commands;
            let is_same = sent == whole.commands && !variant.is_checked();
            assert_eq!(is_same, variant == Variant::OneTemperature, "{variant:?}");
            // A command with a part left out has the same kind.
            let kinds = |of: &[Command]| of.iter().map(discriminant).collect::<Vec<_>>();
            let is_warmed = matches!(
                variant,
                Variant::TwoTemperatures | Variant::TwoTemperaturesAndCheckSpring
            );
            let is_alike = kinds(&sent) == kinds(&whole.commands);
            assert!(is_alike || is_warmed, "{variant:?}");
        }
    }
}
