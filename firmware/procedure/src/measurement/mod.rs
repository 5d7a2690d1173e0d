//! One measurement: from the rise of the current to an estimate or a refusal.

mod interval;
mod ramps;
pub(crate) mod train;

use coil_hbridge::CurrentLine;
use palpate_model::magnetorheological::{Stiffening, attraction, deviation};
use palpate_model::math::ln;
use palpate_model::ramp::RampSample;
use palpate_model::units::{Ampere, Metre, Newton, NewtonPerMetre};
use palpate_wire::code::{FaultCode, Location, RefusalReason};
use palpate_wire::command::{Creep, Settings};
use palpate_wire::record::{Estimate, Refusal, UncertaintyBudget};

use crate::board::Limits;
use crate::configuration::Calibrated;
use crate::deformation::Deformation;
use crate::event::{Failure, Scan};
use crate::heat::Heat;
use crate::relaxation::{HeldPress, Level};
use crate::time::{Duration, Instant, after, in_seconds, seconds, span};
pub(crate) use interval::{EstimateReport, MeasurementOutcome};
use ramps::{Ramps, TwoStates};
use train::{Train, TrainProfile, TrainSegment};

/// Largest tracking error of the current, as a fraction of the peak current. A larger error means that
/// the driven profile differs from that of the stiffening calibration. 2 % of gain error and an
/// amplifier's non-linearity (sim-host/stacks) are well within this limit.
const MAX_TRACKING_ERROR: f32 = 0.1;

/// A measurement is refused if more than one conversion in this number is flagged or lost: with so many
/// errors, the other conversions are unreliable too.
const ONE_IN: u32 = 10;

/// Reason for a missing estimate, with numbers whose meaning depends on the code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reason {
    pub(crate) code: RefusalReason,
    pub(crate) value: Option<f32>,
    pub(crate) limit: Option<f32>,
}

impl Reason {
    pub(crate) const fn new(code: RefusalReason, value: Option<f32>, limit: Option<f32>) -> Self {
        Self { code, value, limit }
    }
}

/// Train in progress, with its checks.
#[derive(Clone, Debug)]
pub(crate) struct TrainDrive {
    train: Train,
    began: Instant,
    deadline: Instant,
}

/// Measurement in progress.
#[derive(Clone, Debug)]
pub(crate) struct Measurement {
    pub(crate) number: u32,
    pub(crate) drive: TrainDrive,
    calibrated: Calibrated,
    /// Start of the touch.
    touched: Instant,
    /// Steady press before the train.
    before: Level,
    /// Sums over the falls, from the first sample on.
    ramps: Option<Ramps>,
    zero: ZeroAtTrain,
    two_states: TwoStates,
    /// Contributions to the interval, once known.
    budget: Option<UncertaintyBudget>,
    lost: u32,
    flagged: u32,
    /// Allowed number of lost conversions of the train, and of flagged ones.
    allowed: u32,
}

/// Zero of the deformation at the start of the train, with its uncertainty.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ZeroAtTrain {
    /// Creep of the sensing layer since the press, less the creep that the calibration on the bench
    /// contains.
    creep: Metre,
    variance_m2: f32,
}

/// Longest time from press to train at a calibration on a bench, s: the calibration contains the creep
/// up to this time.
///
/// A sensor's creep until 3 s hardly predicts that until a minute: of 4000 drawn layers the latter is
/// 1.87 +- 0.72 % for each factor of e in age, +- 0.64 % if the former is known.
const BENCH_S: f32 = 1.5;

impl ZeroAtTrain {
    /// Computes the zero at the first sample of a train.
    fn of(deformation: &Deformation) -> Self {
        let longer = ln((deformation.mean_age.0 / BENCH_S).max(1.0)) * deformation.value.0;
        let uncertain = Creep::TYPICAL.uncertainty * longer;
        Self {
            creep: Metre(Creep::TYPICAL.sensing * longer),
            variance_m2: deformation.zero_variance_m2 + uncertain * uncertain,
        }
    }
}

/// Progress of a train after an event.
pub(crate) enum Progress {
    /// The train continues, with a new line of current if one is due.
    On(Option<CurrentLine>),
    /// All ramps are complete and the current is zero.
    Done,
    /// The measurement ends without an estimate.
    Refused(Reason),
    /// A part has failed.
    Failed(Failure),
}

impl TrainDrive {
    /// Starts with the first rise.
    pub(crate) fn start(settings: &Settings, limits: &Limits, now: Instant) -> (Self, CurrentLine) {
        let profile = TrainProfile::new(settings);
        let (train, line) = Train::start(profile, now);
        let began = Instant::from_ticks(line.start_us);
        // Every segment starts with the conversion nearest to the end of the previous segment. A delay
        // of a tenth of a second means a failed scheduler.
        let slack = span(0.1).as_ticks() * (u64::from(profile.ramps) * 3 + 3);
        let allowed = profile.duration().as_ticks() + slack;
        let allowed = allowed.min(span(limits.on_time_s).as_ticks());
        let deadline = Instant::from_ticks(began.as_ticks().saturating_add(allowed));
        let drive = Self {
            train,
            began,
            deadline,
        };
        (drive, line)
    }

    pub(crate) const fn train(&self) -> &Train {
        &self.train
    }

    /// Returns the time origin of the samples: the middle of the first rise. A drift that restarts with
    /// every ramp then does so in the middle of a rise, far from any sample.
    fn origin(&self) -> Instant {
        let half = Duration::from_ticks(self.train.profile().rise.as_ticks() / 2);
        after(self.began, half)
    }

    /// Advances the train to `now`; `converted` says whether a conversion has just ended.
    pub(crate) fn tick(&mut self, now: Instant, converted: bool) -> Progress {
        if now >= self.deadline {
            let allowed = seconds(self.began, self.deadline).0;
            let took = seconds(self.began, now).0;
            let reason = RefusalReason::TimedOut;
            return Progress::Refused(Reason::new(reason, Some(took), Some(allowed)));
        }
        let line = converted.then(|| self.train.advance(now)).flatten();
        if self.train.segment() == TrainSegment::Done {
            Progress::Done
        } else {
            Progress::On(line)
        }
    }

    /// Checks heat and current at a scan.
    pub(crate) fn check(
        &mut self,
        scan: &Scan,
        settings: &Settings,
        heat: &Heat,
    ) -> Result<(), Progress> {
        self.train.convert(scan.middle, scan.window);
        if let Some(failure) = check_heat(settings, heat) {
            return Err(Progress::Failed(failure));
        }
        self.check_current(scan)
    }

    /// Checks that the measured current follows its setpoint.
    fn check_current(&self, scan: &Scan) -> Result<(), Progress> {
        let refused = |code, value, limit: Ampere| {
            Err(Progress::Refused(Reason::new(code, value, Some(limit.0))))
        };
        let peak = self.train.profile().peak;
        let Some(current) = scan.measured_current() else {
            let setpoint = self.train.setpoint(scan.middle).unwrap_or(peak);
            return refused(RefusalReason::CurrentOffTarget, None, setpoint);
        };
        // The current is checked only if the whole conversion was within the segment, and not on a rise,
        // which starts at the present current.
        let half = scan.window.as_ticks() / 2;
        let begins = Instant::from_ticks(scan.middle.as_ticks().saturating_sub(half));
        if !self.train.has_begun(begins) || self.train.segment() == TrainSegment::Rise {
            return Ok(());
        }
        let setpoint = self.train.setpoint(scan.middle).unwrap_or(current);
        if (current - setpoint).0.abs() <= MAX_TRACKING_ERROR * peak.0 {
            return Ok(());
        }
        if self.train.segment() == TrainSegment::Hold && current < setpoint {
            return refused(RefusalReason::PeakNotReached, Some(current.0), peak);
        }
        refused(RefusalReason::CurrentOffTarget, Some(current.0), setpoint)
    }
}

/// Checks the measured energy and temperature against the limits that the forecast has checked before.
pub(crate) fn check_heat(settings: &Settings, heat: &Heat) -> Option<Failure> {
    let copper_c = heat.copper().0;
    let (code, value, limit) = if copper_c > settings.greatest_temperature_c {
        let limit_c = settings.greatest_temperature_c;
        (FaultCode::CoilTooHot, copper_c, limit_c)
    } else if heat.energy_j() > settings.greatest_energy_j {
        let limit_j = settings.greatest_energy_j;
        (FaultCode::TooMuchEnergy, heat.energy_j(), limit_j)
    } else {
        return None;
    };
    Some(Failure {
        code,
        location: Location::Coil,
        value: Some(value),
        limit: Some(limit),
    })
}

impl Measurement {
    /// Starts a measurement with a train that has just started.
    pub(crate) fn start(
        number: u32,
        calibrated: Calibrated,
        (touched, before): (Instant, Level),
        settings: &Settings,
        (drive, line): (TrainDrive, CurrentLine),
    ) -> (Self, CurrentLine) {
        let conversions = in_seconds(drive.train.profile().duration()).0 * settings.rate_hz;
        let measurement = Self {
            number,
            drive,
            calibrated,
            touched,
            before,
            ramps: None,
            zero: ZeroAtTrain::default(),
            two_states: TwoStates::default(),
            budget: None,
            lost: 0,
            flagged: 0,
            allowed: conversions as u32 / ONE_IN,
        };
        (measurement, line)
    }

    /// Takes the contributions to the interval, after an estimate or the refusal of a too uncertain one.
    pub(crate) const fn take_budget(&mut self) -> Option<UncertaintyBudget> {
        self.budget.take()
    }

    /// Returns the press that is held after this estimate.
    pub(crate) fn held(&self, estimate: &Estimate, creep: Creep) -> Option<HeldPress> {
        let reference = self.ramps.as_ref()?.reference();
        let sensor = (reference.regressor(), creep);
        Some(HeldPress::new(estimate, sensor, self.before))
    }

    /// Returns the start of the touch.
    pub(crate) const fn touched(&self) -> Instant {
        self.touched
    }

    /// Handles a scan, with the deformation at the principal channel; `None` if it was flagged.
    pub(crate) fn push(
        &mut self,
        scan: &Scan,
        deformation: Option<Deformation>,
        settings: &Settings,
        heat: &Heat,
    ) -> Progress {
        self.lost = self.lost.saturating_add(scan.lost);
        let verdict = self
            .drive
            .check(scan, settings, heat)
            .and_then(|()| self.evaluate(scan, deformation, settings));
        match verdict {
            Ok(()) => Progress::On(None),
            Err(progress) => progress,
        }
    }

    fn evaluate(
        &mut self,
        scan: &Scan,
        deformation: Option<Deformation>,
        settings: &Settings,
    ) -> Result<(), Progress> {
        let refuse = |reason| Err(Progress::Refused(reason));
        let allowed = self.allowed;
        if self.lost > allowed {
            let reason = RefusalReason::ConversionsLost;
            return refuse(Reason::new(
                reason,
                Some(self.lost as f32),
                Some(allowed as f32),
            ));
        }
        let Some(deformation) = deformation else {
            self.flagged = self.flagged.saturating_add(1);
            if self.flagged > allowed {
                let reason = RefusalReason::Flagged;
                return refuse(Reason::new(
                    reason,
                    Some(self.flagged as f32),
                    Some(allowed as f32),
                ));
            }
            return Ok(());
        };
        if deformation.is_untouched() {
            let after = seconds(self.drive.began, scan.middle).0;
            return refuse(Reason::new(RefusalReason::ContactLost, Some(after), None));
        }
        if deformation.extrapolated {
            let pressed_m = deformation.value.0;
            let deepest = metres(self.calibrated.deepest);
            return refuse(Reason::new(
                RefusalReason::PressedTooFar,
                Some(pressed_m),
                deepest,
            ));
        }
        if let Some(ramp) = self.drive.train.ramp_of(scan.middle, scan.window)
            && let Some(current) = scan.acting_current()
        {
            self.take(scan, &deformation, (ramp, current), settings);
        }
        Ok(())
    }

    /// Adds a sample of a ramp's fall to the sums.
    fn take(
        &mut self,
        scan: &Scan,
        deformation: &Deformation,
        (ramp, current): (u8, Ampere),
        settings: &Settings,
    ) {
        let origin = self.drive.origin();
        if self.ramps.is_none() {
            self.begin_sums(deformation, origin, settings);
        }
        let law = &self.calibrated.law;
        let Some(ramps) = &mut self.ramps else {
            return;
        };
        let rise = law.rise(current).value;
        let actuated = law.at_rest() * (1.0 + rise);
        let reference = ramps.reference();
        let pressed = deformation.value - self.zero.creep;
        let pull = self.calibrated.pull(current);
        let sample = RampSample {
            time: seconds(origin, scan.middle),
            deformation: pressed - reference.deformation(),
            regressor: deviation(reference.regressor(), rise) + attraction(pull, actuated, pressed),
            sigma: deformation.sigma,
        };
        ramps.push(&sample, ramp);
        if ramp == 0 {
            self.two_states.push(pressed, actuated);
        }
    }
}

impl Measurement {
    /// Starts the sums at the first sample.
    #[inline(never)]
    fn begin_sums(&mut self, deformation: &Deformation, origin: Instant, settings: &Settings) {
        self.zero = ZeroAtTrain::of(deformation);
        let sensing = NewtonPerMetre(self.calibrated.springs.sensing_n_per_m);
        let actuated_ratio = self.calibrated.law.reference_ratio(sensing);
        let since_touch = seconds(self.touched, origin);
        let drift = ramps::drift(settings, since_touch, self.drive.train.profile());
        let pressed = deformation.value - self.zero.creep;
        self.ramps = Ramps::new(pressed, actuated_ratio, drift);
    }
}

impl Calibrated {
    /// Returns the attraction between the halves of the actuated layer.
    pub(crate) fn pull(&self, current: Ampere) -> Newton {
        Newton(self.attraction.attraction_n_per_a2 * current.0 * current.0)
    }
}

/// Creates the record of a refusal. Numbers that the protocol cannot represent are omitted.
pub(crate) fn refusal(measurement: u32, reason: Reason) -> Refusal {
    const GREATEST: f32 = 1e30;
    let in_range = |number: Option<f32>| number.filter(|number| number.abs() <= GREATEST);
    Refusal {
        measurement,
        reason: reason.code,
        value: in_range(reason.value),
        limit: in_range(reason.limit),
        wait_s: None,
    }
}

/// Returns a deformation as a plain number for a record.
pub(crate) const fn metres(deformation: Metre) -> Option<f32> {
    Some(deformation.0)
}
