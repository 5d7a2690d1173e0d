//! Preparation of a board for a recording of measurements.

use palpate_cli::failure::Failure;
use palpate_wire::{Command, Record};

use crate::board::link::Link;

/// Longest wait for the settings after the answer to their command, s.
const RECORD_S: f64 = 5.0;

/// Restarts the board's baseline and arms it.
///
/// The baseline restarts when the settings are set; here they keep their values. All later results
/// follow from recorded data, so a replay can start there.
pub(super) fn arm(link: &mut Link) -> Result<(), Failure> {
    link.send_accepted(&Command::Disarm)?;
    link.send_accepted(&Command::GetSettings)?;
    let settings = link.wait_for(RECORD_S, "settings", |record| match record {
        Record::Settings(settings) => Some(settings.clone()),
        _ => None,
    })?;
    link.send_accepted(&Command::SetSettings(settings))?;
    link.send_accepted(&Command::Arm)?;
    Ok(())
}
