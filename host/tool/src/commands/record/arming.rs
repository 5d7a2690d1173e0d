//! Before a recording of measurements.

use palpate_cli::failure::Failure;
use palpate_wire::{Command, Record};

use crate::board::link::Link;

/// How long the settings may take that follow their command's answer, s.
const RECORD_S: f64 = 5.0;

/// Lets the board learn anew what the untouched sensor reads, and arms it.
///
/// It learns anew when settings are set: here those that are in force already. All that it computes from
/// then on follows from what is recorded, so that a replay begins there.
pub(super) fn arm(link: &mut Link) -> Result<(), Failure> {
    link.must(&Command::Disarm)?;
    link.must(&Command::GetSettings)?;
    let settings = link.wait_for(RECORD_S, "settings", |record| match record {
        Record::Settings(settings) => Some(settings.clone()),
        _ => None,
    })?;
    link.must(&Command::SetSettings(settings))?;
    link.must(&Command::Arm)?;
    Ok(())
}
