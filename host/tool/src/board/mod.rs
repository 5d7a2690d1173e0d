//! Boards: links, real and emulated boards, their storage, and benches for their calibration.

pub(crate) mod bench;
pub(crate) mod configuration;
pub(crate) mod emulated;
pub(crate) mod engine;
pub mod image;
pub(crate) mod link;
pub(crate) mod log;
pub(crate) mod storage;
pub(crate) mod switches;
