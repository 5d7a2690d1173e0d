//! Shore hardness as a computed equivalent: the reading of an ideal durometer of ASTM D2240 on a
//! linear elastic half-space.
//!
//! The durometer's spring presses an indentor by F = F_0 + k H, and the depth is w = (100 - H)/100 of
//! 2.5 mm. The half-space resists by Sneddon's solution (Int. J. Eng. Sci. 3 (1965) 47) for the
//! indentor's shape, which needs E* = E/(1 - nu^2) alone:
//!
//! - Type A, a cone of 35 degrees with a flat end of radius b = 0.395 mm: with u = sqrt(a^2/b^2 - 1),
//!   w = b cot(17.5 deg) sqrt(1 + u^2) atan(u), F = E* b^2 cot(17.5 deg) [(1 + u^2) atan(u) + u];
//! - Type 00, a sphere of radius R = 1.19 mm: with t = tanh(s) = a/R,
//!   w = R s t, F = E* R^2 [(1 + t^2) s - t].
//!
//! Real rubbers deviate: the strains below an indentor are large, and hardness is read after a second
//! or more, a stiffness by palpate within a tenth of a second.

use crate::math;
use crate::units::Pascal;

/// Depth of an indentor at the reading zero, m.
const TRAVEL_M: f32 = 2.5e-3;

/// A scale of ASTM D2240.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Type A.
    A,
    /// Type 00.
    Double0,
}

impl Scale {
    /// Least and greatest reading that the standard accepts.
    pub const VALID: [f32; 2] = [20.0, 90.0];

    /// Returns the reading on a half-space of modulus E*, 0 to 100: at most 0.001 off the solution of
    /// the equations above.
    ///
    /// ```
    /// use palpate_model::{hardness::Scale, units::Pascal};
    /// let reading = Scale::A.reading(Pascal(2.5e6));
    /// assert!((reading - 39.6).abs() < 0.1);
    /// ```
    pub fn reading(self, reduced: Pascal) -> f32 {
        // The contact's parameter, u or s: at the upper end each indentor is deeper than its travel.
        let (mut low, mut high) = (0.0, 3.0);
        for _ in 0..28 {
            let middle = 0.5 * (low + high);
            let (depth_m, force_m2) = self.contact(middle);
            if reduced.0 * force_m2 < self.spring_n(reading_at(depth_m)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        reading_at(self.contact(low).0).clamp(0.0, 100.0)
    }

    /// Force of the spring at a reading, N.
    fn spring_n(self, reading: f32) -> f32 {
        match self {
            Self::A => 0.55 + 0.075 * reading,
            Self::Double0 => 0.203 + 0.00908 * reading,
        }
    }

    /// Depth in m and force over E* in m^2, for a parameter of the contact.
    fn contact(self, parameter: f32) -> (f32, f32) {
        match self {
            Self::A => {
                const END_M: f32 = 0.395e-3;
                const COT: f32 = 3.171_595;
                let u = parameter;
                let (square, angle) = (1.0 + u * u, math::atan(u));
                (
                    END_M * COT * math::sqrt(square) * angle,
                    END_M * END_M * COT * (square * angle + u),
                )
            }
            Self::Double0 => {
                const RADIUS_M: f32 = 1.19e-3;
                let grown = math::exp_m1(2.0 * parameter);
                let t = grown / (grown + 2.0);
                (
                    RADIUS_M * parameter * t,
                    RADIUS_M * RADIUS_M * ((1.0 + t * t) * parameter - t),
                )
            }
        }
    }
}

/// Reading at a depth; below zero beyond the travel.
fn reading_at(depth_m: f32) -> f32 {
    100.0 * (1.0 - depth_m / TRAVEL_M)
}
