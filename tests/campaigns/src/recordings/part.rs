//! Result of one part of the campaign.

/// Result of a part: a sentence, and its failures.
pub(super) struct Part {
    pub(super) text: String,
    pub(super) failed: Option<String>,
}
