//! The places at which presses are claimed.

use super::array::{Coil, MOST_COILS};
use crate::math::hypot;
use crate::units::Metre;

/// Places at which a press is claimed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// A disc.
    Disc {
        /// Centre.
        centre: [Metre; 2],
        /// Radius.
        radius: Metre,
    },
    /// The convex hull of the coils' centres, moved outwards by a margin.
    Hull {
        /// Distance by which the hull grows; below zero it shrinks.
        margin: Metre,
    },
}

/// A side of the hull: places with x normal_x + y normal_y <= offset lie within.
type Side = [f32; 3];

/// A region with the sides of its hull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    region: Region,
    sides: [Side; MOST_COILS],
}

impl Bounds {
    pub(super) fn new(region: Region, coils: &[Coil]) -> Self {
        // Unused sides, which exclude no place.
        let mut sides = [[0.0, 0.0, f32::INFINITY]; MOST_COILS];
        let ordered = coils.iter().flat_map(|a| coils.iter().map(move |b| (a, b)));
        let found = ordered.filter_map(|(a, b)| side(a, b, coils));
        for (to, side) in sides.iter_mut().zip(found) {
            *to = side;
        }
        Self { region, sides }
    }

    #[inline(always)]
    pub(super) const fn region(&self) -> Region {
        self.region
    }

    pub(super) fn contains(&self, [x, y]: [f32; 2]) -> bool {
        match self.region {
            Region::Disc { centre, radius } => {
                let [cx, cy] = centre;
                hypot(x - cx.0, y - cy.0) <= radius.0
            }
            Region::Hull { margin } => self
                .sides
                .iter()
                .all(|[nx, ny, offset]| x * nx + y * ny <= offset + margin.0),
        }
    }
}

/// The side from `a` to `b`, if all coils lie on its left; if several coils lie on its line, only
/// between the two outermost.
fn side(a: &Coil, b: &Coil, coils: &[Coil]) -> Option<Side> {
    // A distance below a thousandth of the side's length is rounding.
    const ON_LINE: f32 = 1e-3;
    let [dx, dy] = [b.x.0 - a.x.0, b.y.0 - a.y.0];
    let length = hypot(dx, dy);
    if !(length > 0.0) {
        return None;
    }
    let [nx, ny] = [dy / length, -dx / length];
    let outermost = coils.iter().all(|coil| {
        let [px, py] = [coil.x.0 - a.x.0, coil.y.0 - a.y.0];
        let outwards = px * nx + py * ny;
        let along = (px * dx + py * dy) / length;
        let slack = ON_LINE * length;
        outwards < -slack || (outwards <= slack && (-slack..=length + slack).contains(&along))
    });
    outermost.then_some([nx, ny, a.x.0 * nx + a.y.0 * ny])
}
