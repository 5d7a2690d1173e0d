//! Comments that mark the part of a campaign's output which `cargo xtask evidence` keeps.

/// Start of that part.
pub const BEGIN: &str = "<!-- evidence:begin -->";
/// End of that part.
pub const END: &str = "<!-- evidence:end -->";
