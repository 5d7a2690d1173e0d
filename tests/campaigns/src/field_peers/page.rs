//! The result as Markdown.

use std::fmt::Write;

use super::result::{Compared, EQUAL, PeerResult};

/// The figure and the table.
pub(super) fn render(rows: &[Compared]) -> (String, String) {
    let mut table = String::from(
        "Truth is palpate-field by elements of fourth order at 3e-6. The geometry of the peers' decks is \
         written down apart from the design files. Saturated cases (backplates, pot) are at 10 A, all \
         others at 1 A. Agreement: relative difference from the truth, each peer on its finest mesh. NGSolve: cubic \
         elements, Kelvin's transform. GetDP: hierarchical elements of second order, shell transform. Time and \
         memory: each program's coarsest mesh from which on the mean field in the core is within 1e-4 of the truth; \
         ours as users call it, for 1e-4 of centre and mean by estimate. Seconds with meshing: ours of the whole program, \
         the best of three (saturated: with the solution per ampere); NGSolve without the import of its \
         libraries; GetDP of Gmsh and GetDP. Peak memory of the process, libraries included.\n\n\
         | case | NGSolve: mean | centre | L | GetDP: mean | centre | L | ours: s | MB | mean's error | NGSolve: s | MB | GetDP: s | MB | ours / NGSolve |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let (mut mean, mut ratios) = ([0.0_f64; 2], Vec::new());
    for row in rows {
        let truth = row.truth.core_mean_t;
        let peers = [&row.ngsolve, &row.getdp];
        for (worst, found) in mean.iter_mut().zip(peers) {
            let of_finest = found.last().map_or(f64::NAN, |it| it.core_mean_t);
            *worst = worst.max((of_finest / truth - 1.0).abs());
        }
        let agreement = |found: &Vec<PeerResult>| match found.last() {
            Some(found) => {
                let inductance = if row.case.saturates {
                    String::new()
                } else {
                    change(found.inductance_h, row.truth.inductance_h)
                };
                format!(
                    "{} | {} | {inductance}",
                    change(found.core_mean_t, truth),
                    change(found.centre_t, row.truth.centre_t),
                )
            }
            None => "| |".to_owned(),
        };
        let cost = |found: Option<&PeerResult>| match found {
            Some(found) => format!("{:.2} | {:.0}", found.wall_s, found.peak_mb),
            None => "not reached |".to_owned(),
        };
        let ngsolve = good_enough(&row.ngsolve, truth);
        let ratio = ngsolve.map(|peer| row.ours.wall_s / peer.wall_s);
        ratios.extend(ratio);
        // Writing to a text cannot fail.
        let _ = writeln!(
            table,
            "| {} | {} | {} | {} | {:.0e} | {} | {} | {} |",
            row.case.name,
            agreement(&row.ngsolve),
            agreement(&row.getdp),
            cost(Some(&row.ours)),
            (row.ours.core_mean_t / truth - 1.0).abs(),
            cost(ngsolve),
            cost(good_enough(&row.getdp, truth)),
            ratio.map_or(String::new(), |ratio| format!("{ratio:.2}")),
        );
    }
    let figure = format!(
        "The core's mean field is within {:.1e} of NGSolve's and {:.1e} of GetDP's; at an error of 1e-4 palpate takes {} of \
         NGSolve's time",
        mean[0],
        mean[1],
        range(&ratios)
    );
    (figure, table)
}

/// Text of a range, from the least to the greatest ratio.
pub(super) fn range(ratios: &[f64]) -> String {
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = ratios.iter().copied().fold(0.0, f64::max);
    format!("{least:.2} to {greatest:.2}")
}

/// First result from which on all are within [`EQUAL`].
fn good_enough(found: &[PeerResult], truth: f64) -> Option<&PeerResult> {
    let near = |found: &&PeerResult| (found.core_mean_t / truth - 1.0).abs() <= EQUAL;
    found.iter().rev().take_while(near).last()
}

fn change(found: f64, truth: f64) -> String {
    format!("{:+.1e}", found / truth - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lucky_coarse_mesh_does_not_count() {
        let at = |core_mean_t: f64, wall_s: f64| PeerResult {
            core_mean_t,
            wall_s,
            ..PeerResult::default()
        };
        let found = [at(1.0, 1.0), at(1.01, 2.0), at(1.00005, 3.0), at(1.0, 4.0)];
        assert_eq!(
            good_enough(&found, 1.0).map(|found| found.wall_s),
            Some(3.0)
        );
        assert!(good_enough(&found[..2], 1.0).is_none());
    }
}
