//! Fields beyond the B-H tables.

use std::fmt;

use palpate_cli::notice::say;
use palpate_field::design::Design;
use palpate_field::solve::{self, Solved};
use serde::Serialize;

/// A part where the field exceeds the table of its material.
#[derive(Clone, Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
pub(super) struct BeyondTable {
    part: String,
    material: String,
    greatest_B_T: f64,
    table_ends_T: f64,
}

impl BeyondTable {
    /// Returns the parts of a field that exceed their tables; empty for a field per ampere.
    pub(super) fn all(design: &Design, solved: &Solved) -> Vec<Self> {
        let of = |beyond: solve::BeyondTable| {
            let part = design.parts.get(beyond.part)?;
            Some(Self {
                part: part.name.clone(),
                material: part.material_name.clone(),
                greatest_B_T: beyond.greatest_t,
                table_ends_T: beyond.ends_t,
            })
        };
        let beyond = solved.beyond_tables(design);
        beyond.into_iter().filter_map(of).collect()
    }

    /// Prints these parts on standard error, for outputs that have no place for them.
    pub(super) fn say_all(design: &Design, solved: &Solved) {
        for beyond in Self::all(design, solved) {
            say(format!("{}: {beyond}", design.name));
        }
    }

    /// Excess over the table, T.
    pub(super) fn excess_t(&self) -> f64 {
        self.greatest_B_T - self.table_ends_T
    }
}

impl fmt::Display for BeyondTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} reaches {:.3} T, {:.3} T beyond the table of {}, which ends at {} T: there B rises as in vacuum",
            self.part,
            self.greatest_B_T,
            self.excess_t(),
            self.material,
            self.table_ends_T
        )
    }
}
