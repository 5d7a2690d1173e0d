//! Springs in series: load, frame under the load, sensing layer, actuated layer.
//!
//! From the press to the base, one force F passes through all of them:
//!
//! F = F_L(x_L − Σ z_L),  F = c_S (x_S − Σ z_S),  F + F_att = c_D (x_D − Σ z_D),
//! x_L + φ F + x_S + x_D = x_0 + growth,
//!
//! with the overall displacement x_0 of the press, the compliance φ of the frame, the attraction
//! F_att = k I² (1 + γ x_D) between the halves of the actuated layer, and the displacements z of
//! the creep of layers and load. Without disturbances this is SOURCES.md section 2. Displacements are
//! compressions, positive. Inertia is neglected, as in the paper: five grams on 4 N/mm swing at
//! 140 Hz, above any vibration of the press, though not far above its 120 Hz.
//!
//! Two disturbed worlds add terms that no drawn plant has: friction J beside the sensing layer, so
//! that the layer carries F − J, and a pull P of the actuating coils on the load, so that the load
//! and the frame carry F − P. Under a tilted contact x_S contains the displacement of a gap that
//! closes.
//!
//! [`load`] is the object, [`contact`] its place and tilt on the sensor, [`indented`] an object under a
//! tip, [`layer`] a layer with its creep, [`friction`] the stick-slip element,
//! [`chain`] the balance, [`energy`] the balance of work, [`press`] the motion of the press.

pub mod chain;
pub mod contact;
pub mod energy;
pub mod friction;
pub mod indented;
pub mod layer;
pub mod load;
pub mod press;
