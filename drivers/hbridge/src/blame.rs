//! Tells a weak supply from other causes of missing current.
//!
//! The bridge switches off at once in either case. The supply's reading arrives later, through the
//! capacitor of its divider; so the latched fault is checked again until the reading has settled.

use crate::drive::{DriveState, Report};
use crate::fault::Fault;

/// Time for the supply's reading to settle, us: five time constants of a divider of 1 ms.
const SETTLES_US: u32 = 5_000;
/// A reading that falls by less than this fraction from one poll to the next has settled: seven
/// times the noise of two codes of 9 mV each at 12 V.
const FALLS: f32 = 0.01;
/// Number of polls that count: a supply that breaks down under load recovers when the bridge
/// switches off.
const READINGS: usize = 3;
/// A supply below this fraction of its voltage without load explains a missing current: the watch
/// reports a current as missing when the law gives 1.5 times the voltage that it should take.
const EXPLAINS: f32 = 2.0 / 3.0;

/// Supply voltages needed, V.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Lower limit of the supply.
    pub(crate) limit_v: f32,
    /// Supply voltage while no current flows.
    pub(crate) open_v: f32,
    /// Voltage that the setpoint needs through the circuit as tested, including the supply's own
    /// resistance, at the greatest duty.
    pub(crate) setpoint_v: f32,
}

impl Needs {
    /// Voltage below which the supply is the cause of a fault; `None` for faults that it cannot
    /// cause.
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

/// Decides whether the supply caused a fault.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SupplyDiagnosis {
    /// Readings at the last polls, the latest first.
    readings_v: [f32; READINGS],
    was_latched: bool,
    /// Voltage below which the supply is the cause, and the time left to wait for its reading, us.
    open: Option<(f32, u32)>,
    /// The supply's lowest voltage and the voltage needed, if it was too low.
    pub(crate) low_v: Option<[f32; 2]>,
}

impl SupplyDiagnosis {
    /// Whether the latched fault has been checked and its cause is known.
    pub(crate) const fn is_settled(&self) -> bool {
        self.was_latched && self.open.is_none()
    }

    /// Takes the supply's latest reading; returns whether the supply caused the latched fault.
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
