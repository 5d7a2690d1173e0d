//! Contact of any rigid face with the layer, on a grid.
//!
//! The pressure is zero or positive, and the surface lies on the face where it is positive and below
//! it elsewhere. Conjugate gradients over the cells in contact, with cells leaving and entering
//! (Polonsky and Keer, Wear 231 (1999) 206), find it; the layer's compliance acts by Fourier
//! transform (Stanley and Kato 1997). The grid is periodic: the layer has no edge, and its images lie
//! a period away.

use core::f64::consts::TAU;

use super::fft::{Complex, Fft};
use super::layer::Layer;

/// Steps after which an iteration ends in any case.
const MOST_STEPS: u32 = 400;

/// Sum of the changes of the pressure in a step, relative to its sum, at which an iteration ends.
const ENOUGH: f64 = 1e-6;

/// What an indenter is pressed to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Demand {
    /// Depth below the untouched surface, m.
    Depth(f64),
    /// Force, N.
    Force(f64),
}

/// A layer on a square, periodic grid, centred at the origin.
#[derive(Clone, Debug)]
pub(super) struct GridSolver {
    layer: Layer,
    fft: Fft,
    period_m: f64,
    /// Wave numbers of rows and columns, 1/m.
    waves: Vec<f64>,
    /// Compliance at each wave number, m/Pa.
    compliance: Vec<f64>,
}

/// A contact on the grid.
#[derive(Clone, Debug)]
pub(super) struct GridContact {
    /// Pressure of each cell, Pa.
    pub(super) pressure: Vec<f64>,
    /// Depth of the indenter, m.
    pub(super) depth_m: f64,
    /// Force, N.
    pub(super) force_n: f64,
    /// Area in contact, m².
    pub(super) area_m2: f64,
    /// Centre of the pressure, m.
    pub(super) centre_m: [f64; 2],
}

impl GridSolver {
    /// A grid with 2^`bits` cells a side and this period, m.
    pub(super) fn new(layer: Layer, bits: u32, period_m: f64) -> Self {
        let fft = Fft::new(bits);
        let waves = fft.waves();
        let waves: Vec<f64> = waves.iter().map(|wave| TAU / period_m * wave).collect();
        let mut solver = Self {
            layer,
            fft,
            period_m,
            waves,
            compliance: Vec::new(),
        };
        solver.compliance = solver.response(|k| layer.compliance_m_per_pa(k));
        solver
    }

    /// Number of cells a side.
    pub(super) fn size(&self) -> usize {
        self.waves.len()
    }

    /// Side of a cell, m.
    pub(super) fn cell_m(&self) -> f64 {
        self.period_m / self.size() as f64
    }

    /// Length by which sharp edges are moved outwards, m. Each cell is in contact as a whole or not at
    /// all, and the pressure rises towards an edge. So the force is that of a smaller circle: its edge
    /// is 0.14 of a cell inside the circle with the area of the cells (pins of 2 to 4 mm on grids of 0.2
    /// and 0.4 mm). The remaining error is the staircase of the cells, a quarter of a cell at most.
    pub(super) fn edge_m(&self) -> f64 {
        0.14 * self.cell_m()
    }

    /// Centres of all cells, m.
    pub(super) fn centres(&self) -> impl Iterator<Item = [f64; 2]> {
        let (size, cell_m) = (self.size(), self.cell_m());
        let place_m =
            move |index: usize| cell_m * (index as f64 + 0.5) - 0.5 * size as f64 * cell_m;
        (0..size * size).map(move |index| [place_m(index % size), place_m(index / size)])
    }

    /// A function of the wave number's magnitude for all waves of the grid. It is computed once for
    /// each magnitude, since rows and columns have the same magnitudes.
    fn response(&self, of: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut known = std::collections::BTreeMap::new();
        let mut all = Vec::with_capacity(self.size() * self.size());
        let unit = TAU / self.period_m;
        for y in &self.waves {
            for x in &self.waves {
                let (i, j) = (x / unit, y / unit);
                let key = (i * i + j * j + 0.5) as u64;
                all.push(*known.entry(key).or_insert_with(|| of(libm::hypot(*x, *y))));
            }
        }
        all
    }

    /// Convolution of a field with a real response.
    fn convolved(&self, field: &[f64], response: &[f64]) -> Vec<f64> {
        let mut grid: Vec<Complex> = field.iter().map(|&re| Complex { re, im: 0.0 }).collect();
        self.fft.forward(&mut grid);
        for (value, factor) in grid.iter_mut().zip(response) {
            value.re *= factor;
            value.im *= factor;
        }
        self.fft.inverse(&mut grid);
        let scale = 1.0 / grid.len() as f64;
        grid.iter().map(|value| scale * value.re).collect()
    }

    /// Downward displacement at a height above the base, m, for all cells.
    pub(super) fn displacement_m(&self, pressure: &[f64], height_m: f64) -> Vec<f64> {
        if height_m >= self.layer.thickness_m {
            return self.convolved(pressure, &self.compliance);
        }
        let at_height = |k| self.layer.response(k, height_m).down_by_pressure;
        self.convolved(pressure, &self.response(at_height))
    }

    /// Downward displacement at a height above the base, m, by tractions that are the pressure times
    /// `drag`, the shares along x and y.
    pub(super) fn dragged_m(&self, pressure: &[f64], drag: [f64; 2], height_m: f64) -> Vec<f64> {
        let [drag_x, drag_y] = drag;
        let mut grid: Vec<Complex> = pressure.iter().map(|&re| Complex { re, im: 0.0 }).collect();
        self.fft.forward(&mut grid);
        let factor = self.response(|k| {
            let shear = self.layer.response(k, height_m).down_by_shear;
            if k > 0.0 { shear / k } else { 0.0 }
        });
        let waves = self.waves.iter();
        let waves = waves.flat_map(|y| self.waves.iter().map(move |x| drag_x * x + drag_y * y));
        for ((value, factor), along) in grid.iter_mut().zip(factor).zip(waves) {
            // i times the cosine between wave and drag, times the response
            *value = Complex {
                re: -along * factor * value.im,
                im: along * factor * value.re,
            };
        }
        self.fft.inverse(&mut grid);
        let scale = 1.0 / grid.len() as f64;
        grid.iter().map(|value| scale * value.re).collect()
    }

    /// The contact as in [`Self::contact`], under tractions that are the pressure times `drag`. The
    /// displacement by the tractions is added to the face until it no longer changes; each round
    /// reduces the error by about the share of that displacement.
    pub(super) fn dragged_contact(
        &self,
        face: &[f64],
        demand: Demand,
        start: Option<&[f64]>,
        drag: [f64; 2],
    ) -> GridContact {
        let mut contact = self.contact(face, demand, start);
        if drag == [0.0; 2] {
            return contact;
        }
        for _ in 0..6 {
            let moved = self.dragged_m(&contact.pressure, drag, self.layer.thickness_m);
            let raised: Vec<f64> = face.iter().zip(moved).map(|(f, w)| f + w).collect();
            contact = self.contact(&raised, demand, Some(&contact.pressure));
        }
        contact
    }

    /// The contact with a face of these heights, m, for all cells. `start` is the pressure of a
    /// contact nearby.
    pub(super) fn contact(
        &self,
        face: &[f64],
        demand: Demand,
        start: Option<&[f64]>,
    ) -> GridContact {
        let mut state = Iteration::new(self, face, demand, start);
        for _ in 0..MOST_STEPS {
            if state.step() < ENOUGH {
                break;
            }
        }
        state.finished()
    }
}

/// State of the conjugate gradients.
struct Iteration<'a> {
    solver: &'a GridSolver,
    face: &'a [f64],
    demand: Demand,
    pressure: Vec<f64>,
    direction: Vec<f64>,
    square_before: f64,
    depth_m: f64,
}

impl<'a> Iteration<'a> {
    fn new(solver: &'a GridSolver, face: &'a [f64], demand: Demand, start: Option<&[f64]>) -> Self {
        let lowest_m = face.iter().copied().fold(f64::INFINITY, f64::min);
        let per_m = 1.0 / (solver.layer.half_space_per_pa() * solver.layer.thickness_m);
        let depth_m = match demand {
            Demand::Depth(depth_m) => depth_m,
            Demand::Force(_) => lowest_m + 0.02 * solver.layer.thickness_m,
        };
        let overlap = |height_m: &f64| per_m * (depth_m - height_m).max(0.0);
        let pressure = start.map_or_else(|| face.iter().map(overlap).collect(), <[f64]>::to_vec);
        let mut state = Self {
            solver,
            face,
            demand,
            direction: vec![0.0; pressure.len()],
            pressure,
            square_before: 0.0,
            depth_m,
        };
        state.meet_force();
        state
    }

    /// Scales the pressure to the demanded force.
    fn meet_force(&mut self) {
        if let Demand::Force(force_n) = self.demand {
            let cell_m = self.solver.cell_m();
            let sum: f64 = self.pressure.iter().sum();
            let factor = force_n / (sum * cell_m * cell_m);
            self.pressure.iter_mut().for_each(|p| *p *= factor);
        }
    }

    /// Mean of a field over the cells in contact.
    fn mean(&self, field: impl Iterator<Item = f64>) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (value, pressure) in field.zip(&self.pressure) {
            if *pressure > 0.0 {
                sum += value;
                count += 1.0;
            }
        }
        sum / f64::max(count, 1.0)
    }

    /// One step; returns the sum of the changes of the pressure relative to its sum.
    fn step(&mut self) -> f64 {
        let compliance = &self.solver.compliance;
        let surface = self.solver.convolved(&self.pressure, compliance);
        let levels = surface.iter().zip(self.face).map(|(w, f)| w + f);
        if let Demand::Force(_) = self.demand {
            self.depth_m = self.mean(levels.clone());
        }
        let gap: Vec<f64> = levels.map(|level| level - self.depth_m).collect();
        let contact = |pressure: f64, value: f64| if pressure > 0.0 { value } else { 0.0 };
        let cells = || self.pressure.iter().zip(&gap);
        let square: f64 = cells().map(|(&p, g)| contact(p, g * g)).sum();
        let share = if self.square_before > 0.0 {
            square / self.square_before
        } else {
            0.0
        };
        for ((t, &p), g) in self.direction.iter_mut().zip(&self.pressure).zip(&gap) {
            *t = contact(p, g + share * *t);
        }
        let image = self.solver.convolved(&self.direction, compliance);
        let offset = match self.demand {
            Demand::Force(_) => self.mean(image.iter().copied()),
            Demand::Depth(_) => 0.0,
        };
        let (mut above, mut below) = (0.0, 0.0);
        for ((g, t), r) in gap.iter().zip(&self.direction).zip(&image) {
            above += g * t;
            below += (r - offset) * t;
        }
        let step = if below > 0.0 {
            above / below
        } else {
            // All cells in contact lie on the face already; others may still penetrate.
            1.0 / (self.solver.layer.half_space_per_pa() * self.solver.cell_m())
        };
        let entered = self.moved(step, &gap);
        self.square_before = if entered.0 { 0.0 } else { square };
        self.meet_force();
        entered.1
    }

    /// Moves the pressure; returns whether cells came into contact, and the relative change.
    fn moved(&mut self, step: f64, gap: &[f64]) -> (bool, f64) {
        let (mut entered, mut change, mut sum) = (false, 0.0, 0.0);
        for ((p, t), g) in self.pressure.iter_mut().zip(&self.direction).zip(gap) {
            let before = *p;
            if before > 0.0 {
                *p = (before - step * t).max(0.0);
            } else if *g < 0.0 {
                *p = -step * g;
                entered |= *p > 0.0;
            }
            change += (*p - before).abs();
            sum += *p;
        }
        (entered, if sum > 0.0 { change / sum } else { 0.0 })
    }

    fn finished(self) -> GridContact {
        let cell_m = self.solver.cell_m();
        let cell_m2 = cell_m * cell_m;
        let (mut force_n, mut area_m2, mut moment) = (0.0, 0.0, [0.0; 2]);
        for (pressure, [x_m, y_m]) in self.pressure.iter().zip(self.solver.centres()) {
            if *pressure > 0.0 {
                force_n += pressure * cell_m2;
                area_m2 += cell_m2;
                let [along_x, along_y] = &mut moment;
                *along_x += pressure * cell_m2 * x_m;
                *along_y += pressure * cell_m2 * y_m;
            }
        }
        let centre_m = if force_n > 0.0 {
            moment.map(|moment| moment / force_n)
        } else {
            [0.0; 2]
        };
        GridContact {
            pressure: self.pressure,
            depth_m: self.depth_m,
            force_n,
            area_m2,
            centre_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::indenter::Indenter;
    use super::super::round::RoundSolver;
    use super::*;

    const LAYER: Layer = Layer {
        thickness_m: 5e-3,
        shear_modulus_pa: 20e3,
        poisson: 0.5,
    };
    const PERIOD_M: f64 = 50e-3;

    fn pressed(bits: u32, indenter: &Indenter, demand: Demand) -> (GridSolver, GridContact) {
        let solver = GridSolver::new(LAYER, bits, PERIOD_M);
        let face: Vec<f64> = solver
            .centres()
            .map(|[x, y]| indenter.height_m(x, y, solver.edge_m()))
            .collect();
        let contact = solver.contact(&face, demand, None);
        (solver, contact)
    }

    fn near(found: f64, expected: f64, relative: f64, what: &str) {
        let error = found / expected - 1.0;
        println!("{what}: {found:e} {expected:e} {error:e}");
        assert!(error.abs() < relative, "{what}: {found} {expected} {error}");
    }

    #[test]
    fn a_ball_is_that_of_the_integral_equation() {
        let ball = RoundSolver::new(LAYER).ball(5e-3, 2.5e-3);
        let indenter = Indenter::Ball { radius_m: 5e-3 };
        let (solver, contact) = pressed(7, &indenter, Demand::Depth(ball.depth_m));
        near(contact.force_n, ball.force_n, 0.01, "force");
        let radius_m = libm::sqrt(contact.area_m2 / core::f64::consts::PI);
        near(radius_m, ball.radius_m, 0.03, "radius");
        let surface = solver.displacement_m(&contact.pressure, LAYER.thickness_m);
        let round = RoundSolver::new(LAYER);
        let mut worst_m: f64 = 0.0;
        for ([x, y], w) in solver.centres().zip(surface) {
            let r_m = libm::hypot(x, y);
            if r_m < 15e-3 {
                worst_m = worst_m.max((w - round.surface_m(&ball, r_m)).abs());
            }
        }
        println!("displacement {worst_m:e} of {:e}", ball.depth_m);
        assert!(worst_m < 0.01 * ball.depth_m, "{worst_m}");
    }

    #[test]
    fn a_pin_is_that_of_the_integral_equation() {
        let pin = RoundSolver::new(LAYER).flat(4e-3, 0.2e-3);
        let indenter = Indenter::Pin { radius_m: 4e-3 };
        let (_, contact) = pressed(7, &indenter, Demand::Depth(0.2e-3));
        near(contact.force_n, pin.force_n, 0.025, "force");
    }

    #[test]
    fn a_force_finds_its_depth() {
        let indenter = Indenter::Ball { radius_m: 5e-3 };
        let (_, deep) = pressed(6, &indenter, Demand::Depth(0.3e-3));
        let (_, hard) = pressed(6, &indenter, Demand::Force(deep.force_n));
        near(hard.depth_m, 0.3e-3, 1e-5, "depth");
        near(hard.area_m2, deep.area_m2, 1e-12, "area");
    }

    #[test]
    fn a_tilted_plate_leans_on_one_side() {
        let tilted = |toward_rad| Indenter::Tilted {
            radius_m: 6e-3,
            tilt_rad: 0.1,
            toward_rad,
        };
        let (_, along_x) = pressed(6, &tilted(0.0), Demand::Force(0.3));
        let (_, along_y) = pressed(6, &tilted(TAU / 4.0), Demand::Force(0.3));
        let [x, y] = along_x.centre_m;
        assert!(x > 1e-3 && y.abs() < 1e-9, "{x} {y}");
        let [other_x, other_y] = along_y.centre_m;
        assert!((other_y - x).abs() < 1e-8 && other_x.abs() < 1e-8);
        assert!(along_x.area_m2 < 0.9 * core::f64::consts::PI * 36e-6);
    }

    #[test]
    fn nothing_pulls_and_nothing_penetrates() {
        let indenter = Indenter::TwoBalls {
            radius_m: 3e-3,
            apart_m: 8e-3,
            toward_rad: 0.3,
        };
        let (solver, contact) = pressed(7, &indenter, Demand::Depth(0.3e-3));
        let surface = solver.displacement_m(&contact.pressure, LAYER.thickness_m);
        let cells = solver.centres().zip(&contact.pressure).zip(surface);
        for (([x, y], &pressure), w) in cells {
            let gap_m = w - (contact.depth_m - indenter.height_m(x, y, 0.0));
            assert!(pressure >= 0.0);
            if pressure > 0.0 {
                assert!(gap_m.abs() < 1e-4 * 0.3e-3, "{gap_m}");
            } else {
                assert!(gap_m > -1e-4 * 0.3e-3, "{gap_m}");
            }
        }
        let [x, y] = contact.centre_m;
        assert!(libm::hypot(x, y) < 1e-8);
    }

    #[test]
    fn a_layer_dragged_along_x_rises_ahead() {
        let (solver, contact) = pressed(6, &Indenter::Pin { radius_m: 3e-3 }, Demand::Force(0.2));
        let moved = solver.dragged_m(&contact.pressure, [1.0, 0.0], LAYER.thickness_m);
        let at = |x_mm: f64| {
            let nearest = solver
                .centres()
                .zip(&moved)
                .min_by(|(a, _), (b, _)| {
                    let distance = |p: &[f64; 2]| libm::hypot(p[0] - 1e-3 * x_mm, p[1]);
                    distance(a).total_cmp(&distance(b))
                })
                .unwrap();
            *nearest.1
        };
        assert!(at(5.0) < 0.0 && at(-5.0) > 0.0, "{} {}", at(5.0), at(-5.0));
    }
}
