//! `palpate plan`: expected error of presses with a sensor design, and the best train for it.

mod bench;
mod causes;
mod chip;
mod expected;
mod heat;
mod information;
mod line;
mod result;
mod search;
mod sensor;
mod show;
#[cfg(test)]
mod tests;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_sim::stack::{Disturbances, LoadError, Stack};

pub use self::bench::PlannedBench;
use self::bench::Unplannable;
pub use self::chip::Conversions;
pub use self::expected::PlannedPress;
use self::expected::{ASSUMED_FROM, ExpectedError};
pub use self::information::Information;
use self::result::Plan;
use self::search::{TrainLimit, TrainSearch};
pub use self::sensor::{PlannedSensor, metres_per_relative_frequency};
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::quantity::within;

/// Default depth of the press, in units of the working depth.
const DEPTH: f64 = 1.0;
/// Default difference between the temperature of the press and that of the bench, K.
const AWAY_K: f64 = 2.9;

/// Compute the expected error of a press against the load's stiffness, what limits it, and the best train
#[derive(Args)]
#[command(after_help = "\
Nothing is simulated: errors of conversions, stand, springs and temperature are propagated through the three \
springs and the calibration's least squares. They are standard errors of ln(c_L), so that 0.05 is 5 %; c_L is \
the load with what it stands on. The variances of the causes add up. What the instrument's model does not know, \
as a sensor that has aged, is not in them. \
Two causes are not computed: `creep`, by which trains scatter, was found with 60 simulated sensors of the stack \
ultrasoft, `model`, what the calibration's model leaves out of a press, with 15. For every other stack both are \
assumed.

Exit code 1 when the stack cannot be calibrated, or has no train within the limits; exit code 2 for an \
invalid stack or number.

Example: a stack of your own, pressed to 0.7 of its depth at the bench's temperature, with a chart

  palpate plan mine.toml --depth 0.7 --away 0 --plot mine.svg")]
pub struct Arguments {
    /// Kind of sensor: paper, soft-closed, ultrasoft, or a stack file
    #[arg(value_name = "STACK")]
    stack: String,
    /// How deep the load is pressed, in units of the depth that the sensor is made for
    #[arg(long, default_value_t = DEPTH, value_parser = within(0.1, 2.0, ""))]
    depth: f64,
    /// The softest load, in units of c_S
    #[arg(long, default_value_t = 0.1, value_name = "RATIO", value_parser = within(0.01, 1e3, ""))]
    load_from: f64,
    /// The hardest load, in units of c_S
    #[arg(long, default_value_t = 10.0, value_name = "RATIO", value_parser = within(0.01, 1e3, ""))]
    load_to: f64,
    /// Temperature away from the bench's, K; 2.9 is the root mean square of up to 5
    #[arg(long, default_value_t = AWAY_K, value_name = "KELVIN", value_parser = within(0.0, 100.0, "K"))]
    away: f64,
    /// How long the load stays pressed for a train, s
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS", value_parser = within(0.1, 20.0, "s"))]
    contact: f64,
    /// One JSON object
    #[arg(long)]
    json: bool,
    /// Draw the errors against the load
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let plot = OutputFile::optional("--plot", arguments.plot.as_ref())?;
    let plot = plot.map(|file| file.apart_from(Path::new(&arguments.stack)));
    let plot = plot.transpose()?;
    if arguments.load_from > arguments.load_to {
        return Err(Failure::Argument(format!(
            "--load-from {} is above --load-to {}: name the softer load first",
            arguments.load_from, arguments.load_to
        )));
    }
    let stack = Stack::named(&arguments.stack, Path::new(""))?;
    let plan = Plan::of(&stack, arguments)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        writeln!(out, "{}", show::json(&plan)?)?;
    } else {
        write!(out, "{}", show::text(&plan))?;
    }
    let Some(file) = plot else {
        return Ok(());
    };
    let errors = plan.errors_at(&arguments.fine_loads())?;
    file.write(show::chart(&plan, &errors).svg()?)
}

impl Plan {
    fn of(stack: &Stack, arguments: &Arguments) -> Result<Self, Failure> {
        let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
        let mut plan = Self {
            stack: stack.name.clone(),
            is_assumed: *stack != Stack::builtin(ASSUMED_FROM).map_err(LoadError::from)?,
            sensor: PlannedSensor::new(stack, &disturbances),
            press: PlannedPress {
                depth: arguments.depth,
                away_k: arguments.away,
            },
            contact_s: arguments.contact,
            errors: Vec::new(),
            trains: Vec::new(),
        };
        plan.errors = plan.errors_at(&arguments.loads())?;
        let search = TrainSearch {
            sensor: &plan.sensor,
            press: plan.press,
            contact_s: plan.contact_s,
        };
        plan.trains = search.compare().map_err(default_refused)?;
        Ok(plan)
    }

    /// Errors with the default train at these loads, c_L/c_S.
    fn errors_at(&self, loads: &[f64]) -> Result<Vec<ExpectedError>, Failure> {
        expected_errors(&self.stack, &self.sensor, &self.press, loads)
    }
}

/// Expected standard error of ln(c_L) for one press onto a load of c_L = c_S, at the working depth
/// and the default temperature difference.
pub fn expected_error_ln(stack: &Stack) -> Result<f64, Failure> {
    let disturbances = Disturbances::builtin().map_err(LoadError::from)?;
    let sensor = PlannedSensor::new(stack, &disturbances);
    let press = PlannedPress {
        depth: DEPTH,
        away_k: AWAY_K,
    };
    let errors = expected_errors(&stack.name, &sensor, &press, &[1.0])?;
    let error_ln = errors.first().map(|error| error.standard_error_ln);
    error_ln.ok_or_else(|| unplannable(&stack.name, Unplannable::TooFewConversions))
}

/// Expected errors of a press with the default train onto these loads, c_L/c_S.
fn expected_errors(
    stack: &str,
    sensor: &PlannedSensor,
    press: &PlannedPress,
    loads: &[f64],
) -> Result<Vec<ExpectedError>, Failure> {
    let white = sensor.plant.ldc.white_noise_relative;
    let conversions =
        Conversions::at(sensor.settings.rate_hz as u32, white).map_err(crate::plan_ldc::refused)?;
    let bench = PlannedBench::new(sensor, &sensor.settings, conversions)
        .map_err(|cause| unplannable(stack, cause))?;
    let errors = bench.expected(loads, press);
    errors.ok_or_else(|| unplannable(stack, Unplannable::TooFewConversions))
}

fn unplannable(stack: &str, cause: Unplannable) -> Failure {
    let reason = match cause {
        Unplannable::TooFewConversions => {
            "the falls of its train have too few conversions for a line"
        }
        Unplannable::StiffensTooLittle => {
            "the actuated layer stiffens too little to be measured, and a calibration would be \
             refused. It needs a stronger field, a softer elastomer, or a softer actuated layer than \
             the sensing one"
        }
    };
    Failure::Refused(format!("the stack {stack}: {reason}"))
}

fn default_refused(limit: TrainLimit) -> Failure {
    Failure::Refused(format!(
        "the default train exceeds a limit ({}): allow a longer --contact, or a stack with less peak current",
        limit.name()
    ))
}

impl Arguments {
    /// Loads of the table: 1, 2 and 5 times powers of ten.
    fn loads(&self) -> Vec<f64> {
        let decades = -2..=3;
        let series = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|digit: f64| (digit, decade)));
        let loads = series.map(|(digit, decade)| match decade {
            0.. => digit * 10_f64.powi(decade),
            _ => digit / 10_f64.powi(-decade),
        });
        let within: Vec<f64> = loads
            .filter(|load| (self.load_from..=self.load_to).contains(load))
            .collect();
        if within.is_empty() {
            vec![self.load_from, self.load_to]
        } else {
            within
        }
    }

    /// Loads of the chart: evenly spaced in the logarithm.
    fn fine_loads(&self) -> Vec<f64> {
        /// Number of intervals between the loads of a chart's line.
        const POINTS: u32 = 60;
        let ratio = self.load_to / self.load_from;
        let at = |point: u32| self.load_from * ratio.powf(f64::from(point) / f64::from(POINTS));
        (0..=POINTS).map(at).collect()
    }
}
