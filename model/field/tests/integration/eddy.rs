//! Eddy currents and losses with known solutions: a coil above a plate and a half-space (Dodd and
//! Deeds), the limit of low frequency, and a closed ring.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use num_complex::Complex64;
use palpate_field::design::Design;
use palpate_field::solve::{AcCoil, AcSolved, Accuracy, solve_ac};

use crate::dodd_deeds::{Plate, Ring, Spectrum};

/// The coil's radii, its lower and upper end above the plate, m, and its turns.
const R_M: [f64; 2] = [4e-3, 7e-3];
const ABOVE_M: [f64; 2] = [1e-3, 2.5e-3];
const TURNS: f64 = 50.0;
const RING: Ring = Ring {
    r_m: R_M,
    above_m: ABOVE_M,
    turns: TURNS,
};

static SPECTRUM: LazyLock<Spectrum> = LazyLock::new(|| Spectrum::of(RING));

/// The radius of the plates, m.
const PLATE_RADIUS_M: f64 = 0.1;

const ALUMINIUM: Plate = Plate {
    conductivity: 2e7,
    mu_r: 1.0,
    loss_tangent: 0.0,
    thickness_m: 12e-3,
};

fn coil(name: &str, r_m: [f64; 2], above_m: [f64; 2], turns: f64) -> String {
    let ring = Ring {
        r_m,
        above_m,
        turns,
    };
    ring.coil(name)
}

fn design(parts: &str) -> Design {
    let text = format!(
        "name = \"x\"\nlength_unit = \"m\"\n[core]\nr = 20e-3\nx = [1e-3, 41e-3]\n\
         [conductor]\nresistivity_ohm_m = 1.72e-8\ncurrent_A = 1\n{parts}"
    );
    Design::parse("x", &text).expect("a design")
}

fn accuracy(relative: f64) -> Accuracy {
    Accuracy {
        relative,
        ..Accuracy::default()
    }
}

/// Results of the first coil at a frequency.
fn solved(design: &Design, frequency_hz: f64, relative: f64) -> AcSolved {
    let solved = solve_ac(design, None, frequency_hz, &[0], &accuracy(relative)).expect("a field");
    assert!(solved.reached);
    solved
}

#[test]
fn a_coil_above_plates_changes_as_dodd_and_deeds_computed() {
    let foil = Plate {
        thickness_m: 0.1e-3,
        ..ALUMINIUM
    };
    let steel = Plate {
        conductivity: 2e6,
        mu_r: 50.0,
        ..ALUMINIUM
    };
    let powder = Plate {
        conductivity: 0.0,
        mu_r: 3.7,
        loss_tangent: 0.05,
        thickness_m: 2e-3,
    };
    // The skin depth of 2 um is far below the thickness, so the currents flow in the surface.
    let permalloy = Plate {
        conductivity: 1.8e6,
        mu_r: 1e4,
        thickness_m: 1e-3,
        ..ALUMINIUM
    };
    let cases = [
        ("half-space", ALUMINIUM, 1e4),
        ("foil", foil, 1e5),
        ("steel", steel, 1e4),
        ("powder in rubber", powder, 1e6),
        ("permalloy", permalloy, 3e6),
    ];
    for (name, plate, frequency_hz) in cases {
        let omega = TAU * frequency_hz;
        let exact = SPECTRUM.added_by(&plate, omega);
        let design = design(&(plate.disc(PLATE_RADIUS_M) + &coil("c", R_M, ABOVE_M, TURNS)));
        let change = |coil: &AcCoil| {
            let resistance = coil.resistance_ohm - coil.dc_resistance_ohm;
            Complex64::new(coil.inductance_h - SPECTRUM.in_air_h(), -resistance / omega)
        };
        let rough = solved(&design, frequency_hz, 1e-2).coils.remove(0);
        let missed = change(&rough) - exact;
        let covered = [missed.re.abs(), missed.im.abs() * omega];
        println!("{name}: {covered:?} within {:?}", rough.errors);
        assert!(
            covered[0] <= rough.errors[0] && covered[1] <= rough.errors[1],
            "{name}"
        );
        let coil = solved(&design, frequency_hz, 3e-5).coils.remove(0);
        let found = change(&coil);
        let off = [found.re / exact.re - 1.0, found.im / exact.im - 1.0];
        println!(
            "{name}: L off by {:.1e} of its change, R by {:.1e}",
            off[0], off[1]
        );
        assert!(
            off[0].abs() < 1e-4 && off[1].abs() < 1e-4,
            "{name}: {off:?}"
        );
        let by_part = coil.by_part_ohm[0];
        assert!(
            (by_part / (-omega * found.im) - 1.0).abs() < 1e-9,
            "{name}: {by_part}"
        );
    }
}

/// A single-turn ring carries a current proportional to 1/r: its conductance is h ln(r₁/r₀)/(2πρ).
/// A ring of many turns carries it evenly, like a constant current.
#[test]
fn a_current_that_hardly_alternates_is_a_constant_one() {
    let (r_m, x_m) = ([4e-3, 7e-3], [1e-3, 1.1e-3]);
    for turns in [1.0, 20.0] {
        let solved = solved(&design(&coil("c", r_m, x_m, turns)), 0.01, 1e-4);
        let coil = &solved.coils[0];
        let conductance = 0.1e-3 * (r_m[1] / r_m[0]).ln() / (TAU * 1.72e-8);
        let even = turns == 1.0;
        let resistance = if even {
            1.0 / conductance
        } else {
            coil.dc_resistance_ohm
        };
        let off = coil.resistance_ohm / resistance - 1.0;
        assert!(off.abs() < 1e-6, "{turns} turns: R off by {off}");
        let off = (coil.inductance_h / coil.dc_inductance_h - 1.0).abs();
        let allowed = if even { 1e-4..0.05 } else { 0.0..1e-6 };
        assert!(allowed.contains(&off), "{turns} turns: L off by {off}");
    }
}

/// A short-circuited ring winding acts like a ring of metal.
#[test]
fn a_closed_coil_is_a_ring_of_metal() {
    let (r_m, x_m) = ([3e-3, 6e-3], [-0.5e-3, 0.0]);
    let sensing = coil("sensing", R_M, ABOVE_M, TURNS) + "driven = false\n";
    let closed = design(&(sensing.clone() + &coil("ring", r_m, x_m, 1.0)));
    let closed = solved(&closed, 1e5, 1e-5).with_driven_closed(&closed, 0);
    let metal = format!(
        "[material.m]\nmu_r = 1\nconductivity_S_per_m = {}\n[[plate]]\nname = \"p\"\n\
         material = \"m\"\nshape = {{ r = {r_m:?}, x = {x_m:?} }}\n",
        1.0 / 1.72e-8
    );
    let metal = solved(&design(&(sensing + &metal)), 1e5, 1e-5).impedance_ohm[0][0];
    let off = (closed.expect("an impedance") / metal - 1.0).norm();
    assert!(off < 1e-5, "{off}");
}

/// If triangles are higher than the skin depth, a change from mesh to mesh does not show their
/// error, so the estimate must include it.
#[test]
fn currents_thinner_than_the_mesh_are_followed_or_in_the_estimate() {
    let plate = Plate {
        conductivity: 1.8e6,
        mu_r: 1e5,
        thickness_m: 0.1e-3,
        ..ALUMINIUM
    };
    let omega = TAU * 3e6;
    let exact = -omega * SPECTRUM.added_by(&plate, omega).im;
    let design = design(&(plate.disc(PLATE_RADIUS_M) + &coil("c", R_M, ABOVE_M, TURNS)));
    // Most of the resistance is the coil's own, so the mesh is not refined where the part's error
    // arises.
    let design = Design {
        resistivity_ohm_m: 1e-4,
        ..design
    };
    let accuracy = Accuracy {
        most_unknowns: 20_000,
        ..accuracy(0.01)
    };
    let solved = solve_ac(&design, None, 3e6, &[0], &accuracy).expect("a field");
    assert!(!solved.reached);
    let coil = &solved.coils[0];
    let miss = (coil.resistance_ohm - coil.dc_resistance_ohm - exact).abs();
    println!(
        "off by {miss:.2e} of {exact:.2e}, estimated {:.2e}",
        coil.errors[1]
    );
    assert!(miss <= coil.errors[1], "{miss} {exact} {:?}", coil.errors);
}
