//! The comments between which `cargo xtask evidence` finds what it keeps of a campaign's output.

/// Before it.
pub const BEGIN: &str = "<!-- evidence:begin -->";
/// After it.
pub const END: &str = "<!-- evidence:end -->";
