//! Place, force and contact radius of a press, from several sensing coils under one elastic layer.
//!
//! A press at the place x with the force F and the contact radius a changes the inductance of coil
//! i by
//!
//! dL_i = g_i (F Phi(|x - x_i|, a) + F^2 Psi(|x - x_i|, a)).
//!
//! All coils have one radial profile, Phi and Psi ([`Profile`]), a gain g_i and a place x_i. a is the radius
//! of the round contact with Hertz's pressure that has the press's second moment: a flat pin counts
//! with sqrt(5/3) of its radius.
//!
//! [`Array::estimate`] fits x, y, ln F and ln a to the readings of one scan, with the information
//! that is known beforehand of a ([`Indenter`]), and gives a [`Verdict`]: a [`Press`] with its
//! covariance, or why there is none.
//!
//! **Uncertainty.** The covariance is the inverse of the information of readings and indenter. The
//! error of a reading is its noise, and the calibration's uncertainty in a reduced form of five
//! numbers: what differs from coil to coil ([`ReadingError`]), and what is common to all coils and
//! is therefore added to the result ([`CommonError`]). The covariance of the coefficients itself
//! stays on the PC.
//!
//! **Limits.** With four coils and an unknown indenter there are as many readings as unknowns: most
//! second contacts, edges and tilted faces are explained by another single press. Of two contacts on
//! four coils, 23 % do not fit with an unknown and 80 % with a declared indenter; on seven coils 99 %.

mod array;
mod estimate;
mod matrix;
mod misfit;
mod profile;
mod region;
mod start;
mod verdict;

pub use array::{Array, ArrayError, Coil, CommonError, MOST_COILS, ReadingError};
pub use estimate::{Indenter, LEAST_SIGNIFICANCE, Track};
pub use profile::{BASE, BENT, BY_RADIUS, Coefficients, Profile};
pub use region::Region;
pub use verdict::{Ellipse, Press, Verdict};
