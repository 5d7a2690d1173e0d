//! Alternating fields: eddy currents and lossy permeability at one frequency.
//!
//! Fields are phasors, proportional to e^(iωt), without displacement currents. Materials are
//! linearised about a constant field by their differential reluctivity. A ring of one turn is solid
//! copper: its current is not evenly distributed. Parts with a conductivity carry induced currents,
//! which flow in circles about the axis.

mod local;
mod region;
mod system;

use core::f64::consts::TAU;

use num_complex::Complex64;

use super::accuracy::Accuracy;
use super::adapt::{Solved, transfer};
use super::assembly::Level;
use super::excitation::Excitation;
use super::indicator::{jumps_of_change, jumps_without, refined};
use super::newton::SolveError;
use super::scalar::dot;
use super::small_signal::response;
use super::space::Space;
use crate::design::Design;
use crate::mesh::{self, MeshLines};
use region::is_solid;
use system::System;

/// Results for one coil at a frequency, with all other coils open.
#[derive(Clone, Debug, PartialEq)]
pub struct AcCoil {
    /// Index of the coil in the design.
    pub coil: usize,
    /// Inductance, H.
    pub inductance_h: f64,
    /// Series resistance, Ω.
    pub resistance_ohm: f64,
    /// Estimated absolute errors of `inductance_h`, `resistance_ohm` and `dc_inductance_h`.
    pub errors: [f64; 3],
    /// Part of the three values of `errors` that is due to currents in layers thinner than the
    /// mesh, H and Ω.
    coarse: [f64; 3],
    /// Changes of L, R and `dc_inductance_h` from the previous mesh, H and Ω.
    changes: [f64; 3],
    /// Inductance for small changes of a constant current that is evenly distributed over the
    /// copper, H.
    pub dc_inductance_h: f64,
    /// Resistance for a constant current, Ω.
    pub dc_resistance_ohm: f64,
    /// Contribution of each coil's copper to the resistance, Ω.
    pub by_coil_ohm: Vec<f64>,
    /// Contribution of each part to the resistance, Ω.
    pub by_part_ohm: Vec<f64>,
}

/// Results for coils at a frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct AcSolved {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Results for the requested coils.
    pub coils: Vec<AcCoil>,
    /// Voltage on each coil (row) per ampere in each coil (column), with all other coils open, Ω.
    pub impedance_ohm: Vec<Vec<Complex64>>,
    /// Number of unknowns on the last mesh.
    pub unknowns: usize,
    /// Number of meshes solved.
    pub levels: usize,
    /// Whether L and R of all requested coils have the requested accuracy; otherwise refinement
    /// ended at [`Accuracy::most_unknowns`].
    pub reached: bool,
}

/// At each refinement, triangles are halved that together have this fraction of the total score.
/// For a ring above 30 mm of copper at 100 kHz a larger fraction takes up to twice as long, since
/// the last mesh is finer than necessary.
const SHARE: f64 = 0.4;
/// The estimated error is the change from mesh to mesh times this safety factor: the change is
/// nearly the error of the coarser mesh. This factor and `MEMORY` are those of constant fields.
const SAFETY: f64 = 3.0;
/// Fraction of the previous change that the estimated error includes, since a single change may
/// vanish by chance.
const MEMORY: f64 = 0.5;

/// Smallest number of meshes, since a single change may be too small by chance: for the sensing
/// coil above design A the first change was a tenth of the error.
const LEAST_MESHES: usize = 3;
/// Solves for alternating currents in some coils of a design, about a solved constant field or
/// about no field. [`Accuracy::relative`] applies to each coil's L and R.
///
/// # Errors
/// [`SolveError`] if the design cannot be triangulated.
pub fn solve_ac(
    design: &Design,
    about: Option<&Solved>,
    frequency_hz: f64,
    coils: &[usize],
    accuracy: &Accuracy,
) -> Result<AcSolved, SolveError> {
    let excitation = about.map_or_else(
        || Excitation::small(design, 0.0),
        |solved| solved.excitation.clone(),
    );
    let (mut space, mut state) = match about {
        Some(solved) => (solved.level.space.clone(), solved.w.clone()),
        None => {
            let space = Space::new(mesh::build(design, MeshLines::PartsAlone)?, accuracy.order);
            let state = vec![0.0; space.count];
            (space, state)
        }
    };
    let mut levels = 0;
    let mut last: Option<AcSolved> = None;
    loop {
        levels += 1;
        let level = Level::new(design, space, &excitation);
        let about = ConstantField {
            excitation: &excitation,
            w: &state,
        };
        let (mut now, scores) = on_level(design, &level, &about, frequency_hz, coils)?;
        now.levels = levels;
        if let Some(last) = &last {
            now.estimate(last, accuracy.relative);
            now.reached &= levels >= LEAST_MESHES;
            if now.reached || 2 * now.unknowns > accuracy.most_unknowns {
                return Ok(now);
            }
        }
        last = Some(now);
        let (finer, parents) = refined(&level.space.mesh, scores, SHARE);
        space = Space::new(finer, level.space.basis.order());
        state = transfer(&level.space, &state, &space, &parents);
    }
}

/// The constant field about which materials are linearised.
struct ConstantField<'f> {
    excitation: &'f Excitation,
    w: &'f [f64],
}

/// Solves on one mesh. Also returns a score for each triangle: the higher it is, the more the
/// triangle needs to be halved.
fn on_level(
    design: &Design,
    level: &Level,
    about: &ConstantField<'_>,
    frequency_hz: f64,
    coils: &[usize],
) -> Result<(AcSolved, Vec<f64>), SolveError> {
    let omega = TAU * frequency_hz;
    let system = System::of(design, level, about.w, omega, coils);
    let assembled = system.assemble(design.coils.len());
    let factor = system.factor(&assembled)?;
    let driven = assembled.driven.iter();
    let fields: Vec<Vec<Complex64>> = driven.map(|of| system.solve(&factor, of)).collect();
    let voltage = |row: &Vec<f64>, field: &Vec<Complex64>| {
        let linked = row.iter().zip(field).map(|(row, x)| x * row);
        Complex64::I * omega * TAU * linked.sum::<Complex64>()
    };
    let row = |row: &Vec<f64>| fields.iter().map(|field| voltage(row, field)).collect();
    let mut impedance_ohm: Vec<Vec<Complex64>> = assembled.driven.iter().map(row).collect();
    for (index, (coil, row)) in design.coils.iter().zip(&mut impedance_ohm).enumerate() {
        if let Some(own) = row.get_mut(index).filter(|_| !is_solid(design, index)) {
            *own += design.coil_resistance_ohm(coil);
        }
    }
    let coarse = system.coarse();
    let mut scores = vec![0.0; level.space.mesh.triangles.len()];
    let mut solved = Vec::with_capacity(coils.len());
    for &coil in coils {
        let own = impedance_ohm.get(coil).and_then(|row| row.get(coil));
        let (Some(field), Some(own)) = (fields.get(coil), own) else {
            continue;
        };
        let whole = Complex64::new(own.im, own.re) / (TAU * omega);
        for part in [|x: &Complex64| x.re, |x: &Complex64| x.im] {
            let field: Vec<f64> = field.iter().map(part).collect();
            let jumps = jumps_without(level, about.w, Some(&field), &system.left_out);
            add_shares(&mut scores, &jumps.energy, whole.norm());
        }
        let forms = system.forms(&assembled, field);
        let mut unknown = Complex64::default();
        for ((form, coarse), score) in forms.iter().zip(&coarse).zip(&mut scores) {
            let form = form * coarse;
            unknown += form;
            *score += form.re / whole.re + form.im / whole.im;
        }
        let mut of_coil = AcCoil::of(design, level, coil, omega, *own, &forms);
        of_coil.coarse = [TAU * unknown.re, TAU * omega * unknown.im, 0.0];
        let constant = about.response(design, level, coil)?;
        of_coil.dc_inductance_h = constant.inductance_h;
        let jumps = jumps_of_change(level, about.w, &constant.field);
        add_shares(&mut scores, &jumps.energy, constant.inductance_h / TAU);
        solved.push(of_coil);
    }
    let solved = AcSolved {
        frequency_hz,
        coils: solved,
        impedance_ohm,
        unknowns: system.count,
        levels: 0,
        reached: false,
    };
    Ok((solved, scores))
}

/// Adds to each score the triangle's fraction of a total.
fn add_shares(scores: &mut [f64], of_triangles: &[f64], whole: f64) {
    for (score, of_triangle) in scores.iter_mut().zip(of_triangles) {
        *score += of_triangle / whole;
    }
}

/// Response of the field to one additional ampere of constant current in each coil.
struct ConstantResponse {
    inductance_h: f64,
    field: Vec<f64>,
}

impl ConstantField<'_> {
    fn response(
        &self,
        design: &Design,
        level: &Level,
        coil: usize,
    ) -> Result<ConstantResponse, SolveError> {
        let more_a: Vec<f64> = (0..design.coils.len())
            .map(|index| if index == coil { 1.0 } else { 0.0 })
            .collect();
        let (driven, field) = response(design, level, self.excitation, self.w, &more_a)?;
        Ok(ConstantResponse {
            inductance_h: TAU * dot(&driven, &field),
            field,
        })
    }
}

impl AcCoil {
    /// Computes the results of a coil from its impedance; the losses are the forms x̄ᵀ A x of the
    /// triangles.
    fn of(
        design: &Design,
        level: &Level,
        coil: usize,
        omega: f64,
        impedance: Complex64,
        forms: &[Complex64],
    ) -> Self {
        let mut by_coil_ohm = vec![0.0; design.coils.len()];
        let mut by_part_ohm = vec![0.0; design.parts.len()];
        for (triangle, form) in level.space.mesh.triangles.iter().zip(forms) {
            let region = level.space.mesh.region(triangle);
            let share = match (region.ring, region.part) {
                (Some([coil, _]), _) => by_coil_ohm.get_mut(coil as usize),
                (None, Some(part)) => by_part_ohm.get_mut(part as usize),
                (None, None) => None,
            };
            if let Some(share) = share {
                *share += TAU * omega * form.im;
            }
        }
        let copper = design.coils.get(coil);
        let dc_resistance_ohm = copper.map_or(0.0, |coil| design.coil_resistance_ohm(coil));
        if let Some(own) = by_coil_ohm
            .get_mut(coil)
            .filter(|_| !is_solid(design, coil))
        {
            *own += dc_resistance_ohm;
        }
        Self {
            coil,
            inductance_h: impedance.im / omega,
            resistance_ohm: impedance.re,
            errors: [f64::INFINITY; 3],
            coarse: [0.0; 3],
            changes: [0.0; 3],
            dc_inductance_h: 0.0,
            dc_resistance_ohm,
            by_coil_ohm,
            by_part_ohm,
        }
    }

    /// Quality factor ω L/R at a frequency in Hz.
    #[must_use]
    pub fn quality(&self, frequency_hz: f64) -> f64 {
        TAU * frequency_hz * self.inductance_h / self.resistance_ohm
    }

    /// The three values whose errors are estimated: L, R and the L of a constant current.
    fn estimated(&self) -> [f64; 3] {
        [self.inductance_h, self.resistance_ohm, self.dc_inductance_h]
    }

    /// Estimates the errors from the changes between the last three meshes.
    fn estimate(&mut self, last: &Self) {
        let values = self.estimated().into_iter().zip(last.estimated());
        let changes: Vec<f64> = values.map(|(now, then)| (now - then).abs()).collect();
        self.changes.copy_from_slice(&changes);
        let changes = self.changes.iter().zip(&last.changes);
        let estimates = self.errors.iter_mut().zip(changes).zip(self.coarse);
        for ((error, (change, before)), coarse) in estimates {
            *error = (SAFETY * change.max(MEMORY * before)).max(coarse);
        }
    }

    fn is_within(&self, relative: f64) -> bool {
        let both = self.errors.iter().zip(self.estimated());
        both.into_iter()
            .all(|(error, value)| *error <= relative * value.abs())
    }
}

impl AcSolved {
    fn estimate(&mut self, last: &Self, relative: f64) {
        for (coil, last) in self.coils.iter_mut().zip(&last.coils) {
            coil.estimate(last);
        }
        self.reached = self.coils.iter().all(|coil| coil.is_within(relative));
    }

    /// Impedance of a coil, Ω, if all driven coils are connected in series and short-circuited.
    /// `None` if the coil is one of them, or if there are no driven coils.
    #[must_use]
    pub fn with_driven_closed(&self, design: &Design, coil: usize) -> Option<Complex64> {
        let driven: Vec<usize> = (0..design.coils.len())
            .filter(|&index| design.coils.get(index).is_some_and(|coil| coil.driven))
            .collect();
        let at = |row: usize, column: usize| {
            let row: Option<&Vec<Complex64>> = self.impedance_ohm.get(row);
            row.and_then(|row| row.get(column)).copied()
        };
        if driven.is_empty() || driven.contains(&coil) {
            return None;
        }
        let mutual: Complex64 = driven.iter().filter_map(|&other| at(coil, other)).sum();
        let pairs = driven
            .iter()
            .flat_map(|&a| driven.iter().map(move |&b| (a, b)));
        let own: Complex64 = pairs.filter_map(|(a, b)| at(a, b)).sum();
        Some(at(coil, coil)? - mutual * mutual / own)
    }
}
