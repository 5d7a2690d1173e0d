//! The field solver against two others: NGSolve from the Python package index, and GetDP with Gmsh
//! from Debian. `cargo xtask field-peers` installs them, writes their decks, runs all three on
//! every named case and prints the result. It is not part of the gate.

mod bench;
mod cases;
mod lean;
mod page;
mod result;
mod with_getdp;

use std::path::PathBuf;

use anyhow::{Context, Result};

use crate::evidence::{BEGIN, END};
use crate::process::Workspace;
use bench::PeerBench;
use cases::CASES;

/// Runs everything, one case, or only the comparison with the fastest deck, and prints the result.
pub(crate) fn compare(
    workspace: &Workspace,
    python: Option<PathBuf>,
    only: Option<&str>,
    lean: bool,
) -> Result<()> {
    let cases = match only {
        None => &CASES,
        Some(name) => {
            let case = CASES.iter().find(|case| case.name == name);
            std::slice::from_ref(case.with_context(|| format!("there is no case {name}"))?)
        }
    };
    if lean {
        let bench = PeerBench::prepare(workspace, python, &[])?;
        println!("{}", lean::table(&bench, cases)?.1);
        return Ok(());
    }
    let bench = PeerBench::prepare(workspace, python, &["gmsh", "getdp"])?;
    bench.write("with_ngsolve.py", include_str!("with_ngsolve.py"))?;
    let (ratios, lean) = lean::table(&bench, cases)?;
    let mut rows = Vec::new();
    for case in cases {
        println!("{}", case.name);
        rows.push(bench.compare(case)?);
    }
    let (figure, table) = page::render(&rows);
    println!(
        "{BEGIN}\n{figure}, and {ratios} of that of its leanest deck.\n\n{table}\n{}\n{END}",
        lean.trim_end()
    );
    Ok(())
}
