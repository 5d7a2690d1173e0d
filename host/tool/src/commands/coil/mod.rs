//! `palpate coil`: test of bridge and load, and response of the current.

pub(crate) mod calibrate;
mod response;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::plot::{Axis, BLUE, Chart, GREY, Marks, Series};
use palpate_simulate::instrument::coil;
use palpate_wire::code::Outcome;
use palpate_wire::command::{DriveCoil, Settings};
use palpate_wire::record::CoilTest;
use palpate_wire::{Command, Record};
use response::{Ramp, StepResponse, Traced};
use serde::Serialize;

use crate::board::configuration;
use crate::board::link::{self, Link, Reported};

/// Test bridge and coil of a board, and see how its current follows a step and a ramp
///
/// Runs the self-test, which finds resistance and inductance, steps the current up and lets it fall
/// in a ramp, and draws what the board has measured.
#[derive(Args)]
#[command(after_help = "\
The coil gets current: up to 6 A for a tenth of a \
second in the test, and the step's for a fifth of one.

Exit code 1 if the current does not follow within its limits.

Examples:
  palpate coil --stack mine.toml
  palpate coil --board emulated --to 6")]
pub(crate) struct Arguments {
    #[command(flatten)]
    link: link::Arguments,
    /// Current of the step, A, of either sign. Otherwise the greatest that supply and settings allow
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Folder for the plots step.svg and ramp.svg
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    plots: PathBuf,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Longest wait for the self-test, s; it takes at most a fifth of a second.
const TEST_S: f64 = 5.0;
/// Sampling interval of a step's record, s: one period of the bridge.
const STEP_INTERVAL_S: f32 = 16e-6;
/// Longest wait for all parts of a step's record, s; sending them takes two milliseconds plus the
/// delay of a probe.
const RECORD_S: f64 = 5.0;
/// Duration of a ramp, as in a measurement, s.
const RAMP_S: f32 = 0.06;
/// Current at the end of the ramp, relative to that of the step.
const RAMP_ENDS: f64 = 0.2;
/// Time for which the current is held before the ramp, s.
const HOLD_S: f64 = 0.03;
/// Greatest current of the step, relative to the current that the supply drives through the coil's
/// resistance: the remaining voltage is for regulation.
const OF_SUPPLY: f64 = 0.8;

/// Results.
#[derive(Serialize)]
struct CoilReport {
    simulated: bool,
    test: CoilTest,
    time_constant_s: f64,
    step: StepResponse,
    ramp: Ramp,
    within_limits: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let names = ["step.svg", "ramp.svg"].map(str::to_owned);
    let files = OutputFile::in_folder("--plots", &arguments.plots, names)?;
    let mut link = open(&arguments.link)?;
    let settings = configuration::settings(&mut link)?;
    let test = armed(&mut link)?;
    let to_a = destination(arguments.to, &settings, &test)?;
    link.take();
    let stepped = step(&mut link, to_a)?;
    link.drive_on(HOLD_S)?;
    let fallen = ramp(&mut link, RAMP_ENDS * to_a)?;
    link.send_accepted(&Command::Abort)?;
    link.send_accepted(&Command::Disarm)?;
    let found = CoilReport {
        simulated: arguments.link.is_emulated(),
        time_constant_s: f64::from(test.inductance_h) / f64::from(test.resistance_ohm),
        step: StepResponse::of(&stepped, to_a, &test)?,
        ramp: Ramp::of(&fallen, [to_a, RAMP_ENDS * to_a])?,
        within_limits: false,
        test,
    };
    let found = CoilReport {
        within_limits: found.step.is_as_it_should_be() && found.ramp.is_as_it_should_be(),
        ..found
    };
    let charts = [
        step_chart(&found.step, &stepped),
        ramp_chart(&found.ramp, &fallen),
    ];
    let drawn = draw(&charts, &files);
    if arguments.json {
        writeln!(io::stdout(), "{}", serde_json::to_string(&found)?)?;
    } else {
        print(&found, &files)?;
    }
    drawn?;
    if found.within_limits {
        return Ok(());
    }
    Err(Failure::Refused(
        "the current does not follow its setpoint within the limits: see the plots; docs/firmware.md \
         has the limits, docs/faults.md the causes"
            .to_owned(),
    ))
}

/// Connects, and sends the coil's data if the sensor design is known, as for an emulated board.
fn open(arguments: &link::Arguments) -> Result<Link, Failure> {
    let known = arguments.sensor()?;
    let mut link = arguments.open()?;
    link.send_accepted(&Command::Disarm)?;
    if let Some((_, plant)) = known {
        link.send_accepted(&Command::SetCoil(coil(&plant)))?;
    }
    Ok(link)
}

/// Arms the board, and waits for the result of its coil test.
fn armed(link: &mut Link) -> Result<CoilTest, Failure> {
    link.take();
    let (_, outcome) = link.ask(&Command::Arm)?;
    match outcome {
        Outcome::Accepted => {}
        Outcome::NotCalibrated => {
            return Err(Failure::Refused(
                "the board has no data of its coil, and cannot limit its temperature: name its stack \
                 with --stack, or calibrate it"
                    .to_owned(),
            ));
        }
        other => return Err(link.refusal(&Command::Arm, other)),
    }
    link.wait_for(TEST_S, "result of the coil's test", |record| match record {
        Record::CoilTest(test) => Some(test.clone()),
        _ => None,
    })
}

/// Greatest current that supply and settings allow, A.
fn allowed_a(settings: &Settings, test: &CoilTest) -> f64 {
    let supplied_a = f64::from(test.supply_v) / f64::from(test.resistance_ohm);
    f64::from(settings.peak_current_a).min(OF_SUPPLY * supplied_a)
}

fn destination(
    wanted_a: Option<f64>,
    settings: &Settings,
    test: &CoilTest,
) -> Result<f64, Failure> {
    let allowed_a = allowed_a(settings, test);
    match wanted_a {
        None => Ok((10.0 * allowed_a).floor() / 10.0),
        Some(to_a) if to_a.abs() <= allowed_a && to_a.abs() >= 1.0 => Ok(to_a),
        Some(to_a) => Err(Failure::Argument(format!(
            "--to {to_a}: allowed are 1 to {allowed_a:.1} A of either sign, limited by the settings' \
             peak current and by {:.1} V at {:.2} ohm",
            test.supply_v, test.resistance_ohm
        ))),
    }
}

fn drive(link: &mut Link, to_a: f64, over_s: f32, trace_interval_s: f32) -> Result<f64, Failure> {
    link.send_accepted(&Command::DriveCoil(DriveCoil {
        to_a: to_a as f32,
        over_s,
        trace_interval_s,
    }))
}

/// Current that wakes the bridge before a step, A, and time in which the bridge wakes, s. The time
/// is the length of a step's record. The current is within the noise of a reading at zero current.
const WAKING_A: f64 = 0.05;
const WAKING_S: f64 = 0.005;

/// Steps from rest, and waits for the record.
fn step(link: &mut Link, to_a: f64) -> Result<Traced, Failure> {
    drive(link, WAKING_A.copysign(to_a), 0.0, 0.0)?;
    link.collect(WAKING_S)?;
    link.take();
    drive(link, to_a, 0.0, STEP_INTERVAL_S)?;
    let mut records: Vec<Reported> = Vec::new();
    let mut left_s = RECORD_S;
    while left_s > 0.0 {
        link.drive_on(link::KEEP_ALIVE_S)?;
        records.extend(link.take_records());
        if let Some(traced) = Traced::whole(&records) {
            return Ok(traced);
        }
        left_s -= link::KEEP_ALIVE_S;
    }
    Err(Failure::Refused(
        "the trace of the current is incomplete: the probe loses records".to_owned(),
    ))
}

/// Drives a falling ramp. Returns the reported currents as pairs of time since the ramp's start, s,
/// and current, A.
fn ramp(link: &mut Link, to_a: f64) -> Result<Vec<(f64, f64)>, Failure> {
    link.take();
    let begin_s = drive(link, to_a, RAMP_S, 0.0)?;
    link.drive_on(f64::from(RAMP_S) + HOLD_S)?;
    let records = link.take_records().into_iter();
    let currents = records.filter_map(|(at_s, record)| match record {
        Record::Sample(sample) => Some((at_s - begin_s, f64::from(sample.current_a?))),
        _ => None,
    });
    Ok(currents.collect())
}

fn draw(charts: &[Chart], files: &[OutputFile]) -> Result<(), Failure> {
    let mut drawings = charts.iter().zip(files);
    drawings.try_for_each(|(chart, file)| file.write(chart.svg()?))
}

/// Range of a step's chart relative to the step, s.
const AROUND_STEP_S: [f64; 2] = [-100e-6, 700e-6];

fn step_chart(step: &StepResponse, traced: &Traced) -> Chart {
    let shown = traced.points().filter_map(|(at_s, current_a)| {
        let since_s = at_s - step.begins_s;
        let [from_s, to_s] = AROUND_STEP_S;
        (from_s..=to_s)
            .contains(&since_s)
            .then_some((1e6 * since_s, current_a))
    });
    let [_, to_s] = AROUND_STEP_S;
    let possible = step.fastest_rise(to_s);
    Chart {
        title: format!("Step to {:.1} A", step.to_a),
        x: Axis::linear("time, µs"),
        y: Axis::linear("current, A"),
        series: vec![
            Series::new(
                "possible with this coil and supply",
                GREY,
                Marks::Line(possible),
            ),
            Series::new(
                "measured, by periods of the bridge",
                BLUE,
                Marks::Crosses(shown.collect()),
            ),
        ],
    }
}

fn ramp_chart(ramp: &Ramp, currents: &[(f64, f64)]) -> Chart {
    let [from_s, to_s] = ramp.span_s;
    let off = currents
        .iter()
        .filter(|(at_s, _)| (from_s..=to_s).contains(at_s))
        .map(|(at_s, current_a)| (1e3 * at_s, 1e3 * (current_a - ramp.at(*at_s))));
    let allowed_ma = 1e3 * response::NONLINEARITY * ramp.from_a.abs();
    let bound = |off_ma: f64| Marks::Line([from_s, to_s].map(|at_s| (1e3 * at_s, off_ma)).to_vec());
    Chart {
        title: format!(
            "Ramp from {:.1} to {:.1} A, less its straight line",
            ramp.from_a, ramp.to_a
        ),
        x: Axis::linear("time, ms"),
        y: Axis::linear("off the line, mA"),
        series: vec![
            Series::new(
                "measured, by conversions",
                BLUE,
                Marks::Crosses(off.collect()),
            ),
            Series::new("allowed", GREY, bound(allowed_ma)),
            Series::new("and below", GREY, bound(-allowed_ma)),
        ],
    }
}

fn print(found: &CoilReport, files: &[OutputFile]) -> Result<(), Failure> {
    let CoilReport {
        test, step, ramp, ..
    } = found;
    let mut table = Table::new();
    table.load_style(NOTHING);
    let limit = test.limited_to_a.map_or_else(
        || "not tested: the board cannot lower it".to_owned(),
        |limited_a| format!("acts: {limited_a:.1} A when lowered"),
    );
    for [what, value, should] in [
        [
            "resistance of the circuit".into(),
            format!("{:.3} ohm", test.resistance_ohm),
            String::new(),
        ],
        [
            "inductance L".into(),
            format!("{:.1} µH", 1e6 * test.inductance_h),
            String::new(),
        ],
        [
            "time constant".into(),
            format!("{:.0} µs", 1e6 * found.time_constant_s),
            String::new(),
        ],
        [
            "dead time".into(),
            format!("{:.1} % of a period", 1e2 * test.lost),
            String::new(),
        ],
        [
            "current measurement at rest".into(),
            format!("{:.3} V", test.zero_v),
            String::new(),
        ],
        [
            "supply".into(),
            format!("{:.1} V", test.supply_v),
            String::new(),
        ],
        ["the bridge's own limit".into(), limit, String::new()],
        [
            format!("step to {:.1} A: to 90 %", step.to_a),
            format!("{:.0} µs", 1e6 * step.rise_s),
            format!(
                "{:.0} at most: {:.0} that the circuit takes, two periods, and one of the record",
                1e6 * step.longest_rise_s(),
                1e6 * step.shortest_rise_s
            ),
        ],
        [
            "overshoot".into(),
            format!("{:.1} %", 1e2 * step.overshoot),
            format!(
                "{:.1} at most: 2 and the noise of a period",
                1e2 * step.overshoot_at_most()
            ),
        ],
        [
            "after it".into(),
            format!("{:.2} A", step.settled_a),
            format!(
                "{:.2} to {:.2}",
                step.to_a - step.tolerance_a(),
                step.to_a + step.tolerance_a()
            ),
        ],
        [
            format!("ramp to {:.1} A: from a straight line", ramp.to_a),
            format!("{:.2} %", 1e2 * ramp.nonlinearity),
            format!("{:.2} at most", 1e2 * response::NONLINEARITY),
        ],
        [
            "scatter about it".into(),
            format!("{:.0} mA", 1e3 * ramp.scatter_a),
            String::new(),
        ],
    ] {
        table.add_row([what, value, should]);
    }
    let mut out = io::stdout().lock();
    if found.simulated {
        writeln!(out, "simulated coil at the emulated board")?;
    }
    writeln!(out, "{table}")?;
    let files = files.iter().map(|file| file.path().display().to_string());
    Ok(writeln!(
        out,
        "Plots: {}",
        files.collect::<Vec<_>>().join(", ")
    )?)
}
