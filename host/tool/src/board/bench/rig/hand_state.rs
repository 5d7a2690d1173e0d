//! State of a stage that is driven by hand.

/// State of a stage driven by hand.
#[derive(Default)]
pub(super) struct Hand {
    /// Position of the scale while it rests, m.
    pub(super) position_m: Option<f64>,
    /// Whether the stage has a scale; `None` before the first touch.
    pub(super) has_scale: Option<bool>,
    /// Position of the scale at the last touch, m.
    pub(super) touch_m: Option<f64>,
}
