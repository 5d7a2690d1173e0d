//! `cargo campaign efficiency`: errors of presses against the least error of any estimate from the
//! same readings.

mod arguments;
mod bound;
mod judged_press;
mod press;
mod rung;
mod show;
#[cfg(test)]
mod tests;
mod train;
mod unknowns;

use std::io::{self, Write};
use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_cli::in_order::in_order;
use palpate_cli::progress::Progress;
use palpate_design::plan::{Conversions, PlannedBench, PlannedPress, PlannedSensor};
use palpate_sim::mechanics::load::Load;
use palpate_sim::parameters::{Parameters, draw};
use palpate_sim::stack::{Disturbances, LoadError, Stack};
use palpate_sim::switches::Switches;
use palpate_simulate::demo;
use palpate_simulate::engine::Native;
use palpate_simulate::instrument::{BenchTask, CalibratedInstrument, default_settings};

pub(crate) use self::arguments::Arguments;
use self::bound::BenchInformation;
use self::judged_press::JudgedPress;
use self::show::Efficiency;
use self::unknowns::{Unknown, unknowns};

/// Loads, in units of c_S.
const LOADS: [f64; 5] = [0.2, 0.5, 1.0, 2.0, 5.0];
/// Number of standard errors by which a bound may exceed the measured value.
const STANDARD_ERRORS: f64 = 3.0;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let stack = Stack::named(&arguments.stack, Path::new(""))?;
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let unknowns = unknowns(&stack, &disturbances);
    let seed_of = |index: usize| arguments.seed.saturating_add(index as u64);
    let progress = Progress::new(arguments.plants as usize);
    let (mut presses, mut left_out) = (Vec::new(), 0);
    let judged = |index| {
        let mut plant = draw(&stack, &disturbances, seed_of(index));
        if arguments.bench_temperature {
            plant.thermal.ambient_change_k = 0.0;
        }
        let sensor = Judged {
            stack: &stack,
            disturbances: &disturbances,
            unknowns: &unknowns,
            plant,
        };
        sensor.presses()
    };
    in_order(arguments.plants as usize, judged, |index, judged| {
        let said = match judged {
            Ok(judged) => {
                presses.extend(judged.iter().copied());
                left_out += LOADS.len() - judged.len();
                format!("{} presses", judged.len())
            }
            Err(failure) => {
                left_out += LOADS.len();
                failure.to_string()
            }
        };
        progress.step();
        if !arguments.json {
            writeln!(io::stdout().lock(), "seed {}: {said}", seed_of(index))?;
        }
        Ok(())
    })?;
    progress.finish();
    let loads: Vec<Efficiency> = LOADS
        .iter()
        .filter_map(|ratio| Efficiency::of(*ratio, &presses))
        .collect();
    show::print(arguments, &stack.name, &loads, left_out)?;
    judge(arguments, &loads)
}

fn judge(arguments: &Arguments, loads: &[Efficiency]) -> Result<(), Failure> {
    if loads.is_empty() {
        return Err(Failure::Refused(
            "no press came to an estimate, so that there is nothing to judge".to_owned(),
        ));
    }
    for load in loads {
        let is_bound = load.efficiency - STANDARD_ERRORS * load.efficiency_standard_error <= 1.0;
        if !is_bound {
            return Err(Failure::Refused(format!(
                "at {} c_S the bound is {:.2} times the variance that was measured, and is none: a disturbance is missing in \
                 it",
                load.ratio, load.efficiency
            )));
        }
        if load.efficiency < arguments.least {
            return Err(Failure::Refused(format!(
                "the efficiency at {} c_S is {:.2}, below {:.2}",
                load.ratio, load.efficiency, arguments.least
            )));
        }
    }
    Ok(())
}

/// A sensor under evaluation.
struct Judged<'a> {
    stack: &'a Stack,
    disturbances: &'a Disturbances,
    unknowns: &'a [Unknown],
    plant: Parameters,
}

impl Judged<'_> {
    /// The sensor's presses that gave an estimate.
    fn presses(&self) -> Result<Vec<JudgedPress>, Failure> {
        let (plant, switches) = (&self.plant, Switches::all());
        let settings = default_settings();
        let instrument =
            CalibratedInstrument::of_plant(plant.clone(), self.stack, switches, &settings)?;
        let task = BenchTask::of(plant, self.stack, switches, &settings);
        let rate_hz = instrument.settings.rate_hz as u32;
        let conversions = Conversions::at(rate_hz, plant.ldc.white_noise_relative)
            .map_err(palpate_design::plan_ldc::refused)?;
        let planned = PlannedSensor::of(plant.clone(), self.stack, self.disturbances);
        let vibration_m = planned.vibration_m / 2_f64.sqrt();
        let noise = (conversions.relative_sigma, vibration_m);
        let bench = BenchInformation::new(plant, &task, self.unknowns, noise)?;
        let plan = PlannedBench::new(&planned, &planned.settings, conversions);
        let press = PlannedPress {
            depth: 1.0,
            away_k: plant.thermal.ambient_change_k.abs(),
        };
        let mut presses = Vec::new();
        for ratio in LOADS {
            let n_per_m = ratio * plant.sensing.spring_n_per_m;
            let load = Load::Spring { n_per_m };
            let measured = demo::measure(&instrument, format!("{ratio} c_S"), load, 1.0, &Native)?;
            let true_n_per_m = measured.pressed.true_n_per_m;
            let estimate = measured
                .verdict
                .estimate()
                .and_then(|estimate| estimate.stiffness_n_per_m);
            let bounds = bench.press(true_n_per_m, instrument.depth_m)?;
            let error_ln = plan.as_ref().ok().and_then(|plan| {
                plan.standard_errors_ln([true_n_per_m / plant.sensing.spring_n_per_m], &press)
            });
            if let (Some(estimate), Some(bounds), Some([error_ln])) = (estimate, bounds, error_ln) {
                presses.push(JudgedPress {
                    ratio,
                    error_ln: (f64::from(estimate) / true_n_per_m).ln(),
                    bounds,
                    planned: error_ln * error_ln,
                });
            }
        }
        Ok(presses)
    }
}
