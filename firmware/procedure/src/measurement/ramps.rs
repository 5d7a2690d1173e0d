//! Running sums of a train, and secondary statistics.

use palpate_model::ramp::{
    Basis, DriftModel, Fit, Noise, Ramp, RampRefusal, RampSample, Reference, Scatter, Term,
};
use palpate_model::springs::two_state_load;
use palpate_model::units::{Metre, NewtonPerMetre, Second};
use palpate_wire::code::Drift;
use palpate_wire::command::Settings;

use crate::measurement::train::TrainProfile;
use crate::time::in_seconds;

/// Sums over the whole train.
#[derive(Clone, Debug)]
pub(super) struct Ramps {
    /// Sums for level, slope, drifts and, last, a quadratic term. The estimate is solved without the
    /// quadratic term, the load's curve with it.
    sums: Ramp,
    /// Number of unknowns of a single ramp, the first ones of the sums: level, slope and, if the
    /// settings allow a drift, a linear drift. Any slow drift is linear over a single ramp.
    of_single: usize,
    /// Ramp in progress: its number, and the sums at its start.
    single: (u8, Ramp),
    /// Estimates of the single ramps.
    scatter: Scatter,
    /// Minimum and maximum of the regressor.
    regressors: (f32, f32),
}

/// Ratio of the drift's time constant to the train's duration above which the drift is modelled as a
/// straight line. At this ratio, creep of 1 % of the deformation differs from a line by 1 %/(8 * 30^2),
/// 1.4e-6 of the deformation, less than the noise of a train. At a ratio of a hundred, exponential and
/// line cannot be distinguished, and every measurement would be refused as ill-conditioned.
const STRAIGHT: f32 = 30.0;

/// Returns the drift model of the settings, for a press of age `since_touch` when the train started:
/// creep of rubber is logarithmic in the time since the touch.
pub(super) fn drift(
    settings: &Settings,
    since_touch: Second,
    profile: &TrainProfile,
) -> Option<DriftModel> {
    let train = in_seconds(profile.duration());
    let unless_straight = |tau: Second, drift| {
        if tau.0 > STRAIGHT * train.0 {
            DriftModel::Linear
        } else {
            drift
        }
    };
    match settings.drift {
        Drift::Linear => Some(DriftModel::Linear),
        Drift::Logarithmic => {
            let tau = since_touch;
            Some(unless_straight(tau, DriftModel::Logarithmic { tau }))
        }
        Drift::Exponential => {
            let tau = Second(settings.drift_time_s);
            Some(unless_straight(tau, DriftModel::Exponential { tau }))
        }
        Drift::SawTooth => Some(DriftModel::SawTooth {
            period: in_seconds(profile.period()),
        }),
        _ => None,
    }
}

impl Ramps {
    /// Creates empty sums about the first sample's deformation. `None` for a deformation or a time
    /// constant that is not above zero.
    pub(super) fn new(
        deformation: Metre,
        actuated_ratio: f32,
        drift: Option<DriftModel>,
    ) -> Option<Self> {
        let reference = Reference::new(deformation, actuated_ratio).ok()?;
        let (level, slope, bend) = (Term::Level, Term::Slope, Term::Quadratic);
        let straight = Term::Drift(DriftModel::Linear);
        let basis = match drift {
            None => Basis::new(&[level, slope, bend]),
            Some(DriftModel::Linear) => Basis::new(&[level, slope, straight, bend]),
            // Combines a curved drift with a straight one: rubber creeps while the coil's heat continues
            // to change. With only one of the two, the residuals are ten times the noise (see the
            // residuals in the demo's report).
            Some(drift) => Basis::new(&[level, slope, straight, Term::Drift(drift), bend]),
        };
        let sums = Ramp::new(reference, basis.ok()?);
        Some(Self {
            sums,
            of_single: if drift.is_some() { 3 } else { 2 },
            single: (0, sums),
            scatter: Scatter::default(),
            regressors: (f32::INFINITY, f32::NEG_INFINITY),
        })
    }

    pub(super) const fn reference(&self) -> &Reference {
        self.sums.reference()
    }

    /// Solves without the quadratic term, and also with it if the samples determine it.
    pub(super) fn solve(&self) -> Result<(Fit, Option<Fit>), RampRefusal> {
        let straight = self.sums.basis().terms().len().saturating_sub(1);
        let fit = self.sums.fit_first(straight, Noise::Larger);
        let fit = fit.unwrap_or(Err(RampRefusal::NotFinite))?;
        Ok((fit, self.sums.fit(Noise::Larger).ok()))
    }

    /// Returns the number of samples.
    pub(super) const fn samples(&self) -> u32 {
        self.sums.samples()
    }

    /// Returns the smallest and the largest regressor.
    pub(super) const fn regressors(&self) -> (f32, f32) {
        self.regressors
    }

    /// Returns the width of the regressor's range.
    pub(super) fn span(&self) -> f32 {
        let (low, high) = self.regressors;
        high - low
    }

    /// Adds a sample of the ramp with this number to all sums. Omits a sample that is not finite or not
    /// pressed.
    pub(super) fn push(&mut self, sample: &RampSample, ramp: u8) {
        if ramp != self.single.0 {
            self.close_single(ramp);
        }
        if self.sums.push(sample).is_err() {
            return;
        }
        let (low, high) = self.regressors;
        self.regressors = (low.min(sample.regressor), high.max(sample.regressor));
    }

    /// Adds the estimate of the finished ramp to the scatter, and starts the next ramp.
    fn close_single(&mut self, next: u8) {
        let alone = self.sums.since(&self.single.1);
        let fit = alone.and_then(|alone| alone.fit_first(self.of_single, Noise::Residual));
        if let Some(Ok(ratio)) = fit.map(|fit| fit.and_then(|fit| fit.load_ratio())) {
            self.scatter.add(ratio.value, ratio.standard_error);
        }
        self.single = (next, self.sums);
    }

    /// Returns the estimates of the single ramps, including the last one.
    pub(super) fn scatter(&mut self) -> &Scatter {
        self.close_single(self.single.0);
        &self.scatter
    }
}

/// First and last sample of the first ramp, for eq. (2) of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TwoStates {
    first: Option<(Metre, NewtonPerMetre)>,
    last: Option<(Metre, NewtonPerMetre)>,
}

impl TwoStates {
    pub(super) fn push(&mut self, deformation: Metre, actuated: NewtonPerMetre) {
        let state = (deformation, actuated);
        self.first.get_or_insert(state);
        self.last = Some(state);
    }

    /// Returns the load stiffness by eq. (2); `None` if it is not a number.
    pub(super) fn load(&self, sensing: NewtonPerMetre) -> Option<NewtonPerMetre> {
        let ((x1, c1), (x2, c2)) = (self.first?, self.last?);
        let load = two_state_load(sensing, [c1, c2], [x1, x2]);
        load.0.is_finite().then_some(load)
    }
}
