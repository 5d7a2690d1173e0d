//! `palpate demo touch`: touches of a simulated array of coils, estimated and compared with the truth.

pub mod bench;
pub mod instrument;
pub mod path;
mod show;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::output::{OutputFile, distinct};
use palpate_cli::progress::Progress;
use palpate_cli::touch_map::{self, Array};
use palpate_sim::touch::{Scan, Surroundings};

use bench::TouchBench;
use instrument::Judged;
use path::{TouchPath, TouchScenario};

/// Scans of all coils, 1/s. Quantisation falls with the length of a conversion: half of that at 140 scans/s.
pub const SCANS_PER_S: f64 = 80.0;

/// Touch a simulated array of coils, and show place, force and radius of contact with their errors
///
/// The sensor is drawn and calibrated by fifty presses on its own simulated bench. Procedure and estimator
/// are the firmware's own. Positions along a path are judged once the touch is down.
#[derive(Args)]
#[command(after_help = "\
--path shows other touches. A file states the layout and, for each touch, what presses, from where to where, how deep or \
with which force:

  layout = \"seven\"              # or \"three-around-one\", whose indenter is declared within 5 %

  [[touch]]
  name = \"slide\"
  indenter = \"ball\"             # pin, tilted (tilt_deg, toward_deg), bar (length_m, width_m,
                                # toward_deg), two-balls (apart_m, toward_deg)
  radius_m = 10e-3
  x_m = -4e-3
  y_m = 0
  to_x_m = 4e-3                 # optional, as to_y_m
  depth_m = 0.12e-3             # or force_N
  seconds = 1
  drag_x = 0.1                  # optional, as drag_y: traction along the surface over pressure

Examples:
  palpate demo touch --plot touch.svg
  palpate demo touch --path PATHS.toml --json")]
pub struct Arguments {
    /// Which sensor is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Touches of this file, in place of a press, a slide, a roll and two fingers
    #[arg(long, value_name = "FILE.toml")]
    path: Option<PathBuf>,
    /// Draw paths and 95 % ellipses over the coils
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Write design and presses of the bench, design.toml and presses.csv, as `palpate calibrate-touch` reads them
    #[arg(long, value_name = "FOLDER")]
    bench: Option<PathBuf>,
    /// One JSON object for each scan in place of the table
    #[arg(long)]
    json: bool,
}

/// A touch with what the instrument says of each scan.
pub(crate) struct Touched<'p> {
    path: &'p TouchPath,
    scans: Vec<Judged>,
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let plot = OutputFile::optional("--plot", arguments.plot.as_ref())?;
    let names = || ["design.toml".to_owned(), "presses.csv".to_owned()];
    let folder = arguments.bench.as_ref();
    let files = folder.map(|folder| OutputFile::in_folder("--bench", folder, names()));
    let files = files.transpose()?.unwrap_or_default();
    distinct(plot.iter().chain(&files))?;
    let scenario = match &arguments.path {
        Some(file) => TouchScenario::load(file)?,
        None => TouchScenario::builtin()?,
    };
    let progress = Progress::new(scenario.touches.len() + 1);
    progress.say("calibrating on the bench");
    let bench = TouchBench::drawn(scenario.kind, arguments.seed, SCANS_PER_S)?;
    let calibration = bench.calibrated()?;
    progress.step();
    let mut all = Vec::new();
    for path in &scenario.touches {
        progress.say(&format!("touching: {}", path.name));
        let commands = bench.commands(&calibration, path.declared);
        all.push(Touched {
            path,
            scans: instrument::judged(
                &commands,
                &scans(&bench, path),
                (&bench.sequence, SCANS_PER_S),
            )?,
        });
        progress.step();
    }
    progress.finish();
    for (file, text) in files.iter().zip([bench.design_file(), bench.table()]) {
        file.write(text)?;
    }
    if let Some(file) = plot {
        let commands = bench.commands(&calibration, bench::ANY_TIP);
        let array = Array::of_commands(&commands).unwrap_or_default();
        let maps: Vec<_> = all.iter().map(|of| show::map(of, &array)).collect();
        file.write(touch_map::svg(&maps))?;
    }
    let text = if arguments.json {
        show::json(&all)?
    } else {
        show::title(&bench, &calibration, arguments.seed) + &show::text(&all)
    };
    Ok(write!(io::stdout().lock(), "{text}")?)
}

/// Scans of a touch on the layer at rest.
fn scans(bench: &TouchBench, path: &TouchPath) -> Vec<Scan> {
    let mut pressing = bench.sensor.pressed_by(&path.indenter, path.drag, 1);
    let count = (SCANS_PER_S * path.length_s()) as u32;
    let scan = |number| {
        let start_s = f64::from(number) / SCANS_PER_S;
        let around = Surroundings::default();
        pressing.scan(start_s, &bench.sequence, |time_s| path.at(time_s), &around)
    };
    (0..count).map(scan).collect()
}
