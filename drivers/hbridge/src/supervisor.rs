//! Converts requests in ampere to drive orders; runs outside the interrupt.

use crate::averages::BLOCK;
use crate::blame::{Needs, SupplyDiagnosis};
use crate::correction::Correction;
use crate::current_line::CurrentLine;
use crate::drive::{Drive, DriveState, Fixed, Order, Orders, RawLine, Report};
use crate::energy::{Account, EnergyDemand, Load};
use crate::fault::{Fault, Refusal};
use crate::hardware::{CoilParameters, Hardware};
use crate::limits::Limits;
use crate::output::Shaper;
use crate::probe::{Next, Probe, Reach};
use crate::regulator::Gains;
use crate::ripple::Ripple;
use crate::self_test::{Findings, SELF_TEST_J, TARGET_A, TestPlan, evaluate};
use crate::watch::{ATTENDED_WITHIN, BALANCED_WITHIN, Bounds};

/// Relative change of supply or resistance at which the control law is recomputed: far smaller than
/// the changes that the law compensates by itself.
const CHANGE: f32 = 0.02;
/// Longest time that one poll may account for, us: otherwise a jump of the clock would erase
/// counted energy.
const MOST_ELAPSED_US: u32 = 1_000_000;
/// Largest tracking error of the current, as a fraction of the greatest setpoint.
const TRACKING_ERROR: f32 = 1.0 / 16.0;
/// Blocks over which each value of the resistance is computed: 16 ms at 16 us.
const RESISTANCE_BLOCKS: u32 = 64;

/// Converts requests to orders for a [`Drive`], and checks the drive's reports.
#[derive(Clone, Debug)]
pub struct Supervisor {
    hardware: Hardware,
    limits: Limits,
    findings: Option<Findings>,
    /// Supply, V, and resistance, ohm, for which the present control law was computed.
    made_for: (f32, f32),
    account: Account,
    /// Sum of level times current at the last poll.
    power: i64,
    /// Sums from which the next value of the resistance is computed.
    seen: (i32, i32, u32),
    resistance_ohm: Option<f32>,
    source: SupplyModel,
    latched: bool,
    probe: Probe,
    blame: SupplyDiagnosis,
    /// Measured value and limit of the latched fault, if that fault has numbers.
    found: Option<[f32; 2]>,
    /// Lowest reading of the supply since the last poll, V, if there were readings.
    lowest_v: Option<f32>,
    /// Setpoint at the last poll at which the drive was driving, units.
    setpoint: i32,
    reach: Reach,
}

/// Model of the supply as a voltage source with a resistance, and of the circuit without the
/// supply.
#[derive(Clone, Copy, Debug, Default)]
struct SupplyModel {
    /// Voltage without load.
    open_v: f32,
    /// Resistance of the supply.
    ohm: f32,
    /// Resistance of coil and bridge alone, if known.
    shorted_ohm: Option<f32>,
}

impl Supervisor {
    /// Creates a drive, switched off, and its supervisor.
    ///
    /// # Errors
    /// The first field that is out of range.
    pub fn new(hardware: Hardware, limits: Limits) -> Result<(Self, Drive), Refusal> {
        hardware.check()?;
        limits.check(&hardware)?;
        let full = i32::from(hardware.full_level);
        let twice_zero = 2 * i32::from(hardware.zero_count);
        let drive = Drive::new(Fixed {
            current: hardware.units(limits.setpoint_a),
            trip: hardware.units(limits.trip_a),
            bounds: Bounds {
                margin: full / 24,
                tracking: hardware.units(TRACKING_ERROR * limits.setpoint_a),
                on_periods: (limits.on_time_s / hardware.period_s) as u32,
            },
            reversed: hardware.ampere_per_count < 0.0,
            twice_zero,
            shaper: Shaper {
                full,
                decay: hardware.decay,
                coast_q8: 256,
            },
            top: (limits.duty * f32::from(hardware.full_level)) as i32,
            wake_periods: hardware.wake_periods(),
        });
        let supervisor = Self {
            hardware,
            limits,
            findings: None,
            made_for: (0.0, 0.0),
            account: Account::new(&hardware, &limits),
            power: 0,
            seen: (0, 0, 0),
            resistance_ohm: None,
            source: SupplyModel::default(),
            latched: false,
            probe: Probe::default(),
            blame: SupplyDiagnosis::default(),
            found: None,
            lowest_v: None,
            setpoint: 0,
            reach: Reach {
                currents: [0.5 * TARGET_A, limits.setpoint_a].map(|of| hardware.units(of)),
                tracking_error: hardware.units(TRACKING_ERROR * limits.setpoint_a),
                top: (0.95 * limits.duty * f32::from(hardware.full_level)) as i32,
            },
        };
        Ok((supervisor, drive))
    }

    /// The hardware parameters.
    #[must_use]
    pub const fn hardware(&self) -> &Hardware {
        &self.hardware
    }

    /// The hard limits.
    #[must_use]
    pub const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Results of the last self-test.
    #[must_use]
    pub const fn findings(&self) -> Option<&Findings> {
        self.findings.as_ref()
    }

    /// Resistance of the circuit, ohm, from the last 16 ms in which more than half an ampere
    /// flowed. Less the resistance of bridge and supply, it shows the copper's temperature.
    #[must_use]
    pub const fn resistance_ohm(&self) -> Option<f32> {
        self.resistance_ohm
    }

    /// The PWM ripple, which adds to the effect of the mean current; `None` before a coil is known.
    #[must_use]
    pub fn ripple(&self) -> Option<Ripple> {
        let Findings { coil, .. } = self.findings.as_ref()?;
        let SupplyModel {
            open_v,
            ohm,
            shorted_ohm,
        } = self.source;
        Some(Ripple {
            open_v,
            source_ohm: ohm,
            resistance_ohm: shorted_ohm.unwrap_or(coil.resistance_ohm),
            inductance_h: coil.inductance_h,
            period_s: self.hardware.period_s,
        })
    }

    /// Net energy that the circuit has taken.
    #[must_use]
    pub const fn account(&self) -> &Account {
        &self.account
    }

    /// Adds energy that the circuit took before this supervisor was created, for example before a
    /// reset.
    pub fn charge(&mut self, energy_j: f32) {
        self.account.charge(energy_j);
    }

    /// Whether the cause of the latched fault is known, which takes at most 6 ms after the bridge
    /// switched off: a weak supply may be the cause, and its reading lags behind.
    #[must_use]
    pub const fn is_cause_known(&self) -> bool {
        self.blame.is_settled()
    }

    /// Measured value and limit of a latched fault. Current faults: A. Supply faults, V: lowest
    /// reading and voltage needed, or highest reading and limit. Energy: J. On-time: s. `None` for
    /// faults without numbers.
    #[must_use]
    pub const fn value_and_limit(&self, fault: Fault) -> Option<[f32; 2]> {
        match fault {
            Fault::SupplyLow => self.blame.low_v,
            _ => self.found,
        }
    }

    /// Orders a self-test.
    ///
    /// # Errors
    /// A fault is latched, a test is running, the supply is outside its limits, or the energy
    /// account has too little left.
    pub fn test(&mut self, report: &Report, supply_v: f32) -> Result<Order, Refusal> {
        match report.state {
            DriveState::Latched(fault) => return Err(Refusal::Latched(fault)),
            DriveState::Testing => return Err(Refusal::Testing),
            DriveState::Off { .. } | DriveState::Driving => {}
        }
        let [low_v, high_v] = self.limits.supply_v;
        if !(low_v..=high_v).contains(&supply_v) {
            return Err(Refusal::Supply(supply_v));
        }
        if self.account.energy_j() + SELF_TEST_J > self.account.usable_j() {
            return Err(Refusal::Energy(SELF_TEST_J));
        }
        self.account.charge(SELF_TEST_J);
        self.findings = None;
        if report.state != DriveState::Driving {
            self.source.open_v = supply_v;
        }
        let full = i32::from(self.hardware.full_level);
        let target = self.hardware.units(TARGET_A);
        // The test needs at most the voltage that drives the target current through the greatest
        // resistance.
        let [_, most_ohm] = self.limits.resistance_ohm;
        let most = (TARGET_A * most_ohm / supply_v).min(self.limits.duty);
        Ok(Order(Orders::Test(TestPlan {
            full,
            most: (most * full as f32) as i32,
            target,
            too_much: 3 * target,
            test_limit: self.hardware.reduced_limit_a.is_some(),
            wake_periods: self.hardware.wake_periods(),
            twice_zero: [
                2 * i32::from(self.hardware.zero_count),
                2 * i32::from(self.hardware.zero_tolerance),
            ],
        })))
    }

    /// Orders a straight line of the current. A bridge that is off wakes first; a line whose start
    /// time comes earlier starts when the bridge is awake. `now_us` reads the clock of the start
    /// time. It is called again after the checks, since they take 0.2 ms on a processor without
    /// floating point. Apply the order at once.
    ///
    /// # Errors
    /// No coil is known, a fault is latched, or a limit would be exceeded; [`Refusal::Energy`] if
    /// the line would take more energy than is left: [`Account::time_until_s`] returns how long to
    /// wait.
    pub fn follow(
        &self,
        report: &Report,
        line: &CurrentLine,
        now_us: impl Fn() -> u64,
    ) -> Result<Order, Refusal> {
        match report.state {
            DriveState::Latched(fault) => return Err(Refusal::Latched(fault)),
            DriveState::Testing => return Err(Refusal::Testing),
            DriveState::Off { tested: false } => return Err(Refusal::NotTested),
            DriveState::Off { tested: true } | DriveState::Driving => {}
        }
        let findings = self.findings.ok_or(Refusal::NotTested)?;
        let checked_us = now_us();
        line.check(&self.limits, checked_us)?;
        let is_off = report.state != DriveState::Driving;
        let wakes_s = if is_off { self.hardware.wake_s } else { 0.0 };
        let ahead_s = line.ahead_s(checked_us);
        let (supply_v, _) = self.made_for;
        let mut demand = EnergyDemand::new(
            &self.account,
            Load {
                resistance_ohm: self.resistance_ohm.unwrap_or(findings.coil.resistance_ohm),
                lost_v: findings.coil.dead_time_share * supply_v,
            },
        );
        demand.starts_at(report.setpoint as f32 * self.hardware.ampere_per_unit());
        if ahead_s > 0.0 {
            demand.line(line.from_a, ahead_s);
        }
        demand.line(line.to_a, line.over_s);
        if !self.account.allows(&demand) {
            return Err(Refusal::Energy(demand.most_j()));
        }
        let last = self.raw(line.to_a, line.over_s);
        let ahead_s = line.ahead_s(now_us());
        let from_a = if ahead_s > 0.0 { line.from_a } else { 0.0 };
        let ahead_s = ahead_s.max(wakes_s);
        Ok(Order(if ahead_s > 0.0 {
            Orders::Run {
                line: self.raw(from_a, ahead_s),
                next: Some(last),
            }
        } else {
            Orders::Run {
                line: last,
                next: None,
            }
        }))
    }

    /// Converts a line to the drive's integers.
    fn raw(&self, to_a: f32, over_s: f32) -> RawLine {
        RawLine {
            to: self.hardware.units(to_a),
            periods: (over_s / self.hardware.period_s + 0.5) as u32,
        }
    }

    /// Orders the bridge off.
    #[must_use]
    pub const fn stop() -> Order {
        Order(Orders::Stop)
    }

    /// Clears a fault: the bridge stays off, and may be driven if a coil is known.
    #[must_use]
    pub const fn clear() -> Order {
        Order(Orders::Clear)
    }

    /// Orders a correction of the measured current from now on. Only the trip level stays
    /// uncorrected: it applies to the converter's reading.
    #[must_use]
    pub const fn correct(correction: Correction) -> Order {
        Order(Orders::Correct(correction))
    }

    /// Evaluates the drive's report and returns the next order for the drive; call it about every
    /// millisecond. `supply_v` is the measured supply, `elapsed_us` the time since the last call.
    ///
    /// Without this call a drive switches itself off after
    /// [`ATTENDED_WITHIN`](crate::ATTENDED_WITHIN) periods.
    pub fn attend(&mut self, report: &Report, supply_v: f32, elapsed_us: u32) -> Order {
        self.count_energy(report, supply_v, elapsed_us);
        let gave_way = self.gave_way(report, supply_v, elapsed_us);
        let active = matches!(report.state, DriveState::Testing | DriveState::Driving);
        self.follow_fault(report, elapsed_us);
        if !active {
            self.source.open_v = supply_v;
        }
        let [low_v, high_v] = self.limits.supply_v;
        let orders = if active && (supply_v.is_nan() || supply_v < low_v) {
            self.blame.low_v = Some([supply_v, low_v]);
            Orders::Latch(Fault::SupplyLow)
        } else if gave_way {
            Orders::Cause(Fault::SupplyLow)
        } else if active && supply_v > high_v {
            self.found = Some([supply_v, high_v]);
            Orders::Latch(Fault::SupplyHigh)
        } else if active && self.account.is_used_up() {
            self.found = Some([self.account.energy_j(), self.account.usable_j()]);
            Orders::Latch(Fault::Energy)
        } else if let Some(sums) = report.outcome {
            match evaluate(&sums, &self.hardware, &self.limits, supply_v) {
                Ok((findings, twice_zero)) => self.fit(findings, twice_zero, supply_v),
                Err(fault) => Orders::Latch(fault),
            }
        } else {
            self.follow_resistance(report, supply_v);
            match self.probe.poll(report, &self.reach) {
                Next::Nothing => self.adapt(supply_v),
                Next::Hold(units) => Orders::Hold(units),
                Next::Frozen => Orders::Latch(Fault::SenseFrozen),
            }
        };
        Order(orders)
    }

    /// Records measured value and limit of a fault that the drive has detected by itself.
    fn follow_fault(&mut self, report: &Report, elapsed_us: u32) {
        let DriveState::Latched(fault) = report.state else {
            self.found = None;
            return;
        };
        if self.found.is_some() {
            return;
        }
        let periods_s = |periods: u32| periods as f32 * self.hardware.period_s;
        self.found = match fault {
            Fault::OverCurrent => {
                let tripped_a = report.tripped as f32 * self.hardware.ampere_per_unit();
                Some([tripped_a, self.limits.trip_a])
            }
            Fault::OnTime => Some([periods_s(report.on_periods), self.limits.on_time_s]),
            Fault::Unattended => Some([elapsed_us as f32 * 1e-6, periods_s(ATTENDED_WITHIN)]),
            _ => None,
        };
    }

    /// Takes a reading of the supply. If [`attend`](Self::attend) receives a smoothed value, call
    /// this before each `attend` with the latest reading, and with the reading at the moment at
    /// which the bridge switched off. The lowest of these readings shows whether a supply that
    /// broke down caused a missing current.
    pub fn read_supply(&mut self, reading_v: f32) {
        let lowest_v = self
            .lowest_v
            .map_or(reading_v, |so_far_v| so_far_v.min(reading_v));
        self.lowest_v = Some(lowest_v);
    }

    /// Whether the supply caused the latched fault.
    fn gave_way(&mut self, report: &Report, supply_v: f32, elapsed_us: u32) -> bool {
        if report.state == DriveState::Driving {
            self.setpoint = report.setpoint;
        }
        let latest_v = self.lowest_v.take().unwrap_or(supply_v);
        let [limit_v, _] = self.limits.supply_v;
        let tested_ohm = self.findings.map_or(0.0, |found| found.coil.resistance_ohm);
        let setpoint_a = self.setpoint as f32 * self.hardware.ampere_per_unit();
        let needs = Needs {
            limit_v,
            open_v: self.source.open_v,
            setpoint_v: setpoint_a.abs() * tested_ohm / self.limits.duty,
        };
        self.blame.follow(report, latest_v, elapsed_us, &needs)
    }

    fn count_energy(&mut self, report: &Report, supply_v: f32, elapsed_us: u32) {
        let elapsed_s = elapsed_us.min(MOST_ELAPSED_US) as f32 * 1e-6;
        let work = report.power.wrapping_sub(self.power);
        self.power = report.power;
        let full = f32::from(self.hardware.full_level);
        let step_j = supply_v / full * self.hardware.ampere_per_unit() * self.hardware.period_s;
        self.account.pass(work as f32 * step_j, elapsed_s);
        let was_latched = core::mem::replace(
            &mut self.latched,
            matches!(report.state, DriveState::Latched(_)),
        );
        if self.latched && !was_latched {
            // Energy that may have flowed unmeasured before the fault was detected.
            let found_s = BALANCED_WITHIN as f32 * self.hardware.period_s;
            let [_, most_v] = self.limits.supply_v;
            self.account.charge(found_s * most_v * self.limits.trip_a);
        }
    }

    fn fit(&mut self, findings: Findings, twice_zero: i32, supply_v: f32) -> Orders {
        match self.gains(&findings.coil, supply_v) {
            Ok(gains) => {
                self.findings = Some(findings);
                self.made_for = (supply_v, findings.coil.resistance_ohm);
                self.resistance_ohm = Some(findings.coil.resistance_ohm);
                Orders::Fit {
                    twice_zero,
                    gains,
                    coast_q8: self.coast_q8(supply_v),
                }
            }
            Err(_) => Orders::Latch(Fault::NotACoil),
        }
    }

    /// Returns an order with the control law for the present supply and resistance, if they have
    /// changed.
    fn adapt(&mut self, supply_v: f32) -> Orders {
        let Some(findings) = self.findings else {
            return Orders::Attended;
        };
        // Range of the resistance of heated copper: a slowly developing short beyond it is not
        // compensated.
        let tested_ohm = findings.coil.resistance_ohm;
        let now_ohm = self.resistance_ohm.unwrap_or(tested_ohm);
        // Not `clamp`, which panics if a limit is NaN.
        let resistance_ohm = now_ohm.max(0.6 * tested_ohm).min(1.6 * tested_ohm);
        let (before_v, before_ohm) = self.made_for;
        let changed = |now: f32, before: f32| (now - before).abs() > CHANGE * before;
        if !changed(supply_v, before_v) && !changed(resistance_ohm, before_ohm) {
            return Orders::Attended;
        }
        let coil = CoilParameters {
            resistance_ohm,
            ..findings.coil
        };
        match self.gains(&coil, supply_v) {
            Ok(gains) => {
                self.made_for = (supply_v, resistance_ohm);
                Orders::Adapt {
                    gains,
                    coast_q8: self.coast_q8(supply_v),
                }
            }
            Err(_) => Orders::Attended,
        }
    }

    fn gains(&self, coil: &CoilParameters, supply_v: f32) -> Result<Gains, Refusal> {
        Gains::new(&self.hardware, &self.limits, coil, supply_v)
    }

    fn coast_q8(&self, supply_v: f32) -> i32 {
        (256.0 * supply_v / (supply_v + 2.0 * self.hardware.diode_v)) as i32
    }

    fn follow_resistance(&mut self, report: &Report, supply_v: f32) {
        let (levels, units, blocks) = self.seen;
        if report.state != DriveState::Driving {
            self.seen = (report.levels, report.units, report.blocks);
            return;
        }
        let passed = report.blocks.wrapping_sub(blocks);
        if passed < RESISTANCE_BLOCKS {
            return;
        }
        self.seen = (report.levels, report.units, report.blocks);
        let periods = (passed * BLOCK) as f32;
        let mean_a =
            report.units.wrapping_sub(units) as f32 / periods * self.hardware.ampere_per_unit();
        let level = report.levels.wrapping_sub(levels) as f32 / periods;
        let lost = self
            .findings
            .map_or(0.0, |found| found.coil.dead_time_share);
        if mean_a.abs() > 0.5 * TARGET_A {
            let share = level / f32::from(self.hardware.full_level);
            let share = if mean_a > 0.0 {
                share - lost
            } else {
                share + lost
            };
            let seen_ohm = share * supply_v / mean_a;
            self.resistance_ohm = Some(seen_ohm);
            self.source
                .follow(share.abs(), mean_a.abs(), supply_v, seen_ohm);
        }
    }
}

impl SupplyModel {
    /// Updates the model from the fraction d of a period for which the supply drives, the mean
    /// current I, the measured supply and the apparent resistance. The supply's resistance r lowers
    /// its mean voltage to V = V₀ − r d I. With d = R I/(V₀ − r I), the apparent resistance V d/I
    /// is R + r d (1 − d), where R is the resistance of coil and bridge.
    fn follow(&mut self, share: f32, mean_a: f32, supply_v: f32, seen_ohm: f32) {
        let ohm = (self.open_v - supply_v) / (share * mean_a);
        self.ohm = if ohm > 0.0 { ohm } else { 0.0 };
        self.shorted_ohm = Some(seen_ohm - self.ohm * share * (1.0 - share));
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;
    use crate::hardware::EXAMPLE as HARDWARE;
    use crate::limits::EXAMPLE as LIMITS;

    #[test]
    fn a_line_begins_at_its_time_however_long_its_check_takes() {
        let (mut supervisor, drive) = Supervisor::new(HARDWARE, LIMITS).unwrap();
        supervisor.findings = Some(Findings {
            zero_count: 2048.0,
            coil: CoilParameters {
                resistance_ohm: 0.4,
                inductance_h: 40e-6,
                dead_time_share: 0.05,
            },
            limited_to_a: None,
        });
        let report = Report {
            state: DriveState::Off { tested: true },
            ..drive.report()
        };
        let line = CurrentLine {
            start_us: 10_000,
            from_a: 8.0,
            to_a: 2.0,
            over_s: 60e-3,
        };
        let now_us = Cell::new(8_000);
        let clock = || now_us.replace(now_us.get() + 400);
        let order = supervisor.follow(&report, &line, clock).unwrap();
        let Orders::Run { line, next } = order.0 else {
            panic!("{order:?}")
        };
        assert_eq!(line.periods, 1_600 / 16);
        assert_eq!(next.map(|line| line.periods), Some(3_750));
    }
}
