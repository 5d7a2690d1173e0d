//! `palpate field ac`: inductance, resistance and quality factor of coils at a frequency.

use std::collections::BTreeMap;
use std::io::{self, Write};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::quantity::within;
use palpate_field::design::Design;
use palpate_field::solve::{AcCoil, AcSolved, Accuracy, solve_ac};
use rayon::prelude::*;
use serde::Serialize;

use super::drive::{Drive, reached};
use super::input::{DesignSource, current};
use super::tables::BeyondTable;

/// Inductance, resistance and quality factor at a frequency, with eddy currents
#[derive(Args)]
#[command(after_help = "\
The coils are those with `driven = false`, as the sensing coil, or --coil; without any, all coils. Each is \
solved alone, the others open. Rings of one turn are solid copper, in which the current crowds; a ring of \
more turns carries its current evenly. Currents are induced in parts of a material with \
conductivity_S_per_m; one with loss_tangent has a lossy permeability. \
--current sets the working point: saturated materials answer by their differential permeability there. \
`driven coils closed` is the same coil with the driven coils short-circuited in series. \
L and R are within ten times --accuracy. Fields are quasi-static: no displacement currents, so that no \
capacitance and no wave is contained.

Examples:
  palpate field show closed-sensing > mine.toml
  palpate field ac closed-sensing --frequency 3e6 --current 5
  palpate field ac sensing --frequency 1e6,3e6 --set material.plane.conductivity_S_per_m=5.8e7")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// Frequencies, Hz, separated by commas
    #[arg(long, value_name = "HZ", required = true, value_delimiter = ',', value_parser = within(1e-3, 1e9, "Hz"))]
    frequency: Vec<f64>,
    /// Constant current of the driven coils, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// A coil to solve for; may be given several times
    #[arg(long, value_name = "NAME")]
    coil: Vec<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Factor by which the tolerance of L and R exceeds that of the constant field. An error of L or R
/// only scales a resonance, which is resolved to 20 bits, and a tenth of a per cent is below the
/// uncertainty of any material.
const WIDER: f64 = 10.0;

/// Series inductance and resistance, as a measuring bridge shows them.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct SeriesImpedance {
    inductance_H: f64,
    resistance_ohm: f64,
    quality: f64,
}

impl SeriesImpedance {
    fn of(frequency_hz: f64, inductance_h: f64, resistance_ohm: f64) -> Self {
        Self {
            inductance_H: inductance_h,
            resistance_ohm,
            quality: core::f64::consts::TAU * frequency_hz * inductance_h / resistance_ohm,
        }
    }
}

/// Result for a coil at a frequency.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct CoilAtFrequency {
    coil: String,
    #[serde(flatten)]
    alternating: SeriesImpedance,
    /// Estimated absolute error of the inductance, H.
    inductance_error_H: f64,
    resistance_error_ohm: f64,
    /// Inductance for small changes of a constant current.
    dc_inductance_H: f64,
    dc_inductance_error_H: f64,
    dc_resistance_ohm: f64,
    /// Contribution of each coil and each part to the resistance.
    resistance_by_part_ohm: BTreeMap<String, f64>,
    /// Impedance with the driven coils short-circuited in series.
    #[serde(skip_serializing_if = "Option::is_none")]
    driven_coils_closed: Option<SeriesImpedance>,
}

impl CoilAtFrequency {
    fn of(design: &Design, solved: &AcSolved, coil: &AcCoil) -> Self {
        let frequency_hz = solved.frequency_hz;
        let closed = solved.with_driven_closed(design, coil.coil);
        let closed = closed.map(|impedance| {
            let inductance_h = impedance.im / (core::f64::consts::TAU * frequency_hz);
            SeriesImpedance::of(frequency_hz, inductance_h, impedance.re)
        });
        let coils = design.coils.iter().map(|coil| &coil.name);
        let parts = design.parts.iter().map(|part| &part.name);
        let shares = coils
            .zip(&coil.by_coil_ohm)
            .chain(parts.zip(&coil.by_part_ohm));
        let shares = shares.filter(|(_, share)| **share > 0.0);
        let name = design.coils.get(coil.coil).map(|coil| coil.name.clone());
        Self {
            coil: name.unwrap_or_default(),
            alternating: SeriesImpedance::of(frequency_hz, coil.inductance_h, coil.resistance_ohm),
            inductance_error_H: coil.errors[0],
            resistance_error_ohm: coil.errors[1],
            dc_inductance_H: coil.dc_inductance_h,
            dc_inductance_error_H: coil.errors[2],
            dc_resistance_ohm: coil.dc_resistance_ohm,
            resistance_by_part_ohm: shares.map(|(name, share)| (name.clone(), *share)).collect(),
            driven_coils_closed: closed,
        }
    }

    fn explain(&self) -> String {
        let Self { alternating, .. } = self;
        let mut text = format!(
            "  {}\n    L {:>12.5} uH  (+- {:.1e}), {:.5} uH (+- {:.1e}) of a constant current\n    \
             R {:>12.5} ohm (+- {:.1e}), {:.5} ohm of a constant current\n    Q {:>12.2}\n",
            self.coil,
            1e6 * alternating.inductance_H,
            1e6 * self.inductance_error_H,
            1e6 * self.dc_inductance_H,
            1e6 * self.dc_inductance_error_H,
            alternating.resistance_ohm,
            self.resistance_error_ohm,
            self.dc_resistance_ohm,
            alternating.quality,
        );
        let mut shares: Vec<_> = self.resistance_by_part_ohm.iter().collect();
        shares.sort_by(|a, b| b.1.total_cmp(a.1));
        let shares = shares.iter().filter_map(|(name, ohm)| {
            let share = 100.0 * *ohm / alternating.resistance_ohm;
            (share >= 0.05).then(|| format!("{name} {share:.1} %"))
        });
        let shares: Vec<String> = shares.collect();
        text.push_str(&format!("    R is of: {}\n", shares.join(", ")));
        if let Some(closed) = &self.driven_coils_closed {
            text.push_str(&format!(
                "    driven coils closed: L {:.5} uH, R {:.5} ohm, Q {:.2}\n",
                1e6 * closed.inductance_H,
                closed.resistance_ohm,
                closed.quality
            ));
        }
        text
    }
}

/// Results for all coils at a frequency.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct CoilsAtFrequency {
    design: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    current_A: Option<f64>,
    frequency_Hz: f64,
    coils: Vec<CoilAtFrequency>,
    /// Magnetic plates for which the design has no conductivity.
    parts_without_currents: Vec<String>,
    /// Voltage on each coil (row), real and imaginary part, per ampere in each coil (column), with
    /// all other coils open.
    impedances_ohm: Vec<Vec<[f64; 2]>>,
    unknowns: usize,
    reached: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load()?;
    let effort = &arguments.source.effort;
    let coils = coils(&design, &arguments.coil)?;
    let drive = match arguments.current {
        Some(current_a) => Some(Drive::of(&design, Some(current_a))?),
        None => (design.has_standing_field()).then_some(Drive::Background),
    };
    // In linear materials the constant field changes nothing.
    let bends = design.parts.iter().any(|part| !part.material.is_linear());
    let about = drive
        .filter(|_| bends)
        .map(|drive| drive.solve(&design, effort))
        .transpose()?;
    if let Some(about) = &about {
        BeyondTable::say_all(&design, about);
    }
    let accuracy = effort.accuracy();
    let accuracy = Accuracy {
        relative: WIDER * accuracy.relative,
        ..accuracy
    };
    let solve = |&frequency_hz: &f64| {
        solve_ac(&design, about.as_ref(), frequency_hz, &coils, &accuracy)
            .map_err(|error| Failure::Refused(format!("{}: {error}", design.name)))
    };
    let solved: Result<Vec<AcSolved>, Failure> =
        arguments.frequency.par_iter().map(solve).collect();
    let outcomes: Vec<CoilsAtFrequency> = solved?
        .iter()
        .map(|solved| CoilsAtFrequency {
            design: design.name.clone(),
            current_A: arguments.current,
            frequency_Hz: solved.frequency_hz,
            coils: solved
                .coils
                .iter()
                .map(|coil| CoilAtFrequency::of(&design, solved, coil))
                .collect(),
            parts_without_currents: without_currents(&design),
            impedances_ohm: (solved.impedance_ohm.iter())
                .map(|row| row.iter().map(|z| [z.re, z.im]).collect())
                .collect(),
            unknowns: solved.unknowns,
            reached: solved.reached,
        })
        .collect();
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &outcomes)?;
        writeln!(out)?;
    } else {
        for outcome in &outcomes {
            write!(out, "{}", outcome.explain())?;
        }
    }
    about.iter().try_for_each(|about| reached(&design, about))?;
    outcomes.iter().try_for_each(CoilsAtFrequency::reached)
}

/// Magnetic plates without eddy currents, since the design has no conductivity for them.
fn without_currents(design: &Design) -> Vec<String> {
    let plates = design.parts.iter();
    let plates = plates.filter(|part| !part.cast && part.material.initial_mu_r() > 1.0);
    let insulating = plates.filter(|plate| plate.conductivity_s_per_m == 0.0);
    insulating.map(|plate| plate.name.clone()).collect()
}

/// Returns the indices of the named coils. Without names: of the coils that are not driven or, if all are
/// driven, of all coils.
fn coils(design: &Design, names: &[String]) -> Result<Vec<usize>, Failure> {
    if design.coils.is_empty() {
        let name = &design.name;
        return Err(Failure::Argument(format!(
            "{name}: there is no coil: add a [[coil]]"
        )));
    }
    let index = |name: &String| {
        let found = design.coils.iter().position(|coil| coil.name == *name);
        found.ok_or_else(|| {
            let known = design.coils.iter().map(|coil| coil.name.as_str());
            let known: Vec<&str> = known.collect();
            let design = &design.name;
            let known = known.join(", ");
            Failure::Argument(format!(
                "{design}: no coil is named {name:?}; allowed: {known}"
            ))
        })
    };
    if !names.is_empty() {
        return names.iter().map(index).collect();
    }
    let all = design.coils.iter().enumerate();
    let sensing = all.filter(|(_, coil)| !coil.driven).map(|(index, _)| index);
    let sensing: Vec<usize> = sensing.collect();
    Ok(if sensing.is_empty() {
        (0..design.coils.len()).collect()
    } else {
        sensing
    })
}

impl CoilsAtFrequency {
    fn explain(&self) -> String {
        let about = self
            .current_A
            .map_or("no constant current".to_owned(), |current_a| {
                format!("a constant current of {current_a} A")
            });
        let mut text = format!(
            "{} at {} Hz, about {about}; {} unknowns\n",
            self.design, self.frequency_Hz, self.unknowns
        );
        for coil in &self.coils {
            text.push_str(&coil.explain());
        }
        if !self.parts_without_currents.is_empty() {
            text.push_str(&format!(
                "  without conductivity_S_per_m, so that no currents are induced in them: {}\n",
                self.parts_without_currents.join(", ")
            ));
        }
        text
    }

    /// Fails if the requested accuracy was not reached.
    fn reached(&self) -> Result<(), Failure> {
        if self.reached {
            return Ok(());
        }
        Err(Failure::Refused(format!(
            "{}: at {} Hz the accuracy of L and R is not reached with {} unknowns, since currents are thinner than the mesh can follow: ask for less by --accuracy, or for a lower frequency",
            self.design, self.frequency_Hz, self.unknowns
        )))
    }
}
