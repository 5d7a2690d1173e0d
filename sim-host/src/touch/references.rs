//! The whole forward model, as a campaign uses it, against finer references of its own: displacements and
//! readings of all coils of both built-in layouts.

use super::coil::{Moved, Reading};
use super::grid::{Demand, GridSolver};
use super::indenter::Indenter;
use super::layer::Layer;
use super::layout::{Layout, WINDING};
use super::press::{Contacts, GRID_BITS, Heights, Pressed};
use super::round::RoundSolver;

const LAYER: Layer = Layer {
    thickness_m: 5e-3,
    shear_modulus_pa: 20e3,
    poisson: 0.499,
};
const DEPTH_M: f64 = 0.237e-3;

/// Distance from a sharp edge within which displacements are not compared, m: two cells.
const EDGE_M: f64 = 0.6e-3;

/// Boundaries of the elastomer: on the layer, as the built-in layouts have it, and 3 mm above the base.
const ON_LAYER: Heights = Heights {
    lower_m: 5e-3,
    upper_m: 5e-3,
};
const WITHIN: Heights = Heights {
    lower_m: 3e-3,
    upper_m: 5e-3,
};

/// Places of presses, m.
const PLACES_M: [[f64; 2]; 4] = [
    [0.0, 0.0],
    [2.9e-3, 1.3e-3],
    [-1.7e-3, 4.1e-3],
    [6.0e-3, -3.2e-3],
];

/// Displacements on a grid of another size and period.
struct FineGrid {
    solver: GridSolver,
    lower_m: Vec<f64>,
    upper_m: Vec<f64>,
}

impl FineGrid {
    fn new(indenter: &Indenter, heights: &Heights, bits: u32, period_m: f64) -> Self {
        let solver = GridSolver::new(LAYER, bits, period_m);
        let face: Vec<f64> = solver
            .centres()
            .map(|[x, y]| indenter.height_m(x, y, solver.edge_m()))
            .collect();
        let contact = solver.contact(&face, Demand::Depth(DEPTH_M), None);
        Self {
            lower_m: solver.displacement_m(&contact.pressure, heights.lower_m),
            upper_m: solver.displacement_m(&contact.pressure, heights.upper_m),
            solver,
        }
    }

    fn moved(&self, x_m: f64, y_m: f64) -> Moved {
        let size = self.solver.size();
        let place = |at_m: f64| at_m / self.solver.cell_m() + 0.5 * size as f64 - 0.5;
        let (x, y) = (place(x_m), place(y_m));
        let (column, row) = (x as usize, y as usize);
        let mut sum = Moved::default();
        for (index, share) in [
            (row * size + column, (1.0 - y.fract()) * (1.0 - x.fract())),
            (row * size + column + 1, (1.0 - y.fract()) * x.fract()),
            ((row + 1) * size + column, y.fract() * (1.0 - x.fract())),
            ((row + 1) * size + column + 1, y.fract() * x.fract()),
        ] {
            let cell = Moved {
                lower_m: self.lower_m[index],
                upper_m: self.upper_m[index],
            };
            sum.add(&cell, share);
        }
        sum
    }
}

/// Greatest difference of displacements over 12 mm around the press, relative to the greatest. Along a sharp
/// edge the slope has no limit, and each grid ends it within its own cells: places within `EDGE_M` of it
/// are left out.
fn displacement_error(
    indenter: &Indenter,
    pressed: &Pressed,
    reference: impl Fn(f64, f64) -> Moved,
) -> f64 {
    let at_edge = |x_m: f64, y_m: f64| match indenter {
        Indenter::Tilted { radius_m, .. } => (libm::hypot(x_m, y_m) - radius_m).abs() < EDGE_M,
        _ => false,
    };
    let (mut worst_m, mut greatest_m): (f64, f64) = (0.0, 0.0);
    for column in -30..=30 {
        for row in -30..=30 {
            let (x_m, y_m) = (0.397e-3 * f64::from(column), 0.397e-3 * f64::from(row));
            if at_edge(x_m, y_m) {
                continue;
            }
            let (found, expected) = (pressed.moved(x_m, y_m), reference(x_m, y_m));
            greatest_m = greatest_m.max(expected.upper_m);
            worst_m = worst_m
                .max((found.lower_m - expected.lower_m).abs())
                .max((found.upper_m - expected.upper_m).abs());
        }
    }
    worst_m / greatest_m
}

/// Greatest difference of readings of both layouts' coils, relative to the greatest reading; the reference
/// has finer samples too.
fn reading_error(pressed: &Pressed, gap_m: f64, reference: impl Fn(f64, f64) -> Moved) -> f64 {
    let design = crate::sensing_coil::CoilDesign {
        gap_at_rest_m: gap_m,
        ..WINDING
    };
    let (coarse, fine) = (Reading::new(&design), Reading::sampled(&design, 9, 144));
    let mut centres_m: Vec<[f64; 2]> = Vec::new();
    for layout in [Layout::three_around_one(), Layout::seven()] {
        centres_m.extend(layout.coils.iter().map(|coil| coil.centre_m));
    }
    let (mut worst_h, mut largest_h): (f64, f64) = (0.0, 0.0);
    for [press_x_m, press_y_m] in PLACES_M {
        for [x_m, y_m] in &centres_m {
            let place = |x: f64, y: f64| (x_m + x - press_x_m, y_m + y - press_y_m);
            let found_h = coarse.change_h(coarse.samples().map(|sample| {
                let (x_m, y_m) = place(sample.x_m, sample.y_m);
                pressed.moved(x_m, y_m)
            }));
            let expected_h = fine.change_h(fine.samples().map(|sample| {
                let (x_m, y_m) = place(sample.x_m, sample.y_m);
                reference(x_m, y_m)
            }));
            worst_h = worst_h.max((found_h - expected_h).abs());
            largest_h = largest_h.max(expected_h.abs());
        }
    }
    worst_h / largest_h
}

/// Errors of displacements and readings against a grid with cells and edges that are finer and farther.
fn against_grid(indenter: &Indenter, heights: &Heights, gap_m: f64) -> [f64; 2] {
    let table = Contacts::new(&LAYER, heights, indenter, [0.0; 2], GRID_BITS);
    let pressed = table.pressed(DEPTH_M);
    // Half the cell, and three quarters more of the period.
    let reference = FineGrid::new(indenter, heights, 9, 14.0 * LAYER.thickness_m);
    let moved = |x_m: f64, y_m: f64| reference.moved(x_m, y_m);
    let errors = [
        displacement_error(indenter, &pressed, moved),
        reading_error(&pressed, gap_m, moved),
    ];
    println!(
        "{indenter:?}, elastomer from {:e} m: {errors:.4?}",
        heights.lower_m
    );
    errors
}

const BALLS: [Indenter; 2] = [
    Indenter::Ball { radius_m: 3e-3 },
    Indenter::Ball { radius_m: 12e-3 },
];

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn balls_are_those_of_a_finer_grid() {
    for ball in BALLS {
        for (heights, gap_m) in [(ON_LAYER, 0.6e-3), (WITHIN, 3e-3)] {
            let errors = against_grid(&ball, &heights, gap_m);
            assert!(errors.iter().all(|error| *error < 0.01), "{errors:?}");
        }
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn tilted_pins_are_those_of_a_finer_grid() {
    for (radius_m, tilt_rad) in [(4e-3, 0.02), (6e-3, 0.1)] {
        let tilted = Indenter::Tilted {
            radius_m,
            tilt_rad,
            toward_rad: 0.5,
        };
        for (heights, gap_m) in [(ON_LAYER, 0.6e-3), (WITHIN, 3e-3)] {
            let errors = against_grid(&tilted, &heights, gap_m);
            // The staircase of the edge in its cells. These are its errors, not limits of a design.
            let [displacement, reading] = errors;
            assert!(displacement < 0.04 && reading < 0.015, "{errors:?}");
        }
    }
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn tables_of_round_indenters_read_as_their_contacts() {
    // The reference has neither the table between depths nor its profile; grids place the edge of a pin only
    // within a quarter of a cell.
    let solver = RoundSolver::new(LAYER);
    for radius_m in [1e-3, 4e-3] {
        let pin = Indenter::Pin { radius_m };
        let contact = solver.flat(radius_m, DEPTH_M);
        let pressed = Contacts::new(&LAYER, &ON_LAYER, &pin, [0.0; 2], GRID_BITS).pressed(DEPTH_M);
        let moved = |x_m: f64, y_m: f64| {
            let w = solver.surface_m(&contact, libm::hypot(x_m, y_m));
            Moved {
                lower_m: w,
                upper_m: w,
            }
        };
        let errors = [
            displacement_error(&pin, &pressed, moved),
            reading_error(&pressed, 0.6e-3, moved),
        ];
        println!("{pin:?}: {errors:.4?}");
        assert!(errors.iter().all(|error| *error < 0.01), "{errors:?}");
    }
}
