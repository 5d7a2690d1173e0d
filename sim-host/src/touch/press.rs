//! Displacements and force of one indenter at any depth.
//!
//! The layer is the same everywhere, so the contact is computed once for some depths and moved to
//! the place of a press. Round indenters stand as profiles along the radius, all others as fields on
//! a grid. Between the computed depths values are interpolated by cubics in the root of the depth,
//! to which the radius of contact of a ball is proportional.

use core::f64::consts::PI;

use super::coil::Moved;
use super::grid::{Demand, GridSolver};
use super::indenter::Indenter;
use super::layer::Layer;
use super::round::{RoundContact, RoundSolver};

/// Greatest depth, as a share of the layer's thickness. The theory of small strains ends well
/// before.
const DEEPEST: f64 = 0.2;

/// Steps of the table of a ball.
const BALL_STEPS: usize = 24;

/// Steps of the table of an indenter on a grid.
const GRID_STEPS: u32 = 8;

/// Cells a side of the grid, as a power of two, and its period in thicknesses of the layer.
pub(super) const GRID_BITS: u32 = 7;
const PERIOD: f64 = 8.0;

/// Points of a profile inside of the contact, in (r/a)², and outside, in the root of r − a.
const INSIDE: usize = 17;
const OUTSIDE: usize = 65;

/// Greatest r − a of a profile, in thicknesses of the layer; beyond it the layer does not move.
const OUTERMOST: f64 = 8.0;

/// Heights above the layer's base of the slab's boundaries, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Heights {
    pub(super) lower_m: f64,
    pub(super) upper_m: f64,
}

/// A boundary closer to the surface than this, in thicknesses, counts as the surface: it would need
/// shorter waves than the pressure of a round contact has nodes for.
const SKIN: f64 = 0.05;

impl Heights {
    /// Boundaries at these heights in a layer.
    pub(super) fn new(layer: &Layer, lower_m: f64, upper_m: f64) -> Self {
        let snapped = |height_m: f64| {
            if height_m > (1.0 - SKIN) * layer.thickness_m {
                layer.thickness_m
            } else {
                height_m
            }
        };
        Self {
            lower_m: snapped(lower_m),
            upper_m: snapped(upper_m),
        }
    }
}

/// Contacts of one indenter with one layer, over a coordinate from 0 at first touch to 1.
#[derive(Clone, Debug)]
pub(super) struct Contacts {
    thickness_m: f64,
    depths_m: Vec<f64>,
    forces_n: Vec<f64>,
    radii_m: Vec<f64>,
    /// Centres of pressure relative to the indenter's axis, m.
    centres_m: Vec<[f64; 2]>,
    fields: Fields,
}

#[derive(Clone, Debug)]
enum Fields {
    /// Displacements inside and outside of the contact's radius.
    Round(Vec<Vec<Moved>>),
    Grid {
        side_m: f64,
        moved: Vec<Vec<Moved>>,
    },
}

/// The layer under an indenter at one depth.
#[derive(Clone, Debug)]
pub(super) struct Pressed {
    /// Depth below the untouched surface, m.
    pub(super) depth_m: f64,
    /// Radius of a circle of the contact's area, m.
    pub(super) radius_m: f64,
    /// Centre of the pressure relative to the indenter's axis, m.
    pub(super) centre_m: [f64; 2],
    field: Field,
}

#[derive(Clone, Debug)]
enum Field {
    Flat,
    Round {
        thickness_m: f64,
        profile: Vec<Moved>,
    },
    Grid {
        side_m: f64,
        moved: Vec<Moved>,
    },
}

impl Contacts {
    /// Computes the contacts of an indenter. `drag` is the tangential traction at the contact as
    /// shares of the pressure along x and y; `bits` sets the grid's 2^`bits` cells a side.
    pub(super) fn new(
        layer: &Layer,
        heights: &Heights,
        indenter: &Indenter,
        drag: [f64; 2],
        bits: u32,
    ) -> Self {
        match *indenter {
            Indenter::Ball { radius_m } if drag == [0.0; 2] => Self::ball(layer, heights, radius_m),
            Indenter::Pin { radius_m } if drag == [0.0; 2] => Self::pin(layer, heights, radius_m),
            _ => Self::on_grid(layer, heights, indenter, drag, bits),
        }
    }

    fn ball(layer: &Layer, heights: &Heights, ball_m: f64) -> Self {
        let solver = RoundSolver::new(*layer);
        let deepest_m = DEEPEST * layer.thickness_m;
        let most_m = (0.9 * ball_m).min(2.0 * layer.thickness_m);
        // Accurate to a thousandth, which is enough for the end of the table.
        let widest_m = bisected(10, 0.05 * most_m, most_m, |radius_m| {
            solver.ball(ball_m, radius_m).depth_m < deepest_m
        });
        let step_m = widest_m / BALL_STEPS as f64;
        let steps = (1..=BALL_STEPS).map(|step| solver.ball(ball_m, step_m * step as f64));
        Self::round(&solver, heights, steps.collect(), true)
    }

    fn pin(layer: &Layer, heights: &Heights, pin_m: f64) -> Self {
        let solver = RoundSolver::new(*layer);
        let deepest_m = DEEPEST * layer.thickness_m;
        let steps = (1..=3).map(|step| solver.flat(pin_m, deepest_m * f64::from(step) / 3.0));
        Self::round(&solver, heights, steps.collect(), false)
    }

    /// The table of round contacts in equal steps. At first touch a ball has no radius, a pin its
    /// own.
    fn round(
        solver: &RoundSolver,
        heights: &Heights,
        contacts: Vec<RoundContact>,
        grows: bool,
    ) -> Self {
        let thickness_m = solver.layer().thickness_m;
        let first_m = match contacts.first() {
            Some(contact) if !grows => contact.radius_m,
            _ => 0.0,
        };
        let mut table = Self {
            thickness_m,
            depths_m: vec![0.0],
            forces_n: vec![0.0],
            radii_m: vec![first_m],
            centres_m: Vec::new(),
            fields: Fields::Round(Vec::new()),
        };
        let mut profiles = vec![vec![Moved::default(); INSIDE + OUTSIDE]];
        let at = Inner::new(solver, heights);
        for contact in &contacts {
            table.depths_m.push(contact.depth_m);
            table.forces_n.push(contact.force_n);
            table.radii_m.push(contact.radius_m);
            let [lower, upper] = at.transforms(contact);
            let radii_m = profile_radii_m(contact.radius_m, thickness_m);
            let profile = radii_m.map(|r_m| Moved {
                lower_m: at.moved_m(contact, lower.as_deref(), r_m),
                upper_m: at.moved_m(contact, upper.as_deref(), r_m),
            });
            profiles.push(profile.collect());
        }
        table.fields = Fields::Round(profiles);
        table
    }

    /// The table of any indenter.
    pub(super) fn on_grid(
        layer: &Layer,
        heights: &Heights,
        indenter: &Indenter,
        drag: [f64; 2],
        bits: u32,
    ) -> Self {
        let solver = GridSolver::new(*layer, bits, PERIOD * layer.thickness_m);
        let edge_m = solver.edge_m();
        let face: Vec<f64> = solver
            .centres()
            .map(|[x_m, y_m]| indenter.height_m(x_m, y_m, edge_m))
            .collect();
        let lowest_m = face.iter().copied().fold(f64::INFINITY, f64::min);
        let nothing = vec![Moved::default(); face.len()];
        let mut moved = vec![nothing];
        let mut table = Self {
            thickness_m: layer.thickness_m,
            depths_m: vec![lowest_m],
            forces_n: vec![0.0],
            radii_m: vec![0.0],
            centres_m: Vec::new(),
            fields: Fields::Round(Vec::new()),
        };
        let mut start: Option<Vec<f64>> = None;
        for step in 1..=GRID_STEPS {
            let share = f64::from(step) / f64::from(GRID_STEPS);
            let depth_m = lowest_m + DEEPEST * layer.thickness_m * share * share;
            let demand = Demand::Depth(depth_m);
            let contact = solver.dragged_contact(&face, demand, start.as_deref(), drag);
            table.depths_m.push(contact.depth_m);
            table.forces_n.push(contact.force_n);
            table.radii_m.push(libm::sqrt(contact.area_m2 / PI));
            if table.centres_m.is_empty() {
                table.centres_m.push(contact.centre_m);
            }
            table.centres_m.push(contact.centre_m);
            let at = |height_m: f64| {
                let normal = solver.displacement_m(&contact.pressure, height_m);
                if drag == [0.0; 2] {
                    return normal;
                }
                let dragged = solver.dragged_m(&contact.pressure, drag, height_m);
                normal.iter().zip(dragged).map(|(a, b)| a + b).collect()
            };
            let lower = at(heights.lower_m.min(layer.thickness_m));
            let upper = if heights.lower_m >= layer.thickness_m {
                lower.clone()
            } else {
                at(heights.upper_m.min(layer.thickness_m))
            };
            let both = lower.iter().zip(&upper);
            let both = both.map(|(&lower_m, &upper_m)| Moved { lower_m, upper_m });
            moved.push(both.collect());
            start = Some(contact.pressure);
        }
        let side_m = PERIOD * layer.thickness_m;
        table.fields = Fields::Grid { side_m, moved };
        table
    }

    /// Greatest depth, m; deeper presses count as this one.
    pub(super) fn deepest_m(&self) -> f64 {
        self.depths_m.last().copied().unwrap_or(0.0)
    }

    /// Elastic force at a depth, N.
    pub(super) fn force_n(&self, depth_m: f64) -> f64 {
        self.at(&self.depths_m, depth_m)
            .map_or(0.0, |stencil| stencil.of(&self.forces_n))
    }

    /// Depth at an elastic force, m; that of first touch without force.
    pub(super) fn depth_m(&self, force_n: f64) -> f64 {
        match self.at(&self.forces_n, force_n) {
            Some(stencil) => stencil.of(&self.depths_m),
            None => self.depths_m.first().copied().unwrap_or(0.0),
        }
    }

    /// Stencil at a value of one of the rising columns; none at or below its first value.
    fn at(&self, column: &[f64], value: f64) -> Option<Stencil> {
        let (first, last) = (column.first()?, column.last()?);
        if value <= *first {
            return None;
        }
        let steps = column.len() - 1;
        if value >= *last {
            return Some(Stencil::new(steps as f64, column.len()));
        }
        let position = bisected(40, 0.0, steps as f64, |position| {
            Stencil::new(position, column.len()).of(column) < value
        });
        Some(Stencil::new(position, column.len()))
    }

    /// The layer at a depth.
    pub(super) fn pressed(&self, depth_m: f64) -> Pressed {
        let Some(stencil) = self.at(&self.depths_m, depth_m) else {
            return Pressed {
                depth_m,
                radius_m: 0.0,
                centre_m: [0.0; 2],
                field: Field::Flat,
            };
        };
        let component = |pick: fn(&[f64; 2]) -> f64| {
            let column: Vec<f64> = self.centres_m.iter().map(pick).collect();
            stencil.of(&column)
        };
        Pressed {
            depth_m: stencil.of(&self.depths_m),
            radius_m: stencil.of(&self.radii_m),
            centre_m: [component(|[x, _]| *x), component(|[_, y]| *y)],
            field: match &self.fields {
                Fields::Round(profiles) => Field::Round {
                    thickness_m: self.thickness_m,
                    profile: stencil.mixed(profiles),
                },
                Fields::Grid { side_m, moved } => Field::Grid {
                    side_m: *side_m,
                    moved: stencil.mixed(moved),
                },
            },
        }
    }
}

impl Pressed {
    /// Displacements at a place relative to the indenter's axis, m.
    pub(super) fn moved(&self, x_m: f64, y_m: f64) -> Moved {
        match &self.field {
            Field::Flat => Moved::default(),
            Field::Round {
                thickness_m,
                profile,
            } => {
                let r_m = libm::sqrt(x_m * x_m + y_m * y_m);
                let (inside, outside) = profile.split_at(INSIDE.min(profile.len()));
                if r_m <= self.radius_m {
                    let share = r_m / self.radius_m;
                    Stencil::new(share * share * (INSIDE - 1) as f64, INSIDE).moved(inside)
                } else {
                    let root = libm::sqrt((r_m - self.radius_m) / (OUTERMOST * thickness_m));
                    if root >= 1.0 {
                        return Moved::default();
                    }
                    Stencil::new(root * (OUTSIDE - 1) as f64, OUTSIDE).moved(outside)
                }
            }
            Field::Grid { side_m, moved } => bilinear(moved, *side_m, x_m, y_m),
        }
    }
}

/// Radii of a profile, m.
fn profile_radii_m(radius_m: f64, thickness_m: f64) -> impl Iterator<Item = f64> {
    let inside =
        (0..INSIDE).map(move |point| radius_m * libm::sqrt(point as f64 / (INSIDE - 1) as f64));
    let outside = (0..OUTSIDE).map(move |point| {
        let root = point as f64 / (OUTSIDE - 1) as f64;
        // The first point lies on the rim, from outside.
        radius_m * (1.0 + 1e-12) + OUTERMOST * thickness_m * root * root
    });
    inside.chain(outside)
}

/// Displacements of round contacts at two heights.
struct Inner<'a> {
    solver: &'a RoundSolver,
    rules: [Option<Vec<(f64, f64)>>; 2],
}

impl<'a> Inner<'a> {
    fn new(solver: &'a RoundSolver, heights: &Heights) -> Self {
        let rule = |height_m: f64| {
            (height_m < solver.layer().thickness_m).then(|| solver.inner_rule(height_m))
        };
        Self {
            solver,
            rules: [rule(heights.lower_m), rule(heights.upper_m)],
        }
    }

    /// The integrand of the displacement at each height below the surface, without the Bessel
    /// function.
    fn transforms(&self, contact: &RoundContact) -> [Option<Vec<(f64, f64)>>; 2] {
        self.rules.each_ref().map(|rule| {
            let rule = rule.as_ref()?;
            let term = |&(k, weight): &(f64, f64)| (k, weight * contact.transform(k));
            Some(rule.iter().map(term).collect())
        })
    }

    fn moved_m(&self, contact: &RoundContact, inner: Option<&[(f64, f64)]>, r_m: f64) -> f64 {
        match inner {
            None => self.solver.surface_m(contact, r_m),
            Some(terms) => terms.iter().map(|(k, term)| term * libm::j0(k * r_m)).sum(),
        }
    }
}

/// Cubic interpolation between equal steps (Lagrange).
#[derive(Clone, Copy, Debug)]
struct Stencil {
    first: usize,
    weights: [f64; 4],
}

impl Stencil {
    /// At a position in steps, of a column of `count` values, four or more.
    fn new(position: f64, count: usize) -> Self {
        let first = (position as usize).saturating_sub(1).min(count - 4);
        let t = position - first as f64;
        let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
        Self {
            first,
            weights: [
                -b * c * d / 6.0,
                a * c * d / 2.0,
                -a * b * d / 2.0,
                a * b * c / 6.0,
            ],
        }
    }

    fn each<'a, T>(&self, column: &'a [T]) -> impl Iterator<Item = (&'a T, f64)> {
        column.iter().skip(self.first).zip(self.weights)
    }

    fn of(&self, column: &[f64]) -> f64 {
        self.each(column)
            .map(|(value, weight)| weight * value)
            .sum()
    }

    fn moved(&self, column: &[Moved]) -> Moved {
        let mut sum = Moved::default();
        for (moved, weight) in self.each(column) {
            sum.add(moved, weight);
        }
        sum
    }

    fn mixed(&self, columns: &[Vec<Moved>]) -> Vec<Moved> {
        let length = columns.first().map_or(0, Vec::len);
        let mut sum = vec![Moved::default(); length];
        for (column, weight) in self.each(columns) {
            for (sum, moved) in sum.iter_mut().zip(column) {
                sum.add(moved, weight);
            }
        }
        sum
    }
}

/// Bilinear interpolation on a square grid, centred at the origin; outside there is no displacement.
fn bilinear(moved: &[Moved], side_m: f64, x_m: f64, y_m: f64) -> Moved {
    let size = libm::sqrt(moved.len() as f64);
    let place = |place_m: f64| (place_m / side_m + 0.5) * size - 0.5;
    let (x, y) = (place(x_m), place(y_m));
    if !(0.0..size - 1.0).contains(&x) || !(0.0..size - 1.0).contains(&y) {
        return Moved::default();
    }
    let (column, row) = (x as usize, y as usize);
    let (right, down) = (x - column as f64, y - row as f64);
    let mut sum = Moved::default();
    for (row, share) in [(row, 1.0 - down), (row + 1, down)] {
        let cells = moved.iter().skip(row * size as usize + column);
        for (cell, weight) in cells.zip([1.0 - right, right]) {
            sum.add(cell, share * weight);
        }
    }
    sum
}

/// The place between `low` and `high` up to which `below` holds, in halvings of the range.
fn bisected(halvings: u32, mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..halvings {
        let middle = 0.5 * (low + high);
        if below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYER: Layer = Layer {
        thickness_m: 5e-3,
        shear_modulus_pa: 20e3,
        poisson: 0.5,
    };
    const SURFACE: Heights = Heights {
        lower_m: 5e-3,
        upper_m: 5e-3,
    };
    const BALL: Indenter = Indenter::Ball { radius_m: 4e-3 };

    #[test]
    fn between_its_steps_the_table_is_the_contact() {
        let table = Contacts::new(&LAYER, &SURFACE, &BALL, [0.0; 2], 6);
        let solver = RoundSolver::new(LAYER);
        for radius_m in [0.31e-3, 0.77e-3, 1.63e-3, 2.11e-3] {
            let contact = solver.ball(4e-3, radius_m);
            let pressed = table.pressed(contact.depth_m);
            assert!(
                (table.force_n(contact.depth_m) / contact.force_n - 1.0).abs() < 1e-4,
                "{radius_m}"
            );
            assert!(
                (pressed.radius_m / radius_m - 1.0).abs() < 1e-4,
                "{radius_m}"
            );
            let mut worst_m: f64 = 0.0;
            for step in 0..100 {
                let r_m = 0.173e-3 * f64::from(step);
                let moved = pressed.moved(0.6 * r_m, -0.8 * r_m);
                worst_m = worst_m.max((moved.lower_m - solver.surface_m(&contact, r_m)).abs());
                assert_eq!(moved.lower_m, moved.upper_m);
            }
            println!("{radius_m:e}: {:e}", worst_m / contact.depth_m);
            assert!(worst_m < 1e-3 * contact.depth_m, "{radius_m}: {worst_m}");
            let depth_m = table.depth_m(contact.force_n);
            assert!((depth_m / contact.depth_m - 1.0).abs() < 1e-4);
        }
        assert_eq!(table.force_n(-1e-3), 0.0);
        assert_eq!(table.pressed(0.0).moved(0.0, 0.0), Moved::default());
    }

    #[test]
    fn inside_the_layer_profile_and_grid_agree() {
        let heights = Heights {
            lower_m: 3e-3,
            upper_m: 5e-3,
        };
        let table = Contacts::new(&LAYER, &heights, &BALL, [0.0; 2], 6);
        let grid = Contacts::on_grid(&LAYER, &heights, &BALL, [0.0; 2], 7);
        let [round, square] = [&table, &grid].map(|table| table.pressed(0.6e-3));
        for x_m in [0.0, 1e-3, 3e-3, 6e-3, 12e-3] {
            let [a, b] = [&round, &square].map(|pressed| pressed.moved(x_m, 0.5e-3));
            println!("{x_m:e} {a:?} {b:?}");
            assert!((a.lower_m - b.lower_m).abs() < 0.015 * 0.3e-3, "{x_m}");
            assert!((a.upper_m - b.upper_m).abs() < 0.015 * 0.6e-3, "{x_m}");
        }
        assert!(round.moved(0.0, 0.0).lower_m < 0.8 * round.moved(0.0, 0.0).upper_m);
    }
}
