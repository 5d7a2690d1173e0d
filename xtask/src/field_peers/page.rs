//! The result as Markdown.

use std::fmt::Write;

use super::{Compared, EQUAL, PeerResult};

/// Both tables.
pub(super) fn render(rows: &[Compared]) -> String {
    let mut text = String::from(
        "Truth is palpate-field by elements of fourth order at 3e-6. The geometry of the peers' decks is \
         written down apart from the design files. Saturated cases (backplates, pot) are at 10 A, all \
         others at 1 A.\n\n\
         ## Agreement, each peer on its finest mesh\n\n\
         Relative difference from the truth. NGSolve: cubic elements, Kelvin's transform. GetDP: hierarchical elements \
         of second order, shell transform.\n\n\
         | case | core mean, mT | NGSolve: mean | centre | L | unknowns | GetDP: mean | centre | L | nodes |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let peer = |found: Option<&PeerResult>| match found {
            Some(found) => {
                let inductance = if row.case.saturates {
                    String::new()
                } else {
                    change(found.inductance_h, row.truth.inductance_h)
                };
                format!(
                    "{} | {} | {inductance} | {:.0}",
                    change(found.core_mean_t, row.truth.core_mean_t),
                    change(found.centre_t, row.truth.centre_t),
                    found.unknowns
                )
            }
            None => "| | |".to_owned(),
        };
        // Writing to a text cannot fail.
        let _ = writeln!(
            text,
            "| {} | {:.6} | {} | {} |",
            row.case.name,
            1e3 * row.truth.core_mean_t,
            peer(row.ngsolve.last()),
            peer(row.getdp.last()),
        );
    }
    text.push_str(
        "\n## Time and memory at equal error\n\n\
         Each program's coarsest mesh from which on the mean field in the core is within 1e-4 of the truth; \
         ours as users call it, for 1e-4 of centre and mean by estimate. Seconds with meshing: ours of the whole program, \
         the best of three (saturated: with the solution per ampere); NGSolve without the import of its \
         libraries; GetDP of Gmsh and GetDP. Peak memory of the process, libraries included.\n\n\
         | case | ours: s | MB | error | NGSolve: s | MB | error | GetDP: s | MB | error | ours / NGSolve |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let truth = row.truth.core_mean_t;
        let cells = |found: Option<&PeerResult>| match found {
            Some(found) => format!(
                "{:.2} | {:.0} | {:.0e}",
                found.wall_s,
                found.peak_mb,
                (found.core_mean_t / truth - 1.0).abs()
            ),
            None => "not reached | |".to_owned(),
        };
        let ngsolve = good_enough(&row.ngsolve, truth);
        let ratio = ngsolve.map_or(String::new(), |peer| {
            format!("{:.2}", row.ours.wall_s / peer.wall_s)
        });
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {ratio} |",
            row.case.name,
            cells(Some(&row.ours)),
            cells(ngsolve),
            cells(good_enough(&row.getdp, truth)),
        );
    }
    text
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
