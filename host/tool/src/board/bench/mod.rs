//! Benches for a board on a link.

mod bare;
mod linked;
mod rig;

pub(crate) use bare::BareInstrument;
pub(crate) use linked::LinkedBench;
pub(crate) use rig::{RigBench, RigPlan};
