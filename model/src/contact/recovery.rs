//! Upper bound of the remaining recovery of an elastomer.

use core::f32::consts::E;

use crate::units::{Metre, Second};

/// Largest fraction of a deformation that creep adds in the long run, and that remains after the
/// release: three modes of at most 10 % each (sim-host/stacks/disturbances.toml; three modes by
/// Soft Matter 12 (2016) 2901).
pub const MOST_CREEP: f32 = 0.3;

/// Upper bound of the deformation that still remains from earlier touches.
///
/// A touch of duration T loads a mode of time constant tau to the fraction 1 - exp(-T/tau); after a
/// time t, the fraction exp(-t/tau) of that remains. For any tau the product is below T/(T + e t).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Recovery {
    /// Bound at the release of the touch, m.
    most: f32,
    /// T, duration of the touch, s.
    touched: f32,
    /// t, time since the release, s.
    since: f32,
}

impl Recovery {
    /// The bound after a touch of depth `deepest` and duration `touched`. `left` is the deformation
    /// that remains from earlier touches at the release.
    #[must_use]
    pub fn after(self, deepest: Metre, touched: Second, left: Option<Metre>) -> Self {
        let own = MOST_CREEP * deepest.0;
        let Some(left) = left else {
            return Self {
                most: own,
                touched: touched.0,
                since: 0.0,
            };
        };
        // The fast modes of earlier touches have decayed. The bound of these touches therefore
        // continues from its present denominator T + e t, instead of restarting at T.
        let earlier = self.touched + E * (self.since + touched.0);
        Self {
            most: own + left.0,
            touched: touched.0.max(earlier),
            since: 0.0,
        }
    }

    /// Advances the time by an interval without contact.
    pub fn advance(&mut self, interval: Second) {
        self.since += interval.0;
    }

    /// Largest deformation that may remain now.
    pub fn most(&self) -> Metre {
        if self.most <= 0.0 {
            return Metre(0.0);
        }
        Metre(self.most * self.touched / (self.touched + E * self.since))
    }

    /// Lowers the bound to `reading`, a reading of the untouched sensor.
    pub fn no_more_than(&mut self, reading: Metre) {
        self.most = self.most.min(reading.0.max(0.0));
    }
}
