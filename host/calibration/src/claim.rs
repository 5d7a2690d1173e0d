//! Uncertainty of a load that the calibration leaves.

use super::adjustment::{Adjusted, Changes, QUANTITIES, scattered};
use super::line::Bend;
use super::terms::terms;
use super::{Known, Unusable};

/// Standard uncertainties that the instrument adds to a measurement, in the terms that it stores: a
/// constant one of kappa = c_S/c_L, one proportional to kappa, and a relative one of the rise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Constant uncertainty of kappa.
    pub constant: f64,
    /// Uncertainty of kappa, relative to kappa.
    pub scale: f64,
    /// Relative uncertainty of the rise.
    pub rise: f64,
    /// Root mean square of the bends of the trains' own lines.
    pub bend: f64,
    /// Relative standard uncertainty of 1/c_L at each of [`LOADS`], without the noise of a press.
    pub at: [f64; LOADS.len()],
    /// The contributions to `at`.
    pub parts: Parts,
}

/// Loads, c_L/c_S, for which uncertainties are shown.
pub const LOADS: [f64; 3] = [0.2, 1.0, 5.0];

/// Relative standard uncertainties of 1/c_L at each of [`LOADS`], by cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// The springs' tolerance.
    pub springs: [f64; LOADS.len()],
    /// Residuals of the trains: noise, creep, memory, slip.
    pub trains: [f64; LOADS.len()],
    /// The gauges: scale of the force, compliance of the frame.
    pub bench: [f64; LOADS.len()],
}

/// Standard uncertainties of the bench.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BenchScatter {
    /// Scale of the force, relative.
    pub(crate) force: f64,
    /// Compliance of the frame, m/N.
    pub(crate) frame_m_per_n: f64,
}

/// Depths of presses in use, relative to the mean depth of all trains, over which the variance is
/// averaged.
const DEPTHS: [f64; 3] = [0.7, 1.0, 1.3];

pub(crate) fn uncertainty(
    adjusted: &Adjusted,
    bench: BenchScatter,
    known: &Known,
) -> Result<Uncertainty, Unusable> {
    let open = RemainingVariance {
        adjusted,
        bench,
        sensing_n_per_m: known.sensing_n_per_m,
    };
    let [constant, scale, whole] = terms(adjusted.layer.actuated.ratio, |kappa| open.all(kappa))?;
    let actuated = &adjusted.layer.actuated;
    let relative = |variance: &dyn Fn(f64) -> f64| {
        LOADS.map(|load| variance(1.0 / load).max(0.0).sqrt() * load)
    };
    let found = Uncertainty {
        constant,
        scale,
        // The instrument multiplies the uncertainty of the rise by W/(1 + rise).
        rise: whole * (1.0 + actuated.rise(actuated.peak_a)),
        bend: Bend::root_mean_square(&adjusted.bends),
        at: relative(&|kappa| open.all(kappa)),
        parts: Parts {
            springs: relative(&|kappa| {
                open.of_quantities(kappa, &adjusted.covariance)
                    - open.of_quantities(kappa, &adjusted.covariance_of_exact_springs)
            }),
            trains: relative(&|kappa| {
                open.of_quantities(kappa, &adjusted.covariance_of_exact_springs)
                    + open.of_train(kappa)
            }),
            bench: relative(&|kappa| open.of_bench(kappa)),
        },
    };
    found.within(known.settings.greatest_error.into())
}

impl Uncertainty {
    /// Returns the uncertainty itself if a load of c_S can be measured with it. Beyond the
    /// settings' `greatest_error` the instrument refuses every estimate, and does not accept the
    /// values either.
    fn within(self, allowed: f64) -> Result<Self, Unusable> {
        let [_, at_sensing, _] = self.at;
        if at_sensing <= allowed {
            return Ok(self);
        }
        Err(Unusable::TooUncertain {
            at_sensing,
            allowed,
        })
    }
}

/// Remaining uncertainties, as variances of kappa.
struct RemainingVariance<'a> {
    adjusted: &'a Adjusted,
    bench: BenchScatter,
    sensing_n_per_m: f64,
}

impl RemainingVariance<'_> {
    fn all(&self, kappa: f64) -> f64 {
        self.of_quantities(kappa, &self.adjusted.covariance)
            + self.of_train(kappa)
            + self.of_bench(kappa)
    }

    /// Variance of kappa by the adjusted quantities, averaged over [`DEPTHS`].
    fn of_quantities(&self, kappa: f64, covariance: &[Changes; QUANTITIES]) -> f64 {
        /// Step of a quantity for the derivative of the reading.
        const STEP: f64 = 1e-6;
        let layer = &self.adjusted.layer;
        let at_depth = |depth: f64| {
            let slopes: Changes = std::array::from_fn(|index| {
                let mut changes = Changes::default();
                if let Some(change) = changes.get_mut(index) {
                    *change = STEP;
                }
                let wrong = layer.changed(&changes);
                (wrong.reads(layer, kappa, depth * layer.depth_m) - kappa) / STEP
            });
            let rows = covariance.iter().zip(slopes);
            rows.map(|(row, slope)| {
                let columns = row.iter().zip(slopes);
                slope * columns.map(|(entry, slope)| entry * slope).sum::<f64>()
            })
            .sum::<f64>()
        };
        DEPTHS.into_iter().map(at_depth).sum::<f64>() / DEPTHS.len() as f64
    }

    /// Variance of kappa by the errors of a single train.
    fn of_train(&self, kappa: f64) -> f64 {
        let ratio = self.adjusted.layer.actuated.ratio;
        scattered(self.adjusted.scatter, kappa, ratio).powi(2)
    }

    fn of_bench(&self, kappa: f64) -> f64 {
        let constant = self.bench.frame_m_per_n * self.sensing_n_per_m;
        constant.powi(2) + (self.bench.force * kappa).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leaves_a_load_of_c_s_open_is_no_calibration() {
        let with = |at_sensing: f64| {
            let at = [0.1, at_sensing, 2.0];
            Uncertainty {
                constant: at_sensing,
                scale: 0.0,
                rise: 0.0,
                bend: 0.0,
                at,
                parts: Parts {
                    springs: at,
                    trains: at,
                    bench: at,
                },
            }
            .within(0.5)
        };
        assert!(with(0.4).is_ok());
        let refused = with(1.45).unwrap_err();
        assert!(matches!(refused, Unusable::TooUncertain { .. }));
        assert!(
            refused.to_string().contains("uncertain by 145 %"),
            "{refused}"
        );
        // NaN is refused too.
        assert!(with(f64::NAN).is_err());
    }
}
