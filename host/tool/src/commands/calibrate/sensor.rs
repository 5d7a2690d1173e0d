//! `palpate calibrate sensor`: from specimens on a bench to a calibration stored in the board.

use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;
use palpate_calibration::bench::{self, Bench, ContactPlan};
use palpate_calibration::session::{Pressed, Session};
use palpate_calibration::{evaluate, evaluate_both};
use palpate_sim::parameters::Parameters;
use palpate_sim::stack::Stack;
use palpate_sim::switches::Switches;
use palpate_wire::code::{Outcome, Part, StorageState, Stream};
use palpate_wire::command::{
    CalibrationIdentity, Coil, ContactTolerance, Creep, GetCalibration, Settings,
    TemperatureCoefficients,
};
use palpate_wire::{Command, Message, Record, configuration_crc};

use super::found;
pub(crate) use super::found::CalibrationFigures;
use palpate_cli::confirmation::{can_be_confirmed, is_confirmed};
use palpate_cli::describe::stiffness;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_cli::output::{OutputFile, distinct};
use palpate_cli::progress::Progress;
use palpate_cli::quantity::within;
use palpate_simulate::instrument::{BenchTask, ContactArguments, default_settings};

use super::{report, written};
use crate::board::bench::{LinkedBench, RigBench, RigPlan};
use crate::board::configuration;
use crate::board::link::{self, Link};
use crate::board::storage;
use crate::interrupt::Interrupt;

/// Calibrate a board's sensor on a bench, and store the calibration in the board
///
/// Presses a block and six springs upon the sensor, each to three depths, drives the train of ramps on
/// each, evaluates what board and gauges say, and stores what it finds. Data that cannot be true are
/// refused with the reason. What was stored before stays in force until the end, and for good if anything
/// fails.
#[derive(Args)]
#[command(after_help = "\
The emulated board has a simulated bench, with a stage, a load cell and springs that are as good as \
their tolerance. For a real one, docs/calibration.md says what is needed and what a gauge's program \
prints.

Examples:
  palpate calibrate sensor --board emulated --save-session cold.json
  palpate calibrate sensor --board emulated --warmer-k 20 --other-session cold.json
  palpate calibrate sensor --board emulated --contact-within 1 --contact-tilt 0.1
  palpate calibrate sensor --stack mine.toml --force ./read-cell --stage ./stage \\
    --springs 600,1200,3000,6000,12000,30000 --report calibration.html    # needs a bench
  palpate calibrate sensor --stack mine.toml --no-load-cell --stage ./stage \\
    --springs 600,1200,3000,6000,12000,30000    # needs a bench")]
pub(crate) struct Arguments {
    #[command(flatten)]
    link: link::Arguments,
    /// Program of the load cell: prints newtons, a number on each line; or openscale:PORT, a SparkFun
    /// OpenScale at its serial port
    #[arg(long, value_name = "PROGRAM")]
    force: Option<String>,
    /// Calibrate without a load cell: known springs and the stage's scale give the force
    #[arg(long, conflicts_with = "force")]
    no_load_cell: bool,
    /// Program of the stage: moves to positions and prints them, in metres. Without it you drive the
    /// stage by hand
    #[arg(long, value_name = "PROGRAM")]
    stage: Option<String>,
    /// Stiffness of the springs, N/m, by commas: four at least, from a tenth of the sensing
    /// layer's to five times it
    #[arg(long, value_name = "N_PER_M", value_delimiter = ',', value_parser = spring)]
    springs: Vec<f64>,
    /// Relative tolerance of the springs
    #[arg(long, value_name = "PART", default_value_t = 0.01, value_parser = tolerance)]
    spring_tolerance: f64,
    /// Write the recorded session to this file, as JSON: for --other-session later
    #[arg(long, value_name = "FILE.json")]
    save_session: Option<PathBuf>,
    /// Combine this session, of the same sensor and specimens at another temperature, with the present
    /// one: the calibration is that of the file, and both give the temperature coefficients of the
    /// layers
    #[arg(long, value_name = "FILE.json")]
    other_session: Option<PathBuf>,
    #[command(flatten)]
    contact: ContactArguments,
    /// Temperature of the emulated board's bench above its first one, K
    #[arg(long, value_name = "KELVIN", default_value_t = 0.0, value_parser = within(-50.0, 50.0, "K"), allow_negative_numbers = true)]
    warmer_k: f64,
    /// Store without asking
    #[arg(long)]
    yes: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write figures and charts to this file
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
}

/// Stiffness of a spring, N/m, from a rubber band to a steel beam.
pub(crate) fn spring(text: &str) -> Result<f64, String> {
    within(1.0, 1e7, "N/m")(text)
}

/// Relative tolerance.
pub(crate) fn tolerance(text: &str) -> Result<f64, String> {
    within(0.0, 0.2, "as a part: 0.01 is 1 %")(text)
}

impl Arguments {
    /// Whether the bench is the simulated one of the emulated board.
    fn is_simulated_bench(&self) -> bool {
        self.link.is_emulated()
    }

    /// Returns the sensor design and its data. They determine the depth of the presses and the
    /// heating of the coil.
    fn known(&self) -> Result<(Stack, Parameters), Failure> {
        self.link.sensor()?.ok_or_else(|| {
            Failure::Argument(
                "the layers of the sensor are unknown: name its stack with --stack".to_owned(),
            )
        })
    }

    /// Refuses contradictory arguments.
    fn check(&self) -> Result<(), Failure> {
        let wrong = |reason: &str| Err(Failure::Argument(reason.to_owned()));
        if self.other_session.is_some() && self.contact.plan() != ContactPlan::default() {
            return wrong(
                "the calibration is that of --other-session, with its contact: give --contact-within and \
                 --contact-tilt to the command that saves that session",
            );
        }
        if self.is_simulated_bench() {
            if self.force.is_some() || self.stage.is_some() || !self.springs.is_empty() {
                return wrong(
                    "--board emulated has its own bench: leave --force, --stage and --springs out, or name \
                     the board of `palpate serve-emulated --rig`",
                );
            }
            return Ok(());
        }
        if self.warmer_k != 0.0 {
            return wrong(
                "--warmer-k is the emulated board's: warm or cool a real sensor yourself",
            );
        }
        if self.force.is_none() && !self.no_load_cell {
            return wrong(
                "the force is unknown: name the load cell's program with --force, or add --no-load-cell \
                 to calibrate by springs and the stage's scale",
            );
        }
        self.known()?;
        let softest = self.springs.iter().copied().fold(f64::INFINITY, f64::min);
        let stiffest = self.springs.iter().copied().fold(0.0, f64::max);
        if self.springs.len() < LEAST_SPRINGS || stiffest < LEAST_RANGE * softest {
            return Err(Failure::Argument(format!(
                "--springs: at least {LEAST_SPRINGS} springs are needed, the stiffest at least \
                 {LEAST_RANGE} times as stiff as the softest: their stiffness in N/m, as --springs \
                 600,1200,3000,6000,12000,30000"
            )));
        }
        Ok(())
    }
}

/// Smallest number of springs. The adjusted quantities affect the loads of all trains together; with fewer
/// springs and a block the fit has no redundancy.
const LEAST_SPRINGS: usize = 4;
/// Smallest ratio of the stiffest spring to the softest: only different loads separate the unknowns
/// of the fit.
const LEAST_RANGE: f64 = 5.0;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.check()?;
    if !arguments.yes {
        can_be_confirmed("storing")?;
    }
    let files = Files {
        report: OutputFile::optional("--report", arguments.report.as_ref())?,
        session: OutputFile::optional("--save-session", arguments.save_session.as_ref())?,
    };
    let outputs = || files.report.iter().chain(&files.session);
    distinct(outputs())?;
    let other = arguments.other_session.as_deref();
    for (output, other) in outputs().zip(other.into_iter().cycle()) {
        output.clone().apart_from(other)?;
    }
    let other = other.map(written::read).transpose()?;
    let other = other.map(|written| written.session);
    let mut link = arguments.link.open()?;
    let interrupt = Interrupt::catch()?;
    is_stored(&mut link)?;
    let before = configuration::settings(&mut link)?;
    let done = calibrated(&mut link, arguments, (&files, other), interrupt);
    if done.is_err() {
        restore(&mut link, &before);
    }
    found::print(&done?, arguments.json)
}

/// Output files.
struct Files {
    report: Option<OutputFile>,
    session: Option<OutputFile>,
}

/// Fails if an aborted calibration would lose the configuration in force.
fn is_stored(link: &mut Link) -> Result<(), Failure> {
    let storage = storage::inspect(link)?;
    if storage.state == StorageState::Whole && storage.stored_crc != storage.in_force_crc {
        return Err(Failure::Refused(
            "the active configuration of the board is not stored, and would be lost: `palpate settings \
             store` first, or restart the board"
                .to_owned(),
        ));
    }
    Ok(())
}

/// Puts the stored configuration in force again, or the previous settings if nothing is stored.
fn restore(link: &mut Link, before: &Settings) {
    let load = |link: &mut Link| -> Result<(), Failure> {
        link.ask(&Command::Disarm)?;
        if link.ask(&Command::Load)?.1 != Outcome::Accepted {
            link.ask(&Command::SetSettings(before.clone()))?;
        }
        Ok(())
    };
    if load(link).is_ok() || link.reconnect(&Interrupt::uncaught()).is_ok() && load(link).is_ok() {
        return;
    }
    notice::say(
        "palpate: the board cannot be reached. Its stored configuration is unchanged, and active after \
         its next start",
    );
}

fn calibrated(
    link: &mut Link,
    arguments: &Arguments,
    (files, other): (&Files, Option<Session>),
    interrupt: Interrupt,
) -> Result<CalibrationFigures, Failure> {
    let task = task(link, arguments)?;
    let held = session(link, arguments, &task, interrupt)?;
    let by_itself = evaluate(&held, &task.known);
    if let Some(file) = &files.session {
        // Written even if the session gives no calibration, since the file shows the cause.
        let commands = by_itself.as_ref().ok().map(|of| of.commands.as_slice());
        written::write(&held, commands, file)?;
    }
    let (session, calibration) = match other {
        Some(other) => {
            let calibration = evaluate_both(&other, &held, &task.known);
            (other, calibration)
        }
        None => (held, by_itself),
    };
    let calibration =
        calibration.map_err(|error| Failure::Refused(format!("calibration: {error}")))?;
    let identity = identity(None, session.temperature_c);
    let is_simulated = arguments.link.is_simulated(link);
    let mut found = CalibrationFigures::of(&session, &task, &calibration, &identity, is_simulated);
    if let Some(file) = &files.report {
        file.write(report::page(&found, &calibration)?)?;
    }
    put_in_force(link, &calibration.commands, identity)?;
    if arguments.yes || is_confirmed("Store this calibration in the board?")? {
        found.configuration_crc = storage::store(link)?.stored_crc;
        found.stored = true;
    }
    Ok(found)
}

/// Plan of the bench and prior data.
fn task(link: &mut Link, arguments: &Arguments) -> Result<BenchTask, Failure> {
    let (stack, plant) = arguments.known()?;
    let mut task = if arguments.is_simulated_bench() {
        BenchTask::of(&plant, &stack, Switches::all(), &default_settings())
    } else {
        // The board sends its status together with its identity.
        link.greet()?;
        let status = link.wait_for(STATUS_S, "status", |record| match record {
            Record::Status(status) => Some(status.clone()),
            _ => None,
        })?;
        let supply_v = status.supply_v.map(f64::from);
        let mut task = BenchTask::of_board(&plant, &stack, supply_v, &default_settings());
        task.plan.springs_n_per_m.clone_from(&arguments.springs);
        task.known.spring_tolerance = arguments.spring_tolerance;
        task.temperature_c = status.temperature_c.map(f64::from);
        if let Some(coil) = coil_in_force(link)? {
            notice::say(format_args!(
                "palpate: the board's own data of its coil stay in force, among them {:.3} ohm",
                coil.resistance_ohm
            ));
            task.plan.coil = coil.clone();
            task.known.coil = coil;
        }
        task
    };
    if arguments.no_load_cell {
        task.known.load_cell_gain = None;
    }
    task.plan.contact = arguments.contact.plan();
    Ok(task)
}

/// Returns the data of the coil in force, by which the board guards it against heat: only its owner knows
/// them, and a stack file has the resistance alone.
fn coil_in_force(link: &mut Link) -> Result<Option<Coil>, Failure> {
    let question = GetCalibration {
        part: Part::Coil,
        sensor: 0,
        channel: 0,
    };
    let records = configuration::read_part(link, &question)?;
    Ok(records.into_iter().find_map(|record| match record {
        Record::Coil(coil) => Some(coil),
        _ => None,
    }))
}

/// Carries out the session on the simulated or the real bench.
fn session(
    link: &mut Link,
    arguments: &Arguments,
    task: &BenchTask,
    interrupt: Interrupt,
) -> Result<Session, Failure> {
    let progress = Progress::new(task.plan.runs());
    let mut say = |pressed: Pressed, depth_m: f64| {
        progress.say(&describe(pressed, depth_m));
        progress.step();
    };
    let mut hold = |bench: &mut dyn Bench<Error = Failure>| {
        bench::hold(bench, &task.plan, &task.known, &mut say)
    };
    let session = if arguments.is_simulated_bench() {
        let (_, plant) = arguments.link.emulated.stack_and_plant()?;
        hold(&mut LinkedBench::new(
            link,
            &plant,
            arguments.warmer_k,
            interrupt,
        ))?
    } else {
        let plan = RigPlan {
            force: arguments.force.clone(),
            stage: arguments.stage.clone(),
            settings: Settings {
                stream: Stream::Samples,
                decimation: 1,
                ..task.plan.settings.clone()
            },
            sensing_n_per_m: task.known.sensing_n_per_m,
            actuated_n_per_m: task.known.actuated_n_per_m,
            temperature_c: task.temperature_c.unwrap_or(ROOM_C),
        };
        hold(&mut RigBench::new(link, plan, interrupt)?)?
    };
    progress.finish();
    Ok(if arguments.no_load_cell {
        session.without_load_cell()
    } else {
        session
    })
}

/// Longest wait for a status record, s: the board sends one at once after its identity, then one
/// every second.
const STATUS_S: f64 = 5.0;
/// Temperature that is stated for a board without a thermometer, degrees Celsius; such a board does
/// not correct for the temperature either.
const ROOM_C: f64 = 25.0;

/// Describes specimen and depth of a run in words.
pub(crate) fn describe(pressed: Pressed, depth_m: f64) -> String {
    let depth = format!("{:.2} mm deep", 1e3 * depth_m);
    match pressed {
        Pressed::Nothing => "nothing touches".to_owned(),
        Pressed::Block => format!("block, {depth}"),
        Pressed::Spring { n_per_m } => format!("spring of {}, {depth}", stiffness(n_per_m)),
        Pressed::BlockBeside { distance_m, .. } => {
            format!(
                "block {:.2} mm beside the centre, {depth}",
                1e3 * distance_m
            )
        }
        Pressed::BlockTilted { angle_rad, .. } => {
            format!("block tilted by {:.2} deg, {depth}", angle_rad.to_degrees())
        }
    }
}

/// Number, date and temperature of a calibration; [`put_in_force`] adds the hash of the board's
/// parts.
pub(crate) fn identity(id: Option<u32>, temperature_c: f64) -> CalibrationIdentity {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
    let now_s = since_1970.map_or(0, |time| time.as_secs());
    let now_s = u32::try_from(now_s).unwrap_or(u32::MAX);
    CalibrationIdentity {
        id: id.unwrap_or(now_s),
        calibrated_at_s: now_s,
        calibrated_at_c: temperature_c as f32,
        hash: 0,
    }
}

/// Puts a calibration in force; it is lost at power-off unless stored. It replaces every part of
/// the previous calibration. The board's own parts stay: the data of its coil, the correction of its
/// current, and other channels.
///
/// # Errors
/// If the board is gone, or refuses a part.
pub(crate) fn put_in_force(
    link: &mut Link,
    commands: &[Command],
    identity: CalibrationIdentity,
) -> Result<(), Failure> {
    link.send_accepted(&Command::Disarm)?;
    for command in commands {
        link.send_accepted(command)?;
    }
    let before = configuration::read(link)?;
    // A part cannot be removed; with these values it has no effect.
    let without_effect = [
        Command::SetTemperatureCoefficients(TemperatureCoefficients {
            springs_per_k: 0.0,
            rise_per_k: 0.0,
        }),
        Command::SetContact(ContactTolerance {
            within_m: 0.0,
            tilt_rad: 0.0,
            rise_uncertainty: 0.0,
            zero_uncertainty_m: 0.0,
        }),
        Command::SetCreep(Creep::TYPICAL),
    ];
    for part in without_effect {
        let has = |commands: &[Command]| commands.iter().any(|of| of.kind() == part.kind());
        if has(&before) && !has(commands) {
            link.send_accepted(&part)?;
        }
    }
    let is_part = |command: &Command| {
        !matches!(
            command,
            Command::SetSettings(_) | Command::SetTip(_) | Command::SetCalibrationIdentity(_)
        )
    };
    let mut parts = configuration::read(link)?;
    parts.retain(is_part);
    link.send_accepted(&Command::SetCalibrationIdentity(CalibrationIdentity {
        hash: configuration_crc(parts),
        ..identity
    }))?;
    Ok(())
}
