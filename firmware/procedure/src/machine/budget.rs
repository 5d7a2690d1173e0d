//! Checks a current profile before it starts against two limits: the coil's temperature, and the
//! remaining energy of its drive, computed by the drive's own law and constants ([`Account`]). A profile
//! beyond a limit is refused with the time to wait.

use coil_hbridge::{Account, CurrentLine, EnergyDemand, Load, SELF_TEST_J};
use palpate_model::units::Celsius;
use palpate_wire::code::{Part, RefusalReason};
use palpate_wire::record::CoilTest;

use super::Procedure;
use super::state::Budget;
use crate::event::Scan;
use crate::heat::{Forecast, Heat};
use crate::measurement::Reason;
use crate::measurement::train::TrainProfile;
use crate::time::{Instant, in_seconds, seconds};

/// Factor on the forecast energy that allows for the heat of the current's ripple, which adds at most
/// 1.5 % to the square of the current (decision 40).
const RIPPLE: f32 = 1.02;
/// Factor on the coil's resistance, which raises the forecast of the energy that the drive will count.
/// It allows for the inaccuracy of the drive's account: supply and current are read a millisecond apart,
/// and the supply is filtered. On circuits of 0.23 to 0.55 ohm and 20 to 200 uH at 8 and 12 V the count
/// is 0.913 to 1.013 of the forecast without this factor (`the_forecast_is_what_the_drive_counts` in
/// sim-host/tests/integration/energy.rs).
const RESERVE: f32 = 1.03;
/// Time added to every wait, s: the drive's account at rest is reported up to 0.07 s late.
const LATE_S: f32 = 0.1;

/// Reason why the coil may not be driven at this time, and the time to wait; `None` if waiting does not
/// help.
pub(super) struct DriveRefusal {
    pub(super) reason: Reason,
    pub(super) wait_s: Option<f32>,
}

impl Procedure {
    /// Stores the drive's account and the current.
    pub(super) fn take_account(&mut self, scan: &Scan, now: Instant) {
        self.budget.account = scan.account.map(|account| (now, account));
        self.budget.current = scan.measured_current().unwrap_or_default();
    }

    /// Stores the result of the coil test that started at `begun`.
    pub(super) fn take_load(&mut self, found: &CoilTest, begun: Instant) {
        self.budget.tested = begun;
        let load = Load {
            resistance_ohm: found.resistance_ohm,
            lost_v: found.lost * found.supply_v,
        };
        self.budget.load = self.heat.as_ref().map(|heat| (load, heat.pad()));
    }

    /// Records the time up to which the coil is driven.
    pub(super) fn follow_drive(&mut self, now: Instant) {
        if self.phase.activity().drives() {
            self.budget.driven = now;
        }
    }

    /// Returns whether the coil can take the train.
    pub(super) fn may_take_train(&self, now: Instant) -> Result<(), DriveRefusal> {
        let never = |code, value, limit| {
            Err(DriveRefusal {
                reason: Reason::new(code, value, limit),
                wait_s: None,
            })
        };
        let settings = &self.configuration.settings;
        let limits = &self.board.limits;
        let Some(heat) = &self.heat else {
            let part = Part::Coil.number();
            return never(RefusalReason::NotCalibrated, Some(part.into()), None);
        };
        let profile = TrainProfile::new(settings);
        let longest = profile.longest();
        let limit_c = self.hottest();
        let forecast = heat.forecast(&longest, limit_c);
        let energy_j = RIPPLE * forecast.energy_j;
        let limit_j = settings.greatest_energy_j.min(limits.energy_j);
        let takes_s = in_seconds(profile.duration()).0;
        // Too much energy is a final refusal only if the copper is not too hot. Hot copper takes more
        // energy, so after cooling the train may need less.
        let is_too_much = energy_j.is_nan() || energy_j > limit_j;
        if forecast.hottest.is_some() && is_too_much {
            return never(RefusalReason::TooMuchEnergy, Some(energy_j), Some(limit_j));
        }
        if takes_s > limits.on_time_s {
            return never(
                RefusalReason::TimedOut,
                Some(takes_s),
                Some(limits.on_time_s),
            );
        }
        let energy = self.train_fits(heat, &longest, forecast, now);
        if forecast.hottest.is_some() {
            return energy;
        }
        // The wait is the longer of two times: for the copper's temperature and for the drive's account.
        let cool_s = heat.wait_s(&longest, limit_c);
        let wait_s = match energy {
            Ok(()) => cool_s,
            Err(DriveRefusal { wait_s, .. }) => cool_s
                .zip(wait_s)
                .map(|(cool_s, wait_s)| cool_s.max(wait_s)),
        };
        Err(DriveRefusal {
            reason: Reason::new(
                RefusalReason::CoilTooHot,
                Some(heat.copper().0),
                Some(limit_c.0),
            ),
            wait_s,
        })
    }

    /// Returns whether the coil can take a commanded line of current.
    pub(super) fn may_take_line(
        &self,
        line: &CurrentLine,
        now: Instant,
    ) -> Result<(), DriveRefusal> {
        let Some(heat) = &self.heat else {
            return Ok(());
        };
        let copper = heat.copper();
        let limit = self.hottest();
        // A copper temperature of NaN counts as too hot.
        if copper.0.is_nan() || copper > limit {
            let profile = TrainProfile::new(&self.configuration.settings);
            return Err(DriveRefusal {
                reason: Reason::new(RefusalReason::CoilTooHot, Some(copper.0), Some(limit.0)),
                wait_s: heat.wait_s(&profile, limit),
            });
        }
        self.fits(heat, copper, now, |demand| {
            demand.starts_at(self.budget.current.0);
            demand.line(line.to_a, line.over_s);
        })
    }

    fn hottest(&self) -> Celsius {
        let settings_c = self.configuration.settings.greatest_temperature_c;
        Celsius(settings_c.min(self.board.limits.temperature.0))
    }

    fn train_fits(
        &self,
        heat: &Heat,
        profile: &TrainProfile,
        forecast: Forecast,
        now: Instant,
    ) -> Result<(), DriveRefusal> {
        let hottest = forecast.hottest.unwrap_or_else(|| self.hottest());
        self.fits(heat, hottest, now, |demand| {
            for (to, over) in profile.lines() {
                demand.line(to.0, in_seconds(over).0);
            }
        })
    }

    /// Returns whether the drive's account can take a profile with the copper at temperature `hottest`.
    fn fits(
        &self,
        heat: &Heat,
        hottest: Celsius,
        now: Instant,
        profile: impl FnOnce(&mut EnergyDemand),
    ) -> Result<(), DriveRefusal> {
        // Without a known load the energy cannot be forecast. The drive itself still enforces the limit.
        let Some(load) = self.load_at(heat, hottest) else {
            return Ok(());
        };
        let Some(account) = self.account(load, now) else {
            return Ok(());
        };
        let mut demand = EnergyDemand::new(&account, load);
        profile(&mut demand);
        if account.allows(&demand) {
            return Ok(());
        }
        let energy_j = account.energy_j() + demand.most_j();
        Err(DriveRefusal {
            reason: Reason::new(
                RefusalReason::TooMuchEnergy,
                Some(energy_j),
                Some(account.usable_j()),
            ),
            wait_s: account.wait_s(&demand).map(|wait_s| wait_s + LATE_S),
        })
    }

    /// Returns the load with the copper at a temperature: the load at the coil test, and the rise in
    /// resistance since the test by the coil's calibration.
    fn load_at(&self, heat: &Heat, hottest: Celsius) -> Option<Load> {
        let (found, then) = self.budget.load?;
        let gained_ohm = heat.resistance(hottest).0 - heat.resistance(then).0;
        Some(Load {
            resistance_ohm: RESERVE * (found.resistance_ohm + gained_ohm.max(0.0)),
            lost_v: found.lost_v,
        })
    }

    /// Returns an upper bound of the drive's account at this time. Since the report, it assumes peak
    /// current for as long as the coil was driven, and a coil test if one has started.
    fn account(&self, load: Load, now: Instant) -> Option<Account> {
        let Budget { tested, driven, .. } = self.budget;
        let (reported, mut account) = self.budget.account?;
        let peak_a = self.configuration.settings.peak_current_a;
        let mut unseen = EnergyDemand::new(&account, load);
        unseen.starts_at(peak_a);
        unseen.line(peak_a, seconds(reported, driven).0);
        account.charge(unseen.most_j());
        if reported <= tested {
            account.charge(SELF_TEST_J);
        }
        account.pass(0.0, seconds(reported.max(driven), now).0);
        Some(account)
    }
}
