//! The coil against the table of SOURCES.md section 5.

use core::f64::consts::PI;

use palpate_sim::sensing_coil::{CoilDesign, Sides, integral::CoilIntegral};

fn coil(outer_mm: f64, inner_mm: f64, turns: u32, sides: Sides) -> CoilDesign {
    CoilDesign {
        outer_diameter_m: outer_mm * 1e-3,
        inner_diameter_m: inner_mm * 1e-3,
        turns,
        sides,
        ..CoilDesign::REFERENCE
    }
}

/// Whether a value rounds to a printed table value of `decimals` decimals.
fn prints_as(value: f64, printed: f64, decimals: i32) -> bool {
    (value - printed).abs() <= 0.500_1 * 10_f64.powi(-decimals)
}

/// (do mm, di mm, N), L0 uH with decimals, f MHz with decimals, ppm of f per um at 1 mm: one, both.
type CoilRow = ((f64, f64, u32), (f64, i32), (f64, i32), (f64, f64));

const TABLE: [CoilRow; 4] = [
    ((8.0, 2.0, 15), (1.05, 2), (8.5, 1), (73.0, 174.0)),
    ((14.0, 4.0, 25), (5.48, 2), (3.74, 2), (62.0, 158.0)),
    ((20.0, 6.0, 25), (8.07, 2), (3.08, 2), (49.0, 127.0)),
    ((25.0, 8.0, 30), (15.1, 1), (2.25, 2), (40.0, 106.0)),
];

#[test]
fn inductances_in_air_and_frequencies_are_those_of_the_table() {
    for ((outer, inner, turns), (l0_uh, l_decimals), (mhz, f_decimals), _) in TABLE {
        let l0 = coil(outer, inner, turns, Sides::Both).inductance_in_air_h();
        assert!(
            prints_as(l0 * 1e6, l0_uh, l_decimals),
            "{outer}/{inner}: {l0}"
        );
        let hertz = 1.0 / (2.0 * PI * (l0 * 330e-12).sqrt());
        assert!(
            prints_as(hertz * 1e-6, mhz, f_decimals),
            "{outer}/{inner}: {hertz}"
        );
    }
}

#[test]
fn sensitivities_at_1_mm_are_those_of_the_table() {
    for ((outer, inner, turns), _, _, (one, both)) in TABLE {
        for (sides, printed) in [(Sides::One, one), (Sides::Both, both)] {
            let coil = CoilIntegral::new(coil(outer, inner, turns, sides), None);
            let [near, at, far] = [0.999e-3, 1e-3, 1.001e-3].map(|gap| coil.inductance_h(gap));
            let ppm_per_um = 0.5 * (near - far) / 2.0 / at * 1e6;
            assert!(
                prints_as(ppm_per_um, printed, 0),
                "{outer}/{inner} {sides:?}: {ppm_per_um} for {printed}"
            );
        }
    }
}

#[test]
fn ratios_of_the_reference_coil_are_those_of_the_table_within_half_a_percent() {
    let one = [
        (0.5, 1.308),
        (1.0, 1.214),
        (2.0, 1.110),
        (3.0, 1.060),
        (5.0, 1.021),
    ];
    let both = [
        (0.5, 1.897),
        (1.0, 1.551),
        (2.0, 1.252),
        (3.0, 1.131),
        (5.0, 1.045),
    ];
    for (sides, table) in [(Sides::One, one), (Sides::Both, both)] {
        let coil = CoilIntegral::new(coil(14.0, 4.0, 25, sides), None);
        for (gap_mm, printed) in table {
            let ratio = coil.inductance_h(gap_mm * 1e-3) / coil.design().inductance_in_air_h();
            let error = ratio / printed - 1.0;
            println!("{sides:?} {gap_mm} {ratio} {printed} {error}");
            assert!(
                error.abs() < 5e-3,
                "{sides:?} {gap_mm} mm: {ratio} for {printed}"
            );
        }
    }
}
