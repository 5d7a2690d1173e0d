//! What is at the other end: a link, a board on it or an emulated one, what it has stored, the benches it is calibrated on.

pub(crate) mod bench;
pub(crate) mod configuration;
pub(crate) mod emulated;
pub(crate) mod engine;
pub mod image;
pub(crate) mod link;
pub(crate) mod log;
pub(crate) mod storage;
pub(crate) mod switches;
