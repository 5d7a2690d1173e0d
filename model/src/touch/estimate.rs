//! The fit: steps of Gauss and Newton on x, y, ln F and ln a. The length of a step follows from the
//! curvature along the previous step.

use super::array::{Array, Coil, MOST_COILS};
use super::matrix::{Cholesky, Matrix, UNKNOWNS, Vector, dot};
use super::misfit::greatest_chi_square;
use super::start::start;
use super::verdict::{Press, Verdict};
use crate::math::{exp, ln, sqrt};
use crate::units::{Metre, Newton};

/// What is known of the contact before a press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Indenter {
    /// No knowledge: any radius of the calibration's range.
    Unknown,
    /// The contact's radius follows from the force: a = radius (F / 1 N)^exponent. The exponent is
    /// 0 for a flat pin and 1/3 for a ball (Hertz).
    Declared {
        /// Radius of the contact at 1 N.
        at_one_newton: Metre,
        /// Exponent of the force.
        exponent: f32,
        /// Relative standard uncertainty of the radius.
        uncertainty: f32,
    },
}

/// Prior normal distribution of ln a, with the mean ln_radius + exponent ln F.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior {
    pub(super) ln_radius: f32,
    /// As `ln_radius`, but for the start of a fit: mid-range if the radius is unknown.
    pub(super) start: f32,
    pub(super) exponent: f32,
    pub(super) sigma: f32,
    is_declared: bool,
}

impl Prior {
    /// `None` if a number is not finite, or the uncertainty is not above zero.
    fn new(indenter: &Indenter, [low, high]: [f32; 2]) -> Option<Self> {
        /// Standard deviation of a uniform distribution over its width.
        const UNIFORM: f32 = 0.288_675;
        /// Mean of ln a of an unknown radius, as a fraction of the calibrated range. Only for small
        /// radii it has to be right: readings hardly tell those apart, but do so for large ones.
        const LOWER_THIRD: f32 = 1.0 / 3.0;
        let prior = match *indenter {
            Indenter::Unknown => Self {
                ln_radius: low + LOWER_THIRD * (high - low),
                start: 0.5 * (low + high),
                exponent: 0.0,
                sigma: UNIFORM * (high - low),
                is_declared: false,
            },
            Indenter::Declared {
                at_one_newton,
                exponent,
                uncertainty,
            } => Self {
                ln_radius: ln(at_one_newton.0),
                start: ln(at_one_newton.0),
                exponent,
                sigma: uncertainty,
                is_declared: true,
            },
        };
        let is_usable = prior.ln_radius.is_finite()
            && prior.exponent.is_finite()
            && prior.sigma.is_finite()
            && prior.sigma > 0.0;
        is_usable.then_some(prior)
    }
}

/// Readings of a scan.
pub(super) struct Scan {
    straight: [f32; MOST_COILS],
    weights: [f32; MOST_COILS],
    targets: [f32; MOST_COILS],
    count: usize,
}

impl Scan {
    /// `None` if a reading is not finite, or there is not one for each coil.
    fn new(array: &Array, given: &[f32]) -> Option<Self> {
        let coils = array.coils();
        if given.len() != coils.len() || !given.iter().all(|reading| reading.is_finite()) {
            return None;
        }
        let largest = given.iter().fold(0.0_f32, |most, of| most.max(of.abs()));
        let error = array.reading_error;
        let of_largest = error.of_largest * largest;
        let mut scan = Self {
            straight: [0.0; MOST_COILS],
            weights: [0.0; MOST_COILS],
            targets: [0.0; MOST_COILS],
            count: coils.len(),
        };
        let own = scan.straight.iter_mut().zip(&mut scan.weights);
        let own = own.zip(&mut scan.targets);
        for (((straight, weight), target), (coil, &given)) in own.zip(coils.iter().zip(given)) {
            let relative = error.relative * given;
            let square = coil.noise * coil.noise + relative * relative + of_largest * of_largest;
            let per_sigma = 1.0 / sqrt(square);
            *straight = given / coil.gain;
            *weight = coil.gain * per_sigma;
            *target = given * per_sigma;
        }
        Some(scan)
    }

    /// For each coil, the reading with the gain undone.
    pub(super) fn straight(&self) -> &[f32] {
        self.straight.get(..self.count).unwrap_or(&self.straight)
    }

    /// For each coil, the gain over the standard error of the reading.
    pub(super) fn weights(&self) -> &[f32] {
        self.weights.get(..self.count).unwrap_or(&self.weights)
    }

    /// For each coil, the reading over its standard error.
    fn targets(&self) -> &[f32] {
        self.targets.get(..self.count).unwrap_or(&self.targets)
    }
}

/// x and y in knots of the profile, ln F, ln a.
#[derive(Clone, Copy, Debug)]
pub(super) struct State(pub(super) Vector);

/// Cost at a state, with the information and the gradient.
struct Normal {
    chi_square: f32,
    /// Part of the cost that the indenter causes.
    of_indenter: f32,
    /// Lower triangle of the information.
    information: Matrix,
    gradient: Vector,
    informative: u8,
}

/// Evaluations of the model after the start. 4,000 presses all over the discs of `three-around-one`
/// and `seven` took 4.4 on average and 15 at most, and 4 to 9 from the previous press.
const MOST_EVALUATIONS: u8 = 20;
/// Evaluations for each scan of a track: at the press of the scan before, and after a step.
const EVALUATIONS_PER_SCAN: u8 = 2;
/// Gains of an alpha-beta filter: fractions of the way from a fit's start to its end by which the next
/// start, and the motion per scan, are corrected. The next fit then starts near the present place of a
/// sliding press, with less noise than one scan has, and two evaluations are enough: without the
/// filter 387 of 450 scans of four coils at 250 scans/s were claimed, in `touch::four_coils...` of
/// `system-tests`. The second gain follows from the first (Benedict and Bordner 1962).
const FOLLOWED: f32 = 0.4;
const FOLLOWED_BY_MOTION: f32 = 0.1;
/// Scans without a claim after which a track starts anew: as many evaluations as one fit may take.
const MOST_SCANS: u8 = MOST_EVALUATIONS / EVALUATIONS_PER_SCAN;
/// A reading above this number of standard deviations of its noise counts as contact: by chance,
/// one scan of eight channels in 400,000 does.
pub const LEAST_SIGNIFICANCE: f32 = 5.0;
/// Greatest posterior over prior standard deviation of ln a at which a radius is claimed: the prior
/// pulls it towards its mean by at most one ninth of the distance.
const CLAIMED: f32 = 1.0 / 3.0;
/// A prediction above this number of sigmas is informative.
const REACHED: f32 = 3.0;
/// Longest step: in knots, ln F and ln a.
const LONGEST_STEP: Vector = [1.0, 1.0, 1.0, 0.5];
/// Bounds of ln F: from 1 uN to 8 kN.
const LN_FORCE: [f32; 2] = [-14.0, 9.0];
/// Knots beyond the outermost coils up to which a place is searched.
const SEARCHED: f32 = 6.0;

impl Array {
    /// Estimates a press from the relative changes of inductance of one scan, one for each coil.
    ///
    /// `last` is the press of the scan before, if there was one; it saves half of the time.
    pub fn estimate(&self, readings: &[f32], indenter: &Indenter, last: Option<&Press>) -> Verdict {
        let (scan, prior) = match self.contact(readings, indenter) {
            Ok(contact) => contact,
            Err(verdict) => return verdict,
        };
        let fit = Fit {
            array: self,
            scan: &scan,
            prior: &prior,
        };
        if let Some(last) = last {
            let (verdict, ..) = fit.from(fit.state_of(last), 1.0, MOST_EVALUATIONS);
            if verdict.claimed().is_some() {
                return verdict;
            }
        }
        start(self, &scan, &prior).map_or(Verdict::NotConverged, |state| {
            let (verdict, state, _) = fit.from(state, 1.0, MOST_EVALUATIONS);
            match verdict {
                // A press beyond the array or a contradiction is reported even if the steps have run out.
                Verdict::NotConverged => fit.unclaimed(&state),
                verdict => verdict,
            }
        })
    }

    /// As [`estimate`](Self::estimate) for scan after scan, in bounded time: two evaluations for each
    /// scan. A fit that needs more goes on with the next scan, and until then is `NotConverged`.
    pub fn track(&self, readings: &[f32], indenter: &Indenter, track: &mut Track) -> Verdict {
        let earlier = track.0.take();
        let (scan, prior) = match self.contact(readings, indenter) {
            Ok(contact) => contact,
            Err(verdict) => return verdict,
        };
        let fit = Fit {
            array: self,
            scan: &scan,
            prior: &prior,
        };
        let begun = || {
            Some(Point {
                state: start(self, &scan, &prior)?,
                motion: [0.0; UNKNOWNS],
                length: 1.0,
                scans: 1,
            })
        };
        let Some(point) = earlier.or_else(begun) else {
            return Verdict::NotConverged;
        };
        let ahead = point.state.after(&point.motion);
        let (verdict, mut state, length) = fit.from(ahead, point.length, EVALUATIONS_PER_SCAN);
        let mut motion = point.motion;
        let (length, scans) = match verdict.claimed() {
            Some(_) => (1.0, 0),
            None => (length, point.scans + 1),
        };
        if (point.scans, scans) == (0, 0) {
            let off = state.since(&ahead);
            state = ahead.after(&off.map(|of| FOLLOWED * of));
            for (mean, off) in motion.iter_mut().zip(off) {
                *mean += FOLLOWED_BY_MOTION * off;
            }
        }
        track.0 = (scans <= MOST_SCANS).then_some(Point {
            state,
            motion,
            length,
            scans,
        });
        verdict
    }

    /// The readings and the prior of a fit; the verdict if they are not readable, or none is clearly above
    /// its noise.
    fn contact(&self, readings: &[f32], indenter: &Indenter) -> Result<(Scan, Prior), Verdict> {
        let scan = Scan::new(self, readings).ok_or(Verdict::NotReadable)?;
        let ln_radii = self.profile.ln_radii();
        let prior = Prior::new(indenter, ln_radii).ok_or(Verdict::NotReadable)?;
        let is_contact =
            |(reading, coil): (&f32, &Coil)| *reading > LEAST_SIGNIFICANCE * coil.noise;
        if readings.iter().zip(self.coils()).any(is_contact) {
            Ok((scan, prior))
        } else {
            Err(Verdict::TooSmall)
        }
    }
}

/// End of the fit of the previous scan.
#[derive(Clone, Copy, Debug, Default)]
pub struct Track(Option<Point>);

#[derive(Clone, Copy, Debug)]
struct Point {
    state: State,
    /// Mean change of the state from one claimed scan to the next.
    motion: Vector,
    /// Part of a step to take next.
    length: f32,
    /// Number of scans since the last claimed one.
    scans: u8,
}

struct Fit<'a> {
    array: &'a Array,
    scan: &'a Scan,
    prior: &'a Prior,
}

impl Fit<'_> {
    fn state_of(&self, press: &Press) -> State {
        let profile = &self.array.profile;
        State([
            profile.knots(press.x),
            profile.knots(press.y),
            ln(press.force.0),
            ln(press.radius.0),
        ])
    }

    /// Fits from a start. Returns the verdict, the state reached, and the fraction of the next step
    /// to take.
    fn from(&self, start: State, mut length: f32, most_evaluations: u8) -> (Verdict, State, f32) {
        let mut state = self.bounded(start);
        let mut at = self.normal(&state);
        for evaluations in 1..=most_evaluations {
            let Some(whole) = self.step(&state, &at) else {
                return (Verdict::NotConverged, state, length);
            };
            let expected = -dot(&whole, &at.gradient, UNKNOWNS);
            if expected <= CONVERGED {
                return (self.judge(&state, &at, evaluations), state, length);
            }
            let part = whole.map(|of| length * of);
            if evaluations == most_evaluations {
                at.chi_square -= length * (2.0 - length) * expected;
                let next = self.bounded(state.after(&part));
                let is_near = expected <= NEAR;
                let verdict = is_near.then(|| self.judge(&next, &at, evaluations));
                return (verdict.unwrap_or(Verdict::NotConverged), next, length);
            }
            let next = self.bounded(state.after(&part));
            let found = self.normal(&next);
            let change = found.chi_square - at.chi_square;
            let best = length * best_part(change, length * expected);
            // NaN is rejected too.
            if change <= 0.0 {
                (state, at) = (next, found);
                length = best.clamp(SHORTEST, 1.0);
            } else {
                length = best.max(0.1 * length).min(0.6 * length);
            }
        }
        (Verdict::NotConverged, state, length)
    }

    /// Verdict of a fit without an end: a press beyond the array, or a contradiction.
    fn unclaimed(&self, state: &State) -> Verdict {
        let verdict = self.judge(state, &self.normal(state), MOST_EVALUATIONS);
        verdict.claimed().map_or(verdict, |_| Verdict::NotConverged)
    }

    /// The next step. If it leads out of the range of radii, the radius goes to the end of its range,
    /// and the other unknowns follow.
    fn step(&self, State([.., ln_radius]): &State, at: &Normal) -> Option<Vector> {
        let free = step(&at.information, &at.gradient)?;
        let [.., by] = free;
        let [least, greatest] = self.array.profile.ln_radii();
        let allowed = (ln_radius + by).max(least).min(greatest) - ln_radius;
        if allowed == by {
            return Some(free);
        }
        let (mut information, mut gradient) = (at.information, at.gradient);
        let [.., last] = &mut information;
        for (slope, coupling) in gradient.iter_mut().zip(*last) {
            *slope += coupling * allowed;
        }
        *last = [0.0, 0.0, 0.0, 1.0];
        let [.., slope] = &mut gradient;
        *slope = -allowed;
        step(&information, &gradient)
    }

    fn place(&self, State([x, y, ..]): &State) -> [f32; 2] {
        let knot = self.array.profile.spacing().0;
        [x * knot, y * knot]
    }

    fn bounded(&self, State([x, y, ln_force, ln_radius]): State) -> State {
        let coils = self.array.coils();
        let within = |value: f32, of: fn(&Coil) -> Metre| {
            let places = coils.iter().map(|coil| self.array.profile.knots(of(coil)));
            let [low, high] = places.fold([f32::MAX, f32::MIN], |[low, high], at| {
                [low.min(at), high.max(at)]
            });
            value.max(low - SEARCHED).min(high + SEARCHED)
        };
        let [least, greatest] = self.array.profile.ln_radii();
        let [weakest, strongest] = LN_FORCE;
        State([
            within(x, |coil| coil.x),
            within(y, |coil| coil.y),
            ln_force.max(weakest).min(strongest),
            ln_radius.max(least).min(greatest),
        ])
    }

    /// Sums of the readings and the prior at a state.
    fn normal(&self, State([x, y, ln_force, ln_radius]): &State) -> Normal {
        let profile = &self.array.profile;
        let (force, table) = (exp(*ln_force), profile.table(*ln_radius));
        let prior = self.prior;
        let off = *ln_radius - prior.ln_radius - prior.exponent * ln_force;
        let mut normal = Normal::default();
        normal.add(
            &[0.0, 0.0, -prior.exponent / prior.sigma, 1.0 / prior.sigma],
            off / prior.sigma,
        );
        normal.of_indenter = normal.chi_square;
        let scan = self.scan.weights().iter().zip(self.scan.targets());
        for (coil, (weight, target)) in self.array.coils().iter().zip(scan) {
            let [dx, dy] = [x - profile.knots(coil.x), y - profile.knots(coil.y)];
            let distance = sqrt(dx * dx + dy * dy);
            let response = table.response(distance, force);
            // The profile is even: at the axis its slope is zero, and any direction serves.
            let radial = weight * response.by_distance / distance.max(f32::MIN_POSITIVE);
            let row = [
                radial * dx,
                radial * dy,
                weight * response.by_ln_force,
                weight * response.by_ln_radius,
            ];
            let value = response.value;
            normal.add(&row, weight * value - target);
            normal.informative += u8::from((weight * value).abs() > REACHED);
        }
        normal
    }

    fn judge(&self, state: &State, at: &Normal, evaluations: u8) -> Verdict {
        let inverse = Cholesky::new(&at.information).map(|of| of.inverse());
        let press = inverse.and_then(|of| Some((of, self.press(state, at, (of, evaluations))?)));
        let Some((inverse, press)) = press else {
            return Verdict::NotConverged;
        };
        if !self.array.bounds.contains([press.x.0, press.y.0]) {
            return Verdict::BeyondArray(press);
        }
        // The indenter counts as one more reading; an unknown one contradicts nothing. NaN is refused.
        let degrees = (self.scan.count + 1).saturating_sub(UNKNOWNS);
        let greatest = greatest_chi_square(degrees);
        if !(press.chi_square <= greatest) {
            return Verdict::DoesNotFit { press, greatest };
        }
        if self.claims_radius(state, &inverse) {
            Verdict::Inside(press)
        } else {
            Verdict::RadiusNotDetermined(press)
        }
    }

    /// Whether the radius is declared, or the readings determine it within the calibration's range.
    fn claims_radius(&self, State([.., ln_radius]): &State, inverse: &Matrix) -> bool {
        if self.prior.is_declared {
            return true;
        }
        let [least, greatest] = self.array.profile.ln_radii();
        let is_within = least < *ln_radius && *ln_radius < greatest;
        let [.., [.., variance]] = inverse;
        is_within && sqrt(*variance) <= CLAIMED * self.prior.sigma
    }

    /// The press of a state; `None` if a number of it is not finite.
    fn press(
        &self,
        state: &State,
        at: &Normal,
        (mut covariance, evaluations): (Matrix, u8),
    ) -> Option<Press> {
        let knot = self.array.profile.spacing().0;
        let units = [knot, knot, 1.0, 1.0];
        let common = self.array.common_error;
        let common = [
            common.place.0,
            common.place.0,
            common.ln_force,
            common.ln_radius,
        ];
        for (i, (row, row_unit)) in covariance.iter_mut().zip(units).enumerate() {
            for (j, (entry, unit)) in row.iter_mut().zip(units).enumerate() {
                *entry *= row_unit * unit;
                if i == j {
                    let add = common.get(i)?;
                    *entry += add * add;
                }
            }
        }
        let [x, y] = self.place(state).map(Metre);
        let State([_, _, ln_force, ln_radius]) = state;
        let press = Press {
            x,
            y,
            force: Newton(exp(*ln_force)),
            radius: Metre(exp(*ln_radius)),
            covariance,
            chi_square: if self.prior.is_declared {
                at.chi_square
            } else {
                at.chi_square - at.of_indenter
            },
            informative: at.informative,
            evaluations,
        };
        let numbers = [x.0, y.0, press.force.0, press.radius.0, press.chi_square];
        let all = press.covariance.iter().flatten().chain(&numbers);
        all.into_iter().all(|of| of.is_finite()).then_some(press)
    }
}

/// Expected decrease of chi-square at which a fit ends: 0.03 standard errors from the best.
const CONVERGED: f32 = 1e-3;
/// Expected decrease of chi-square at which one step after the last evaluation ends a fit: a step
/// of one standard error, after which the curvature leaves less than a tenth
/// (tests/integration/touch.rs: 0.08 at most, with up to sixteen times the noise of a converter).
const NEAR: f32 = 1.0;
/// Smallest fraction of a step to take after an accepted step.
const SHORTEST: f32 = 0.2;

/// Part of a step at which the parabola through its start, with the slope there, and its end is
/// lowest. `expected` is minus the product of step and gradient, which is half of the slope.
fn best_part(change: f32, expected: f32) -> f32 {
    let curvature = change + 2.0 * expected;
    if curvature > 0.0 {
        expected / curvature
    } else {
        f32::INFINITY
    }
}

/// The step of Gauss and Newton, within [`LONGEST_STEP`]; `None` if the system has no solution.
fn step(information: &Matrix, gradient: &Vector) -> Option<Vector> {
    let mut step = Cholesky::new(information)?.solve(gradient).map(|of| -of);
    let parts = step.iter().zip(&LONGEST_STEP);
    let excess = parts.fold(1.0_f32, |most, (part, longest)| {
        most.max(part.abs() / longest)
    });
    step.iter_mut().for_each(|part| *part /= excess);
    Some(step)
}

impl State {
    fn after(&self, step: &Vector) -> Self {
        let mut next = self.0;
        for (to, by) in next.iter_mut().zip(step) {
            *to += by;
        }
        Self(next)
    }

    /// The step from an earlier state to this one.
    fn since(&self, Self(earlier): &Self) -> Vector {
        let mut step = self.0;
        for (to, from) in step.iter_mut().zip(earlier) {
            *to -= from;
        }
        step
    }
}

impl Default for Normal {
    fn default() -> Self {
        Self {
            chi_square: 0.0,
            of_indenter: 0.0,
            information: [[0.0; UNKNOWNS]; UNKNOWNS],
            gradient: [0.0; UNKNOWNS],
            informative: 0,
        }
    }
}

impl Normal {
    fn add(&mut self, row: &Vector, residual: f32) {
        self.chi_square += residual * residual;
        let sums = self.information.iter_mut().zip(&mut self.gradient);
        for (i, ((sums, gradient), a)) in sums.zip(row).enumerate() {
            *gradient += a * residual;
            for (sum, b) in sums.iter_mut().zip(row).take(i + 1) {
                *sum += a * b;
            }
        }
    }
}
