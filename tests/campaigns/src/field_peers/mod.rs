//! `cargo campaign field-peers`: the field solver against two others, NGSolve from the Python
//! package index, and GetDP with Gmsh from Debian. Installs them, writes their decks, runs all three
//! on every named case and prints Markdown for `cargo xtask evidence field-peers`.

mod bench;
mod cases;
mod lean;
mod page;
mod result;
mod with_getdp;

use palpate_cli::failure::Failure;

use crate::evidence;
use bench::PeerBench;
use cases::CASES;

/// Runs everything and prints the result.
pub(crate) fn run() -> Result<(), Failure> {
    let bench = PeerBench::prepare()?;
    let (ratios, lean) = lean::table(&bench)?;
    let mut rows = Vec::new();
    for case in &CASES {
        println!("{}", case.name);
        rows.push(bench.compare(case)?);
    }
    let (figure, table) = page::render(&rows);
    evidence::print(&format!(
        "{figure}; for the core's mean alone it takes {ratios} of the time of a minimal NGSolve \
         program.\n\n{table}\n{lean}"
    ));
    Ok(())
}
