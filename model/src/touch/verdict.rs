//! Result of an estimate.

use crate::math::student::NORMAL_975;
use crate::math::{atan, exp, sqrt};
use crate::units::{Metre, Newton};

/// What the readings of a scan say.
///
/// Only the first two variants claim a press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// A press within the region: place, force and radius (the declared one, or the fitted one).
    Inside(Press),
    /// A press within the region whose radius the readings do not determine: place and force hold
    /// for every radius that was possible beforehand.
    RadiusNotDetermined(Press),
    /// The fit lies beyond the region.
    BeyondArray(Press),
    /// No single press gives these readings: two contacts, an edge, a tilted face, or a coil whose
    /// gain has changed.
    DoesNotFit {
        /// The best fit.
        press: Press,
        /// Greatest chi-square that a fit may have.
        greatest: f32,
    },
    /// No reading is clearly above its noise.
    TooSmall,
    /// The steps were used up, or the readings do not determine place and force.
    NotConverged,
    /// A reading is infinite or NaN, or there is not one reading for each coil.
    NotReadable,
}

impl Verdict {
    /// The press, if its place and force are claimed.
    pub const fn claimed(&self) -> Option<&Press> {
        match self {
            Self::Inside(press) | Self::RadiusNotDetermined(press) => Some(press),
            _ => None,
        }
    }
}

/// A fitted press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    /// Place.
    pub x: Metre,
    /// Place.
    pub y: Metre,
    /// Force normal to the surface.
    pub force: Newton,
    /// Radius of the contact.
    pub radius: Metre,
    /// Covariance of x (m), y (m), ln F and ln a.
    pub covariance: [[f32; 4]; 4],
    /// Sum of the squared residuals of the readings, and of a declared indenter, each divided by its
    /// sigma.
    pub chi_square: f32,
    /// Readings that the press reaches: predicted above three sigma. With fewer than five, a single
    /// press explains most readings of two contacts.
    pub informative: u8,
    /// Evaluations of the model.
    pub evaluations: u8,
}

/// The 95 % region of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Larger half axis.
    pub major: Metre,
    /// Smaller half axis.
    pub minor: Metre,
    /// Direction of the larger one, counterclockwise from the x axis, rad, from -pi/2 to pi/2.
    pub angle_rad: f32,
}

impl Press {
    /// 95 % ellipse of the place.
    pub fn ellipse(&self) -> Ellipse {
        /// Root of the 95 % quantile of chi-square with two degrees of freedom, -2 ln 0.05.
        const QUANTILE: f32 = 2.447_747;
        let [[xx, xy, ..], [_, yy, ..], ..] = self.covariance;
        let [mean, half] = [0.5 * (xx + yy), 0.5 * (xx - yy)];
        let difference = sqrt(half * half + xy * xy);
        let axis = |variance: f32| Metre(QUANTILE * sqrt(variance.max(0.0)));
        // The direction of the larger axis is (difference + half, xy); a circle has no direction.
        let along = difference + half;
        let angle_rad = if xy == 0.0 && half >= 0.0 {
            0.0
        } else {
            atan(xy / along)
        };
        Ellipse {
            major: axis(mean + difference),
            minor: axis(mean - difference),
            angle_rad,
        }
    }

    /// 95 % interval of the force.
    pub fn force_interval(&self) -> [Newton; 2] {
        let [.., [_, _, variance, _], _] = self.covariance;
        interval(self.force.0, variance).map(Newton)
    }

    /// 95 % interval of the radius.
    pub fn radius_interval(&self) -> [Metre; 2] {
        let [.., [_, _, _, variance]] = self.covariance;
        interval(self.radius.0, variance).map(Metre)
    }
}

fn interval(value: f32, variance: f32) -> [f32; 2] {
    let factor = exp(NORMAL_975 * sqrt(variance.max(0.0)));
    [value / factor, value * factor]
}
