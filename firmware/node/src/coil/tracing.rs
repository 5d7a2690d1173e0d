//! A record of the coil's current under way.

use coil_hbridge::{Hardware, Trace};
use palpate_wire::record::CurrentTrace;

use super::hardware::TRACE_LENGTH;

/// A record that was begun, of which parts were reported.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tracing {
    began_us: u64,
    /// Periods from one current to the next.
    every: u32,
    /// Number of currents that have been reported.
    reported: usize,
}

impl Tracing {
    /// Begins a record with a current each `interval_s`, a period at least.
    pub(crate) fn new(began_us: u64, interval_s: f32, hardware: &Hardware) -> Self {
        let every = (interval_s / hardware.period_s + 0.5) as u32;
        Self {
            began_us,
            every: every.max(1),
            reported: 0,
        }
    }

    /// Periods from one current to the next.
    pub(crate) const fn every(&self) -> u32 {
        self.every
    }

    /// The next part with the time of its first current, and whether more of `taken` currents follow.
    pub(crate) fn part(
        &mut self,
        trace: &Trace<TRACE_LENGTH>,
        taken: usize,
        hardware: &Hardware,
    ) -> Option<(u64, CurrentTrace)> {
        let first = self.reported;
        let mut currents_a = heapless::Vec::new();
        for current_a in trace.currents_a(hardware).skip(first) {
            if currents_a.push(current_a).is_err() {
                break;
            }
        }
        if currents_a.is_empty() {
            return None;
        }
        self.reported += currents_a.len();
        let interval_s = self.every as f32 * hardware.period_s;
        let first_us = interval_s * 1e6 * (first + 1) as f32 + 0.5;
        let part = CurrentTrace {
            total: taken as u8,
            first: first as u8,
            interval_s,
            currents_a,
        };
        Some((self.began_us + first_us as u64, part))
    }

    /// Whether all of `taken` currents have been reported.
    pub(crate) const fn is_over(&self, taken: usize) -> bool {
        self.reported >= taken
    }
}
