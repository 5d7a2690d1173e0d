//! Effect of the contact's place and tilt, from presses of the block beside the centre and tilted.
//!
//! Each of these trains gives W = 1 + kappa + c_S/c_D0 by its own line, as does the train on the
//! block in the centre, flat, at the same depth: W_0. Beside the centre the stiffening's signal is
//! W_0/W times as large. Under a tilted face every deformation reads too large by o, and W is
//! x/(x - o) times as large.
//!
//! If the place is uniform in the disc within the tolerance, and the change of the signal grows with
//! the square of the distance, the change is uniform from zero to its value at the rim. With a
//! uniform tilt o is uniform too. The root of the mean square of each, its greatest value over the
//! root of three, counts as the uncertainty. The mean is not corrected: that would halve the
//! uncertainty, but the centred, flat contact, which is the most likely one, would then have the
//! greatest error. With such a correction intervals at this contact covered 37 of 60 loads
//! (`palpate campaign --plants 12 --seed 1420001 --contact-within 1 --contact-tilt 0.1`).

use palpate_wire::Command;
use palpate_wire::command::ContactTolerance;

use super::actuated::Train;
use super::adjustment::{Adjusted, Layer, scattered};
use super::claim::{LOADS, Uncertainty};
use super::curve::PressCurve;
use super::line::mean_m;
use super::samples::SampleRun;
use super::session::Pressed;
use super::{Actuated, Unusable};

/// Contacts within a tolerance, with their effect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactEffect {
    /// Greatest distance from the centre, m.
    pub within_m: f64,
    /// Greatest tilt, rad.
    pub tilt_rad: f64,
    /// Relative standard uncertainty of the stiffening's signal that the place adds.
    pub signal_uncertainty: f64,
    /// Standard uncertainty of the deformation's zero that the tilt adds, m.
    pub zero_uncertainty_m: f64,
}

/// Factor on the standard deviation of the changes at four places that makes 1.96 of it cover 95 %:
/// Student's t with three degrees of freedom is 3.18.
const OF_FOUR: f64 = 3.182 / 1.960;

/// Evaluates the trains on the displaced block, with those of the runs on the block in the centre.
/// `None` without such trains.
pub(crate) fn effect(
    displaced: &[SampleRun],
    runs: &[SampleRun],
    (force, adjusted): (&PressCurve, &Adjusted),
) -> Result<Option<ContactEffect>, Unusable> {
    let layer = &adjusted.layer;
    let train =
        |run: &SampleRun| Train::of(run, force, &layer.crosstalk, (layer.sensing_n_per_m, 0.0));
    let centred = runs.iter().filter(|run| run.pressed == Pressed::Block);
    let centred: Vec<Train> = centred.filter_map(train).collect();
    let (mut changes, mut shifts_m) = (Vec::new(), Vec::new());
    let mut effect = ContactEffect::default();
    for (run, train) in displaced.iter().filter_map(|run| Some((run, train(run)?))) {
        let ratio = nearest(&centred, &train, layer)? / whole(&train, layer)?;
        match run.pressed {
            Pressed::BlockBeside { distance_m, .. } => {
                effect.within_m = effect.within_m.max(distance_m);
                changes.push(ratio - 1.0);
            }
            Pressed::BlockTilted { angle_rad, .. } => {
                effect.tilt_rad = effect.tilt_rad.max(angle_rad);
                shifts_m.push(depth_m(&train) * (1.0 - ratio));
            }
            _ => {}
        }
    }
    let (at_rim, spread) = statistics(&changes);
    // Of two tilted presses the larger shift counts: from two values, Student's factor would be 13.
    let greatest_m = shifts_m.iter().copied().fold(0.0, f64::max);
    let [place, tilt] = root_mean_squares(at_rim, greatest_m / layer.depth_m);
    let ratio = layer.actuated.ratio;
    let of_block = scattered(adjusted.scatter, 0.0, ratio) / (1.0 + ratio);
    if effect.within_m > 0.0 {
        // The scatter of the train in the centre is common to all places.
        let scatter = of_block.hypot(OF_FOUR * spread);
        effect.signal_uncertainty = place.hypot(scatter);
    }
    if effect.tilt_rad > 0.0 {
        let scatter = 2_f64.sqrt() * of_block;
        effect.zero_uncertainty_m = layer.depth_m * tilt.hypot(scatter);
    }
    Ok((effect != ContactEffect::default()).then_some(effect))
}

/// Roots of the mean squares of two uniform quantities: the signal's change, from zero to the one at
/// the rim, and the zero's shift relative to the depth, from zero to the greatest one.
///
/// A signal that falls and a zero that is shifted both let a load appear softer. The mean square of
/// the sum of a and b is then a²/3 + b²/3 + ab/2. Both results are raised by a common factor, so
/// that the sum of their squares includes the last term.
fn root_mean_squares(at_rim: f64, shift: f64) -> [f64; 2] {
    let squares = at_rim * at_rim + shift * shift;
    let common = if squares > 0.0 {
        1.5 * (-at_rim).max(0.0) * shift / squares
    } else {
        0.0
    };
    [at_rim.abs(), shift].map(|greatest| greatest * ((1.0 + common) / 3.0).sqrt())
}

/// Mean and sample standard deviation; zeros without two values at least.
fn statistics(values: &[f64]) -> (f64, f64) {
    if values.len() < 2 {
        return (0.0, 0.0);
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0)).sqrt())
}

/// W of a train by its own line.
fn whole(train: &Train, layer: &Layer) -> Result<f64, Unusable> {
    let actuated = &layer.actuated;
    let line = actuated.line(&train.samples, layer.sensing_n_per_m, train.tau_s)?;
    Ok(1.0 + line.kappa + actuated.ratio)
}

fn depth_m(train: &Train) -> f64 {
    mean_m(train.samples.iter().map(|sample| sample.deformation_m))
}

/// W of the centred train whose depth is nearest to that of a train.
fn nearest(centred: &[Train], train: &Train, layer: &Layer) -> Result<f64, Unusable> {
    let off_m = |of: &Train| (depth_m(of) - depth_m(train)).abs();
    let nearest = centred.iter().min_by(|a, b| off_m(a).total_cmp(&off_m(b)));
    whole(
        nearest.ok_or(Unusable::Missing("train on the block"))?,
        layer,
    )
}

impl ContactEffect {
    /// The command that states the tolerance. The instrument counts the uncertainty of the rise as
    /// W/(1 + rise) times that of the signal.
    pub(crate) fn command(&self, actuated: &Actuated) -> Command {
        let rise = actuated.rise(actuated.peak_a);
        Command::SetContact(ContactTolerance {
            within_m: self.within_m as f32,
            tilt_rad: self.tilt_rad as f32,
            rise_uncertainty: (self.signal_uncertainty * (1.0 + rise)) as f32,
            zero_uncertainty_m: self.zero_uncertainty_m as f32,
        })
    }

    /// Relative standard uncertainty of 1/c_L that place and tilt add at each of [`LOADS`], for
    /// c_S/c_D0 and a deformation in m.
    pub fn at_loads(&self, ratio: f64, depth_m: f64) -> [f64; LOADS.len()] {
        let of_whole = self
            .signal_uncertainty
            .hypot(self.zero_uncertainty_m / depth_m);
        LOADS.map(|load| of_whole * (1.0 + 1.0 / load + ratio) * load)
    }

    /// Refuses a tolerance with which no load of c_S could be measured.
    pub(crate) fn check(
        &self,
        uncertainty: &Uncertainty,
        layer: &Layer,
        allowed: f64,
    ) -> Result<(), Unusable> {
        let [_, calibrated, _] = uncertainty.at;
        let [_, of_contact, _] = self.at_loads(layer.actuated.ratio, layer.depth_m);
        let at_sensing = calibrated.hypot(of_contact);
        // NaN is refused too.
        if at_sensing <= allowed {
            return Ok(());
        }
        Err(Unusable::ContactTooWide {
            at_sensing,
            allowed,
        })
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::random::Stream;

    use super::*;

    /// Compares the stated uncertainty with the root mean square of both shifts together, over many
    /// contacts within the tolerance.
    #[test]
    fn the_uncertainty_is_the_root_of_the_mean_square_of_both() {
        for (at_rim, shift) in [(-0.01, 0.02), (-0.02, 0.0), (0.01, 0.02), (0.0, 0.03)] {
            let mut chance = Stream::named(3, "contact");
            let squares: f64 = (0..100_000)
                .map(|_| {
                    // Uniform in the disc, and in the angle.
                    let distance = chance.uniform().sqrt();
                    let moved = -at_rim * distance * distance + shift * chance.uniform();
                    moved * moved
                })
                .sum();
            let drawn = (squares / 1e5).sqrt();
            let [place, tilt] = root_mean_squares(at_rim, shift);
            let stated = place.hypot(tilt);
            // Where the two shifts partly cancel, only the sum of their squares is stated.
            let ratio = stated / drawn;
            let most = if at_rim > 0.0 { 1.7 } else { 1.01 };
            assert!((0.99..most).contains(&ratio), "{at_rim} {shift}: {ratio}");
        }
    }

    #[test]
    fn four_places_give_mean_and_spread() {
        let (mean, spread) = statistics(&[1.0, 2.0, 3.0, 6.0]);
        assert_eq!(mean, 3.0);
        assert!((spread - (14.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(statistics(&[]), (0.0, 0.0));
    }
}
