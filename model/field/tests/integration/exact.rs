//! Fields compared with closed forms, which share no code with the solver.

use std::f64::consts::PI;

use palpate_field::design::{Design, builtin, builtin_text};
use palpate_field::solve::{Accuracy, Excitation, Locator, Solved, solve};

const MU_0: f64 = 4e-7 * PI;

fn accuracy(relative: f64) -> Accuracy {
    Accuracy {
        relative,
        ..Accuracy::default()
    }
}

fn solved(design: &Design, relative: f64) -> Solved {
    // No material saturates here; the excitation includes the design's background field.
    let excitation = Excitation::saturating(design, 1.0);
    solve(design, &excitation, &accuracy(relative)).expect("a field")
}

/// Field on the axis of a ring of rectangular section that carries 1 A, T.
fn ring_on_axis(r: [f64; 2], x: [f64; 2], at: f64) -> f64 {
    let density = 1.0 / ((r[1] - r[0]) * (x[1] - x[0]));
    let f = |z: f64| z * ((r[1] + r[1].hypot(z)) / (r[0] + r[0].hypot(z))).ln();
    MU_0 * density / 2.0 * (f(x[1] - at) - f(x[0] - at))
}

/// Field on the axis of the paper's four spirals, T.
fn air_on_axis(at: f64) -> f64 {
    let layers = [[0.0, 0.07], [1.57, 1.64], [6.64, 6.71], [8.21, 8.28]];
    let mut sum = 0.0;
    for layer in layers {
        for k in 0..7 {
            let r = [8.0 + 3.0 * f64::from(k), 10.0 + 3.0 * f64::from(k)];
            sum += ring_on_axis(r.map(|r| r * 1e-3), layer.map(|x| x * 1e-3), at);
        }
    }
    sum
}

#[test]
fn the_paper_s_coils_in_air() {
    assert!((air_on_axis(4.14e-3) - 1012.9492e-6).abs() < 5e-11);
    let design = builtin("air").expect("built in");
    let solved = solved(&design, 1e-5);
    let centre = solved.figures.centre_t / 1012.9492e-6 - 1.0;
    assert!(centre.abs() < 1e-5, "centre off by {centre:e}");
    let locator = Locator::new(&solved.level, &solved.w);
    let mut worst = 0.0_f64;
    for step in -300..=300 {
        // Points out to 0.3 m: through the circle and far into the exterior.
        let at = 4.14e-3 + f64::from(step).powi(3) / 300_f64.powi(3) * 0.3;
        let exact = air_on_axis(at);
        let miss = (locator.at([0.0, at]).b[1] / exact - 1.0).abs();
        worst = worst.max(miss);
    }
    println!("air: centre off by {centre:.1e}, axis out to 0.3 m by {worst:.1e}");
    assert!(worst < 1e-4, "axis off by {worst:e}");
}

fn uniform(body: &str, mu_r: f64, core: &str) -> Design {
    let text = format!(
        "name = \"x\"\nlength_unit = \"mm\"\n[background]\nfield_T = 1e-3\n[core]\n{core}\n\
         [material.m]\nmu_r = {mu_r}\n[[body]]\nname = \"b\"\nmaterial = \"m\"\n{body}\n"
    );
    Design::parse("x", &text).expect("a design")
}

/// Demagnetising factor along the axis of a spheroid with semi-axes `a` across and `c` along.
fn demagnetising(a: f64, c: f64) -> f64 {
    let ratio = c / a;
    if (ratio - 1.0).abs() < 1e-9 {
        1.0 / 3.0
    } else if ratio > 1.0 {
        let e = (1.0 - 1.0 / (ratio * ratio)).sqrt();
        (1.0 - e * e) / (e * e * e) * (e.atanh() - e)
    } else {
        let e = (1.0 - ratio * ratio).sqrt();
        (1.0 - (1.0 - e * e).sqrt() / e * e.asin()) / (e * e)
    }
}

#[test]
fn spheroids_in_a_uniform_field() {
    for (a, c) in [(10.0, 10.0), (14.0, 8.28), (14.0, 12.0), (5.0, 15.0)] {
        let design = uniform(
            &format!("shape = {{ centre_x = 1.0, semi_r = {a}, semi_x = {c} }}"),
            3.7,
            &format!(
                "r = {}\nx = [{}, {}]",
                0.5 * a,
                1.0 - 0.5 * c,
                1.0 + 0.5 * c
            ),
        );
        let figures = solved(&design, 1e-5).figures;
        let exact = 3.7e-3 / (1.0 + 2.7 * demagnetising(a, c));
        if a == c {
            assert!((exact / 1.947368e-3 - 1.0).abs() < 1e-6);
        }
        let miss = figures.core_mean_t / exact - 1.0;
        println!(
            "spheroid of {a} x {c} mm: mean off by {miss:.1e}, std {:.1e}",
            figures.cv[0]
        );
        assert!(miss.abs() < 1e-5, "{a} x {c}: mean off by {miss:e}");
        assert!(
            figures.cv[0] < 1e-4,
            "{a} x {c}: not uniform, {:e}",
            figures.cv[0]
        );
    }
}

/// The halves of a sphere in a uniform field: the stress on the plane between them, minus the
/// stress of the uniform field alone, has a closed form.
#[test]
fn halves_of_a_sphere_in_a_uniform_field() {
    let radius_m = 10e-3_f64;
    let design = uniform(
        "shape = { centre_x = 0.0, semi_r = 10.0, semi_x = 10.0 }",
        3.7,
        "r = 5.0\nx = [-5.0, 5.0]",
    );
    let outside = 2.7 / 5.7;
    let factor = 0.5 * 9.0 * 3.7 / 5.7_f64.powi(2) - 0.5 - 2.0 * outside + outside.powi(2) / 4.0;
    let exact_n = PI * (1e-3 * radius_m).powi(2) / MU_0 * factor;
    let miss = solved(&design, 1e-5).figures.force_by_stress_n / exact_n - 1.0;
    println!("halves of a sphere: force off by {miss:.1e}");
    assert!(miss.abs() < 1e-4, "off by {miss:e}");
}

/// The effect of a small current does not include a background.
#[test]
fn figures_of_a_small_current_are_without_the_background() {
    let text = builtin_text("A").expect("built in");
    let alone = Design::parse("A.toml", text).expect("a design");
    let within = format!("{text}\n[background]\nfield_T = 0.01\n");
    let within = Design::parse("A.toml", &within).expect("a design");
    let of = |design: &Design, excitation: &Excitation| {
        let solved = solve(design, excitation, &accuracy(1e-3));
        solved.expect("a field").figures
    };
    let small = |design: &Design| of(design, &Excitation::small(design, 1.0));
    assert_eq!(small(&within), small(&alone));
    // There is little saturation at 10 A: the fields of the background and of the current add up.
    let [both, background] = [10.0, 0.0].map(|a| of(&within, &Excitation::saturating(&within, a)));
    let per_ampere = (both.linkage_wb - background.linkage_wb) / 10.0;
    let inductance_h = small(&alone).linkage_wb;
    assert!(
        (per_ampere / inductance_h - 1.0).abs() < 0.05,
        "{per_ampere:e}"
    );
}

#[test]
fn spherical_shield() {
    let design = uniform(
        "shape = { centre_x = 0.0, semi_r = 11.0, semi_x = 11.0 }\n\
         minus = [{ centre_x = 0.0, semi_r = 10.0, semi_x = 10.0 }]",
        1e5,
        "r = 4.0\nx = [-4.0, 4.0]",
    );
    let figures = solved(&design, 1e-5).figures;
    let (mu, ratio) = (1e5_f64, (10.0_f64 / 11.0).powi(3));
    let factor = 9.0 * mu / ((2.0 * mu + 1.0) * (mu + 2.0) - 2.0 * ratio * (mu - 1.0).powi(2));
    let miss = figures.core_mean_t / (1e-3 * factor) - 1.0;
    println!("spherical shield: off by {miss:.1e}");
    assert!(miss.abs() < 1e-4, "off by {miss:e}");
}
