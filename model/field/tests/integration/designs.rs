//! The built-in designs: accuracy, symmetry, and figures from other programs.

use palpate_field::design::{Design, builtin};
use palpate_field::figures::Figures;
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

/// Every figure with its name.
fn named(figures: &Figures) -> [(&'static str, f64); 10] {
    [
        ("centre", figures.centre_t),
        ("core mean", figures.core_mean_t),
        ("cv r8", figures.cv[0]),
        ("cv r6", figures.cv[1]),
        ("cv r4", figures.cv[2]),
        ("axial pp", figures.axial_pp),
        ("radial pp", figures.radial_pp),
        ("linkage", figures.linkage_wb),
        ("force", figures.force_n),
        ("plates", figures.plate_max_t),
    ]
}

/// The estimated error of every figure has to cover its difference from a far finer mesh of higher
/// order. At these accuracies single figures may stay constant by chance.
/// `cargo campaign field-accuracy` does this for every built-in design.
#[test]
fn the_estimates_cover_the_errors() {
    for (name, relative) in [("A", 1e-4), ("C1in", 3e-5)] {
        let design = builtin(name).expect("built in");
        let solved = |relative: f64, order: u32| {
            let accuracy = Accuracy {
                relative,
                order,
                ..Accuracy::default()
            };
            solve(&design, &Excitation::small(&design, 1.0), &accuracy).expect("a field")
        };
        let fine = solved(3e-6, 4).figures;
        let coarse = solved(relative, 3);
        let errors = named(&coarse.figures.change_from(&fine));
        for ((figure, error), (_, estimate)) in errors.into_iter().zip(named(&coarse.errors)) {
            assert!(
                error <= estimate,
                "{name}, {figure}: {error:e}, not {estimate:e}"
            );
        }
        let mean = coarse.figures.core_mean_t / fine.core_mean_t - 1.0;
        assert!(mean.abs() <= relative, "{name}: {mean:e}");
        // The work of the currents is twice the energy of the field in all of space.
        let energy = coarse.energy_j() / (0.5 * coarse.work_j(&design)) - 1.0;
        assert!(energy.abs() < 1e-5, "{name}: {energy:e}");
        if name == "C1in" {
            // A mesh that is graded towards the corners gives 7.66 mT/A.
            assert!((coarse.figures.plate_max_t / 7.66e-3 - 1.0).abs() < 0.03);
        }
    }
}

/// A design with a plate of this outline above two rings.
fn plate_above_rings(outline: &str, upper_sense: &str) -> Design {
    let ring = |x: f64, sense: &str| {
        let to = x + 1.0;
        format!(
            "[[coil]]\nname = \"{x}\"\nr = [10.0, 14.0]\nx = [{x}, {to}]\nturns = 10\nsense = \"{sense}\"\n"
        )
    };
    let text = format!(
        "name = \"x\"\nlength_unit = \"mm\"\n[core]\nr = 3.0\nx = [-2.0, 2.0]\n\
         [conductor]\nresistivity_ohm_m = 1.7e-8\ncurrent_A = 1.0\n\
         [material.m]\nmu_r = 1000.0\n{}{}\
         [[plate]]\nname = \"p\"\nmaterial = \"m\"\nshape = {{ outline = {outline} }}\n",
        ring(-5.0, "+"),
        ring(4.0, upper_sense),
    );
    Design::parse("x.toml", &text).expect("a design")
}

/// Cones, polygons about the axis and opposed coils need no more unknowns than other designs.
#[test]
fn tips_on_the_axis_and_fields_of_zero_are_no_burden() {
    let ball: Vec<[f64; 2]> = (0..20)
        .map(|corner| f64::from(corner) / 19.0 * core::f64::consts::PI)
        .map(|angle| [6.0 * angle.sin().max(1e-9), 9.0 - 6.0 * angle.cos()])
        .map(|[r, x]| [if r < 1e-6 { 0.0 } else { r }, x])
        .collect();
    let disc = "[[20, 20], [22, 20], [22, 22], [20, 22]]";
    for (outline, sense) in [
        ("[[0, 3], [4, 9], [0, 9]]", "+"),
        (&*format!("{ball:?}"), "+"),
        (disc, "-"),
    ] {
        let design = plate_above_rings(outline, sense);
        let excitation = Excitation::small(&design, 1.0);
        let accuracy = Accuracy {
            most_unknowns: 60_000,
            ..Accuracy::default()
        };
        let solved = solve(&design, &excitation, &accuracy).expect("a field");
        assert!(
            solved.report.reached,
            "{outline} {sense}: {:?}",
            solved.report
        );
        assert!(
            solved.report.unknowns < 15_000,
            "{outline} {sense}: {:?}",
            solved.report
        );
        assert!(solved.relative_error() <= 1e-4);
    }
}

#[test]
fn an_accuracy_that_is_not_reached_is_reported() {
    let design = builtin("A").expect("built in");
    let accuracy = Accuracy {
        most_unknowns: 6_000,
        ..Accuracy::default()
    };
    let solved = solve(&design, &Excitation::small(&design, 1.0), &accuracy).expect("a field");
    assert!(!solved.report.reached && solved.relative_error() > 1e-4);
}

/// The field 0.16 mm above the copper of `A`, between two rings, is weak, so it is only as accurate
/// as the field of the thin windings beside it.
#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn a_profile_beside_thin_copper_reaches_its_accuracy() {
    let (design, solved) = small("A");
    let points: Vec<[f64; 2]> = (0..=40)
        .map(|step| [1e-3 * (21.5 + 0.05 * f64::from(step)), 1.8e-3])
        .collect();
    let fine = Accuracy {
        relative: 1e-5,
        order: 5,
        ..Accuracy::default()
    };
    let fine = solve(&design, &Excitation::small(&design, 1.0), &fine).expect("a field");
    let fine = fine.sharpened(&design, &points, 5e-5).expect("a field");
    assert!(fine.report.reached);
    let solved = solved.sharpened(&design, &points, 5e-4).expect("a field");
    assert!(solved.report.reached);
    let [ours, truth] = [&solved, &fine].map(|s| Locator::new(&s.level, &s.w));
    let miss = |point: &[f64; 2]| {
        let (a, b) = (ours.at(*point), truth.at(*point));
        let size = b.size().max(0.02 * solved.figures.core_mean_t);
        (a.b[0] - b.b[0]).hypot(a.b[1] - b.b[1]) / size
    };
    let worst = points.iter().map(miss).fold(0.0, f64::max);
    assert!(worst < 1e-3, "{worst:e}");
}

#[test]
fn saturation() {
    // Published values at 10 A, computed by another program with another method: 64 and 137 mT.
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

/// The derivatives at a working point equal the difference quotients between slightly lower and
/// slightly higher currents.
#[test]
fn derivatives_by_the_current_at_saturation() {
    let design = builtin("pot").expect("built in");
    let at = |current_a: f64| {
        let excitation = Excitation::saturating(&design, current_a);
        solve(&design, &excitation, &Accuracy::default()).expect("a field")
    };
    // 25 A saturate the plates: the inductance falls by a third.
    let found = at(25.0).by_current(&design).expect("derivatives");
    let apart = at(26.0).figures.less(&at(24.0).figures).scaled(0.5);
    for ((figure, found), (_, apart)) in named(&found).into_iter().zip(named(&apart)) {
        // Only these four are compared: the change of a figure that hardly depends on the current
        // is mostly that of the mesh.
        if ["centre", "core mean", "linkage", "force"].contains(&figure) {
            assert!(
                (found / apart - 1.0).abs() < 0.02,
                "{figure}: {found:e} {apart:e}"
            );
        }
    }
}

#[test]
fn resistance_of_the_paper_s_coils() {
    let design = builtin("A").expect("built in");
    assert!((design.resistance_ohm() - 0.389).abs() < 5e-4);
}
