//! The parts of a calibration as items: which command is stored under which key.

use palpate_wire::Command;
use palpate_wire::command::{
    Attraction, CalibrationIdentity, Coil, Crosstalk, CurrentCorrection, DeformationCurve, Springs,
    Stiffening, StiffeningCurve, Tank, TemperatureCoefficients, TemperatureEffect,
};

use crate::item::{Item, Key};
use crate::payload;

/// Defines how each kind of part is stored: its number, the version of its layout, `whole` or
/// `chunk`, the command that sets it, and its place. A number is never used again for another kind,
/// and a version rises with every change of the payload's layout.
///
/// Parts are read and set in the order of their numbers. Two kinds that take each other's place
/// have the same number, so that a save of one replaces the other; then one is whole and one is
/// chunks.
macro_rules! parts {
    ($($number:literal, $version:literal, $extent:ident $setter:ident($payload:ident),
        $of:ident => $place:expr;)+) => {
        /// The key of what a command sets; `None` if it sets no part.
        fn key(command: &Command) -> Option<Key> {
            Some(match command {
                $(Command::$setter($of) => Key {
                    number: $number,
                    place: $place,
                    index: index!($extent, $of),
                },)+
                _ => return None,
            })
        }

        /// What a command sets as an item; `None` if it sets no part.
        pub(crate) fn item(command: &Command) -> Option<Item> {
            let (version, payload) = match command {
                $(Command::$setter(part) => ($version, payload::write(part)),)+
                _ => return None,
            };
            Some(Item { key: key(command)?, version, payload: payload? })
        }

        /// Whether this firmware knows a part and its version.
        pub(crate) const fn knows(key: Key, version: u8) -> bool {
            match (key.number, key.index, version) {
                $(($number, indices!($extent), $version) => true,)+
                _ => false,
            }
        }

        /// The command that sets what an item holds. `None` if its payload cannot be read, or is
        /// that of another item.
        pub(crate) fn command(item: &Item) -> Option<Command> {
            let command = match (item.key.number, item.key.index, item.version) {
                $(($number, indices!($extent), $version) => {
                    Command::$setter(payload::read::<$payload>(&item.payload)?)
                })+
                _ => return None,
            };
            (key(&command)? == item.key).then_some(command)
        }
    };
}

/// Index in the key: a chunk has that of its first knot, counted from 1.
macro_rules! index {
    (whole, $of:ident) => {
        0
    };
    (chunk, $of:ident) => {
        $of.first.saturating_add(1)
    };
}

/// The indices that a part may have.
macro_rules! indices {
    (whole) => {
        0
    };
    (chunk) => {
        1..=u8::MAX
    };
}

/// Place of what there is once.
const ONLY: u8 = 0;

/// Place of a channel of a converter.
const fn channel(sensor: u8, channel: u8) -> u8 {
    sensor << 4 | channel
}

parts! {
    2, 1, whole SetTank(Tank), of => channel(of.sensor, of.channel);
    3, 1, chunk SetDeformationCurve(DeformationCurve), of => channel(of.sensor, of.channel);
    4, 1, whole SetCrosstalk(Crosstalk), of => channel(of.sensor, of.channel);
    5, 1, whole SetSprings(Springs), _of => ONLY;
    6, 1, whole SetStiffening(Stiffening), _of => ONLY;
    6, 1, chunk SetStiffeningCurve(StiffeningCurve), of => ONLY;
    7, 1, whole SetCoil(Coil), _of => ONLY;
    8, 1, whole SetAttraction(Attraction), _of => ONLY;
    9, 1, whole SetTemperatureEffect(TemperatureEffect), _of => ONLY;
    10, 1, whole SetCurrentCorrection(CurrentCorrection), _of => ONLY;
    11, 1, whole SetTemperatureCoefficients(TemperatureCoefficients), _of => ONLY;
    // The last: it is checked against all others, also those that are still to come.
    240, 1, whole SetCalibrationIdentity(CalibrationIdentity), _of => ONLY;
}
