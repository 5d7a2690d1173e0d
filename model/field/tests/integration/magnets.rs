//! Permanent magnets compared with closed forms, which share no code with the solver.

use std::f64::consts::PI;

use palpate_field::design::{Design, builtin_text};
use palpate_field::solve::{Accuracy, Excitation, Locator, Solved, solve};

const MU_0: f64 = 4e-7 * PI;

/// A design with these magnets and a core, in mm, and no other parts.
fn design(core: &str, more: &str) -> Design {
    let text = format!("name = \"x\"\nlength_unit = \"mm\"\n[core]\n{core}\n{more}\n");
    Design::parse("x", &text).expect("a design")
}

fn solved(design: &Design) -> Solved {
    let accuracy = Accuracy {
        relative: 1e-5,
        ..Accuracy::default()
    };
    let excitation = Excitation::saturating(design, 0.0);
    let solved = solve(design, &excitation, &accuracy).expect("a field");
    assert!(solved.report.reached, "{:?}", solved.report);
    solved
}

/// On its axis a cylinder of radius R has B = B_r/2 [z₁/√(z₁² + R²) − z₀/√(z₀² + R²)], inside and
/// outside, with the distances z₀ and z₁ to its faces.
#[test]
fn a_cylinder_on_its_axis() {
    let design = design(
        "r = 2.0\nx = [6.0, 10.0]",
        "[material.magnet]\nmu_r = 1.0\nremanence_T = 1.2\n[[plate]]\nname = \"magnet\"\n\
         material = \"magnet\"\nshape = { r = [0.0, 5.0], x = [-4.0, 4.0] }",
    );
    let solved = solved(&design);
    let locator = Locator::new(&solved.level, &solved.w);
    let mut worst = 0.0_f64;
    for x_mm in [
        -60.0, -12.0, -5.0, -3.5, 0.0, 2.0, 4.5, 6.0, 8.0, 10.0, 20.0, 200.0,
    ] {
        let share = |z: f64| z / 5.0_f64.hypot(z);
        let exact = 0.6 * (share(x_mm + 4.0) - share(x_mm - 4.0));
        let miss = locator.at([0.0, 1e-3 * x_mm]).b[1] / exact - 1.0;
        println!("cylinder magnet at {x_mm} mm: off by {miss:.1e}");
        worst = worst.max(miss.abs());
    }
    assert!(worst < 1e-4, "{worst:e}");
    assert_eq!(solved.figures.plate_max_t, 0.0, "a magnet is no soft metal");
}

/// Inside of a sphere B = 2 B_r/(2 + μ_r) is uniform; outside the field is that of a dipole.
#[test]
fn a_sphere_is_uniform() {
    for (mu_r, remanence_t) in [(1.0, 1.2), (1.05, -1.2), (3.0, 0.4)] {
        let design = design(
            "r = 5.0\nx = [-5.0, 5.0]",
            &format!(
                "[material.magnet]\nmu_r = {mu_r}\nremanence_T = {remanence_t}\n[[body]]\nname = \"magnet\"\n\
                 material = \"magnet\"\nshape = {{ centre_x = 0.0, semi_r = 10.0, semi_x = 10.0 }}"
            ),
        );
        let solved = solved(&design);
        let exact = 2.0 * remanence_t / (2.0 + mu_r);
        let miss = solved.figures.centre_t / exact - 1.0;
        let mean = solved.figures.core_mean_t / exact.abs() - 1.0;
        println!("sphere magnet, mu_r {mu_r}: centre off by {miss:.1e}, mean by {mean:.1e}");
        assert!(miss.abs() < 1e-5 && mean.abs() < 1e-5, "{miss:e} {mean:e}");
        assert!(solved.figures.cv[0] < 1e-4, "{:e}", solved.figures.cv[0]);
        let point = solved.working_point(&design, 0).expect("a magnet");
        let size = exact.abs();
        assert!((point.mean_b_t / size - 1.0).abs() < 1e-5, "{point:?}");
        assert!((point.least_b_t / size - 1.0).abs() < 1e-3, "{point:?}");
        // The demagnetising factor of a sphere is one third, so H = -B/(2 mu0).
        let exact_h = -0.5 * size / MU_0;
        assert!(
            (point.mean_h_a_per_m / exact_h - 1.0).abs() < 1e-5,
            "{point:?}"
        );
        let locator = Locator::new(&solved.level, &solved.w);
        let outside = locator.at([0.0, 25e-3]).b[1] / (exact * 0.4_f64.powi(3)) - 1.0;
        assert!(outside.abs() < 1e-4, "{outside:e}");
    }
}

/// A design with two spheres of radius 4 and 3 mm, 12 mm from centre to centre.
fn spheres(first_t: f64, second_t: f64) -> Design {
    design(
        "r = 1.0\nx = [5.0, 8.0]",
        &format!(
            "[material.first]\nmu_r = 1.0\nremanence_T = {first_t}\n\
             [material.second]\nmu_r = 1.0\nremanence_T = {second_t}\n\
             [[plate]]\nname = \"first\"\nmaterial = \"first\"\n\
             shape = {{ centre_x = 0.0, semi_r = 4.0, semi_x = 4.0 }}\n\
             [[plate]]\nname = \"second\"\nmaterial = \"second\"\n\
             shape = {{ centre_x = 12.0, semi_r = 3.0, semi_x = 3.0 }}"
        ),
    )
}

/// Uniformly magnetised spheres attract each other as dipoles do, at any distance: 3 μ₀ m₁ m₂/(2π d⁴).
#[test]
fn two_spheres_attract_each_other_as_dipoles() {
    for (first_t, second_t) in [(1.2, 1.2), (1.3, -0.7)] {
        let design = spheres(first_t, second_t);
        let solved = solved(&design);
        let moment = |remanence_t: f64, r_m: f64| remanence_t / MU_0 * 4.0 / 3.0 * PI * r_m.powi(3);
        let moments = moment(first_t, 4e-3) * moment(second_t, 3e-3);
        let exact_n = 3.0 * MU_0 * moments / (2.0 * PI * 12e-3_f64.powi(4));
        let force = |name: &str| {
            let part = design.named(name).expect(name);
            solved.force_on_n(part).expect("in air")
        };
        let [first, second] = ["first", "second"].map(force);
        let figures = &solved.figures;
        let found = [first, -second, figures.force_n, figures.force_by_stress_n];
        println!("two spheres: {found:?} N for {exact_n:e}");
        for force_n in found {
            assert!(
                (force_n / exact_n - 1.0).abs() < 1e-4,
                "{force_n:e} {exact_n:e}"
            );
        }
    }
}

/// Design `A` with its body turned into a magnet.
fn magnetic_elastomer() -> Design {
    let text = builtin_text("A").expect("built in");
    let text = text.replace("mu_r = 3.7", "mu_r = 1.3\nremanence_T = 0.1");
    let kept = text.lines().filter(|line| !line.starts_with("saturation"));
    let text: String = kept.map(|line| format!("{line}\n")).collect();
    Design::parse("A.toml", &text).expect("a design")
}

/// Figures per ampere leave out the remanence; at a given current the two fields add up.
#[test]
fn a_coil_beside_a_magnet() {
    let design = magnetic_elastomer();
    let without = {
        let mut design = design.clone();
        design
            .parts
            .iter_mut()
            .for_each(|part| part.remanence_t = 0.0);
        design
    };
    let of = |design: &Design, excitation: &Excitation| {
        let accuracy = Accuracy::default();
        solve(design, excitation, &accuracy)
            .expect("a field")
            .figures
    };
    let small = Excitation::small(&design, 1.0);
    let without_magnet = solve(&design, &small, &Accuracy::default()).expect("a field");
    assert_eq!(without_magnet.working_point(&design, 0), None);
    let small = without_magnet.figures;
    let alone = of(&without, &Excitation::small(&without, 1.0));
    assert!((small.centre_t / alone.centre_t - 1.0).abs() < 1e-4);
    let [both, magnet] = [10.0, 0.0].map(|a| of(&design, &Excitation::saturating(&design, a)));
    assert!(magnet.centre_t > 5e-3, "{magnet:?}");
    let by_current = both.less(&magnet).scaled(0.1);
    for (found, truth) in [
        (by_current.centre_t, small.centre_t),
        (by_current.linkage_wb, small.linkage_wb),
    ] {
        assert!((found / truth - 1.0).abs() < 1e-3, "{found:e} {truth:e}");
    }
}

/// Reciprocity: the flux of a magnet through coils is ∫ B_r · H dV, where H is the field of one
/// ampere in the coils.
#[test]
fn a_magnet_s_flux_is_the_coil_s_field_in_it() {
    let design = magnetic_elastomer();
    let linkage_wb = solved(&design).figures.linkage_wb;
    let one_ampere = solve(
        &design,
        &Excitation::small(&design, 1.0),
        &Accuracy::default(),
    );
    let one_ampere = one_ampere.expect("a field");
    let mut seen = 0.0;
    one_ampere.visit(|at| {
        if at.region.part.is_some() {
            let h_a_per_m = at.b[1] / (1.3 * MU_0);
            seen += 2.0 * PI * at.weight * at.point[0] * 0.1 * h_a_per_m;
        }
    });
    assert!(
        (linkage_wb / seen - 1.0).abs() < 2e-3,
        "{linkage_wb:e} {seen:e}"
    );
}
