//! Arguments of `palpate check`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use palpate_cli::quantity;

use crate::board::link;
use crate::commands::calibrate::sensor::{spring as stiffness_of, tolerance};

/// Check a board's calibration, and correct what has changed
///
/// Temperature and age change the stiffening, which no press upon an unknown object shows. One press upon a
/// spring of known stiffness does: what the calibration leaves open of the stiffening is corrected, and a
/// calibration that is off by more than three standard errors is refused.
///
/// With --untouched nothing is pressed. A train shows whether the current still adds to the reading what it added on
/// the bench: a change is corrected. The current may be another than the board measures then, so that the change counts
/// as an uncertainty of the stiffening, until a known spring is pressed.
#[derive(Args)]
#[command(after_help = "\
First without a press, then with a spring. The spring should be about as stiff as the sensing layer, \
and be pressed as deep as objects are. The calibration is active at once, and lost at power-off unless \
it is stored.

Exit code 1 if the press contradicts the calibration, or the board refuses the measurement.

Examples:
  palpate check --untouched cold.json
  palpate check --spring 8000 --store
  palpate check --board emulated --load 1 --store")]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(super) link: link::Arguments,
    /// Check by a train without a press, compared with the bench's own in the session that the
    /// calibration was made of (`palpate calibrate sensor --save-session`)
    #[arg(long, value_name = "SESSION.json", conflicts_with_all = ["spring", "tolerance", "load", "wait"])]
    pub(super) untouched: Option<PathBuf>,
    /// Stiffness of the spring in series with its stand, N/m. The emulated board knows its own
    #[arg(long, value_name = "N_PER_M", value_parser = stiffness_of)]
    pub(super) spring: Option<f64>,
    /// Relative tolerance of the spring
    #[arg(long, value_name = "PART", default_value_t = 0.01, value_parser = tolerance)]
    pub(super) tolerance: f64,
    /// What the emulated board presses: a spring of this multiple of the sensing layer's nominal
    /// stiffness
    #[arg(long, value_name = "RATIO", default_value_t = 1.0, value_parser = quantity::load, allow_negative_numbers = true)]
    pub(super) load: f64,
    /// Timeout for a contact, s
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = quantity::duration, allow_negative_numbers = true)]
    pub(super) wait: Duration,
    /// Store the corrected calibration
    #[arg(long)]
    pub(super) store: bool,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
}
