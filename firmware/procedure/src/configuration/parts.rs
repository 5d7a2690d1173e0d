//! Parts of a configuration, and the items that have a checksum each.

use palpate_wire::Command;
use palpate_wire::code::Part;

/// Parts in the order of the commands that set them.
pub(super) const PARTS: [Part; 16] = [
    Part::Tank,
    Part::DeformationCurve,
    Part::Crosstalk,
    Part::Springs,
    Part::Stiffening,
    Part::StiffeningCurve,
    Part::Coil,
    Part::Attraction,
    Part::TemperatureEffect,
    Part::CurrentCorrection,
    Part::TemperatureCoefficients,
    Part::Tip,
    Part::Contact,
    Part::TouchArray,
    Part::Creep,
    // Last, since it is checked against all others.
    Part::CalibrationIdentity,
];

/// Returns whether the part exists once per channel of each converter.
pub(super) const fn is_of_a_channel(part: Part) -> bool {
    matches!(part, Part::Tank | Part::DeformationCurve | Part::Crosstalk)
}

/// Number of parts that exist once per channel of each converter; they are first in [`PARTS`].
const OF_A_CHANNEL: usize = 3;

const CHANNELS: usize = 8;

/// Number of checksums: the settings and every part.
pub(crate) const ITEMS: usize = 1 + OF_A_CHANNEL * CHANNELS + (PARTS.len() - OF_A_CHANNEL);

/// Checksums, in the order of the items.
pub(super) type Sums = [u32; ITEMS];

/// Returns the part with a number, with converter and channel; `None` for the settings.
pub(super) fn item(number: usize) -> Option<(Part, u8, u8)> {
    let index = number.checked_sub(1)?;
    let (part, of) = if index < OF_A_CHANNEL * CHANNELS {
        (index / CHANNELS, (index % CHANNELS) as u8)
    } else {
        (index - OF_A_CHANNEL * (CHANNELS - 1), 0)
    };
    Some((*PARTS.get(part)?, of / 4, of % 4))
}

/// Returns whether a command sets an item.
pub(super) fn sets(command: &Command, number: usize) -> bool {
    use Part::{Crosstalk, DeformationCurve, Tank};
    let Some((part, sensor, channel)) = item(number) else {
        return matches!(command, Command::SetSettings(_));
    };
    if part == Part::CalibrationIdentity {
        return touches_the_identity(command);
    }
    let is_at = |at: (u8, u8)| at == (sensor, channel);
    match command {
        Command::SetTank(of) => part == Tank && is_at((of.sensor, of.channel)),
        Command::SetDeformationCurve(of) => {
            part == DeformationCurve && is_at((of.sensor, of.channel))
        }
        Command::SetCrosstalk(of) => part == Crosstalk && is_at((of.sensor, of.channel)),
        // Law and curve replace each other, so setting one changes both items.
        Command::SetStiffening(_) | Command::SetStiffeningCurve(_) => {
            matches!(part, Part::Stiffening | Part::StiffeningCurve)
        }
        Command::SetSprings(_) => part == Part::Springs,
        Command::SetCoil(_) => part == Part::Coil,
        Command::SetAttraction(_) => part == Part::Attraction,
        Command::SetTemperatureEffect(_) => part == Part::TemperatureEffect,
        Command::SetCurrentCorrection(_) => part == Part::CurrentCorrection,
        Command::SetTemperatureCoefficients(_) => part == Part::TemperatureCoefficients,
        Command::SetTip(_) => part == Part::Tip,
        Command::SetContact(_) => part == Part::Contact,
        Command::SetTouchArray(_) => part == Part::TouchArray,
        Command::SetCreep(_) => part == Part::Creep,
        _ => false,
    }
}

/// Returns whether a command sets or removes the calibration's identity; setting any part removes
/// it, except the tip, which is not calibrated, and the array, which is calibrated by itself.
pub(super) const fn touches_the_identity(command: &Command) -> bool {
    use Command::{
        SetAttraction, SetCalibrationIdentity, SetCoil, SetContact, SetCreep, SetCrosstalk,
        SetCurrentCorrection, SetDeformationCurve, SetSprings, SetStiffening, SetStiffeningCurve,
        SetTank, SetTemperatureCoefficients, SetTemperatureEffect,
    };
    matches!(
        command,
        SetTank(_)
            | SetDeformationCurve(_)
            | SetCrosstalk(_)
            | SetSprings(_)
            | SetStiffening(_)
            | SetStiffeningCurve(_)
            | SetCoil(_)
            | SetAttraction(_)
            | SetTemperatureEffect(_)
            | SetCurrentCorrection(_)
            | SetTemperatureCoefficients(_)
            | SetContact(_)
            | SetCreep(_)
            | SetCalibrationIdentity(_)
    )
}
