//! Tells a weak supply from other causes of missing current.
//!
//! The bridge switches off at once in either case. The supply's reading lags behind its voltage,
//! since the divider has a capacitor; so the supply is checked after the fault until the reading
//! has settled.

use crate::drive::{DriveState, Report};
use crate::fault::Fault;

/// Longest wait for the supply's reading to settle, us: five time constants of a divider of 1 ms.
const SETTLES_US: u32 = 5_000;
/// Relative fall of the supply's reading from one poll to the next below which the reading has
/// settled: seven times the noise, which is two codes of 9 mV at 12 V.
const FALLS: f32 = 0.01;
/// Number of latest polls whose lowest reading is compared: a supply that breaks down under load
/// recovers as soon as the bridge switches off.
const READINGS: usize = 3;
/// A supply voltage below this fraction of the voltage without load explains a missing current: the
/// watch reports a current as missing when the applied level is 1.5 times what the measured current
/// needs.
const EXPLAINS: f32 = 2.0 / 3.0;

/// Voltages with which the supply's reading is compared, V.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Lower limit of the supply.
    pub(crate) limit_v: f32,
    /// Supply voltage while no current flows.
    pub(crate) open_v: f32,
    /// Supply voltage with which the greatest duty just drives the setpoint through the circuit as
    /// tested, including the supply's own resistance.
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
    /// Readings of the supply at the last polls, the latest first.
    readings_v: [f32; READINGS],
    was_latched: bool,
    /// While the fault is being checked: voltage below which the supply is its cause, and longest
    /// time left to wait for the supply's reading, us.
    open: Option<(f32, u32)>,
    /// The supply's lowest reading and the voltage needed, if the supply caused the fault.
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
