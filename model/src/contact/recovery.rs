//! What an elastomer may still have to recover from.

use core::f32::consts::E;

use crate::units::{Metre, Second};

/// The most of a deformation that creep adds to it in the long run, and that is left when the touch is over: three modes
/// of at most 10 % each (sim-host/stacks/disturbances.toml; three modes by Soft Matter 12 (2016) 2901).
pub const MOST_CREEP: f32 = 0.3;

/// A bound of what is left of earlier touches.
///
/// A touch of the time T loads a mode of the time constant tau to the part 1 - exp(-T/tau), of which exp(-t/tau) is left at
/// the time t after it. Whatever tau is, the product is below T/(T + e t).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Recovery {
    /// At the release, m.
    most: f32,
    /// T, s.
    touched: f32,
    /// t, s.
    since: f32,
}

impl Recovery {
    /// After a touch as deep as `deepest` for the time `touched`, which began while `left` was left of earlier ones.
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
        // What is left of earlier touches has lost its fast modes: of it T + e t is the T.
        let earlier = self.touched + E * (self.since + touched.0);
        Self {
            most: own + left.0,
            touched: touched.0.max(earlier),
            since: 0.0,
        }
    }

    /// Nothing touches for another interval.
    pub fn advance(&mut self, interval: Second) {
        self.since += interval.0;
    }

    /// The most that may be left now.
    pub fn most(&self) -> Metre {
        if self.most <= 0.0 {
            return Metre(0.0);
        }
        Metre(self.most * self.touched / (self.touched + E * self.since))
    }

    /// No more than this is left, since the sensor read it.
    pub fn no_more_than(&mut self, reading: Metre) {
        self.most = self.most.min(reading.0.max(0.0));
    }
}
