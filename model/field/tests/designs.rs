//! The built-in designs: accuracy, symmetry, and figures known from other programs.

use palpate_field::design::{BUILTIN, Design, builtin, builtin_text};
use palpate_field::solve::{Accuracy, Excitation, Locator, Solved, solve};

fn small(name: &str) -> (Design, Solved) {
    let design = builtin(name).expect("built in");
    let solved = solve(
        &design,
        &Excitation::small(&design, 1.0),
        &Accuracy::default(),
    );
    (design, solved.expect("a field"))
}

#[test]
fn every_design_reaches_its_accuracy() {
    for name in BUILTIN {
        let (design, solved) = small(name);
        let (figures, errors) = (solved.figures, solved.errors);
        assert!(
            errors.centre_t <= 1e-4 * figures.centre_t,
            "{name}: {errors:?}"
        );
        assert!(
            errors.core_mean_t <= 1e-4 * figures.core_mean_t,
            "{name}: {errors:?}"
        );
        // The halves attract, alike by both methods.
        let force = figures.force_n / figures.force_by_stress_n - 1.0;
        assert!(
            figures.force_n > 0.0 && force.abs() < 5e-3,
            "{name}: force by {force:e}"
        );
        // Work of the currents is twice the energy of the field.
        let work = solved.work_j(&design) / figures.inductance_h - 1.0;
        assert!(work.abs() < 1e-9, "{name}: {work:e}");
    }
}

/// The estimate has to cover what a far finer mesh of higher order finds.
#[test]
fn the_estimate_covers_the_error() {
    for name in ["A", "C1in", "backplates"] {
        let (design, solved) = small(name);
        let fine = Accuracy {
            relative: 3e-6,
            order: 4,
            ..Accuracy::default()
        };
        let fine = solve(&design, &Excitation::small(&design, 1.0), &fine).expect("a field");
        let error = solved.figures.change_from(&fine.figures);
        assert!(
            error.centre_t <= solved.errors.centre_t,
            "{name}: {error:?} {:?}",
            solved.errors
        );
        assert!(
            error.core_mean_t <= solved.errors.core_mean_t,
            "{name}: {error:?} {:?}",
            solved.errors
        );
        assert!(
            error.core_mean_t <= 1e-4 * fine.figures.core_mean_t,
            "{name}: {error:?}"
        );
    }
}

#[test]
fn a_design_mirrors_itself() {
    let (design, solved) = small("C1in");
    let locator = Locator::new(&solved.level, &solved.w);
    let middle = design.core.middle_m();
    for (r, x) in [
        (0.0, 1e-3),
        (5e-3, 2e-3),
        (12e-3, 2.2e-3),
        (20e-3, 12e-3),
        (5e-3, 80e-3),
    ] {
        let [above, below] = [locator.at([r, middle + x]), locator.at([r, middle - x])];
        let size = above.size();
        assert!((above.b[1] - below.b[1]).abs() < 2e-3 * size, "{r} {x}");
        assert!((above.b[0] + below.b[0]).abs() < 2e-3 * size, "{r} {x}");
    }
}

#[test]
fn saturation() {
    // Found by a program of another method: 64 and 137 mT at 10 A.
    for (name, centre_t) in [("backplates", 0.064), ("pot", 0.137)] {
        let design = builtin(name).expect("built in");
        let excitation = Excitation::saturating(&design, 10.0);
        let solved = solve(&design, &excitation, &Accuracy::default()).expect("a field");
        assert!(
            (solved.figures.centre_t / centre_t - 1.0).abs() < 0.01,
            "{:?}",
            solved.figures
        );
        assert!(solved.report.newton_iterations <= 6, "{:?}", solved.report);
        assert!(solved.errors.core_mean_t <= 1e-4 * solved.figures.core_mean_t);
    }
}

#[test]
fn resistance_of_the_paper_s_coils() {
    let design = builtin("A").expect("built in");
    assert!((design.resistance_ohm() - 0.389).abs() < 5e-4);
}

/// The force is how the energy changes with the gap, found by solving anew at two other gaps.
#[test]
fn force_by_moving_the_boards() {
    // Without a body: what the force acts on is the copper alone.
    let text = builtin_text("air").expect("built in");
    let energy = |gap: f64| {
        let design = Design::parse(
            "air.toml",
            &text.replace("gap = 5.0", &format!("gap = {gap}")),
        );
        let design = design.expect("a design");
        let accuracy = Accuracy {
            relative: 1e-5,
            order: 4,
            ..Accuracy::default()
        };
        let solved = solve(&design, &Excitation::small(&design, 1.0), &accuracy).expect("a field");
        (0.5 * solved.figures.inductance_h, solved.figures.force_n)
    };
    let step = 0.2;
    let (near, far) = (energy(5.0 - step), energy(5.0 + step));
    let moved = (near.0 - far.0) / (2.0 * step * 1e-3);
    let force = energy(5.0).1;
    assert!((moved / force - 1.0).abs() < 5e-3, "{moved:e} {force:e}");
}
