//! Finds parts whose field exceeds the table of their material.

use super::adapt::Solved;
use super::evaluate::Locator;
use crate::design::Design;
use crate::plates;

/// A part whose field exceeds the table of its material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeyondTable {
    /// Index of the part.
    pub part: usize,
    /// Greatest |B| in the part's metal, at least 0.1 mm from corners, T.
    pub greatest_t: f64,
    /// Last B of the table, T; above it B rises as in vacuum.
    pub ends_t: f64,
}

impl Solved {
    /// The parts whose field exceeds the table of their material. Empty for a field per ampere,
    /// which is far below saturation.
    #[must_use]
    pub fn beyond_tables(&self, design: &Design) -> Vec<BeyondTable> {
        if !self.excitation.saturating {
            return Vec::new();
        }
        let locator = Locator::new(&self.level, &self.w);
        let of = |(index, part): (usize, &crate::design::MagneticPart)| {
            let [_, ends_t] = part.material.in_table_t(0.0)?;
            let mut greatest_t = 0.0_f64;
            let only = |other| other == index;
            plates::visit_parts(&self.level, &self.w, &locator, only, |_, b_t| {
                let [b_t, _] = part.material.in_table_t(b_t).unwrap_or_default();
                greatest_t = greatest_t.max(b_t);
            });
            (greatest_t > ends_t).then_some(BeyondTable {
                part: index,
                greatest_t,
                ends_t,
            })
        };
        design.parts.iter().enumerate().filter_map(of).collect()
    }
}
