//! The self-test: finds the parameters of the load, and decides whether it may be driven.
//!
//! It applies voltage steps and measures the current without regulation. The integer half runs in
//! the PWM interrupt and sums up; [`evaluate`] computes the parameters from the sums.
//!
//! 1. With the bridge asleep, remaining current decays; then the mean reading gives the zero. Then
//!    the bridge wakes.
//! 2. The level rises slowly, at a rate of the full level in [`RISE_PERIODS`], until [`TARGET_A`]
//!    flows.
//! 3. The level stays there, then steps to up to [`FACTOR`] times that level. The two levels and
//!    currents are two points of a straight line, whose slope is the resistance and whose intercept
//!    is the dead time.
//! 4. The area between the rising current and its final value is the time constant times the step.
//! 5. The second level is applied again with the hardware's current limit reduced, if the board can
//!    reduce it.

use crate::fault::Fault;
use crate::hardware::{CoilParameters, Hardware};
use crate::limits::Limits;
use crate::output::Levels;

/// Current of the first point, A: large enough to be measured within one per cent, small enough to
/// heat little.
pub(crate) const TARGET_A: f32 = 1.0;
/// Energy charged for a self-test, J, whatever the test measures: with a failed current measurement
/// the test measures no energy, but may have driven a few amperes for 60 ms.
pub const SELF_TEST_J: f32 = 1.0;
/// Ratio of the second level to the first.
const FACTOR: i32 = 4;
/// Periods in which the level would rise from zero to full: 0.12 s at 16 us, so slow that a coil's
/// current follows without lag, however many levels the PWM has.
const RISE_PERIODS: i32 = 7_680;
/// Periods over which the reading without current is averaged.
const ZERO_PERIODS: u16 = 64;
/// Periods that the current has to settle after a step: 5 ms at 16 us, 8 time constants of 200 uH
/// and 0.33 ohm.
const REST_PERIODS: u16 = 320;
/// Periods over which a settled current is averaged.
const MEAN_PERIODS: u16 = 256;
/// Periods over which the current is summed after a step: five time constants of 200 uH and 0.5
/// ohm.
const AREA_PERIODS: u16 = 128;
/// Number of steps to the second level whose results are averaged.
const RISES: u8 = 2;
/// The test fails if the current reaches this multiple of the hardware's reduced limit.
const LIMIT_TOLERANCE: f32 = 1.5;

/// Parameters of the integer half.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TestPlan {
    pub(crate) full: i32,
    /// Greatest level that may be applied.
    pub(crate) most: i32,
    /// [`TARGET_A`] in units.
    pub(crate) target: i32,
    /// Current in units above which the load is a short: no steps follow.
    pub(crate) too_much: i32,
    pub(crate) test_limit: bool,
    /// Periods that the bridge needs to wake.
    pub(crate) wake_periods: u16,
    /// Twice the nominal reading without current, and the largest deviation from it.
    pub(crate) twice_zero: [i32; 2],
}

/// Sums of the self-test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct TestSums {
    /// Sum of both samples without current, over [`ZERO_PERIODS`].
    zero: i32,
    /// Level of the first point, and the sum of its currents over [`MEAN_PERIODS`], in units.
    low: (i32, i32),
    /// Level of the second point, and the sum of its currents over [`MEAN_PERIODS`] after each
    /// step, in units.
    high: (i32, i32),
    /// Sum of the currents over the [`AREA_PERIODS`] after each step, in units.
    area: i32,
    /// Sum of the currents with the hardware's limit reduced, over [`MEAN_PERIODS`], in units.
    limited: Option<i32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Asleep,
    Zero,
    Wake,
    Rise,
    LowRest,
    LowMean,
    Area,
    HighRest,
    HighMean,
    Again,
    LimitRest,
    LimitMean,
    Over,
}

/// The integer half of the self-test.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SelfTest {
    plan: TestPlan,
    stage: Stage,
    left: u16,
    rises: u8,
    level: i32,
    /// Fractional part of the rising level, as a multiple of 1/[`RISE_PERIODS`].
    rest: i32,
    sums: TestSums,
}

/// Outputs of the test for one period.
pub(crate) enum TestStep {
    On {
        levels: Levels,
        limit_low: bool,
        /// Product of level and current in units, for the energy count.
        power: i32,
    },
    Asleep,
    Waking,
    Over(Result<TestSums, Fault>),
}

impl SelfTest {
    pub(crate) fn new(plan: TestPlan) -> Self {
        Self {
            plan,
            stage: Stage::Asleep,
            left: REST_PERIODS,
            rises: 0,
            level: 0,
            rest: 0,
            sums: TestSums::default(),
        }
    }

    /// Twice the reading without current, once it is known.
    pub(crate) fn twice_zero(&self) -> Option<i32> {
        let is_known = !matches!(self.stage, Stage::Asleep | Stage::Zero);
        is_known.then_some(twice_zero(&self.sums))
    }

    /// Runs one period; `sum` is the sum of its two samples.
    pub(crate) fn step(&mut self, sum: i32) -> TestStep {
        if self.stage == Stage::Asleep {
            self.next(Stage::Zero, ZERO_PERIODS);
            return TestStep::Asleep;
        }
        if self.stage == Stage::Zero {
            self.sums.zero += sum;
            let [nominal, tolerance] = self.plan.twice_zero;
            let wake_periods = self.plan.wake_periods;
            if self.next(Stage::Wake, wake_periods)
                && (twice_zero(&self.sums) - nominal).abs() > tolerance
            {
                return TestStep::Over(Err(Fault::Offset));
            }
            return TestStep::Asleep;
        }
        if self.stage == Stage::Wake && self.left > 0 {
            self.left -= 1;
            return TestStep::Waking;
        }
        let units = sum - twice_zero(&self.sums);
        let plan = self.plan;
        let power = self.level * units;
        if units < -plan.target / 2 {
            return TestStep::Over(Err(Fault::SenseReversed));
        }
        if matches!(self.stage, Stage::Wake | Stage::Rise) {
            self.stage = Stage::Rise;
            if let Some(over) = self.rise(units) {
                return over;
            }
        } else if let Some(over) = self.point(units) {
            return over;
        }
        TestStep::On {
            levels: Levels {
                in1: plan.full as u16,
                in2: (plan.full - self.level.max(0).min(plan.most)) as u16,
            },
            limit_low: matches!(self.stage, Stage::LimitRest | Stage::LimitMean),
            power,
        }
    }

    fn rise(&mut self, units: i32) -> Option<TestStep> {
        let plan = self.plan;
        if units > plan.too_much {
            return Some(TestStep::Over(Err(Fault::Short)));
        }
        if units >= plan.target {
            self.sums.low.0 = self.level;
            self.go(Stage::LowRest, REST_PERIODS);
            return None;
        }
        self.rest += plan.full;
        if self.rest >= RISE_PERIODS {
            if self.level >= plan.most {
                return Some(TestStep::Over(Err(Fault::Open)));
            }
            self.rest -= RISE_PERIODS;
            self.level += 1;
        }
        None
    }

    fn point(&mut self, units: i32) -> Option<TestStep> {
        let high = (FACTOR * self.sums.low.0).min(self.plan.most);
        match self.stage {
            Stage::LowRest => {
                self.next(Stage::LowMean, MEAN_PERIODS);
            }
            Stage::LowMean => {
                self.sums.low.1 += units;
                if self.next(Stage::Area, AREA_PERIODS) {
                    self.sums.high.0 = high;
                    self.level = high;
                }
            }
            Stage::Area => {
                self.sums.area += units;
                self.next(Stage::HighRest, REST_PERIODS);
            }
            Stage::HighRest => {
                self.next(Stage::HighMean, MEAN_PERIODS);
            }
            Stage::HighMean => {
                self.sums.high.1 += units;
                if self.next(Stage::Again, REST_PERIODS) {
                    self.level = self.sums.low.0;
                    self.rises += 1;
                    if self.rises >= RISES && self.plan.test_limit {
                        self.level = high;
                        self.go(Stage::LimitRest, REST_PERIODS);
                    } else if self.rises >= RISES {
                        return Some(TestStep::Over(Ok(self.sums)));
                    }
                }
            }
            Stage::Again => {
                if self.next(Stage::Area, AREA_PERIODS) {
                    self.level = high;
                }
            }
            Stage::LimitRest => {
                self.next(Stage::LimitMean, MEAN_PERIODS);
            }
            Stage::LimitMean => {
                self.sums.limited = Some(self.sums.limited.unwrap_or(0) + units);
                if self.next(Stage::Over, 0) {
                    return Some(TestStep::Over(Ok(self.sums)));
                }
            }
            Stage::Asleep | Stage::Zero | Stage::Wake | Stage::Rise | Stage::Over => {}
        }
        None
    }

    /// Counts a period of the present stage. After its last period, enters `stage` for `periods`
    /// periods and returns true.
    fn next(&mut self, stage: Stage, periods: u16) -> bool {
        self.left = self.left.saturating_sub(1);
        let over = self.left == 0;
        if over {
            self.go(stage, periods);
        }
        over
    }

    fn go(&mut self, stage: Stage, periods: u16) {
        self.stage = stage;
        self.left = periods;
    }
}

fn twice_zero(sums: &TestSums) -> i32 {
    let periods = i32::from(ZERO_PERIODS);
    (sums.zero + periods / 2) / periods
}

/// Results of the self-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Findings {
    /// Reading without current, in counts.
    pub zero_count: f32,
    /// Parameters of the circuit.
    pub coil: CoilParameters,
    /// Current that flowed with the hardware's limit reduced, A; `None` if the board cannot reduce
    /// it.
    pub limited_to_a: Option<f32>,
}

/// Computes the results from the sums.
pub(crate) fn evaluate(
    sums: &TestSums,
    hardware: &Hardware,
    limits: &Limits,
    supply_v: f32,
) -> Result<(Findings, i32), Fault> {
    let twice = twice_zero(sums);
    let unit_a = hardware.ampere_per_unit();
    let full = f32::from(hardware.full_level);
    let mean = f32::from(MEAN_PERIODS);
    let rises = f32::from(RISES);
    let low_a = sums.low.1 as f32 / mean * unit_a;
    let high_a = sums.high.1 as f32 / (mean * rises) * unit_a;
    let step_a = high_a - low_a;
    let step_v = (sums.high.0 - sums.low.0) as f32 / full * supply_v;
    if step_a < 0.25 * TARGET_A {
        return Err(Fault::NotACoil);
    }
    let resistance_ohm = step_v / step_a;
    let foot_v = sums.low.0 as f32 / full * supply_v - low_a * resistance_ohm;
    let dead_time_share = (foot_v / supply_v).clamp(0.0, 0.2);
    // The mean of a period's samples is the current a quarter of a period after its start: the sum
    // of exp(-t/tau) at T/4, 5T/4, ... is tau/T + 1/4 + T/(96 tau) + ...
    let area = f32::from(AREA_PERIODS) * high_a - sums.area as f32 / rises * unit_a;
    let tau_s = (area / step_a - 0.25) * hardware.period_s;
    let inductance_h = tau_s * resistance_ohm;
    let [least_ohm, most_ohm] = limits.resistance_ohm;
    let [least_h, most_h] = limits.inductance_h;
    if resistance_ohm < least_ohm || inductance_h < least_h {
        return Err(Fault::Short);
    }
    // Negated, so that NaN fails too.
    if !(resistance_ohm <= most_ohm && inductance_h <= most_h) {
        return Err(Fault::NotACoil);
    }
    let limited_to_a = sums.limited.map(|units| units as f32 / mean * unit_a);
    if let (Some(limited_a), Some(limit_a)) = (limited_to_a, hardware.reduced_limit_a)
        && limited_a > LIMIT_TOLERANCE * limit_a
    {
        return Err(Fault::NoHardwareLimit);
    }
    let findings = Findings {
        zero_count: 0.5 * twice as f32,
        coil: CoilParameters {
            resistance_ohm,
            inductance_h,
            dead_time_share,
        },
        limited_to_a,
    };
    Ok((findings, twice))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of periods after which the level is at its greatest if no current flows.
    fn rises_in(full: i32) -> u32 {
        let mut test = SelfTest::new(TestPlan {
            full,
            most: full,
            target: 100,
            too_much: 1_000,
            test_limit: false,
            wake_periods: 0,
            twice_zero: [0, 10],
        });
        (0..20_000)
            .position(|_| matches!(test.step(0), TestStep::Over(Err(Fault::Open))))
            .map_or(0, |at| at as u32)
    }

    #[test]
    fn the_voltage_rises_as_fast_whatever_the_number_of_levels() {
        for full in [16, 960, 1_600, 2_048] {
            let rise = rises_in(full) - u32::from(REST_PERIODS + ZERO_PERIODS);
            let level = RISE_PERIODS as u32 / full as u32 + 1;
            assert!(
                rise.abs_diff(RISE_PERIODS as u32) <= level,
                "{full}: {rise}"
            );
        }
    }
}
