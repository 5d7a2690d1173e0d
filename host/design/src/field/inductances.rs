//! Inductances of single coils.

use palpate_cli::failure::Failure;
use palpate_field::design::Design;
use palpate_field::solve::Excitation;
use rayon::prelude::*;
use serde::Serialize;

use super::drive::{field_of, reached};
use super::input::Effort;

/// Flux linkage of each coil per ampere in each coil, far below saturation.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
pub(super) struct InductanceMatrix {
    coils: Vec<String>,
    /// One row for each coil that carries current. Signs include the senses of both coils.
    rows_H: Vec<Vec<f64>>,
    /// Greatest difference between two entries that should be equal by symmetry.
    asymmetry_H: f64,
}

impl InductanceMatrix {
    /// Solves a design once for each coil.
    pub(super) fn of(design: &Design, effort: &Effort) -> Result<Self, Failure> {
        let count = design.coils.len();
        let row = |driven: usize| {
            let mut excitation = Excitation::small(design, 0.0);
            if let Some(current) = excitation.currents_a.get_mut(driven) {
                *current = 1.0;
            }
            let solved = field_of(design, &excitation, effort)?;
            reached(design, &solved)?;
            Ok((0..count)
                .map(|coil| solved.linkage_wb(design, coil))
                .collect())
        };
        let rows: Result<Vec<Vec<f64>>, Failure> = (0..count).into_par_iter().map(row).collect();
        let rows = rows?;
        let entry = |row: usize, column: usize| {
            let row: Option<&Vec<f64>> = rows.get(row);
            row.and_then(|row| row.get(column)).copied().unwrap_or(0.0)
        };
        let pairs = (0..count).flat_map(|a| (0..a).map(move |b| (a, b)));
        let differences = pairs.map(|(a, b)| (entry(a, b) - entry(b, a)).abs());
        Ok(Self {
            coils: design.coils.iter().map(|coil| coil.name.clone()).collect(),
            asymmetry_H: differences.fold(0.0, f64::max),
            rows_H: rows,
        })
    }

    /// Prints one line for each coil.
    pub(super) fn explain(&self) -> String {
        let mut text =
            "inductance L of each coil, and mutual inductance of each pair, uH\n".to_owned();
        for (coil, row) in self.coils.iter().zip(&self.rows_H) {
            let entries = row.iter().map(|henry| format!(" {:>10.4}", 1e6 * henry));
            text.push_str(&format!("  {coil:<16}{}\n", entries.collect::<String>()));
        }
        let asymmetry = 1e6 * self.asymmetry_H;
        text.push_str(&format!(
            "  without an estimate; mirrored entries differ by {asymmetry:.1e} uH at most\n"
        ));
        text
    }
}
