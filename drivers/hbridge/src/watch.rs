//! Checks while current flows, made at the end of each block of periods on the block's sums.

use crate::averages::BLOCK;
use crate::fault::Fault;
use crate::line::Setpoint;
use crate::regulator::{Gains, LEVEL};

/// Number of successive blocks with mismatched voltage and current after which a fault is reported.
const UNBALANCED_BLOCKS: u32 = 4;
/// Number of successive blocks that end off the setpoint after which a fault is reported.
const TRACKING_BLOCKS: u32 = 31;

/// Periods within which voltage without current, or current without voltage, is detected. A change
/// within a block may be detected only from the next block on.
pub const BALANCED_WITHIN: u32 = (UNBALANCED_BLOCKS + 1) * BLOCK;
/// Periods within which a current that does not reach its setpoint is detected.
pub const FOLLOWS_WITHIN: u32 = (TRACKING_BLOCKS + 1) * BLOCK;
/// Deadline for the supervisor's next order, in periods: 20 ms at 16 us.
pub const ATTENDED_WITHIN: u32 = 1_250;

/// Limits of the checks, in units and levels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    /// Largest difference of applied and needed voltage that is no fault, in levels; the dead time
    /// found by the self-test is not part of it. 1/24 of the supply covers the longer dead time of
    /// short pulses, the diodes, and a supply that has just changed.
    pub(crate) margin: i32,
    /// Largest tracking error of the current without a fault, units.
    pub(crate) tracking: i32,
    /// Longest on-time of the bridge, periods.
    pub(crate) on_periods: u32,
}

/// Sums over the present block, and the number of its periods that have passed (`periods`).
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(crate) struct BlockSums {
    periods: u32,
    pub(crate) block: Block,
}

/// Sums of one block: levels, units, and their products.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(crate) struct Block {
    pub(crate) levels: i32,
    pub(crate) units: i32,
    pub(crate) power: i32,
}

impl BlockSums {
    /// Adds the level applied in a period and the current measured in it; returns whether the block
    /// is complete.
    #[inline]
    pub(crate) fn push(&mut self, level: i32, measured: i32) -> bool {
        self.block.levels += level;
        self.block.units += measured;
        self.block.power += level * measured;
        self.periods += 1;
        self.periods >= BLOCK
    }

    /// Returns the sums, and starts the next block.
    pub(crate) fn take(&mut self) -> Block {
        core::mem::take(self).block
    }
}

/// Results of the checks so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watch {
    /// Measured current at the end of the last block.
    last: i32,
    unbalanced: u32,
    off_target: u32,
    on: u32,
}

impl Watch {
    /// Checks a block at its end; returns the fault found, if any.
    pub(crate) fn close(
        &mut self,
        block: &Block,
        gains: &Gains,
        bounds: &Bounds,
        setpoint: Setpoint,
        measured: i32,
    ) -> Option<Fault> {
        let fault = self.judge(block, gains, bounds, setpoint, measured);
        self.on = self.on.saturating_add(BLOCK);
        self.last = measured;
        // The on-time would exceed its limit within the next block.
        let late = (self.on + BLOCK > bounds.on_periods).then_some(Fault::OnTime);
        late.or(fault)
    }

    fn judge(
        &mut self,
        block: &Block,
        gains: &Gains,
        bounds: &Bounds,
        setpoint: Setpoint,
        measured: i32,
    ) -> Option<Fault> {
        // Level that the measured current i needed, summed over the block: `drop` i for the
        // resistance, plus di / `pull` for the inductance.
        let resistive = (gains.drop >> 4) * (block.units >> 4);
        let change = (measured - self.last).clamp(-8_000, 8_000);
        let inductive = (gains.kick * change) >> 12;
        let excess = block.levels - (resistive >> 4) - inductive;
        let lost = (gains.lost >> LEVEL) * BLOCK as i32;
        let allowed = bounds.margin * BLOCK as i32 + lost + (resistive >> 4).abs() / 2;
        self.unbalanced = if excess.abs() > allowed {
            self.unbalanced + 1
        } else {
            0
        };
        let off = (setpoint.at_q4 >> 4) - measured;
        self.off_target = if off.abs() > bounds.tracking {
            self.off_target + 1
        } else {
            0
        };
        if self.unbalanced >= UNBALANCED_BLOCKS {
            // The excess voltage has the sign of the applied voltage: the current is too low.
            let missing = (excess > 0) == (block.levels > 0);
            return Some(if missing {
                Fault::CurrentMissing
            } else {
                Fault::CurrentUnexplained
            });
        }
        (self.off_target >= TRACKING_BLOCKS).then_some(Fault::NotFollowing)
    }

    /// Time with the bridge on, in periods; counts complete blocks only.
    pub(crate) const fn on(&self) -> u32 {
        self.on
    }
}
