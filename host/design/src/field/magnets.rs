//! Working points of magnets.

use palpate_field::design::Design;
use palpate_field::solve::Solved;
use serde::Serialize;

/// Working point of a magnet on its recoil line, along its magnetisation.
#[derive(Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
pub(super) struct Magnet {
    part: String,
    mean_B_T: f64,
    mean_H_A_per_m: f64,
    least_B_T: f64,
}

impl Magnet {
    /// Working points of all magnets in a field; empty for a field per ampere.
    pub(super) fn all(design: &Design, solved: &Solved) -> Vec<Self> {
        let of = |(index, part): (usize, &palpate_field::design::MagneticPart)| {
            let point = solved.working_point(design, index)?;
            Some(Self {
                part: part.name.clone(),
                mean_B_T: point.mean_b_t,
                mean_H_A_per_m: point.mean_h_a_per_m,
                least_B_T: point.least_b_t,
            })
        };
        design.parts.iter().enumerate().filter_map(of).collect()
    }
}

/// Prints one line for each magnet.
pub(super) fn explain(magnets: &[Magnet]) -> String {
    let line = |magnet: &Magnet| {
        let [mean, least] = [magnet.mean_B_T, magnet.least_B_T].map(|b_t| 1e3 * b_t);
        let h = 1e-3 * magnet.mean_H_A_per_m;
        format!(
            "  magnet {:<20} {mean:>12.3} mT mean, {least:.1} mT least; H {h:.1} kA/m mean\n",
            magnet.part
        )
    };
    magnets.iter().map(line).collect()
}
