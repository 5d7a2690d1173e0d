//! Control law of the regulator: predicts the current at the end of this period, and computes the
//! voltage that brings it to its setpoint at the end of the next.
//!
//! All in integers. Currents are in units of half a count of the converter, since two samples are
//! added; voltages are in levels of the PWM, that is in fractions of the supply. With u the level,
//! V the supply and F the level that is always high, a period of length T changes the current by
//!
//! di = pull (u - drop i),  pull = V/(R F) (1 - exp(-R T/L)),  drop = R F/V.
//!
//! Samples are taken at the start and in the middle of a period of phase-correct PWM. There the
//! ripple passes through its mean, so the mean of the two samples is the current a quarter of a
//! period after the start, and three quarters of the change di are still to come.

use crate::fault::Refusal;
use crate::hardware::{CoilParameters, Hardware};
use crate::limits::Limits;
use crate::line::{FixedPointLine, Setpoint};

/// Fractional bits of a level.
pub(crate) const LEVEL: u32 = 12;
/// Fraction of a current error that the next period is to remove, in eighths. Seven leave a
/// margin for an inductance that is an eighth lower than the tested one.
const EIGHTHS: i32 = 7;

/// Fraction of the unexplained voltage of one period that is learned as lasting, as a negative
/// power of two: a quarter.
const LEARN_SHIFT: u32 = 2;

/// Periods between two trims of the level while the current is at its setpoint.
const TRIM_PERIODS: u32 = 8;
/// Each trim learns as lasting this fraction of the voltage that the mean current error needs
/// across the resistance, as a negative power of two: half.
const FOREVER_SHIFT: u32 = 1;
/// Fraction of the voltage that would remove the mean error in one period, as a negative power of
/// two: an eighth, so that eight periods remove all of it. `TRIM_PERIODS`, `FOREVER_SHIFT` and
/// `TRIM_SHIFT` were chosen together: with neighbouring values, ramps or repeatability at the
/// converter's wide codes miss the limits of `coil_drive`.
const TRIM_SHIFT: u32 = 3;

/// Factors of the control law as integers, derived from the parameters of hardware and coil.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Gains {
    /// 1/pull: change of the level for a change of the current within one period, in levels of
    /// 2^-12 per unit.
    pub(crate) kick: i32,
    /// Level that overcomes the resistance, in levels of 2^-12 per unit of current.
    pub(crate) drop: i32,
    /// Change of the current in one period, in units of 2^-10 per level.
    pub(crate) pull: i32,
    /// Level lost to dead time, in 2^-12.
    pub(crate) lost: i32,
    /// Greatest level, in 2^-12.
    pub(crate) most: i32,
    /// Greatest current error or change that the law uses, in sixteenths of a unit.
    reach: i32,
}

impl Gains {
    /// Computes the gains for a coil and a supply.
    pub(crate) fn new(
        hardware: &Hardware,
        limits: &Limits,
        coil: &CoilParameters,
        supply_v: f32,
    ) -> Result<Self, Refusal> {
        let full = f32::from(hardware.full_level);
        let unit_a = hardware.ampere_per_unit();
        // (1 - exp(-x))/x with x = R T/L, within 0.1 % for x below 1: as the current changes within
        // a period, the resistance slows the change down.
        let x = hardware.period_s / coil.time_constant_s();
        let slowed = 1.0 / (1.0 + x * (0.5 + x / 12.0));
        let pull = supply_v * hardware.period_s * slowed / (coil.inductance_h * full * unit_a);
        let drop = coil.resistance_ohm * unit_a * full / supply_v;
        // Limits that keep the products in `step` within 32 bits, for voltages up to twice the full
        // level either way.
        if !(pull > 0.01 && pull * full < 7_500.0) {
            return Err(Refusal::Limits("inductance_h"));
        }
        if !(0.0..15.0).contains(&drop) {
            return Err(Refusal::Limits("resistance_ohm"));
        }
        let kick = (4096.0 / pull) as i32;
        let reach = (2.0 * full * pull * 16.0) as i32;
        Ok(Self {
            kick,
            drop: (drop * 4096.0) as i32,
            pull: (pull * 1024.0) as i32,
            lost: (coil.dead_time_share * full * 4096.0) as i32,
            most: ((limits.duty * full) as i32) << LEVEL,
            reach,
        })
    }
}

/// State of the law.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Regulator {
    /// Level applied in the present period.
    pub(crate) level: i32,
    /// Level that keeps the current at its setpoint, in 2^-12; limited to the greatest level.
    steady: i32,
    /// Computed level less the whole level that was applied last, in 2^-12.
    residue: i32,
    /// Sum of the current errors since the last trim, units.
    off: i32,
    /// 0 right after an evaluation of the law; otherwise the number of calls of `rest` since the
    /// last evaluation or trim, plus [`TRIM_PERIODS`] after a trim.
    rested: u32,
    /// Current expected by the law at the start of the present period, in sixteenths of a unit.
    expected_q4: i32,
    /// Voltage lost to unknown causes, as a level in 2^-12.
    unknown: i32,
}

impl Default for Regulator {
    fn default() -> Self {
        Self {
            level: 0,
            steady: 0,
            residue: 0,
            off: 0,
            rested: TRIM_PERIODS,
            expected_q4: 0,
            unknown: 0,
        }
    }
}

/// Limits a value to plus and minus `most`. `clamp` would check its bounds and could panic.
#[inline]
fn within(value: i32, most: i32) -> i32 {
    value.min(most).max(-most)
}

impl Regulator {
    /// Adapts to a new control law for a changed supply or resistance. The effect of the change has
    /// already been learned bit by bit as unknown voltage: it is moved from the unknown to the
    /// known voltage, so the level does not jump.
    pub(crate) fn adapt(&mut self, from: &Gains, to: &Gains, setpoint: Setpoint) {
        let known = |gains: &Gains| {
            let slope = gains.kick * within(setpoint.change_q4, gains.reach);
            gains.drop * (setpoint.at_q4 >> 4) + (slope >> 4)
        };
        let moved = self.unknown + known(from) - known(to);
        self.unknown = within(moved, to.most >> 1);
    }

    /// Returns the level for the next period, in 2^-12; it may oppose the current.
    ///
    /// If the current of this period differs from the expected one, some voltage was lost: to a
    /// hotter coil, a weaker supply, dead time. That voltage is learned and added. This replaces an
    /// integral term and cannot wind up: it compares the measured current with the expected effect
    /// of the applied voltage, not with the setpoint.
    #[inline(never)]
    pub(crate) fn step(&mut self, gains: &Gains, line: &FixedPointLine, measured: i32) -> i32 {
        let lost = gains.lost * measured.signum();
        let given = (self.level << LEVEL) - self.unknown - lost;
        let drive = within(given - gains.drop * measured, 2 * gains.most);
        let change_q4 = ((drive >> 6) * gains.pull) >> 12;
        let measured_q4 = measured << 4;
        if self.rested == 0 {
            let surprise = measured_q4 - self.expected_q4 - (change_q4 >> 2);
            let taken = (gains.kick * within(surprise, gains.reach)) >> 4;
            self.unknown = within(self.unknown - (taken >> LEARN_SHIFT), gains.most >> 1);
        }
        (self.off, self.rested) = (0, 0);
        self.expected_q4 = measured_q4 + ((change_q4 * 3) >> 2);
        within(self.law(gains, line.setpoint()), gains.most)
    }

    /// Returns the level that brings the current to its setpoint; stores as `steady` the level that
    /// keeps the current there.
    #[inline]
    fn law(&mut self, gains: &Gains, setpoint: Setpoint) -> i32 {
        let expected_q4 = self.expected_q4;
        let error = setpoint.at_q4 - setpoint.change_q4 - expected_q4;
        let error = (within(error, gains.reach) * EIGHTHS) >> 3;
        let change = within(setpoint.change_q4, gains.reach);
        let push = (gains.kick * error) >> 4;
        let slope = (gains.kick * change) >> 4;
        let lost = gains.lost * (setpoint.at_q4 >> 4).signum();
        let at = gains.drop * (setpoint.at_q4 >> 4);
        let steady = at + slope + lost + self.unknown;
        self.steady = within(steady, gains.most);
        // The voltage has to overcome the resistance at the actual current, not at the setpoint.
        steady + push + gains.drop * ((expected_q4 - setpoint.at_q4) >> 4)
    }

    /// Returns the steady level for a current near its setpoint, `off` units away; does not
    /// evaluate the control law. Every eight periods the mean error trims the level, and a part of
    /// the error is learned as lasting: the mean of eight measurements is less noisy than one.
    #[inline]
    pub(crate) fn rest(&mut self, gains: &Gains, line: &FixedPointLine, off: i32) -> i32 {
        self.off += off;
        self.rested += 1;
        if self.rested.is_multiple_of(TRIM_PERIODS) {
            self.trim(gains, line);
        }
        self.steady
    }

    #[inline(never)]
    fn trim(&mut self, gains: &Gains, line: &FixedPointLine) {
        const PERIODS: i32 = TRIM_PERIODS as i32;
        let setpoint = line.setpoint();
        // The mean current error, in sixteenths of a unit.
        let off_q4 = within(self.off * (16 / PERIODS), gains.reach);
        (self.off, self.rested) = (0, TRIM_PERIODS);
        let forever = (gains.drop * off_q4) >> (4 + FOREVER_SHIFT);
        self.unknown = within(self.unknown + forever, gains.most >> 1);
        let trim = (gains.kick * off_q4) >> (4 + TRIM_SHIFT);
        // Setpoint in the middle of the next eight periods.
        let at = (setpoint.at_q4 + (PERIODS / 2) * setpoint.change_q4) >> 4;
        let slope = (gains.kick * within(setpoint.change_q4, gains.reach)) >> 4;
        let lost = gains.lost * at.signum();
        let steady = gains.drop * at + slope + lost + self.unknown + trim;
        self.steady = within(steady, gains.most);
    }

    /// Rounds a level in 2^-12 to a whole level of at most `top`; the remainder is added in the
    /// next period.
    #[inline]
    pub(crate) fn dither(&mut self, setpoint: i32, top: i32) -> i32 {
        const HALF: i32 = 1 << (LEVEL - 1);
        let fine = setpoint + self.residue;
        let level = (fine + HALF) >> LEVEL;
        if (level + top) as u32 > 2 * top as u32 {
            return self.bound(fine, top);
        }
        self.residue = fine - (level << LEVEL);
        level
    }

    /// Limits a level beyond `top`, and the remainder that is added in the next period.
    #[inline(never)]
    fn bound(&mut self, fine: i32, top: i32) -> i32 {
        let level = if fine > 0 { top } else { -top };
        self.residue = within(fine - (level << LEVEL), 1 << LEVEL);
        level
    }
}
