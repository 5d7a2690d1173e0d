//! Benches with a board at the other end of a link.

mod bare;
mod linked;
mod rig;

pub(crate) use bare::BareInstrument;
pub(crate) use linked::LinkedBench;
pub(crate) use rig::{RigBench, RigPlan};
