//! `palpate field stack`: from the field to a stack file that `simulate` takes.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_cli::quantity::within;
use palpate_field::design::Design;
use palpate_field::heat::HeatCapacity;
use palpate_field::layer::{Elastomer, Layer, pad_spring_n_per_m};
use palpate_field::material::Material;
use palpate_field::solve::{Locator, Solved, Wanted};
use palpate_sim::sensing_coil::CoilDesign;
use palpate_sim::stack::{LoadError, Stack};
use rayon::prelude::*;
use serde::Serialize;

use super::drive::Drive;
use super::input::{DesignSource, current};
use super::mse::elastomer;
use super::search::JUDGED;
use super::sensing::disturbance;
use super::tables::BeyondTable;

/// Write the stack file of a design: springs, their rise with the current, attraction, stray field
#[derive(Args)]
#[command(after_help = "\
The spring of the actuated layer is Gent and Lindley's, with the shape factor of what carries the \
load (pillars and slots of the design included); it rises as E(B) = E0 (1 + R B^2/(B^2 + Bc^2)), \
each point counting by its volume. soft and ultrasoft are priors; FILE holds modulus_Pa, rise and \
half_T of a calibration.

Example:
  palpate field stack closed --mse ultrasoft --out closed.toml")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// The elastomer: soft, ultrasoft or a file
    #[arg(long, value_name = "NAME|FILE")]
    mse: String,
    /// Peak current, A; without it, the design's
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// Distance of the sensing coil from the top of the design, mm
    #[arg(long, default_value_t = SPACER_MM, value_name = "MM", value_parser = millimetres)]
    spacer: f64,
    /// Radius of the sensing layer's pad, mm
    #[arg(long, default_value_t = PAD_RADIUS_MM, value_name = "MM", value_parser = millimetres)]
    pad_radius: f64,
    /// Height of the sensing layer's pad, mm
    #[arg(long, default_value_t = PAD_HEIGHT_MM, value_name = "MM", value_parser = millimetres)]
    pad_height: f64,
    /// Write there instead of to standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the figures behind the file as JSON
    #[arg(long, conflicts_with = "out")]
    json: bool,
}

fn millimetres(text: &str) -> Result<f64, String> {
    within(0.01, 1000.0, "mm")(text)
}

/// Default distance of the sensing coil from the top of the design, mm.
const SPACER_MM: f64 = 10.0;
/// Default pad of the sensing layer, mm.
const PAD_RADIUS_MM: f64 = 7.0;
const PAD_HEIGHT_MM: f64 = 2.0;
/// Elastomer of the sensing layer, whose permeability decreases in the stray field. Priors: 30 vol%
/// carbonyl iron, with a saturation of 30 % of that of iron.
const SENSING: Material = Material::Powder {
    chi: 2.7,
    saturation_a_per_m: 510e3,
};
/// Relative spread of single sensors about the nominal sensor: a prior, as in the shipped designs.
const SPREAD: f64 = 0.2;
/// Intended deformations of the sensing layer, m, as in the shipped designs.
const PRESS_M: [f64; 2] = [0.2e-3, 0.4e-3];
/// Shares of the peak current for which the file lists the spring's rise.
const SHARES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
/// Smallest cross-talk, relative to the computed one. The computation uses the differential
/// permeability of the initial curve, which falls linearly with the field. The reversible
/// permeability falls more slowly, so the true cross-talk is smaller than the computed one. This
/// allows a factor of two, as the reference designs do.
const LEAST_CROSSTALK: f64 = 0.5;

/// All figures behind the file, in SI units.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct BridgeFigures {
    design: String,
    mse: String,
    sensing_spring_N_per_m: f64,
    actuated_spring_N_per_m: f64,
    shape_factor: f64,
    loaded_area_m2: f64,
    peak_current_A: f64,
    coil_resistance_ohm: f64,
    coil_inductance_H: f64,
    power_at_peak_W: f64,
    copper_J_per_K: f64,
    stack_J_per_K: f64,
    field_half_T: f64,
    stray_field_at_peak_T: f64,
    sensing_inductance_change_at_peak: f64,
    crosstalk_at_peak_m: f64,
    /// The relative rise of the spring per watt at the peak.
    stiffening_per_W: f64,
    attraction_N_per_A2: f64,
    /// Figures at rising currents; the last is the peak.
    with_current: Vec<Point>,
}

/// The layer at one current.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct Point {
    current_A: f64,
    field_T: f64,
    stiffening: f64,
    actuated_spring_N_per_m: f64,
    attraction_N: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load()?;
    let elastomer = elastomer(&arguments.mse)?;
    let file = OutputFile::optional("--out", arguments.out.as_ref())?;
    let file = file.map(|file| file.apart_from(Path::new(&arguments.source.design)));
    let file = file.transpose()?;
    let bridge = bridge(arguments, &design, &elastomer)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &bridge)?;
        return Ok(writeln!(out)?);
    }
    let Some(file) = file else {
        return Ok(write!(out, "{}", bridge.file())?);
    };
    file.write(bridge.file())?;
    Ok(writeln!(out, "written: {}", file.path().display())?)
}

/// The sensing layer: position of its coil, and its pad.
#[derive(Clone, Copy, Debug)]
pub(super) struct SensingLayer {
    /// Distance of the coil from the top of the design, m.
    spacer_m: f64,
    /// Radius and height of the pad, m.
    pub(super) pad_m: [f64; 2],
}

impl SensingLayer {
    /// The default sensing layer.
    pub(super) const REFERENCE: Self = Self {
        spacer_m: 1e-3 * SPACER_MM,
        pad_m: [1e-3 * PAD_RADIUS_MM, 1e-3 * PAD_HEIGHT_MM],
    };
}

/// Expected standard error of ln(c_L) by `palpate plan`, for the design with the reference's
/// sensing layer, from its field at the peak current, A.
pub(super) fn expected_error_ln(
    design: &Design,
    elastomer: &Elastomer,
    peak_a: f64,
    peak: &Solved,
) -> Result<f64, Failure> {
    may_be_a_stack(design, peak_a)?;
    let figures = BridgeFigures::of(
        design,
        "elastomer",
        elastomer,
        SensingLayer::REFERENCE,
        &[(peak_a, peak)],
    )?;
    let stack = Stack::parse(&design.name, &figures.file()).map_err(LoadError::from)?;
    crate::plan::expected_error_ln(&stack)
}

/// Fails if a design cannot give a stack file.
fn may_be_a_stack(design: &Design, peak_a: f64) -> Result<(), Failure> {
    if !design.is_driven() || peak_a <= 0.0 {
        let reason =
            "the design has no coil or no current: add a [[coil]] and [conductor] current_A";
        return Err(Failure::Refused(reason.to_owned()));
    }
    if let Some(coil) = design.coils.iter().find(|coil| !coil.driven) {
        return Err(Failure::Refused(format!(
            "{}: the coil {:?} carries no current, and a stack's sensing coil lies by --spacer above the top of the design: remove that coil and its slabs",
            design.name, coil.name
        )));
    }
    if design.has_standing_field() {
        return Err(Failure::Refused(format!(
            "{}: a stack file has no key for a background, a magnet or a coil's own current, and its attraction grows with the square of the current: remove [background], remanence_T and current_A of coils",
            design.name
        )));
    }
    Ok(())
}

fn bridge(
    arguments: &Arguments,
    design: &Design,
    elastomer: &Elastomer,
) -> Result<BridgeFigures, Failure> {
    let peak_a = arguments.current.unwrap_or(design.current_a);
    may_be_a_stack(design, peak_a)?;
    let solve = |share: &f64| {
        let current_a = share * peak_a;
        let drive = Drive::Current(current_a);
        let solved = drive.solve_for(design, &arguments.source.effort, Wanted::Only(&JUDGED))?;
        Ok::<_, Failure>((current_a, solved))
    };
    let solved: Vec<(f64, Solved)> = SHARES.par_iter().map(solve).collect::<Result<_, _>>()?;
    if let Some((_, peak)) = solved.last() {
        BeyondTable::say_all(design, peak);
    }
    let solved: Vec<(f64, &Solved)> = solved.iter().map(|(at, solved)| (*at, solved)).collect();
    let sensing = SensingLayer {
        spacer_m: 1e-3 * arguments.spacer,
        pad_m: [arguments.pad_radius, arguments.pad_height].map(|mm| 1e-3 * mm),
    };
    BridgeFigures::of(design, &arguments.mse, elastomer, sensing, &solved)
}

impl BridgeFigures {
    /// Computes the figures from the fields at rising currents, A; the last is the peak.
    fn of(
        design: &Design,
        mse: &str,
        elastomer: &Elastomer,
        sensing: SensingLayer,
        solved: &[(f64, &Solved)],
    ) -> Result<Self, Failure> {
        let no_layer = || {
            let middle = 1e3 * design.core.middle_m();
            Failure::Refused(format!(
                "{}: no body lies between the boards at x = {middle} mm, so there is no actuated \
                 spring: add a [[body]] there",
                design.name
            ))
        };
        let mut with_current = Vec::new();
        let mut layer = None;
        for &(current_a, solved) in solved {
            let found = Layer::of(design, solved, elastomer).ok_or_else(no_layer)?;
            with_current.push(Point {
                current_A: current_a,
                field_T: found.field_t,
                stiffening: found.stiffening,
                actuated_spring_N_per_m: found.spring_n_per_m * (1.0 + found.stiffening),
                attraction_N: solved.figures.force_n,
            });
            layer = Some((current_a, solved, found));
        }
        let (peak_a, peak, layer) = layer.ok_or_else(no_layer)?;
        let coil_radius_m = 0.5 * CoilDesign::REFERENCE.outer_diameter_m;
        let stray_t = stray(design, peak, sensing.spacer_m, coil_radius_m);
        let (crosstalk_m, change) = disturbance(&SENSING, stray_t);
        let power = peak_a * peak_a * design.resistance_ohm();
        let heat = HeatCapacity::of(design, peak);
        let [pad_radius_m, pad_height_m] = sensing.pad_m;
        Ok(Self {
            design: design.name.clone(),
            mse: mse.to_owned(),
            sensing_spring_N_per_m: pad_spring_n_per_m(elastomer, pad_radius_m, pad_height_m),
            actuated_spring_N_per_m: layer.spring_n_per_m,
            shape_factor: layer.shape_factor,
            loaded_area_m2: layer.area_m2,
            peak_current_A: peak_a,
            coil_resistance_ohm: design.resistance_ohm(),
            coil_inductance_H: peak.figures.linkage_wb / peak_a,
            power_at_peak_W: power,
            copper_J_per_K: heat.copper_j_per_k,
            stack_J_per_K: heat.stack_j_per_k,
            field_half_T: elastomer.half_t,
            stray_field_at_peak_T: stray_t,
            sensing_inductance_change_at_peak: change,
            crosstalk_at_peak_m: crosstalk_m,
            stiffening_per_W: layer.stiffening / power,
            attraction_N_per_A2: peak.figures.force_n.abs() / (peak_a * peak_a),
            with_current,
        })
    }
}

/// Mean of |B|, T, over the sensing coil's disc, which is `spacer_m` above the top of the design.
fn stray(design: &Design, solved: &Solved, spacer_m: f64, radius_m: f64) -> f64 {
    const RINGS: u32 = 20;
    let parts = design.parts.iter().flat_map(|part| part.shape.extremes());
    let boards = design.boards.iter().map(|board| board.section.x_m[1]);
    let coils = design.coils.iter().flat_map(|coil| &coil.rings);
    let tops = parts.map(|point| point[1]).chain(boards);
    let top = tops
        .chain(coils.map(|ring| ring.x_m[1]))
        .fold(f64::NEG_INFINITY, f64::max);
    let locator = Locator::new(&solved.level, &solved.w);
    let (mut sum, mut area) = (0.0, 0.0);
    for ring in 0..RINGS {
        let r = (f64::from(ring) + 0.5) / f64::from(RINGS) * radius_m;
        sum += r * locator.at([r, top + spacer_m]).size();
        area += r;
    }
    sum / area
}

impl BridgeFigures {
    /// Formats the stack file.
    fn file(&self) -> String {
        let peak = self.with_current.last();
        let (field, stiffening) = peak.map_or((0.0, 0.0), |peak| (peak.field_T, peak.stiffening));
        let mut text = format!(
            "# {design} with {mse} elastomer, by `palpate field stack {design} --mse {mse}`.\n\
             # Shape factor of the actuated layer {shape:.3} on {area:.1} mm^2.\n\
             # With current:  A        mT     rise %     c_D N/mm   attraction mN\n",
            design = self.design,
            mse = self.mse,
            shape = self.shape_factor,
            area = 1e6 * self.loaded_area_m2,
        );
        for point in &self.with_current {
            text.push_str(&format!(
                "# {:>15.3} {:>9.3} {:>10.4} {:>12.3} {:>15.3}\n",
                point.current_A,
                1e3 * point.field_T,
                100.0 * point.stiffening,
                1e-3 * point.actuated_spring_N_per_m,
                1e3 * point.attraction_N,
            ));
        }
        text.push_str(&format!(
            "# Power at the peak {power:.2} W: copper {copper:.2} K/s at first, the whole stack {stack:.3} K/s.\n\
             # Rise per watt {rise:.3e}. Stray field at the sensing coil {stray:.3} mT, which changes its L by {change:.4} %.\n",
            power = self.power_at_peak_W,
            copper = self.power_at_peak_W / self.copper_J_per_K,
            stack = self.power_at_peak_W / self.stack_J_per_K,
            rise = self.stiffening_per_W,
            stray = 1e3 * self.stray_field_at_peak_T,
            change = 100.0 * self.sensing_inductance_change_at_peak,
        ));
        let spread = |value: f64| format!("{{ nominal = {value:.4e}, spread = {SPREAD} }}");
        let between = |low: f64, high: f64| format!("{{ min = {low:.3e}, max = {high:.3e} }}");
        let crosstalk = self.crosstalk_at_peak_m;
        let entries = [
            (
                "name",
                format!("{:?}", format!("{}-{}", self.design, self.mse)),
            ),
            (
                "sensing_spring_N_per_m",
                spread(self.sensing_spring_N_per_m),
            ),
            (
                "actuated_spring_N_per_m",
                spread(self.actuated_spring_N_per_m),
            ),
            ("stiffening_at_peak", spread(stiffening)),
            ("field_at_peak_T", format!("{field:.5e}")),
            ("field_half_T", format!("{:.5e}", self.field_half_T)),
            ("attraction_N_per_A2", spread(self.attraction_N_per_A2)),
            (
                "crosstalk_at_peak_m",
                between(LEAST_CROSSTALK * crosstalk, crosstalk),
            ),
            ("peak_current_A", format!("{:?}", self.peak_current_A)),
            (
                "coil_resistance_ohm",
                format!("{:.5e}", self.coil_resistance_ohm),
            ),
            (
                "coil_inductance_H",
                format!("{:.5e}", self.coil_inductance_H),
            ),
            (
                "press_depth_of_sensing_layer_m",
                between(PRESS_M[0], PRESS_M[1]),
            ),
        ];
        for (key, value) in entries {
            text.push_str(&format!("{key} = {value}\n"));
        }
        text
    }
}
