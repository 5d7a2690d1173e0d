//! A small known change of the current, to see that its measurement follows.
//!
//! Where a current is held, a measurement that is frozen at it looks like one that works: there is
//! no error to regulate, and what truly flows goes where noise, heat and rounding take it. Voltage
//! and resistance show that late: copper may have 0.6 to 1.6 times the resistance of its test. So a
//! held current is raised and lowered a little now and then. A measurement that works follows,
//! whatever coil, supply and wide codes of the converter do, since the regulator sees to it; a
//! frozen one does not.

use crate::averages::BLOCK;
use crate::drive::{DriveState, Report};

/// How far the current is raised and then lowered, units: 4 counts of the converter, 26 mA of the
/// reference board. As far up as down: what a frozen measurement lets the current do meanwhile
/// cancels, and so does the mean.
const STEP: i32 = 8;
/// Steps from the held current in turn: up, down, and four times not at all.
const STEPS: [i32; 6] = [STEP, -STEP, 0, 0, 0, 0];
/// Blocks, 256 us of the reference board, that the regulator has for a step, and over which a mean
/// is taken then: with noise of 2 counts it scatters by 0.25 units.
const SETTLES: u32 = 4;
const MEANS: u32 = 8;
/// Means that differ by no more than this, units, are all the same: twelve standard deviations. A
/// supply that changes may hide one step, but does not make six means equal.
const SAME: f32 = 3.0;
/// Turns in a row without any difference that are a fault.
const TURNS: u8 = 3;
/// Blocks for which a current is held before the first time: a hold in a train of ramps is shorter,
/// and the ramps themselves show that the measurement follows.
const HELD: u32 = 200;
/// Blocks from one poll to the next, by which each wait may be longer.
const LOOK: u32 = 4;

/// Periods within which a measurement that freezes is found, where the current has been held for
/// [`HELD_BEFORE`] periods: three turns, after one that had begun already.
pub const FROZEN_WITHIN: u32 =
    (TURNS as u32 + 1) * STEPS.len() as u32 * (SETTLES + MEANS + 2 * LOOK) * BLOCK;
/// See [`FROZEN_WITHIN`].
pub const HELD_BEFORE: u32 = HELD * BLOCK;

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    Nothing,
    /// To hold this current, units.
    Hold(i32),
    /// The measurement is frozen.
    Frozen,
}

/// What it needs to know of the board: units, and a level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// Least current with which it is done, and the greatest that is regulated to.
    pub(crate) currents: [i32; 2],
    /// By how much a current may miss its setpoint.
    pub(crate) tracking_error: i32,
    /// Level below which a current surely is reached.
    pub(crate) top: i32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// The current has not been held for long enough.
    #[default]
    Held,
    /// A step settles.
    Settles,
    /// Its mean is taken.
    Means,
}

/// Where it stands.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Probe {
    stage: Stage,
    /// Which of [`STEPS`].
    step: usize,
    /// The current that is held, and the setpoint just now.
    held: i32,
    setpoint: i32,
    /// Sums of units and levels, and blocks, when the stage began.
    since: (i32, i32, u32),
    /// Least and greatest of the means that are all the same, and for how many turns they are.
    range: Option<[f32; 2]>,
    turns: u8,
    /// The level was at its top with the current raised.
    at_top: bool,
}

impl Probe {
    /// Polls the drive.
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

    /// Takes the mean of a step, and goes to the next.
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

    /// The current of the present step.
    fn hold(&mut self, reach: &Reach) -> Next {
        let [_, most] = reach.currents;
        let mut step = STEPS.get(self.step).copied().unwrap_or_default();
        if step < 0 && self.at_top {
            // Down to where it is reached for sure.
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
