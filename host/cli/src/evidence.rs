//! Comments that mark the part of a campaign's output which `cargo xtask evidence` keeps.

/// Start of the part of an output that `cargo xtask evidence` keeps.
pub const BEGIN: &str = "<!-- evidence:begin -->";
/// End of the part of an output that `cargo xtask evidence` keeps.
pub const END: &str = "<!-- evidence:end -->";
