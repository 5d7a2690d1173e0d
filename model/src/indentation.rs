//! Modulus of an indented object, from the contact's tangent stiffness c and force F.
//!
//! A rigid, frictionless tip is pressed into a linear elastic, isotropic object: a half-space, or a
//! layer of thickness h that is bonded to a rigid base. With E* = E/(1 - nu^2) and the radius a of
//! the contact,
//!
//! c = 2 a E* kappa(a/h, nu).
//!
//! A flat pin has the contact radius of its face. For a ball of radius R (Hertz) it follows from
//! c and F without the depth,
//!
//! F/c = (2/3) (a^2/R) lambda(a/h, nu)/kappa(a/h, nu),
//!
//! since the tangent stiffness of a smooth axisymmetric tip is that of a flat pin of the present
//! contact radius: all points of the contact move alike in a small further step. On a half-space
//! kappa = lambda = 1, the depth is 3F/(2c) and E* = c/(2 sqrt(R depth)).
//!
//! kappa and lambda are the ratios of stiffness and of force between a layer and a half-space at
//! the same contact radius: Hayes, Keer, Herrmann, Mockros, J. Biomech. 5 (1972) 541. Here they are
//! polynomials fitted to a solution of Hayes' integral equation.
//!
//! ```
//! use palpate_model::indentation::{Indentation, Tip};
//! use palpate_model::units::{Metre, Newton, NewtonPerMetre};
//! let pin = Indentation {
//!     tip: Tip::FlatPin,
//!     radius: Metre(3e-3),
//!     thickness: None,
//!     poisson_ratio: 0.5,
//! };
//! let modulus = pin.modulus(NewtonPerMetre(6e3), Newton(1.8)).unwrap();
//! assert!((modulus.reduced.0 / 1e6 - 1.0).abs() < 1e-6);
//! assert!((modulus.young.0 / 0.75e6 - 1.0).abs() < 1e-6);
//! ```

use core::fmt;

use crate::math;
use crate::units::{Metre, Newton, NewtonPerMetre, Pascal};

/// Shape of the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tip {
    /// Cylinder with a flat face.
    FlatPin,
    /// Sphere.
    Ball,
}

/// Tip and object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Indentation {
    /// Shape of the tip.
    pub tip: Tip,
    /// Radius of the pin's face or of the ball.
    pub radius: Metre,
    /// Thickness of an object that is bonded to a rigid base; `None` for a thick one.
    pub thickness: Option<Metre>,
    /// Poisson's ratio nu of the object.
    pub poisson_ratio: f32,
}

/// Modulus of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulus {
    /// Young's modulus E.
    pub young: Pascal,
    /// E* = E/(1 - nu^2).
    pub reduced: Pascal,
    /// Relative standard uncertainty of E by what the formulas leave out.
    pub formula_uncertainty: f32,
}

/// Limit of the formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Depth of a pin over its radius.
    PinDepth,
    /// Contact radius over the ball's radius.
    BallContact,
    /// Contact radius over the thickness.
    Thickness,
    /// Depth over the thickness.
    LayerDepth,
    /// Poisson's ratio of a layer.
    LayerPoissonRatio,
}

impl Limit {
    /// Returns the limiting value.
    ///
    /// - Pin: on a thick object the linear theory is robust to depth ("Non-ideal effects in
    ///   indentation testing of soft tissues", Biomech. Model. Mechanobiol. 13 (2014) 573).
    /// - Ball: Hertz's paraboloid and a sphere differ in E by 3.4 % at 0.4 (Sneddon, Int. J. Eng.
    ///   Sci. 3 (1965) 47); on a neo-Hookean half-space Hertz is accepted to a depth of 0.1 R, which
    ///   is a contact radius of 0.32 R (J. Appl. Mech. 87 (2020) 051003).
    /// - Layer: range of the fit, and a depth at which E is off by up to 23 % on layers of half the
    ///   contact radius (Choi, Zheng, Med. Biol. Eng. Comput. 43 (2005) 258).
    pub const fn value(self) -> f32 {
        match self {
            Self::PinDepth => 0.2,
            Self::BallContact => 0.4,
            Self::Thickness => 1.0,
            Self::LayerDepth => 0.1,
            Self::LayerPoissonRatio => 0.3,
        }
    }
}

/// A contact for which the formulas do not hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfLimit {
    /// The limit.
    pub limit: Limit,
    /// The contact's value.
    pub value: f32,
}

impl fmt::Display for OutOfLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, of, remedy) = match self.limit {
            Limit::PinDepth => ("the pin's depth", "of its radius", "use a larger pin"),
            Limit::BallContact => (
                "the contact's radius",
                "of the ball's radius",
                "use a larger ball",
            ),
            Limit::Thickness => (
                "the contact's radius",
                "of the object's thickness",
                "use a smaller tip or a thicker object",
            ),
            Limit::LayerDepth => (
                "the tip's depth",
                "of the object's thickness",
                "use a larger tip or a thicker object",
            ),
            Limit::LayerPoissonRatio => {
                let (value, least) = (self.value, self.limit.value());
                return write!(
                    f,
                    "Poisson's ratio of a thin object is {value}; at least {least} is covered: use a \
                     thicker object"
                );
            }
        };
        let (value, greatest) = (self.value, self.limit.value());
        write!(
            f,
            "{what} is {value:.2} {of}; at most {greatest} is covered: {remedy}"
        )
    }
}

impl core::error::Error for OutOfLimit {}

impl Indentation {
    /// Returns the modulus from the contact's tangent stiffness and its force.
    pub fn modulus(&self, stiffness: NewtonPerMetre, force: Newton) -> Result<Modulus, OutOfLimit> {
        let contact = self.contact_radius(stiffness, force);
        self.check(contact, force / stiffness)?;
        Ok(self.modulus_at(stiffness, contact, force / stiffness))
    }

    /// Returns the modulus as [`modulus`](Self::modulus) does, without a check of the limits: for the
    /// ends of an interval.
    pub fn unchecked(&self, stiffness: NewtonPerMetre, force: Newton) -> Modulus {
        let contact = self.contact_radius(stiffness, force);
        self.modulus_at(stiffness, contact, force / stiffness)
    }

    fn modulus_at(&self, stiffness: NewtonPerMetre, contact: Metre, secant: Metre) -> Modulus {
        let aspect = self.aspect(contact);
        let nu = self.poisson_ratio;
        let reduced = stiffness.0 / (2.0 * contact.0 * stiffness_factor(aspect, nu));
        Modulus {
            young: Pascal(reduced * (1.0 - nu * nu)),
            reduced: Pascal(reduced),
            formula_uncertainty: self.formula_uncertainty(contact, secant),
        }
    }

    /// Radius of the contact; for a ball on a layer by a fixed-point iteration.
    fn contact_radius(&self, stiffness: NewtonPerMetre, force: Newton) -> Metre {
        if self.tip == Tip::FlatPin {
            return self.radius;
        }
        let thick_m = math::sqrt(1.5 * self.radius.0 * (force / stiffness).0);
        // The error shrinks by three or more with every step.
        let of = |contact_m: f32| {
            let (aspect, nu) = (self.aspect(Metre(contact_m)), self.poisson_ratio);
            thick_m * math::sqrt(stiffness_factor(aspect, nu) / force_factor(aspect, nu))
        };
        Metre((0..16).fold(thick_m, |contact_m, _| of(contact_m)))
    }

    /// a/h, zero for a thick object.
    fn aspect(&self, contact: Metre) -> f32 {
        self.thickness.map_or(0.0, |thickness| contact / thickness)
    }

    /// Depth, from above for a ball on a layer. `secant` is F/c.
    fn depth(&self, contact: Metre, secant: Metre) -> Metre {
        match self.tip {
            Tip::FlatPin => secant,
            Tip::Ball => contact * (contact / self.radius),
        }
    }

    fn check(&self, contact: Metre, secant: Metre) -> Result<(), OutOfLimit> {
        let depth = self.depth(contact, secant);
        let of_tip = match self.tip {
            Tip::FlatPin => (Limit::PinDepth, depth / self.radius),
            Tip::Ball => (Limit::BallContact, contact / self.radius),
        };
        let of_layer = self.thickness.map(|thickness| {
            [
                (Limit::Thickness, contact / thickness),
                (Limit::LayerDepth, depth / thickness),
            ]
        });
        for (limit, value) in [of_tip].into_iter().chain(of_layer.into_iter().flatten()) {
            // NaN is out of every limit.
            if !(value <= limit.value()) {
                return Err(OutOfLimit { limit, value });
            }
        }
        let limit = Limit::LayerPoissonRatio;
        let value = self.poisson_ratio;
        if self.thickness.is_some() && !(value >= limit.value()) {
            return Err(OutOfLimit { limit, value });
        }
        Ok(())
    }

    /// Relative standard uncertainty of E by the linear theory. Each error is taken as uniform up to
    /// the bound that [`Limit::value`] cites: 0.21 (a/R)^2 for a ball, and for the tangent stiffness
    /// of a layer twice 23 % at a depth of 0.1 h and a contact radius of 2 h, so 2.3 (depth/h) (a/h).
    fn formula_uncertainty(&self, contact: Metre, secant: Metre) -> f32 {
        const UNIFORM: f32 = 0.577;
        let of_ball = match self.tip {
            Tip::FlatPin => 0.0,
            Tip::Ball => {
                let ratio = contact / self.radius;
                0.21 * ratio * ratio
            }
        };
        let of_layer = self.thickness.map_or(0.0, |thickness| {
            2.3 * (self.depth(contact, secant) / thickness) * (contact / thickness)
        });
        UNIFORM * math::hypot(of_ball, of_layer)
    }
}

/// kappa(a/h, nu): relative error at most 0.12 % for a/h to 1 and nu from 0.3 to 0.5. Beyond, the
/// value at the nearest end.
pub fn stiffness_factor(aspect: f32, poisson_ratio: f32) -> f32 {
    // ln kappa: a row for each power of a/h from 1, a column for each power of nu - 0.4 from 0.
    const LN: [[f32; 4]; 4] = [
        [0.97315, 1.13544, 3.30324, 9.17994],
        [0.49866, 1.44886, 5.60824, 13.45909],
        [-0.64224, -1.29989, -2.32112, 1.53551],
        [0.19678, 0.35056, 0.4607, 0.55218],
    ];
    let (aspect, nu) = in_range(aspect, poisson_ratio);
    math::exp(aspect * polynomial(&LN, aspect, nu))
}

/// lambda(a/h, nu) of a ball: relative error at most 0.2 %, in the range of [`stiffness_factor`].
pub fn force_factor(aspect: f32, poisson_ratio: f32) -> f32 {
    // ln lambda: a row for each power of a/h from 2, a column for each power of nu - 0.4 from 0.
    const LN: [[f32; 3]; 3] = [
        [0.06566, 0.08482, 0.26744],
        [0.48095, 1.13815, 3.80278],
        [-0.277, -0.66667, -2.35443],
    ];
    let (aspect, nu) = in_range(aspect, poisson_ratio);
    math::exp(aspect * aspect * polynomial(&LN, aspect, nu))
}

/// Limits a/h and nu to the fits' range; returns a/h and nu - 0.4.
fn in_range(aspect: f32, poisson_ratio: f32) -> (f32, f32) {
    let least = Limit::LayerPoissonRatio.value();
    let aspect = aspect.clamp(0.0, Limit::Thickness.value());
    (aspect, poisson_ratio.clamp(least, 0.5) - 0.4)
}

/// Polynomial in x with coefficients that are polynomials in y; lowest powers first.
fn polynomial<const N: usize>(rows: &[[f32; N]], x: f32, y: f32) -> f32 {
    let horner = |row: &[f32; N]| row.iter().rev().fold(0.0, |sum, of| sum * y + of);
    rows.iter()
        .rev()
        .fold(0.0, |sum, row| sum * x + horner(row))
}
