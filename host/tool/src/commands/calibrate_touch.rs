//! `palpate calibrate-touch`: calibrates an array of sensing coils from a table of presses.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_calibration::touch::{
    ArrayCalibration, Bench, Cause, CommonError, DeclaredIndenter, Design, KnownPress, Layer,
    Scales, Tip, calibrate,
};
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::text;
use palpate_wire::Command;
use serde::Deserialize;

use crate::board::link;
use crate::board::storage;

/// Calibrate an array of sensing coils from presses with known place, force and tip
#[derive(Args)]
#[command(after_help = "\
DESIGN.toml states coils, layer, bench and indenter (`palpate demo touch --bench FOLDER` writes one), PRESSES.csv a press in each line: x_mm, y_mm, force_n, tip \
(pin or ball), tip_radius_mm, and for each coil from the lowest channel its relative change of inductance, reading_0, \
reading_1 and so on. 30 to 50 presses all over the disc and with several tips are needed. Presses that contradict the \
others are left out and named.

With --load the array goes to a board, which then sends touch records; with --out its commands go to a file.

Examples:
  palpate calibrate-touch DESIGN.toml PRESSES.csv --out ARRAY.jsonl
  palpate calibrate-touch DESIGN.toml PRESSES.csv --load --store")]
pub(crate) struct Arguments {
    /// Coils, layer, bench and indenter
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    /// Presses
    #[arg(value_name = "PRESSES.csv")]
    presses: PathBuf,
    /// Write the commands that set the array
    #[arg(long, value_name = "FILE.jsonl")]
    out: Option<PathBuf>,
    /// Load the array into the board
    #[arg(long)]
    load: bool,
    /// Store the active configuration afterwards
    #[arg(long, requires = "load")]
    store: bool,
    #[command(flatten)]
    link: link::Arguments,
}

/// The file of a design; lengths are in millimetres.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DesignFile {
    /// Channels of the coils, 0 to 3 of the first and 4 to 7 of the second converter, rising.
    channels: Vec<u8>,
    /// Places of the coils' axes.
    coils_mm: Vec<[f64; 2]>,
    place_tolerance_mm: f64,
    gain_tolerance: f64,
    noise: f64,
    spacing_mm: f64,
    radii_mm: [f64; 2],
    reach_mm: f64,
    layer_mm: f64,
    shear_modulus_kpa: f64,
    bench: BenchSection,
    indenter: Option<IndenterSection>,
}

/// Standard errors of the bench.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BenchSection {
    place_mm: f64,
    force: f64,
    radius: f64,
    common_place_mm: f64,
    common_force: f64,
    common_radius: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct IndenterSection {
    radius_at_1_n_mm: f64,
    exponent: f64,
    uncertainty: f64,
}

/// Standard deviation of ln a that is uniform over a range, in units of the range.
const UNIFORM: f64 = 0.288_675;

impl DesignFile {
    fn read(path: &Path) -> Result<Self, Failure> {
        let text = text::of_file(path)?;
        let fail = |line, problem| {
            Failure::Input {
            file: path.to_owned(),
            line,
            problem,
            allowed: "the keys that `palpate demo touch --bench FOLDER` writes, and [indenter] with radius_at_1_n_mm, \
                      exponent, uncertainty"
                .to_owned(),
        }
        };
        let design: Self = toml::from_str(&text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let before = text.get(..start).unwrap_or_default();
            fail(
                1 + before.matches('\n').count() as u64,
                error.message().to_owned(),
            )
        })?;
        let rises = design.channels.windows(2).all(|pair| pair[0] < pair[1]);
        let coils = design.coils_mm.len();
        let highest = design.channels.last().copied();
        if coils == 0 || design.channels.len() != coils || !rises || highest > Some(7) {
            let problem = format!(
                "{coils} coils on the channels {:?}: each has a channel of its own, from 0 to 7, in rising order",
                design.channels
            );
            return Err(fail(1, problem));
        }
        if let Some(problem) = design.out_of_range() {
            return Err(fail(1, problem));
        }
        Ok(design)
    }

    /// Names the first number with which no calibration is possible.
    fn out_of_range(&self) -> Option<String> {
        let [least, greatest] = self.radii_mm;
        let above_zero = [
            ("place_tolerance_mm", self.place_tolerance_mm),
            ("gain_tolerance", self.gain_tolerance),
            ("noise", self.noise),
            ("spacing_mm", self.spacing_mm),
            ("radii_mm", least),
            (
                "radii_mm, the greater less the smaller one,",
                greatest - least,
            ),
            ("reach_mm", self.reach_mm),
            ("layer_mm", self.layer_mm),
            ("shear_modulus_kpa", self.shear_modulus_kpa),
            ("place_mm", self.bench.place_mm),
            ("force", self.bench.force),
            ("radius", self.bench.radius),
        ];
        let wrong = above_zero
            .into_iter()
            .find(|(_, value)| !(value.is_finite() && *value > 0.0));
        wrong.map(|(name, value)| format!("{name} is {value}, which is not above zero"))
    }

    fn design(&self) -> Design {
        let millimetres = |of: [f64; 2]| of.map(|of| 1e-3 * of);
        let [least, greatest] = self.radii_mm;
        let of_any_radius = UNIFORM * (greatest / least).ln();
        Design {
            coils_m: self.coils_mm.iter().copied().map(millimetres).collect(),
            place_tolerance_m: 1e-3 * self.place_tolerance_mm,
            gain_tolerance: self.gain_tolerance,
            noise: self.noise,
            scales: Scales {
                spacing_m: 1e-3 * self.spacing_mm,
                radii_m: millimetres(self.radii_mm),
            },
            reach_m: 1e-3 * self.reach_mm,
            radius_in_use: self
                .indenter
                .as_ref()
                .map_or(of_any_radius, |of| of.uncertainty),
            bench: Bench {
                place_m: 1e-3 * self.bench.place_mm,
                force: self.bench.force,
                radius: self.bench.radius,
                common: CommonError {
                    place_m: 1e-3 * self.bench.common_place_mm,
                    ln_force: self.bench.common_force,
                    ln_radius: self.bench.common_radius,
                },
            },
        }
    }

    fn commands(&self, calibration: &ArrayCalibration) -> Vec<Command> {
        let channels = self
            .channels
            .iter()
            .fold(0, |all, channel| all | 1_u8 << channel);
        let indenter = self.indenter.as_ref().map(|of| DeclaredIndenter {
            radius_m: 1e-3 * of.radius_at_1_n_mm,
            exponent: of.exponent,
            uncertainty: of.uncertainty,
        });
        calibration.commands(channels, indenter)
    }
}

/// Reads the table of presses.
fn presses(path: &Path, design: &DesignFile) -> Result<Vec<KnownPress>, Failure> {
    let text = text::of_file(path)?;
    let layer = Layer {
        thickness_m: 1e-3 * design.layer_mm,
        shear_modulus_pa: 1e3 * design.shear_modulus_kpa,
    };
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let fail = |line, problem: String| Failure::Input {
        file: path.to_owned(),
        line,
        problem,
        allowed:
            "x_mm, y_mm, force_n, tip (pin or ball), tip_radius_mm and a reading_N for each coil"
                .to_owned(),
    };
    let header = reader
        .headers()
        .map_err(|error| fail(1, error.to_string()))?
        .clone();
    let column = |name: &str| {
        let place = header.iter().position(|of| of == name);
        place.ok_or_else(|| fail(1, format!("no column {name}")))
    };
    let [x, y, force, tip, radius] =
        ["x_mm", "y_mm", "force_n", "tip", "tip_radius_mm"].map(column);
    let (x, y, force, tip, radius) = (x?, y?, force?, tip?, radius?);
    let readings = (0..design.coils_mm.len()).map(|coil| column(&format!("reading_{coil}")));
    let readings = readings.collect::<Result<Vec<_>, _>>()?;
    let mut presses = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| {
            fail(
                error.position().map_or(1, csv::Position::line),
                error.to_string(),
            )
        })?;
        let line = record.position().map_or(1, csv::Position::line);
        let number = |column: usize| {
            let text = record.get(column).unwrap_or_default();
            let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| fail(line, format!("{text:?} is no number")))
        };
        let above_zero = |column: usize| {
            let number = number(column)?;
            let problem = || fail(line, format!("{number} is not above zero"));
            (number > 0.0).then_some(number).ok_or_else(problem)
        };
        let radius_m = 1e-3 * above_zero(radius)?;
        let tip = match record.get(tip).unwrap_or_default() {
            "pin" => Tip::Pin(radius_m),
            "ball" => Tip::Ball(radius_m),
            other => return Err(fail(line, format!("the tip {other:?}"))),
        };
        let force_n = above_zero(force)?;
        presses.push(KnownPress {
            place_m: [1e-3 * number(x)?, 1e-3 * number(y)?],
            force_n,
            radius_m: tip.contact_radius_m(&layer, force_n),
            readings: readings
                .iter()
                .map(|of| number(*of))
                .collect::<Result<_, _>>()?,
        });
    }
    Ok(presses)
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let out = OutputFile::optional("--out", arguments.out.as_ref())?;
    let file = DesignFile::read(&arguments.design)?;
    let presses = presses(&arguments.presses, &file)?;
    let calibration = calibrate(&file.design(), &presses).map_err(Failure::refused)?;
    let commands = file.commands(&calibration);
    write!(io::stdout().lock(), "{}", report(&calibration, &presses))?;
    if let Some(out) = out {
        let lines: Result<Vec<_>, _> = commands.iter().map(serde_json::to_string).collect();
        out.write(lines?.join("\n") + "\n")?;
    }
    if !arguments.load {
        return Ok(());
    }
    let mut link = arguments.link.open()?;
    link.send_accepted(&Command::Disarm)?;
    for command in &commands {
        link.send_accepted(command)?;
    }
    let storage = storage::store_if(arguments.store, &mut link)?;
    Ok(writeln!(
        io::stdout().lock(),
        "{}",
        storage::describe(&storage)
    )?)
}

fn report(calibration: &ArrayCalibration, presses: &[KnownPress]) -> String {
    let mut text = String::new();
    let coils = calibration
        .coils()
        .into_iter()
        .zip(calibration.coil_errors());
    for (number, (coil, [x, y, gain])) in coils.enumerate() {
        let [x_mm, y_mm] = coil.place_m.map(|of| 1e3 * of);
        let _ = writeln!(
            text,
            "coil {number}: {x_mm:.3} +- {:.3} mm, {y_mm:.3} +- {:.3} mm, gain {:.3} +- {gain:.3}",
            1e3 * x,
            1e3 * y,
            coil.gain
        );
    }
    let (reading, common) = (calibration.reading_error, calibration.common_error);
    let _ = writeln!(
        text,
        "errors of a reading: {:.2} % of it and {:.2} % of the largest; common: place {:.1} um, force {:.2} %, \
         radius {:.2} %",
        1e2 * reading.relative,
        1e2 * reading.of_largest,
        1e6 * common.place_m,
        1e2 * common.ln_force,
        1e2 * common.ln_radius
    );
    for suspect in &calibration.suspects {
        let [x_mm, y_mm] = presses
            .get(suspect.press)
            .map_or([0.0; 2], |of| of.place_m.map(|of| 1e3 * of));
        let cause = match suspect.cause {
            Cause::Place([x, y]) => format!("as if it was at {:.2}, {:.2} mm", 1e3 * x, 1e3 * y),
            Cause::Force(force_n) => format!("as if its force was {force_n:.3} N"),
            Cause::Unknown => "neither another place nor another force explains it".to_owned(),
        };
        let _ = writeln!(
            text,
            "left out: press {} at {x_mm:.2}, {y_mm:.2} mm contradicts the others, {cause}",
            suspect.press + 1
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const DESIGN: &str = "channels = [0, 1]
coils_mm = [[0.0, 0.0], [0.0, 6.0]]
place_tolerance_mm = 0.3
gain_tolerance = 0.1
noise = 1e-5
spacing_mm = 2.0
radii_mm = [1.0, 5.0]
reach_mm = 4.0
layer_mm = 5.0
shear_modulus_kpa = 20.0
[bench]
place_mm = 0.05
force = 0.003
radius = 0.02
common_place_mm = 0.0
common_force = 0.002
common_radius = 0.0
";
    const HEADER: &str = "x_mm,y_mm,force_n,tip,tip_radius_mm,reading_0,reading_1\n";

    fn read(design: &str, table: &str) -> Result<Vec<KnownPress>, Failure> {
        let folder = tempfile::tempdir().unwrap();
        let [design_file, table_file] = ["a.toml", "a.csv"].map(|name| folder.path().join(name));
        fs::write(&design_file, design).unwrap();
        fs::write(&table_file, table).unwrap();
        presses(&table_file, &DesignFile::read(&design_file)?)
    }

    #[test]
    fn a_table_is_read_in_si_units() {
        let table = format!("{HEADER}1.5,-2,0.08,pin,2,0.01,-0.001\n");
        let presses = read(DESIGN, &table).unwrap();
        let [press] = presses.as_slice() else {
            panic!("{presses:?}");
        };
        assert!((press.place_m[0] - 1.5e-3).abs() < 1e-12 && press.force_n == 0.08);
        assert!((press.radius_m - (5.0_f64 / 3.0).sqrt() * 2e-3).abs() < 1e-12);
        assert_eq!(press.readings, [0.01, -0.001]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let row = "1,2,0.1,pin,2,0.01,0.0\n";
        for (design, table, said) in [
            (
                DESIGN.to_owned(),
                format!("{HEADER}{row}1,2,0,pin,2,0,0\n"),
                "line 3",
            ),
            (
                DESIGN.to_owned(),
                format!("{HEADER}1,2,nan,pin,2,0,0\n"),
                "no number",
            ),
            (
                DESIGN.to_owned(),
                format!("{HEADER}1,2,0.1,cube,2,0,0\n"),
                "cube",
            ),
            (
                DESIGN.to_owned(),
                "x_mm,y_mm\n".to_owned(),
                "no column force_n",
            ),
            (
                DESIGN.replace("[0, 1]", "[0, 8]"),
                HEADER.to_owned(),
                "from 0 to 7",
            ),
            (
                DESIGN.replace("[0, 1]", "[0]"),
                HEADER.to_owned(),
                "2 coils",
            ),
            (DESIGN.replace("noise", "nose"), HEADER.to_owned(), "line 5"),
            (
                DESIGN.replace("spacing_mm = 2.0", "spacing_mm = -2.0"),
                HEADER.to_owned(),
                "spacing_mm is -2",
            ),
            (
                DESIGN.replace("[1.0, 5.0]", "[5.0, 1.0]"),
                HEADER.to_owned(),
                "radii_mm",
            ),
            (
                DESIGN.replace("1e-5", "nan"),
                HEADER.to_owned(),
                "noise is NaN",
            ),
        ] {
            let failure = read(&design, &table).unwrap_err().to_string();
            assert!(failure.contains(said), "{said}: {failure}");
        }
    }
}
