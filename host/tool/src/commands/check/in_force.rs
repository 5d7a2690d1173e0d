//! The calibration in force on a board: read, and written back.

use palpate_cli::failure::Failure;
use palpate_wire::Command;

use crate::board::configuration;
use crate::board::link::Link;
use crate::commands::calibrate::sensor::{identity, put_in_force};

/// Reads the calibration in force with the settings, which are in force even if they were never
/// set.
pub(super) fn in_force(link: &mut Link) -> Result<Vec<Command>, Failure> {
    let mut commands = configuration::read(link)?;
    let has_settings = commands
        .iter()
        .any(|command| matches!(command, Command::SetSettings(_)));
    if !has_settings {
        let settings = configuration::settings(link)?;
        commands.insert(0, Command::SetSettings(settings));
    }
    Ok(commands)
}

/// Puts the corrected calibration in force, with its previous number.
pub(super) fn keep(
    link: &mut Link,
    commands: &[Command],
    temperature_c: Option<f64>,
) -> Result<(), Failure> {
    let before = commands.iter().find_map(|command| match command {
        Command::SetCalibrationIdentity(identity) => Some(identity.clone()),
        _ => None,
    });
    let parts: Vec<Command> = commands
        .iter()
        .filter(|command| !matches!(command, Command::SetCalibrationIdentity(_)))
        .cloned()
        .collect();
    let calibrated_at_c = before.as_ref().map(|identity| identity.calibrated_at_c);
    let temperature_c = temperature_c.or(calibrated_at_c.map(f64::from));
    let identity = identity(
        before.map(|identity| identity.id),
        temperature_c.unwrap_or_default(),
    );
    put_in_force(link, &parts, identity)
}
