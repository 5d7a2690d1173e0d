//! Where and how an object lies on the sensor.
//!
//! Beside the centre the field under the object is weaker or stronger, so the actuated layer
//! stiffens by another amount. A tilted face touches with its edge first: over the first stage
//! s = 2 a θ of its deformation the sensing layer has only a share of its stiffness, then all of
//! it. This is a spring in series with the layer that closes (`Closing`); a zero that is shifted
//! by (1 − share) s remains.

/// Place and tilt of a contact. The default is centred and flat.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// r, distance of the contact's middle from the coil's axis, m, 0 to 0.01.
    pub place_m: f64,
    /// θ, angle between the object's face and the sensor's, rad, 0 to 0.2.
    pub tilt_rad: f64,
}

/// Effects of place and tilt of a press on a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactParameters {
    /// q, relative loss of the stiffening per square of the distance, 1/m², ±10⁵; below zero where
    /// the field rises away from the axis.
    pub lost_per_m2: f64,
    /// a, radius of the contact, m, 0.1 to 20 mm.
    pub radius_m: f64,
    /// Share of its stiffness that the sensing layer has over the first stage of a tilted contact,
    /// 0.1 to 1.
    pub tilted_share: f64,
}

impl ContactParameters {
    /// Stiffening under a contact relative to that in the centre: 1 − q r², never negative.
    ///
    /// ```
    /// use palpate_sim::mechanics::contact::{Contact, ContactParameters};
    ///
    /// let sensor = ContactParameters { lost_per_m2: 1e4, radius_m: 3e-3, tilted_share: 0.5 };
    /// let beside = Contact { place_m: 2e-3, ..Contact::default() };
    /// assert!((sensor.stiffening(&beside) - 0.96).abs() < 1e-15);
    /// assert_eq!(sensor.stiffening(&Contact::default()), 1.0);
    /// ```
    #[must_use]
    pub fn stiffening(&self, contact: &Contact) -> f64 {
        (1.0 - self.lost_per_m2 * contact.place_m * contact.place_m).max(0.0)
    }

    /// The closing gap under a tilted contact with a sensing layer of this spring, N/m.
    ///
    /// Layer c and gap k in series are a spring of share h: k = c h/(1 − h). It has closed when
    /// both have given way by s.
    #[must_use]
    pub(crate) fn closing(&self, contact: &Contact, spring_n_per_m: f64) -> Closing {
        let missing = 1.0 - self.tilted_share;
        let travel_m = missing * 2.0 * self.radius_m * contact.tilt_rad;
        if travel_m <= 0.0 {
            return Closing::default();
        }
        Closing {
            compliance_m_per_n: missing / self.tilted_share / spring_n_per_m,
            travel_m,
        }
    }
}

/// A gap that closes in series with the sensing layer: a spring up to its travel, then rigid.
/// Neither field nor temperature changes the spring (guess). The default is closed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Closing {
    compliance_m_per_n: f64,
    travel_m: f64,
}

impl Closing {
    /// Whether a force closes it.
    pub(crate) fn is_closed(&self, force_n: f64) -> bool {
        force_n * self.compliance_m_per_n >= self.travel_m
    }

    /// Displacement as offset, m, and compliance, m/N, while it is closed or not.
    pub(crate) fn branch(&self, closed: bool) -> (f64, f64) {
        if closed {
            (self.travel_m, 0.0)
        } else {
            (0.0, self.compliance_m_per_n)
        }
    }

    /// Displacement under a force, m.
    pub(crate) fn displacement_m(&self, force_n: f64) -> f64 {
        (force_n * self.compliance_m_per_n).min(self.travel_m)
    }

    /// Energy stored under a force, J.
    pub(crate) fn stored_j(&self, force_n: f64) -> f64 {
        if self.compliance_m_per_n <= 0.0 {
            return 0.0;
        }
        let moved_m = self.displacement_m(force_n);
        0.5 * moved_m * moved_m / self.compliance_m_per_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_layer_has_two_stages_and_a_shifted_zero() {
        let (c, share, a, tilt_rad) = (6e3, 0.4, 3e-3, 2e-3);
        let sensor = ContactParameters {
            lost_per_m2: 0.0,
            radius_m: a,
            tilted_share: share,
        };
        let contact = Contact {
            place_m: 0.0,
            tilt_rad,
        };
        let closing = sensor.closing(&contact, c);
        let x_m = |force_n: f64| force_n / c + closing.displacement_m(force_n);
        let stage_m = 2.0 * a * tilt_rad;
        let end_n = share * c * stage_m;
        for part in [0.1, 0.5, 0.999] {
            let force_n = part * end_n;
            assert!((x_m(force_n) / (part * stage_m) - 1.0).abs() < 1e-12);
            assert!(!closing.is_closed(force_n));
        }
        for more in [1.001, 2.0, 10.0] {
            let force_n = more * end_n;
            let shifted_m = (1.0 - share) * stage_m;
            assert!((x_m(force_n) - force_n / c - shifted_m).abs() < 1e-18);
            assert!(closing.is_closed(force_n));
        }
        // The work of a press is the stored energy.
        let (steps, most_n) = (100_000, 2.0 * end_n);
        let work_j: f64 = (0..steps)
            .map(|step| {
                let [from, to] =
                    [step, step + 1].map(|of| most_n * f64::from(of) / f64::from(steps));
                let moved_m = closing.displacement_m(to) - closing.displacement_m(from);
                0.5 * (from + to) * moved_m
            })
            .sum();
        assert!((work_j / closing.stored_j(most_n) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_flat_contact_adds_nothing() {
        let sensor = ContactParameters {
            lost_per_m2: 1e4,
            radius_m: 3e-3,
            tilted_share: 0.5,
        };
        let flat = sensor.closing(&Contact::default(), 6e3);
        assert_eq!(flat, Closing::default());
        assert!(flat.is_closed(0.0));
        assert_eq!(flat.branch(true), (0.0, 0.0));
        assert_eq!(flat.stored_j(1.0), 0.0);
    }
}
