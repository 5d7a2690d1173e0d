//! The phases, and how one leads to the next.

use palpate_model::contact::Touch;
use palpate_model::units::Second;
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Location, Mode, Outcome, RefusalReason, State};

use super::budget::Hindrance;
use super::coil::Knowledge;
use super::manual::ManualDrive;
use super::{Out, Procedure};
use crate::action::Action;
use crate::deformation::{Deformation, Follower};
use crate::event::{Failure, Scan};
use crate::measurement::train::TrainSegment;
use crate::measurement::{
    EstimateReport, Measurement, MeasurementOutcome, Progress, Reason, TrainDrive, metres, refusal,
};
use crate::steadiness::Steadiness;
use crate::time::{Duration, Instant, between, in_seconds, seconds, span, together};

/// Good conversions in a row that prove sensor, clock and bus.
const SELF_TEST_CONVERSIONS: u8 = 10;

/// Conversion periods without a conversion after which the sensor counts as silent, and the least
/// time: what recovering the bus may take (50 ms).
const SILENT_PERIODS: f32 = 10.0;
const SILENT_S: f32 = 0.05;
/// What bringing a converter up may take, beside conversions. With four channels, which is the most,
/// the drive of each is sought, and 280 registers are written, read back or compared, one transaction
/// each. Each has 0.47 ms until it fails, which is a fault of its own: 132 ms. Reset and waking take
/// 3.5 ms.
pub(super) const BRING_UP: Duration = Duration::from_ticks(140_000);
/// The same time.
const LEAST_SILENCE: Duration = Duration::from_ticks(50_000);

/// Where the procedure stands, with what it has to remember there.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one of it, and no heap to put the larger ones on"
)]
pub(super) enum Phase {
    SelfTest {
        good: u8,
    },
    Baseline,
    Watching,
    /// Something touches, since then.
    Contact {
        since: Instant,
    },
    Settling(Settling),
    Driving(Measurement),
    /// A train for calibration. The time of touch, if something touches.
    Sweeping {
        drive: TrainDrive,
        touched: Option<Instant>,
    },
    /// The estimate has been sent; the points of the load's curve follow, one a step.
    Reporting {
        report: EstimateReport,
        next: u8,
        /// The time of touch, until the object is lifted.
        touched: Option<Instant>,
    },
    /// Measured, or refused; it still touches.
    Release {
        since: Instant,
    },
    /// A current that a PC commands directly.
    Manual(ManualDrive),
    Fault(Failure),
}

/// Waiting for a press to become steady.
#[derive(Clone, Debug)]
pub(super) struct Settling {
    /// When the object touched.
    touched: Instant,
    pub(super) began: Instant,
    steadiness: Steadiness,
    /// The last rate seen, in m/s.
    rate_m_per_s: f32,
    /// Conversions that could not be used.
    flagged: u32,
    /// The last conversion that could.
    last: Option<Instant>,
}

/// So long before a moment.
fn before(moment: Instant, ago: Second) -> Instant {
    Instant::from_ticks(moment.as_ticks().saturating_sub(span(ago.0).as_ticks()))
}

/// What a phase does, for everything that has to know no more of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Activity {
    /// Sensing, with the coil at rest.
    Sensing,
    /// Waiting for a press to become steady.
    Settling,
    /// Driving a train.
    Train,
    /// Driving a current that a PC commands.
    Manual,
    /// Sending a result.
    Reporting,
    /// Stopped by a fault.
    Fault,
}

impl Activity {
    /// Whether the coil is driven.
    pub(super) const fn drives(self) -> bool {
        matches!(self, Self::Train | Self::Manual)
    }

    /// Whether it ends in a result or a refusal.
    pub(super) const fn measures(self) -> bool {
        matches!(self, Self::Settling | Self::Train)
    }

    /// Checks that a command may take the coil; otherwise the command's outcome.
    pub(super) const fn ensure_free(self) -> Result<(), Outcome> {
        match self {
            Self::Sensing => Ok(()),
            Self::Fault => Err(Outcome::Faulted),
            Self::Settling | Self::Train | Self::Manual | Self::Reporting => Err(Outcome::Busy),
        }
    }
}

impl Phase {
    pub(super) const fn activity(&self) -> Activity {
        match self {
            Self::SelfTest { .. }
            | Self::Baseline
            | Self::Watching
            | Self::Contact { .. }
            | Self::Release { .. } => Activity::Sensing,
            Self::Settling(_) => Activity::Settling,
            Self::Driving(_) | Self::Sweeping { .. } => Activity::Train,
            Self::Manual(_) => Activity::Manual,
            Self::Reporting { .. } => Activity::Reporting,
            Self::Fault(_) => Activity::Fault,
        }
    }

    pub(super) const fn state(&self) -> State {
        match self {
            Self::SelfTest { .. } => State::SelfTest,
            Self::Baseline => State::Baseline,
            Self::Watching => State::Watching,
            Self::Contact { .. } => State::Contact,
            Self::Settling(_) => State::Settling,
            Self::Driving(Measurement { drive, .. }) | Self::Sweeping { drive, .. } => {
                let train = drive.train();
                match train.segment() {
                    TrainSegment::Rise | TrainSegment::Hold if train.completed() == 0 => {
                        State::Peak
                    }
                    _ => State::Ramps,
                }
            }
            Self::Reporting { .. } => State::Estimating,
            Self::Release { .. } => State::Release,
            Self::Manual(_) => State::Manual,
            Self::Fault(_) => State::Fault,
        }
    }
}

impl Procedure {
    /// A scan of the first converter, and the deformation at its principal channel.
    pub(super) fn principal(
        &mut self,
        scan: &Scan,
        deformation: Option<Deformation>,
        interval: Second,
        out: &mut Out<'_>,
    ) {
        let settings = &self.configuration.settings;
        let touch = deformation.map(|of| of.touch);
        let all_good = scan.conversions.iter().all(|of| of.reading.is_good());
        match &mut self.phase {
            Phase::SelfTest { good } => {
                *good = if all_good { good.saturating_add(1) } else { 0 };
                if *good >= SELF_TEST_CONVERSIONS {
                    self.go(Phase::Baseline, out);
                }
            }
            Phase::Baseline | Phase::Watching => match touch {
                Some(Touch::Began { ago }) => self.touched(before(scan.middle, ago), out),
                Some(Touch::Held) => {
                    let ago = self.principal_follower().and_then(Follower::touched_for);
                    self.touched(before(scan.middle, ago.unwrap_or_default()), out);
                }
                // Where it is already it need not go: a phase is two kilobytes.
                Some(Touch::Clear) if self.state() != State::Watching => {
                    self.go(Phase::Watching, out);
                }
                _ => {}
            },
            // The object may have left while the coil was driven, when the contact was not checked.
            Phase::Contact { .. } | Phase::Release { .. }
                if deformation.is_some_and(|of| of.is_untouched()) =>
            {
                self.go(Phase::Baseline, out);
            }
            // What was announced is sent to its end.
            Phase::Reporting { touched, .. } if deformation.is_some_and(|of| of.is_untouched()) => {
                *touched = None;
            }
            Phase::Settling(settling) => {
                let Some(deformation) = deformation else {
                    settling.flagged = settling.flagged.saturating_add(1);
                    return;
                };
                let last = settling.last.replace(scan.middle);
                let interval = last.map_or(interval, |last| seconds(last, scan.middle));
                let rate = settling.steadiness.push(interval, deformation.value);
                self.settle(deformation, rate, out);
            }
            Phase::Driving(measurement) => {
                if let Some(heat) = &self.heat {
                    let progress = measurement.push(scan, deformation, settings, heat);
                    self.progress(progress, out);
                }
            }
            Phase::Sweeping { drive, .. } => {
                if let Some(heat) = &self.heat
                    && let Err(progress) = drive.check(scan, settings, heat)
                {
                    self.progress(progress, out);
                }
            }
            // That this converter is seen says nothing of the other one's silence.
            Phase::Fault(standing)
                if all_good
                    && standing.code == FaultCode::SensorSilent
                    && standing.location == Location::Sensor =>
            {
                self.recovered(FaultCode::SensorSilent, out);
            }
            _ => {}
        }
    }

    /// An object touches.
    fn touched(&mut self, since: Instant, out: &mut Out<'_>) {
        self.go(Phase::Contact { since }, out);
        if self.armed && self.configuration.settings.automatic {
            self.begin_settling(since, out);
        }
    }

    /// When the object touched that touches now.
    pub(super) const fn touched_since(&self) -> Option<Instant> {
        match &self.phase {
            Phase::Contact { since } | Phase::Release { since } => Some(*since),
            _ => None,
        }
    }

    /// A measurement that was asked for.
    pub(super) fn begin_asked(&mut self, out: &mut Out<'_>) -> Outcome {
        match self.may_measure() {
            Ok(touched) => {
                // What the coil could not bear now it is not likely to in the second that the press
                // takes to settle.
                match self.may_take_train(out.now) {
                    Err(hindrance) if hindrance.wait_s.is_some() => self.hindered(&hindrance, out),
                    _ => self.begin_settling(touched, out),
                }
                Outcome::Accepted
            }
            Err(answer) => answer,
        }
    }

    pub(super) fn begin_settling(&mut self, touched: Instant, out: &mut Out<'_>) {
        let settling = Settling {
            touched,
            began: out.now,
            steadiness: Steadiness::default(),
            rate_m_per_s: f32::INFINITY,
            flagged: 0,
            last: None,
        };
        self.go(Phase::Settling(settling), out);
    }

    /// A conversion while the press settles; `rate` in m/s at the end of a block.
    fn settle(&mut self, deformation: Deformation, rate: Option<f32>, out: &mut Out<'_>) {
        let settings = &self.configuration.settings;
        let Phase::Settling(settling) = &mut self.phase else {
            return;
        };
        let touched = settling.touched;
        let pressed_m = deformation.value.0;
        if deformation.is_untouched() {
            let after = seconds(settling.began, out.now).0;
            return self.refuse(
                Reason::new(RefusalReason::ContactLost, Some(after), None),
                out,
            );
        }
        let Some(rate) = rate else {
            return;
        };
        settling.rate_m_per_s = rate;
        if rate.is_nan() || rate.abs() > settings.steady_m_per_s {
            return;
        }
        if deformation.extrapolated {
            let reason = RefusalReason::PressedTooFar;
            let deepest = self.configuration.deepest().and_then(metres);
            return self.refuse(Reason::new(reason, metres(deformation.value), deepest), out);
        }
        let least_m = settings.least_press_m;
        if pressed_m < least_m {
            let reason = RefusalReason::PressedTooLittle;
            return self.refuse(Reason::new(reason, Some(pressed_m), Some(least_m)), out);
        }
        // One that was not asked for may come while the coil is not known.
        if self.coil_is_tested(out) {
            self.begin_measurement(touched, out);
        }
    }

    fn begin_measurement(&mut self, touched: Instant, out: &mut Out<'_>) {
        if !self.check_all(out) {
            return;
        }
        if let Some(moved) = self.principal_follower().and_then(Follower::rest_moved) {
            let (reading, limit) = (metres(moved.reading), metres(moved.limit));
            return self.refuse(Reason::new(RefusalReason::RestMoved, reading, limit), out);
        }
        // The same as at the bench, where the temperature is measured before a train as well.
        let calibrated = match self.configuration.calibrated(self.temperature()) {
            Ok(calibrated) => calibrated,
            Err(kind) => {
                let reason = RefusalReason::NotCalibrated;
                return self.refuse(Reason::new(reason, Some(kind.into()), None), out);
            }
        };
        if let Err(hindrance) = self.may_take_train(out.now) {
            return self.hindered(&hindrance, out);
        }
        if let Some(heat) = &mut self.heat {
            heat.start_measurement();
        }
        self.measurement = self.measurement.wrapping_add(1);
        let (settings, limits) = (&self.configuration.settings, &self.board.limits);
        let started = TrainDrive::start(settings, limits, out.now);
        let (measurement, line) =
            Measurement::start(self.measurement, calibrated, touched, settings, started);
        // What goes into an estimate is in the records, so that it can be computed again from them: here the
        // temperature.
        out.record(Record::Status(self.status()));
        self.go(Phase::Driving(measurement), out);
        out.push(Action::Current(line));
    }

    fn progress(&mut self, progress: Progress, out: &mut Out<'_>) {
        match progress {
            Progress::On(line) => {
                if let Some(line) = line {
                    out.push(Action::Current(line));
                }
            }
            Progress::Done => self.conclude(out),
            Progress::Refused(reason) => self.refuse(reason, out),
            Progress::Failed(failure) => self.fail(failure, out),
        }
    }

    /// All ramps are done: bridge off, and the result.
    fn conclude(&mut self, out: &mut Out<'_>) {
        self.safe(Outcome::Aborted, out);
        if let Phase::Sweeping { touched, .. } = self.phase {
            return self.swept(touched, out);
        }
        // Where it lies: it is the largest thing there is, and the stack is short.
        let Phase::Driving(measurement) = &mut self.phase else {
            return;
        };
        let since = measurement.touched();
        let settings = &self.configuration.settings;
        let outcome = measurement.finish(settings, out.now);
        if let Some(budget) = measurement.take_budget() {
            out.record(Record::UncertaintyBudget(budget));
        }
        match outcome {
            MeasurementOutcome::Estimate(report) => {
                out.record(Record::Estimate(report.estimate.clone()));
                self.phase = Phase::Reporting {
                    report,
                    next: 0,
                    touched: Some(since),
                };
                self.announce(State::Ramps, out);
            }
            MeasurementOutcome::Refusal(refusal) => {
                self.counters.refusals = self.counters.refusals.wrapping_add(1);
                out.record(Record::Refusal(refusal));
                self.phase = Phase::Release { since };
                self.announce(State::Ramps, out);
            }
        }
    }

    /// The end of a train for calibration. What it did to an untouched sensor's readings is no
    /// part of their baseline.
    pub(super) fn swept(&mut self, touched: Option<Instant>, out: &mut Out<'_>) {
        match touched {
            Some(since) => self.go(Phase::Release { since }, out),
            None => {
                self.learn_baseline();
                self.go(Phase::Baseline, out);
            }
        }
    }

    /// Begins a train for calibration.
    pub(super) fn begin_sweep(&mut self, out: &mut Out<'_>) -> Outcome {
        if !self.check_all(out) {
            return Outcome::Faulted;
        }
        if let Err(hindrance) = self.may_take_train(out.now) {
            self.hindered(&hindrance, out);
            return Outcome::Accepted;
        }
        if let Some(heat) = &mut self.heat {
            heat.start_measurement();
        }
        let touched = self.touched_since();
        let (settings, limits) = (&self.configuration.settings, &self.board.limits);
        let (drive, line) = TrainDrive::start(settings, limits, out.now);
        self.go(Phase::Sweeping { drive, touched }, out);
        out.push(Action::Current(line));
        Outcome::Accepted
    }

    /// Ends a measurement, or the attempt at one, with a reason. Bridge off first.
    pub(super) fn refuse(&mut self, reason: Reason, out: &mut Out<'_>) {
        let wait_s = None;
        self.hindered(&Hindrance { reason, wait_s }, out);
    }

    /// The same, with the time after which it may be asked for again.
    pub(super) fn hindered(&mut self, hindrance: &Hindrance, out: &mut Out<'_>) {
        let &Hindrance { reason, wait_s } = hindrance;
        let (number, since) = match &self.phase {
            Phase::Driving(measurement) => (measurement.number, Some(measurement.touched())),
            Phase::Settling(settling) => (0, Some(settling.touched)),
            Phase::Sweeping { touched, .. } => (0, *touched),
            _ => (0, self.touched_since()),
        };
        self.safe(Outcome::Aborted, out);
        self.counters.refusals = self.counters.refusals.wrapping_add(1);
        let mut record = refusal(number, reason);
        record.wait_s = wait_s;
        out.record(Record::Refusal(record));
        match since {
            // The release was seen, and the baseline is learnt from there.
            Some(_) if reason.code == RefusalReason::ContactLost => self.go(Phase::Baseline, out),
            Some(since) => self.go(Phase::Release { since }, out),
            None => self.swept(None, out),
        }
    }

    /// What is due by time alone.
    pub(super) fn deadlines(&mut self, out: &mut Out<'_>) {
        self.watch_for_silence(out);
        self.watch_test(out);
        let is_testing = matches!(self.coil, Knowledge::Testing(_));
        let before = self.state();
        match &mut self.phase {
            // A test of the coil has a deadline of its own.
            Phase::Settling(_) if is_testing => {}
            Phase::Settling(settling) => {
                let settings = &self.configuration.settings;
                let least_s = Steadiness::least_s(settings.rate_hz);
                let allowed = span(settings.settling_s.max(least_s));
                if between(settling.began, out.now) > allowed {
                    let reason = if settling.rate_m_per_s.is_finite() {
                        let limit = settings.steady_m_per_s;
                        let rate = settling.rate_m_per_s;
                        Reason::new(RefusalReason::Unsteady, Some(rate), Some(limit))
                    } else {
                        let flagged = settling.flagged as f32;
                        Reason::new(RefusalReason::Flagged, Some(flagged), Some(0.0))
                    };
                    self.refuse(reason, out);
                }
            }
            Phase::Driving(measurement) => {
                let progress = measurement.drive.tick(out.now, out.converted);
                self.driven(progress, before, out);
            }
            Phase::Sweeping { drive, .. } => {
                let progress = drive.tick(out.now, out.converted);
                self.driven(progress, before, out);
            }
            Phase::Reporting { .. } => self.report_point(out),
            Phase::Manual(_) => self.watch_manual(out),
            _ => {}
        }
    }

    /// A train has gone on, perhaps from its peak to its ramps.
    fn driven(&mut self, progress: Progress, before: State, out: &mut Out<'_>) {
        if self.state() != before {
            self.announce(before, out);
        }
        self.progress(progress, out);
    }

    /// Sends the next point of the load's curve.
    fn report_point(&mut self, out: &mut Out<'_>) {
        let Phase::Reporting {
            report,
            next,
            touched,
        } = &mut self.phase
        else {
            return;
        };
        match (report.load_point(*next), *touched) {
            (Some(point), _) => {
                *next = next.saturating_add(1);
                out.record(Record::LoadPoint(point));
            }
            (None, Some(since)) => self.go(Phase::Release { since }, out),
            (None, None) => self.go(Phase::Baseline, out),
        }
    }

    /// A silent converter is a fault. Until it is configured it has longer.
    fn watch_for_silence(&mut self, out: &mut Out<'_>) {
        if matches!(self.phase, Phase::Fault(_)) {
            return;
        }
        let last_seen = self.last_seen.get_or_insert(out.now);
        let silent = between(*last_seen, out.now);
        let busy = between(*last_seen, self.configured);
        if silent <= together(busy, LEAST_SILENCE) {
            return;
        }
        let silent_s = in_seconds(silent).0;
        let allowed_s = self.allowed_silence_s() + in_seconds(busy).0;
        if silent_s > allowed_s {
            self.fail(
                Failure {
                    value: Some(silent_s),
                    limit: Some(allowed_s),
                    ..Failure::new(FaultCode::SensorSilent, Location::Sensor)
                },
                out,
            );
        }
    }

    /// How long a sensor may give nothing of use, s.
    pub(super) fn allowed_silence_s(&self) -> f32 {
        (SILENT_PERIODS / self.configuration.settings.rate_hz).max(SILENT_S)
    }

    /// Whether a measurement may be asked for now.
    pub(super) fn may_measure(&self) -> Result<Instant, Outcome> {
        self.phase.activity().ensure_free()?;
        if self.mode == Mode::SensingOnly {
            return Err(Outcome::SensingOnly);
        }
        if !self.armed {
            return Err(Outcome::NotArmed);
        }
        self.touched_since().ok_or(Outcome::NoContact)
    }
}
