//! Forces on single parts, and currents of single coils.

use palpate_field::design::{Design, Named};
use palpate_field::solve::{Accuracy, Excitation, Solved, solve};

/// A coil above a plate, and a second coil with a current of its own above both, all in air.
/// `gap_mm` is the gap between the plate and the lower coil, `lift_mm` raises the upper coil.
fn design(gap_mm: f64, lift_mm: f64, own_current_a: f64) -> Design {
    let text = format!(
        r#"
name = "forces"
length_unit = "mm"
[parameters]
gap = {gap_mm:?}
lift = {lift_mm:?}
[core]
r = 4.0
x = ["gap + 3", "gap + 5"]
[conductor]
resistivity_ohm_m = 1.72e-8
current_A = 3.0
[material.iron]
mu_r = 200.0
[[plate]]
name = "plate"
material = "iron"
shape = {{ r = [0.0, 15.0], x = [-2.0, 0.0] }}
[[coil]]
name = "lower"
r = [8.0, 10.0]
x = ["gap", "gap + 2"]
turns = 50
[[coil]]
name = "upper"
r = [8.0, 10.0]
x = ["gap + 6 + lift", "gap + 8 + lift"]
turns = 40
current_A = {own_current_a:?}
"#
    );
    Design::parse("forces.toml", &text).expect("a design")
}

fn solved(design: &Design) -> Solved {
    let accuracy = Accuracy {
        relative: 1e-5,
        ..Accuracy::default()
    };
    solve(design, &Excitation::saturating(design, 3.0), &accuracy).expect("a field")
}

/// Energy of the field of all currents, J.
fn energy_j(gap_mm: f64, lift_mm: f64) -> f64 {
    let design = design(gap_mm, lift_mm, -2.0);
    0.5 * solved(&design).work_j(&design)
}

/// At constant currents, a field in linear materials exerts forces towards growing energy.
#[test]
fn forces_are_those_of_lorentz_and_of_the_energy() {
    let of = design(2.0, 0.0, -2.0);
    let field = solved(&of);
    let force = |name: &str| {
        field
            .force_on_n(of.named(name).expect(name))
            .expect("in air")
    };
    let [plate, lower, upper] = ["plate", "lower", "upper"].map(force);
    let step_mm = 0.05;
    let slope =
        |moved: &dyn Fn(f64) -> f64| (moved(step_mm) - moved(-step_mm)) / (2.0 * step_mm * 1e-3);
    // The gap moves both coils away from the plate, so this slope is the force on the plate.
    let of_plate = -slope(&|step| energy_j(2.0 + step, 0.0));
    let of_upper = slope(&|step| energy_j(2.0, step));
    let near = |found: f64, truth: f64| (found / truth - 1.0).abs() < 2e-3;
    assert!(near(plate, of_plate), "{plate:e} {of_plate:e}");
    assert!(near(upper, of_upper), "{upper:e} {of_upper:e}");
    let lorentz = [0, 1].map(|coil| field.lorentz_force_n(coil));
    assert!(near(lower, lorentz[0]), "{lower:e} {lorentz:?}");
    assert!(near(upper, lorentz[1]), "{upper:e} {lorentz:?}");
    let sum = plate + lower + upper;
    assert!(sum.abs() < 2e-3 * upper.abs(), "{sum:e}");
    assert_eq!(of.named("upper"), Some(Named::Coil(1)));
}

/// If magnetic parts touch, the force between them depends on the gap that opens, so no force is
/// stated.
#[test]
fn a_part_that_touches_magnetic_material_has_no_force_of_its_own() {
    let of = design(0.0, 0.0, -2.0);
    let field = solved(&of);
    let force = |name: &str| field.force_on_n(of.named(name).expect(name));
    assert_eq!(
        [force("plate").is_some(), force("lower").is_some()],
        [true, false]
    );
    assert!(field.lorentz_force_n(0) < 0.0);
}

/// An own current flows in that coil only, and is not part of figures per ampere.
#[test]
fn a_coil_carries_its_own_current() {
    let with = design(2.0, 0.0, -2.0);
    assert_eq!(Excitation::saturating(&with, 3.0).currents_a, [3.0, -2.0]);
    assert_eq!(Excitation::small(&with, 1.0).currents_a, [1.0, 0.0]);
    assert_eq!(with.driven_coils().count(), 1);
}
