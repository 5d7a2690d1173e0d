//! The comments between which `cargo xtask evidence` finds what it keeps of a campaign's output.

pub(crate) const BEGIN: &str = "<!-- evidence:begin -->";
pub(crate) const END: &str = "<!-- evidence:end -->";
