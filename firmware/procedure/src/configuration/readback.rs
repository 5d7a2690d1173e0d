//! Configuration as the commands that would set it, for readback and for its CRC.

use palpate_wire::code::Part;
use palpate_wire::command::{
    DeformationCurve, DeformationKnot, KNOTS_PER_CHUNK, StiffeningCurve, StiffeningKnot,
};
use palpate_wire::{Command, Record, configuration_crc};

use super::parts::{PARTS, is_of_a_channel};
use super::{Configuration, Curve, SetStiffening};
use crate::list::gathered;

/// Highest channel number: 0 to 3 are on the first converter, 4 to 7 on the second.
const LAST_CHANNEL: u8 = 7;

/// Position in the sequence of commands that would set a configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cursor {
    settings_are_done: bool,
    /// Index in [`PARTS`].
    part: usize,
    /// Number of the channel: 0 to 3 of the first converter, 4 to 7 of the second.
    channel: u8,
    chunk: usize,
}

impl Cursor {
    /// Position after the settings, at the first part of the calibration.
    const CALIBRATION: Self = Self {
        settings_are_done: true,
        part: 0,
        channel: 0,
        chunk: 0,
    };
}

impl Configuration {
    /// Returns the CRC-32 over the active settings and calibration, as `hello` reports it.
    pub fn crc(&self) -> u32 {
        configuration_crc(self.commands(Cursor::default()))
    }

    /// Returns the CRC-32 over the parts of the calibration, without its identity, tip and array.
    pub fn calibration_crc(&self) -> u32 {
        let is_part = |command: &Command| {
            !matches!(
                command,
                Command::SetCalibrationIdentity(_) | Command::SetTip(_) | Command::SetTouchArray(_)
            )
        };
        configuration_crc(self.commands(Cursor::CALIBRATION).filter(is_part))
    }

    /// Returns the commands that would set the configuration, from a position on.
    fn commands(&self, mut cursor: Cursor) -> impl Iterator<Item = Command> + '_ {
        core::iter::from_fn(move || self.next_command(&mut cursor))
    }

    /// Returns the next command that would set the configuration; settings only if they were set.
    pub(crate) fn next_command(&self, cursor: &mut Cursor) -> Option<Command> {
        if !core::mem::replace(&mut cursor.settings_are_done, true) && self.settings_are_set {
            return Some(Command::SetSettings(self.settings.clone()));
        }
        loop {
            let part = *PARTS.get(cursor.part)?;
            let (sensor, channel) = (cursor.channel / 4, cursor.channel % 4);
            if let Some(command) = self.setter(part, sensor, channel, cursor.chunk) {
                cursor.chunk += 1;
                return Some(command);
            }
            let is_last = !is_of_a_channel(part) || cursor.channel == LAST_CHANNEL;
            *cursor = Cursor {
                part: cursor.part + usize::from(is_last),
                channel: if is_last { 0 } else { cursor.channel + 1 },
                ..Cursor::CALIBRATION
            };
        }
    }

    /// Returns the record of a part of the calibration; for a curve, that of chunk number `chunk`, from
    /// 0. `None` if the part was never set or has no such chunk.
    pub(crate) fn record(
        &self,
        part: Part,
        sensor: u8,
        channel: u8,
        chunk: usize,
    ) -> Option<Record> {
        Some(match self.setter(part, sensor, channel, chunk)? {
            Command::SetTank(of) => Record::Tank(of),
            Command::SetDeformationCurve(of) => Record::DeformationCurve(of),
            Command::SetCrosstalk(of) => Record::Crosstalk(of),
            Command::SetSprings(of) => Record::Springs(of),
            Command::SetStiffening(of) => Record::Stiffening(of),
            Command::SetStiffeningCurve(of) => Record::StiffeningCurve(of),
            Command::SetCoil(of) => Record::Coil(of),
            Command::SetAttraction(of) => Record::Attraction(of),
            Command::SetTemperatureEffect(of) => Record::TemperatureEffect(of),
            Command::SetCurrentCorrection(of) => Record::CurrentCorrection(of),
            Command::SetTemperatureCoefficients(of) => Record::TemperatureCoefficients(of),
            Command::SetTip(of) => Record::Tip(of),
            Command::SetContact(of) => Record::Contact(of),
            Command::SetCreep(of) => Record::Creep(of),
            Command::SetTouchArray(of) => Record::TouchArray(of),
            Command::SetCalibrationIdentity(of) => Record::CalibrationIdentity(of),
            _ => return None,
        })
    }

    pub(super) fn setter(
        &self,
        part: Part,
        sensor: u8,
        channel: u8,
        chunk: usize,
    ) -> Option<Command> {
        let of = self.channel(sensor, channel);
        match part {
            Part::DeformationCurve => {
                return deformation_chunk(of?.curve.as_ref()?, sensor, channel, chunk);
            }
            Part::StiffeningCurve => return self.stiffening_chunk(chunk),
            Part::TouchArray => return self.array.as_ref()?.chunk(chunk),
            _ if chunk > 0 => return None,
            _ => {}
        }
        Some(match part {
            Part::Tank => Command::SetTank(of?.tank.clone()?),
            Part::Crosstalk => Command::SetCrosstalk(of?.crosstalk.clone()?),
            Part::Springs => Command::SetSprings(self.springs.clone()?),
            Part::Stiffening => match self.stiffening.as_ref()? {
                SetStiffening::Law(law) => Command::SetStiffening(law.clone()),
                SetStiffening::Curve { .. } => return None,
            },
            Part::Coil => Command::SetCoil(self.coil.clone()?),
            Part::Attraction => Command::SetAttraction(self.attraction.clone()?),
            Part::TemperatureEffect => {
                Command::SetTemperatureEffect(self.temperature_effect.clone()?)
            }
            Part::CurrentCorrection => {
                Command::SetCurrentCorrection(self.current_correction.clone()?)
            }
            Part::TemperatureCoefficients => {
                Command::SetTemperatureCoefficients(self.temperature_coefficients.clone()?)
            }
            Part::Tip => Command::SetTip(self.tip.clone()?),
            Part::Contact => Command::SetContact(self.contact.clone()?),
            Part::Creep => Command::SetCreep(self.creep.clone()?),
            Part::CalibrationIdentity => Command::SetCalibrationIdentity(self.identity.clone()?),
            _ => return None,
        })
    }

    fn stiffening_chunk(&self, chunk: usize) -> Option<Command> {
        let SetStiffening::Curve { rise, uncertainty } = self.stiffening.as_ref()? else {
            return None;
        };
        let (total, first) = position(rise, chunk)?;
        let knots = knots(rise, first);
        let knots = knots.map(|(current_a, rise)| StiffeningKnot { current_a, rise });
        Some(Command::SetStiffeningCurve(StiffeningCurve {
            total,
            first,
            rise_uncertainty: *uncertainty,
            knots: gathered(knots),
        }))
    }
}

/// Returns the number of knots of a curve and the index of a chunk's first one. `None` beyond the end.
fn position(curve: &Curve, chunk: usize) -> Option<(u8, u8)> {
    let total = curve.points().len();
    let first = chunk.checked_mul(KNOTS_PER_CHUNK)?;
    (first < total).then_some((total as u8, first as u8))
}

/// Returns the knots of the chunk that starts at `first`.
fn knots(curve: &Curve, first: u8) -> impl Iterator<Item = (f32, f32)> + '_ {
    curve.points().skip(first.into()).take(KNOTS_PER_CHUNK)
}

fn deformation_chunk(curve: &Curve, sensor: u8, channel: u8, chunk: usize) -> Option<Command> {
    let (total, first) = position(curve, chunk)?;
    let knots = knots(curve, first);
    let knots = knots.map(|(inductance_change, deformation_m)| DeformationKnot {
        inductance_change,
        deformation_m,
    });
    Some(Command::SetDeformationCurve(DeformationCurve {
        sensor,
        channel,
        total,
        first,
        knots: gathered(knots),
    }))
}
