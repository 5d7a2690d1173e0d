//! Trace of the coil's current in progress.

use coil_hbridge::{Hardware, Trace};
use palpate_wire::record::CurrentTrace;

use super::hardware::TRACE_LENGTH;

/// A started trace, and the number of values already reported.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tracing {
    began_us: u64,
    /// Number of periods between two values.
    every: u32,
    /// Number of values already reported.
    reported: usize,
}

impl Tracing {
    /// Starts a trace with a value every `interval_s`, at least one period.
    pub(crate) fn new(began_us: u64, interval_s: f32, hardware: &Hardware) -> Self {
        let every = (interval_s / hardware.period_s + 0.5) as u32;
        Self {
            began_us,
            every: every.max(1),
            reported: 0,
        }
    }

    /// Returns the number of periods between two values.
    pub(crate) const fn every(&self) -> u32 {
        self.every
    }

    /// Returns the next part with the time of its first value; `taken` is the number of recorded values.
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

    /// Returns whether all `taken` values have been reported.
    pub(crate) const fn is_over(&self, taken: usize) -> bool {
        self.reported >= taken
    }
}
