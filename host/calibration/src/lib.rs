//! Evaluation of the data recorded on the bench into a calibration.
//!
//! All arithmetic is `f64` and shares no function with the instrument's own.
//!
//! 1. `curve`: load cell and coil during quick presses onto a block give the force against the
//!    relative change of inductance; deformation is force over a nominal c_S. Only ratios of
//!    deformations enter a stiffness (eq. (2) is homogeneous in them), so the nominal value sets
//!    only the scale of the deformation.
//! 2. `crosstalk`: the train without contact gives the current's effect on the reading.
//! 3. `actuated`: the trains on block and springs, all together, give c_D0, the rise over the
//!    current, attraction, and growth of the cross-talk, by least squares.
//! 4. `adjustment`: adjusts five of these quantities to the load that each train gives by itself.
//! 5. `claim`: the uncertainty from the trains' scatter and the springs' tolerance.
//! 6. `contact`: what place and tilt of the contact change, by displaced presses of the block.
//!
//! [`evaluate_both`] takes sessions of the same bench at two temperatures and determines the
//! temperature coefficients of springs and rise.
//!
//! [`touch`] calibrates an array of several sensing coils.
//!
//! Later, in use, [`check_untouched`] corrects a calibration by a train without a press, and
//! [`check`] by one press onto a known spring.

mod actuated;
mod actuated_layer;
mod adjustment;
pub mod bench;
mod calibration;
mod check;
pub mod checks;
mod claim;
mod commands;
mod contact;
mod creep;
mod crosstalk;
mod curve;
mod evaluation;
mod fall;
mod known;
pub mod least_squares;
mod line;
#[cfg(test)]
mod made;
mod samples;
mod scatter;
pub mod session;
mod temperature;
mod terms;
pub mod touch;
mod travel;
mod unchecked;
mod untouched;
mod unusable;

pub use actuated_layer::Actuated;
pub use calibration::{Basis, Calibration, Coefficient, Coefficients};
pub use check::{Checked, KnownPress, check};
pub use claim::{LOADS, Parts, Uncertainty};
pub use contact::ContactEffect;
pub use crosstalk::Crosstalk;
pub use curve::{frame, zero_shift_m};
pub use evaluation::evaluate;
pub use fall::Fall;
pub use known::Known;
pub use line::{FallSample, LinePoint, TrainFit};
pub use scatter::train_scatter;
pub use temperature::evaluate_both;
pub use travel::{SpringDeviation, spring_deviations};
pub use unchecked::{MOST_CHANGE, MOST_DEVIATION, Unchecked};
pub use untouched::{OnTheBench, Untouched, check_untouched};
pub use unusable::{LEAST_DIFFERENCE_K, MOST_PER_K, Signal, Unusable};
