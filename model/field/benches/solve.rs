//! Cost of a design, from its text to its figures at an accuracy of 1e-4, for several orders of the
//! elements; and with saturation.
#![allow(missing_docs, reason = "divan's macro makes public items")]

use palpate_field::design::builtin;
use palpate_field::mesh;
use palpate_field::solve::{Accuracy, Excitation, Solved, solve};

fn main() {
    divan::main();
}

fn run(name: &str, order: u32, saturating: bool) -> Solved {
    let design = builtin(name).expect("built in");
    let excitation = if saturating {
        Excitation::saturating(&design, design.current_a)
    } else {
        Excitation::small(&design, 1.0)
    };
    let accuracy = Accuracy {
        order,
        ..Accuracy::default()
    };
    solve(&design, &excitation, &accuracy).expect("a field")
}

#[divan::bench(args = [2, 3, 4, 5], sample_count = 5, sample_size = 1)]
fn cast(order: u32) -> Solved {
    run("A", order, false)
}

#[divan::bench(args = ["C1in", "backplates", "pot", "closed"], sample_count = 5, sample_size = 1)]
fn plates(name: &str) -> Solved {
    run(name, 3, false)
}

#[divan::bench(args = ["backplates", "pot", "closed"], sample_count = 5, sample_size = 1)]
fn saturated(name: &str) -> Solved {
    run(name, 3, true)
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn first_mesh() -> mesh::Mesh {
    mesh::build(&builtin("A").expect("built in"), mesh::MeshLines::WithCore).expect("a mesh")
}
