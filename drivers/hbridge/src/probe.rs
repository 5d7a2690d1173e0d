//! Small known changes of the current, to check that its measurement follows.
//!
//! While a current is held, a frozen measurement looks like a working one: the regulator sees no
//! error, and the true current drifts with noise, heat and rounding. Voltage and resistance reveal
//! a frozen measurement late, since copper may have 0.6 to 1.6 times the resistance found by its
//! test. So a held current is raised and lowered a little from time to time. A working measurement
//! follows these steps, which the regulator ensures for any coil, any supply and wide codes of the
//! converter; a frozen measurement does not.

use crate::averages::BLOCK;
use crate::drive::{DriveState, Report};

/// Amount by which the held current is raised and then lowered, units: 4 counts of the converter,
/// 26 mA on the reference board. Both amounts are equal, so that the mean current stays the same,
/// and so that the true current's drift under a frozen measurement cancels.
const STEP: i32 = 8;
/// Deviations from the held current in turn: up, down, and four times zero.
const STEPS: [i32; 6] = [STEP, -STEP, 0, 0, 0, 0];
/// Number of blocks, each 256 us on the reference board, that the regulator has to settle after a
/// step. The mean is then taken over `MEANS` blocks: with noise of 2 counts it scatters by 0.25
/// units.
const SETTLES: u32 = 4;
const MEANS: u32 = 8;
/// Largest difference of mean currents that count as equal, units: twelve standard deviations of a
/// mean. A changing supply may hide one step, but does not make all six means equal.
const SAME: f32 = 3.0;
/// Number of successive turns through [`STEPS`] with equal means after which the measurement counts
/// as frozen.
const TURNS: u8 = 3;
/// Blocks for which a current must have been held before the first step. A hold in a train of ramps
/// is shorter; there the ramps themselves show that the measurement follows.
const HELD: u32 = 200;
/// Blocks from one poll to the next: each wait may be longer by this number.
const LOOK: u32 = 4;

/// Periods within which a measurement that freezes is detected, if the current has been held for
/// [`HELD_BEFORE`] periods: the turn during which it froze, and three more turns through the steps.
pub const FROZEN_WITHIN: u32 =
    (TURNS as u32 + 1) * STEPS.len() as u32 * (SETTLES + MEANS + 2 * LOOK) * BLOCK;
/// Periods for which a current is held before it is probed; see [`FROZEN_WITHIN`].
pub const HELD_BEFORE: u32 = HELD * BLOCK;

/// Next action of the probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    Nothing,
    /// Hold this current, units.
    Hold(i32),
    /// The measurement is frozen.
    Frozen,
}

/// Limits of the board: currents in units, and a level of the PWM.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// Lowest current that is probed, and the greatest setpoint.
    pub(crate) currents: [i32; 2],
    /// Largest tracking error of a current, units.
    pub(crate) tracking_error: i32,
    /// Level of the PWM below which the current certainly reaches its setpoint.
    pub(crate) top: i32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// Waits until the current has been held for long enough.
    #[default]
    Held,
    /// Waits for a step to settle.
    Settles,
    /// Takes the mean.
    Means,
}

/// State of the probe.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Probe {
    stage: Stage,
    /// Index of the present step in [`STEPS`].
    step: usize,
    /// The held current, and the present setpoint.
    held: i32,
    setpoint: i32,
    /// Sums of currents and of levels, and number of blocks, at the start of the stage.
    since: (i32, i32, u32),
    /// Lowest and highest of the means that count as equal.
    range: Option<[f32; 2]>,
    /// Number of turns for which the means have been equal.
    turns: u8,
    /// Whether the level was at its maximum while the current was raised.
    at_top: bool,
}

impl Probe {
    /// Evaluates the drive's report and returns the next action.
    pub(crate) fn poll(&mut self, report: &Report, reach: &Reach) -> Next {
        let [least, _] = reach.currents;
        let (_, _, begun) = self.since;
        let passed = report.blocks.wrapping_sub(begun);
        if report.state != DriveState::Driving || !report.holds || report.setpoint != self.setpoint
        {
            *self = Self {
                held: report.setpoint,
                setpoint: report.setpoint,
                ..Self::default()
            };
            self.begin(Stage::Held, report);
            return Next::Nothing;
        }
        match self.stage {
            _ if self.held.abs() < least => Next::Nothing,
            Stage::Held if passed >= HELD => {
                self.begin(Stage::Settles, report);
                self.hold(reach)
            }
            Stage::Settles if passed >= SETTLES => {
                self.begin(Stage::Means, report);
                Next::Nothing
            }
            Stage::Means if passed >= MEANS => {
                self.take(report, reach);
                if self.turns >= TURNS {
                    return Next::Frozen;
                }
                self.begin(Stage::Settles, report);
                self.hold(reach)
            }
            _ => Next::Nothing,
        }
    }

    /// Computes the mean current of a step, and advances to the next step.
    fn take(&mut self, report: &Report, reach: &Reach) {
        let (units, levels, blocks) = self.since;
        let periods = (report.blocks.wrapping_sub(blocks) * BLOCK) as f32;
        let mean = |now: i32, then: i32| now.wrapping_sub(then) as f32 / periods;
        let units = mean(report.units, units);
        let [low, high] = self.range.unwrap_or([units; 2]);
        let (low, high) = (low.min(units), high.max(units));
        if self.step == 0 {
            self.at_top = mean(report.levels, levels).abs() >= reach.top as f32;
        }
        self.step = (self.step + 1) % STEPS.len();
        if high - low > SAME {
            self.range = Some([units; 2]);
            self.turns = 0;
        } else {
            self.range = Some([low, high]);
            self.turns += u8::from(self.step == 0);
        }
    }

    /// Sets the current of the present step.
    fn hold(&mut self, reach: &Reach) -> Next {
        let [_, most] = reach.currents;
        let mut step = STEPS.get(self.step).copied().unwrap_or_default();
        if step < 0 && self.at_top {
            // The current did not reach the raised setpoint: the setpoint is lowered by the largest
            // tracking error, to a current that is certainly reached.
            step -= reach.tracking_error;
        }
        let setpoint = self.held + step * self.held.signum();
        self.setpoint = setpoint.min(most).max(-most);
        Next::Hold(self.setpoint)
    }

    fn begin(&mut self, stage: Stage, report: &Report) {
        self.stage = stage;
        self.since = (report.units, report.levels, report.blocks);
    }
}
