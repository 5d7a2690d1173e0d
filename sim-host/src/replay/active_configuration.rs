//! Settings and calibration in force on a board.

use palpate_wire::Command;
use palpate_wire::command::Settings;
use palpate_wire::record::Hello;

/// Settings, calibration and identity of a board.
#[derive(Clone, Debug)]
pub struct ActiveConfiguration {
    /// Identity that the board reports.
    pub hello: Hello,
    /// The settings.
    pub settings: Settings,
    /// Commands that set the parts of its calibration, without the settings.
    pub calibration: Vec<Command>,
}
