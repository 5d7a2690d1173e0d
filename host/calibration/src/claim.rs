//! What the calibration leaves open of a load.

use super::adjustment::{Adjusted, Changes, QUANTITIES};
use super::line::Bend;
use super::terms::terms;
use super::{Known, Unusable};

/// Standard uncertainties that a measurement takes over, as the instrument counts them: of
/// kappa = c_S/c_L by a constant, by a part of kappa, and by a part of the stiffening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Of kappa, constant.
    pub constant: f64,
    /// Of kappa, as a part of it.
    pub scale: f64,
    /// Of the rise, as a part of it.
    pub rise: f64,
    /// By how much the trains' own lines bend, root of the mean square.
    pub bend: f64,
    /// Relative standard uncertainty of 1/c_L at each of [`LOADS`], noise of a press apart.
    pub at: [f64; LOADS.len()],
    /// What it consists of.
    pub parts: Parts,
}

/// Loads, c_L/c_S, at which uncertainties are shown.
pub const LOADS: [f64; 3] = [0.2, 1.0, 5.0];

/// Relative standard uncertainties of 1/c_L at each of [`LOADS`], by cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parts {
    /// The springs' tolerance.
    pub springs: [f64; LOADS.len()],
    /// What the trains leave unexplained: noise, creep, memory, what slipped.
    pub trains: [f64; LOADS.len()],
    /// The gauges: scale of the force, compliance of the frame.
    pub bench: [f64; LOADS.len()],
}

/// Standard uncertainties of what is not known of the bench.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BenchScatter {
    /// Scale of the force, relative.
    pub(crate) force: f64,
    /// Compliance of the frame, m/N.
    pub(crate) frame_m_per_n: f64,
}

/// Depths of a press, in units of the mean of all trains, of which the mean square counts: those to which a
/// press in use goes.
const DEPTHS: [f64; 3] = [0.7, 1.0, 1.3];

pub(crate) fn uncertainty(
    adjusted: &Adjusted,
    bench: BenchScatter,
    known: &Known,
) -> Result<Uncertainty, Unusable> {
    let open = Open {
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
        // The instrument counts it as W/(1 + rise).
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
    /// Itself, if a load of c_S can be measured with it: beyond the settings' greatest error the instrument refuses
    /// every estimate, and does not take the numbers either.
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

/// What is open, as variances of kappa.
struct Open<'a> {
    adjusted: &'a Adjusted,
    bench: BenchScatter,
    sensing_n_per_m: f64,
}

impl Open<'_> {
    fn all(&self, kappa: f64) -> f64 {
        self.of_quantities(kappa, &self.adjusted.covariance)
            + self.of_train(kappa)
            + self.of_bench(kappa)
    }

    /// What the quantities leave open, mean over the depths.
    fn of_quantities(&self, kappa: f64, covariance: &[Changes; QUANTITIES]) -> f64 {
        /// A change of a quantity by which the reading is differentiated.
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

    /// What a train of a press scatters by itself.
    fn of_train(&self, kappa: f64) -> f64 {
        (self.adjusted.scatter * self.whole(kappa)).powi(2)
    }

    fn of_bench(&self, kappa: f64) -> f64 {
        let constant = self.bench.frame_m_per_n * self.sensing_n_per_m;
        constant.powi(2) + (self.bench.force * kappa).powi(2)
    }

    fn whole(&self, kappa: f64) -> f64 {
        1.0 + kappa + self.adjusted.layer.actuated.ratio
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
        // What is no number is none, either.
        assert!(with(f64::NAN).is_err());
    }
}
