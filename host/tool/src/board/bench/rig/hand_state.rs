//! State of a stage that is driven by hand.

/// State of a stage driven by hand.
#[derive(Default)]
pub(super) struct Hand {
    /// Reading of the stage's scale, m; `None` while the stage moves.
    pub(super) position_m: Option<f64>,
    /// Whether the stage has a scale; `None` before the first touch.
    pub(super) has_scale: Option<bool>,
    /// Reading of the stage's scale at the last touch, m; `None` without a scale.
    pub(super) touch_m: Option<f64>,
}
