//! Alternating fields: eddy currents and lossy permeability at one frequency.
//!
//! Phasors e^(iωt), linear about a constant field by the differential reluctivity, without
//! displacement currents. Rings of one turn are solid copper, in which the current crowds; parts with a
//! conductivity carry the currents that are induced in circles.

mod local;
mod region;
mod system;

use core::f64::consts::TAU;
use std::collections::HashSet;

use num_complex::Complex64;

use super::adapt::{Accuracy, Solved, transfer};
use super::assembly::Level;
use super::indicator::{jumps_without, mark};
use super::newton::{Excitation, SolveError, dot};
use super::small_signal::response;
use super::space::Space;
use crate::design::Design;
use crate::mesh;
use region::is_solid;
use system::System;

/// A coil at a frequency, all others open.
#[derive(Clone, Debug, PartialEq)]
pub struct AcCoil {
    /// Its index in the design.
    pub coil: usize,
    /// Inductance, H.
    pub inductance_h: f64,
    /// Resistance in series, Ω.
    pub resistance_ohm: f64,
    /// Estimated absolute errors of both, H and Ω.
    pub errors: [f64; 2],
    /// What currents that may be thinner than the mesh make of both, H and Ω: part of the errors.
    coarse: [f64; 2],
    /// Inductance of a current that is spread evenly and constant but for small changes, H.
    pub dc_inductance_h: f64,
    /// Resistance at a constant current, Ω.
    pub dc_resistance_ohm: f64,
    /// The share of the resistance that each coil's copper makes, Ω.
    pub by_coil_ohm: Vec<f64>,
    /// The share of the resistance that each part makes, Ω.
    pub by_part_ohm: Vec<f64>,
}

/// Coils at a frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct AcSolved {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// The coils that were asked for.
    pub coils: Vec<AcCoil>,
    /// Voltage on each coil (row) per ampere in each (column), the others open, Ω.
    pub impedance_ohm: Vec<Vec<Complex64>>,
    /// Unknowns on the last mesh.
    pub unknowns: usize,
    /// Meshes that were solved on.
    pub levels: usize,
    /// Whether L and R of all coils that were asked for are as accurate as asked for; otherwise
    /// refinement ended at [`Accuracy::most_unknowns`].
    pub reached: bool,
}

/// Share of the indicator that is refined at a time, as for constant fields.
const SHARE: f64 = 0.6;
/// The change from mesh to mesh is nearly the error of the coarser one. Factor and memory are those of
/// constant fields.
const SAFETY: f64 = 3.0;
/// So much of each earlier estimate still counts, since a change may vanish by chance.
const MEMORY: f64 = 0.5;

/// One change says little: at least two count. On the sensing coil above design A the first was a tenth
/// of the error.
const LEAST_MESHES: usize = 3;

/// Solves for alternating currents in coils of a design, about a constant field that was solved before,
/// or about none. [`Accuracy::relative`] is that of each coil's L and R.
///
/// # Errors
/// [`SolveError`] where the design cannot be triangulated.
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
            let space = Space::new(mesh::build(design)?, accuracy.order);
            let state = vec![0.0; space.count];
            (space, state)
        }
    };
    let mut levels = 0;
    let mut last: Option<AcSolved> = None;
    loop {
        levels += 1;
        let level = Level::new(design, space, &excitation);
        let (mut now, scores) = on_level(design, &level, &state, frequency_hz, coils)?;
        now.levels = levels;
        if let Some(last) = &last {
            now.estimate(last, accuracy.relative);
            now.reached &= levels >= LEAST_MESHES;
            if now.reached || 2 * now.unknowns > accuracy.most_unknowns {
                now.add_dc(design, &level, &excitation, &state)?;
                return Ok(now);
            }
        }
        last = Some(now);
        let mut finer = level.space.mesh.clone();
        let parents = finer.refine(&mark(&scores, SHARE));
        space = Space::new(finer, level.space.basis.order());
        state = transfer(&level.space, &state, &space, &parents);
    }
}

/// Solves on one mesh. Returns a score for each triangle too: the higher, the coarser it is.
fn on_level(
    design: &Design,
    level: &Level,
    state: &[f64],
    frequency_hz: f64,
    coils: &[usize],
) -> Result<(AcSolved, Vec<f64>), SolveError> {
    let omega = TAU * frequency_hz;
    let system = System::of(design, level, state, omega);
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
        add_scores(level, state, field, whole, &system.left_out, &mut scores);
        let forms = system.forms(&assembled, field);
        let mut unknown = Complex64::default();
        for ((form, coarse), score) in forms.iter().zip(&coarse).zip(&mut scores) {
            if *coarse {
                unknown += form;
                *score += form.re / whole.re + form.im / whole.im;
            }
        }
        let mut of_coil = AcCoil::of(design, level, coil, omega, *own, &forms);
        of_coil.coarse = [TAU * unknown.re, TAU * omega * unknown.im];
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

/// Adds the jumps of both parts of a field about each triangle, over the field's own energy and loss.
fn add_scores(
    level: &Level,
    state: &[f64],
    field: &[Complex64],
    whole: Complex64,
    left_out: &HashSet<[u32; 2]>,
    scores: &mut [f64],
) {
    let parts: [fn(&Complex64) -> f64; 2] = [|x| x.re, |x| x.im];
    for part in parts {
        let field: Vec<f64> = field.iter().map(part).collect();
        let energy = jumps_without(level, state, Some(&field), left_out).energy;
        for (score, energy) in scores.iter_mut().zip(energy) {
            *score += energy / whole.norm();
        }
    }
}

impl AcCoil {
    /// A coil by its impedance, with losses by the forms x̄ᵀ A x of each triangle.
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
            errors: [f64::INFINITY; 2],
            coarse: [0.0; 2],
            dc_inductance_h: 0.0,
            dc_resistance_ohm,
            by_coil_ohm,
            by_part_ohm,
        }
    }

    /// The quality factor ω L/R at a frequency in Hz.
    #[must_use]
    pub fn quality(&self, frequency_hz: f64) -> f64 {
        TAU * frequency_hz * self.inductance_h / self.resistance_ohm
    }

    /// Estimates the errors from those on the mesh before and the change since then.
    fn estimate(&mut self, last: &Self) {
        let changes = [
            self.inductance_h - last.inductance_h,
            self.resistance_ohm - last.resistance_ohm,
        ];
        let estimates = self.errors.iter_mut().zip(changes).zip(last.errors);
        for (((error, change), before), coarse) in estimates.zip(self.coarse) {
            let remembered = if before.is_finite() {
                MEMORY * before
            } else {
                0.0
            };
            *error = remembered.max(SAFETY * change.abs()).max(coarse);
        }
    }

    fn is_within(&self, relative: f64) -> bool {
        self.errors[0] <= relative * self.inductance_h.abs()
            && self.errors[1] <= relative * self.resistance_ohm
    }
}

impl AcSolved {
    fn estimate(&mut self, last: &Self, relative: f64) {
        for (coil, last) in self.coils.iter_mut().zip(&last.coils) {
            coil.estimate(last);
        }
        self.reached = self.coils.iter().all(|coil| coil.is_within(relative));
    }

    /// The impedance of a coil, Ω, with all driven coils in series in a closed circuit without any
    /// other impedance. None if the coil is one of them, or there is none.
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

    /// Adds the inductances of constant currents, about the same field.
    fn add_dc(
        &mut self,
        design: &Design,
        level: &Level,
        excitation: &Excitation,
        state: &[f64],
    ) -> Result<(), SolveError> {
        for coil in &mut self.coils {
            let mut more_a = vec![0.0; design.coils.len()];
            if let Some(current) = more_a.get_mut(coil.coil) {
                *current = 1.0;
            }
            let (driven, field) = response(design, level, excitation, state, &more_a)?;
            coil.dc_inductance_h = TAU * dot(&driven, &field);
        }
        Ok(())
    }
}
