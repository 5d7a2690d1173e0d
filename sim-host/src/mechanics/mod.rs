//! Springs in series: load, what the load stands on, sensing layer, actuated layer.
//!
//! From the press to the base, one force F passes through all of them:
//!
//! F = F_L(x_L),  F = c_S (x_S − Σ z_S),  F + F_att = c_D (x_D − Σ z_D),
//! x_L + φ F + x_S + x_D = x_0 + growth,
//!
//! with the overall displacement x_0 of the press, the compliance φ of the frame, the attraction
//! F_att = k I² (1 + γ x_D) between the halves of the actuated layer, and the displacements z of
//! the layers' creep. Without disturbances this is SOURCES.md section 2. Displacements are
//! compressions, positive. Inertia is neglected, as in the paper: five grams on 4 N/mm swing at
//! 140 Hz, above what shakes the press, though not far above its 120 Hz.
//!
//! Two worlds add to it what no drawn plant has: friction J beside the sensing layer, so that F − J is in the layer, and
//! a pull P of the actuating coils on the load, so that F − P is in the load and in the frame.
//!
//! [`load`] is the object, [`layer`] a layer with its creep, [`friction`] what sticks and slips, [`chain`] the balance, [`energy`] the
//! account of work, [`press`] what moves the whole.

pub mod chain;
pub mod energy;
pub mod friction;
pub mod layer;
pub mod load;
pub mod press;
