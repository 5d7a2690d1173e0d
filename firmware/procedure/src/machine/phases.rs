//! Phases and their transitions.

use palpate_model::contact::Touch;
use palpate_model::units::Second;
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Location, Mode, Outcome, RefusalReason, State};

use super::budget::DriveRefusal;
use super::state::{CoilTestState, Phase, Settling};
use super::{Out, Procedure};
use crate::action::Action;
use crate::deformation::{Deformation, Follower};
use crate::event::{Failure, Scan};
use crate::measurement::{
    Measurement, MeasurementOutcome, Progress, Reason, TrainDrive, metres, refusal,
};
use crate::relaxation::Level;
use crate::steadiness::Steadiness;
use crate::time::{Duration, Instant, between, in_seconds, seconds, span, together};

/// Number of consecutive good conversions that prove sensor, clock and bus.
const SELF_TEST_CONVERSIONS: u8 = 10;

/// The sensor counts as silent after this number of conversion periods without a conversion, but not
/// before [`SILENT_S`].
const SILENT_PERIODS: f32 = 10.0;
/// Least time without a conversion, s, after which the sensor counts as silent: the recovery of the bus
/// may take 50 ms.
const SILENT_S: f32 = 0.05;
/// Silence below this is not evaluated further: the recovery of the bus may take 50 ms.
const LEAST_SILENCE: Duration = Duration::from_ticks(50_000);

/// Returns the time `ago` before `moment`.
fn before(moment: Instant, ago: Second) -> Instant {
    Instant::from_ticks(moment.as_ticks().saturating_sub(span(ago.0).as_ticks()))
}

impl Procedure {
    /// Handles a scan of the first converter, with the deformation at its principal channel.
    pub(super) fn principal(
        &mut self,
        scan: &Scan,
        deformation: Option<Deformation>,
        interval: Second,
        out: &mut Out<'_>,
    ) {
        let touch = deformation.map(|of| of.touch);
        let all_good = scan.conversions.iter().all(|of| of.reading.is_good());
        self.follow_held(deformation, (scan.middle, interval), out);
        let settings = &self.configuration.settings;
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
                // Enters the phase only if it is new, to avoid copying two kilobytes.
                Some(Touch::Clear) if self.state() != State::Watching => {
                    self.go(Phase::Watching, out);
                }
                _ => {}
            },
            // This may be the first sign of a release: the object may have left while the coil was
            // driven and contact was not checked.
            Phase::Contact { .. } | Phase::Release { .. }
                if deformation.is_some_and(|of| of.is_untouched()) =>
            {
                self.go(Phase::Baseline, out);
            }
            // The remaining points of the load's curve are still sent, since their number was announced.
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
            // A good conversion of the first converter ends only the fault of its own silence, not that
            // of the second converter.
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

    /// Handles the start of a touch.
    fn touched(&mut self, since: Instant, out: &mut Out<'_>) {
        self.go(Phase::Contact { since }, out);
        if self.armed && self.configuration.settings.automatic {
            self.begin_settling(since, out);
        }
    }

    /// Returns the start of the present touch.
    pub(super) const fn touched_since(&self) -> Option<Instant> {
        match &self.phase {
            Phase::Contact { since } | Phase::Release { since } => Some(*since),
            _ => None,
        }
    }

    /// Starts a requested measurement.
    pub(super) fn begin_asked(&mut self, out: &mut Out<'_>) -> Outcome {
        match self.may_measure() {
            Ok(touched) => {
                // A train that the coil cannot take now is refused now: it is unlikely to be possible a
                // second later, when the press has settled.
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

    /// Handles a conversion while the press settles. `rate`, in m/s, is known at the end of a block.
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
        let before = Level {
            at: settling.last.unwrap_or(out.now),
            deformation: settling.steadiness.mean().unwrap_or(deformation.value),
            mean_age: deformation.mean_age,
        };
        // An automatic measurement may settle before the coil is tested; it then waits for the test.
        if self.coil_is_tested(out) {
            self.begin_measurement((touched, before), out);
        }
    }

    /// Follows a press that is held after its estimate, as long as the coil is at rest.
    fn follow_held(
        &mut self,
        deformation: Option<Deformation>,
        conversion: (Instant, Second),
        out: &mut Out<'_>,
    ) {
        let at_rest = matches!(self.phase, Phase::Reporting { .. } | Phase::Release { .. });
        let steady_m_per_s = self.configuration.settings.steady_m_per_s;
        match (&mut self.held, deformation) {
            (Some(held), Some(deformation)) if at_rest && !deformation.is_untouched() => {
                if let Some(record) = held.push(conversion, &deformation, steady_m_per_s) {
                    out.record(Record::Relaxation(record));
                }
            }
            (Some(_), None) if at_rest => {}
            _ => self.held = None,
        }
    }

    #[inline(never)]
    fn begin_measurement(&mut self, press: (Instant, Level), out: &mut Out<'_>) {
        if !self.check_all(out) {
            return;
        }
        if let Some(moved) = self.principal_follower().and_then(Follower::rest_moved) {
            let (reading, limit) = (metres(moved.reading), metres(moved.limit));
            return self.refuse(Reason::new(RefusalReason::RestMoved, reading, limit), out);
        }
        if let Some((distance_m, within_m)) = self.touching.off_centre {
            let reason = RefusalReason::OffCentre;
            return self.refuse(Reason::new(reason, Some(distance_m), Some(within_m)), out);
        }
        // The temperature is measured before the train, as at the calibration on the bench.
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
            Measurement::start(self.measurement, calibrated, press, settings, started);
        // The records contain all inputs of an estimate, so that it can be recomputed from them. This
        // status contains the temperature.
        out.record(Record::Status(self.status()));
        self.go(Phase::Driving(measurement), out);
        out.push(Action::Current(line));
    }

    // Inlined: what usually follows a conversion, nothing, is then in RAM, and the rest in flash.
    #[inline(always)]
    fn progress(&mut self, progress: Progress, out: &mut Out<'_>) {
        if !matches!(progress, Progress::On(None)) {
            self.progressed(progress, out);
        }
    }

    #[inline(never)]
    fn progressed(&mut self, progress: Progress, out: &mut Out<'_>) {
        match progress {
            Progress::On(None) => {}
            Progress::On(Some(line)) => out.push(Action::Current(line)),
            Progress::Done => self.conclude(out),
            Progress::Refused(reason) => self.refuse(reason, out),
            Progress::Failed(failure) => self.fail(failure, out),
        }
    }

    /// Ends the ramps: switches the bridge off, and sends the result.
    fn conclude(&mut self, out: &mut Out<'_>) {
        self.safe(Outcome::Aborted, out);
        if let Phase::Sweeping { touched, .. } = self.phase {
            return self.swept(touched, out);
        }
        // The measurement is used in place: it is the largest object, and the stack is small.
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
                self.held = measurement.held(&report.estimate, self.configuration.creep());
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

    /// Ends a train for calibration. The train's effect on an untouched sensor's readings does not enter
    /// the baseline.
    pub(super) fn swept(&mut self, touched: Option<Instant>, out: &mut Out<'_>) {
        match touched {
            Some(since) => self.go(Phase::Release { since }, out),
            None => {
                self.learn_baseline();
                self.go(Phase::Baseline, out);
            }
        }
    }

    /// Starts a train for calibration.
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

    /// Ends a measurement or its attempt with a reason. Switches the bridge off first.
    pub(super) fn refuse(&mut self, reason: Reason, out: &mut Out<'_>) {
        let wait_s = None;
        self.hindered(&DriveRefusal { reason, wait_s }, out);
    }

    /// As [`refuse`](Self::refuse), with the time after which the measurement may be requested again.
    pub(super) fn hindered(&mut self, hindrance: &DriveRefusal, out: &mut Out<'_>) {
        let &DriveRefusal { reason, wait_s } = hindrance;
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
            // The release was detected already, so the baseline is learnt from here on.
            Some(_) if reason.code == RefusalReason::ContactLost => self.go(Phase::Baseline, out),
            Some(since) => self.go(Phase::Release { since }, out),
            None => self.swept(None, out),
        }
    }

    /// Checks the deadlines of the phases.
    pub(super) fn deadlines(&mut self, out: &mut Out<'_>) {
        self.watch_for_silence(out);
        self.watch_test(out);
        let is_testing = matches!(self.coil, CoilTestState::Testing(_));
        let before = self.state();
        let can_read_flash = self.can_read_flash();
        match &mut self.phase {
            // A test of the coil has its own deadline.
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
            Phase::Reporting { .. } if can_read_flash => self.report_point(out),
            Phase::Manual(_) => self.watch_manual(out),
            _ => {}
        }
    }

    /// Reports a change from peak to ramps, and handles the progress of the train.
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

    /// Raises a fault for a silent converter, with a longer limit during its configuration.
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

    /// Returns the longest time without a usable reading, s.
    pub(super) fn allowed_silence_s(&self) -> f32 {
        (SILENT_PERIODS / self.configuration.settings.rate_hz).max(SILENT_S)
    }

    /// Checks that a measurement may be requested at this time.
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
