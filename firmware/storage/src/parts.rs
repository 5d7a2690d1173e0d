//! Calibration parts as items: the key of each command.

use palpate_wire::Command;
use palpate_wire::command::{
    Attraction, CalibrationIdentity, Coil, ContactTolerance, Creep, Crosstalk, CurrentCorrection,
    DeformationCurve, Springs, Stiffening, StiffeningCurve, Tank, TemperatureCoefficients,
    TemperatureEffect, Tip, TouchArray,
};

use crate::item::{Item, Key};
use crate::payload;

/// Defines the storage of each kind of part: number, layout version, `whole` or `chunk`, the command
/// that sets it, and its place. A number is never reused for another kind, and the version rises with
/// every change of the payload's layout.
///
/// Parts are read and set in the order of their numbers. Two kinds that replace each other share a
/// number, so that a save of one replaces the other; one of them is whole and the other is in chunks.
macro_rules! parts {
    ($($number:literal, $version:literal, $extent:ident $setter:ident($payload:ident),
        $of:ident => $place:expr;)+) => {
        /// Returns the key of a command's part; `None` if it sets no part.
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

        /// Returns a command as an item; `None` if it sets no part.
        pub(crate) fn item(command: &Command) -> Option<Item> {
            let (version, payload) = match command {
                $(Command::$setter(part) => ($version, payload::write(part)),)+
                _ => return None,
            };
            Some(Item { key: key(command)?, version, payload: payload? })
        }

        /// Returns whether this firmware knows a part and its version.
        pub(crate) const fn knows(key: Key, version: u8) -> bool {
            match (key.number, key.index, version) {
                $(($number, indices!($extent), $version) => true,)+
                _ => false,
            }
        }

        /// Returns the command that sets the part in an item. `None` if its payload is unreadable or
        /// belongs to another key.
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

/// Index in a part's key: 0 for a whole part; for a chunk that of its first knot, counted from 1.
macro_rules! index {
    (whole, $of:ident) => {
        0
    };
    (chunk, $of:ident) => {
        $of.first.saturating_add(1)
    };
}

/// Valid indices of a part.
macro_rules! indices {
    (whole) => {
        0
    };
    (chunk) => {
        1..=u8::MAX
    };
}

/// Place of a part that exists once.
const ONLY: u8 = 0;

/// Returns the place of a channel of a converter.
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
    13, 1, whole SetTip(Tip), _of => ONLY;
    18, 1, whole SetContact(ContactTolerance), _of => ONLY;
    19, 1, chunk SetTouchArray(TouchArray), of => ONLY;
    20, 1, whole SetCreep(Creep), _of => ONLY;
    // The identity is last, since it is checked against all other parts, including those of later
    // versions.
    240, 1, whole SetCalibrationIdentity(CalibrationIdentity), _of => ONLY;
}
