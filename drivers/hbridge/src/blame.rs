//! Tells a weak supply from other causes of missing current.
//!
//! The bridge goes off at once, whatever it was. The supply's reading comes later, through its
//! divider's capacitor; so the fault that was latched is looked at again until that has come to rest.

use crate::drive::{DriveState, Report};
use crate::fault::Fault;

/// Time for the supply's reading to come to rest, us: five time constants of a divider of 1 ms.
const SETTLES_US: u32 = 5_000;
/// A reading that falls by less than this part from one look to the next is at rest: seven times the
/// noise of two codes of 9 mV each at 12 V.
const FALLS: f32 = 0.01;
/// Looks that count: a supply that gives way under load recovers when the bridge goes off.
const LOOKS: usize = 3;
/// The watch takes a current for missing when the law gives half as much voltage again as it should
/// take. A supply that has less than this part of what it had without load explains that.
const EXPLAINS: f32 = 2.0 / 3.0;

/// What is needed of the supply, V.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Its lower limit.
    pub(crate) limit_v: f32,
    /// What it had while nothing flowed.
    pub(crate) open_v: f32,
    /// What the current of the setpoint takes through the circuit as it was tested, the supply's own
    /// resistance included, at the greatest duty.
    pub(crate) setpoint_v: f32,
}

impl Needs {
    /// Below which voltage the supply is the cause of a fault; nothing where it cannot be.
    fn of(&self, fault: Fault) -> Option<f32> {
        let Self {
            limit_v,
            open_v,
            setpoint_v,
        } = *self;
        match fault {
            Fault::CurrentMissing => Some(limit_v.max(EXPLAINS * open_v)),
            Fault::NotFollowing => Some(limit_v.max(setpoint_v)),
            _ => None,
        }
    }
}

/// The question who is to blame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Blame {
    /// At the last looks, the latest first.
    readings_v: [f32; LOOKS],
    was_latched: bool,
    /// Below which voltage it is the supply, and how long to wait for its reading, us.
    open: Option<(f32, u32)>,
    /// The supply and what was needed, where that was too little.
    pub(crate) low_v: Option<[f32; 2]>,
}

impl Blame {
    /// Whether the fault that stands was seen, and what is behind it is known.
    pub(crate) const fn is_settled(&self) -> bool {
        self.was_latched && self.open.is_none()
    }

    /// Takes the supply's latest reading; whether the fault that stands is the supply's.
    pub(crate) fn follow(
        &mut self,
        report: &Report,
        latest_v: f32,
        elapsed_us: u32,
        needs: &Needs,
    ) -> bool {
        let [before_v, older_v, _] = self.readings_v;
        self.readings_v = [latest_v, before_v, older_v];
        let DriveState::Latched(fault) = report.state else {
            (self.was_latched, self.open) = (false, None);
            return false;
        };
        if !core::mem::replace(&mut self.was_latched, true) {
            self.open = needs.of(fault).map(|needed_v| (needed_v, SETTLES_US));
        }
        let Some((needed_v, left_us)) = self.open else {
            return false;
        };
        let lowest_v = self.readings_v.into_iter().fold(latest_v, f32::min);
        let is_low = lowest_v < needed_v;
        let falls = before_v - latest_v > FALLS * before_v;
        let left_us = left_us.saturating_sub(elapsed_us);
        self.open = (!is_low && falls && left_us > 0).then_some((needed_v, left_us));
        if is_low {
            self.low_v = Some([lowest_v, needed_v]);
        }
        is_low
    }
}
