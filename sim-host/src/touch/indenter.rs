//! Rigid indenters.

/// A rigid indenter without friction. Its axis stands on the layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Indenter {
    /// A ball of this radius, m, 0.5 mm to 20 mm.
    Ball {
        /// Radius, m.
        radius_m: f64,
    },
    /// A round pin with a flat end.
    Pin {
        /// Radius, m, 0.5 mm to 10 mm.
        radius_m: f64,
    },
    /// A pin or round plate whose end is tilted; the depth counts at its axis.
    Tilted {
        /// Radius, m.
        radius_m: f64,
        /// Angle between end and surface, rad, up to 0.2.
        tilt_rad: f64,
        /// Direction of the deepest point, rad from the x axis.
        toward_rad: f64,
    },
    /// A bar with a flat end and sharp edges.
    Bar {
        /// Length along its direction, m.
        length_m: f64,
        /// Width, m.
        width_m: f64,
        /// Direction of its length, rad from the x axis.
        toward_rad: f64,
    },
    /// Two equal balls on one holder, whose axis is in the middle between them.
    TwoBalls {
        /// Radius of each, m.
        radius_m: f64,
        /// Distance of their centres, m.
        apart_m: f64,
        /// Direction from one to the other, rad from the x axis.
        toward_rad: f64,
    },
}

/// Height of a face beyond its edge, m: so high that it never touches.
const BEYOND_M: f64 = 1.0;

impl Indenter {
    /// Height of the face at a place relative to the axis, above the point whose depth counts, m;
    /// sharp edges lie `edge_m` further out.
    pub(super) fn height_m(&self, x_m: f64, y_m: f64, edge_m: f64) -> f64 {
        let turned = |toward_rad: f64| {
            let (sin, cos) = (libm::sin(toward_rad), libm::cos(toward_rad));
            (cos * x_m + sin * y_m, cos * y_m - sin * x_m)
        };
        match *self {
            Self::Ball { radius_m } => sphere_m(radius_m, x_m, y_m),
            Self::Pin { radius_m } => {
                if libm::hypot(x_m, y_m) <= radius_m + edge_m {
                    0.0
                } else {
                    BEYOND_M
                }
            }
            Self::Tilted {
                radius_m,
                tilt_rad,
                toward_rad,
            } => {
                let (along_m, _) = turned(toward_rad);
                if libm::hypot(x_m, y_m) <= radius_m + edge_m {
                    -libm::tan(tilt_rad) * along_m
                } else {
                    BEYOND_M
                }
            }
            Self::Bar {
                length_m,
                width_m,
                toward_rad,
            } => {
                let (along_m, across_m) = turned(toward_rad);
                let within = |place_m: f64, side_m: f64| place_m.abs() <= 0.5 * side_m + edge_m;
                if within(along_m, length_m) && within(across_m, width_m) {
                    0.0
                } else {
                    BEYOND_M
                }
            }
            Self::TwoBalls {
                radius_m,
                apart_m,
                toward_rad,
            } => {
                let (along_m, across_m) = turned(toward_rad);
                let one = sphere_m(radius_m, along_m - 0.5 * apart_m, across_m);
                let other = sphere_m(radius_m, along_m + 0.5 * apart_m, across_m);
                one.min(other)
            }
        }
    }
}

fn sphere_m(radius_m: f64, x_m: f64, y_m: f64) -> f64 {
    let square = radius_m * radius_m - x_m * x_m - y_m * y_m;
    if square > 0.0 {
        radius_m - libm::sqrt(square)
    } else {
        BEYOND_M
    }
}
