//! Settings as items, one per field.

use palpate_wire::command::Settings;

use crate::item::{Item, Key};
use crate::payload;

/// Kind number of every setting's item.
pub(crate) const NUMBER: u8 = 1;

/// Defines the storage of each field: its number, its layout version and its name. A number is never
/// reused for another field. The numbers rise, because items are stored in their order.
macro_rules! fields {
    ($($number:literal, $version:literal, $field:ident;)+) => {
        /// Numbers of the fields.
        pub(crate) const FIELDS: &[u8] = &[$($number),+];

        /// Returns a field as an item; `None` for a number without a field.
        pub(crate) fn item(settings: &Settings, number: u8) -> Option<Item> {
            // Names all fields, so a field that is missing in the table does not compile.
            let Settings { $($field),+ } = settings;
            let (version, payload) = match number {
                $($number => ($version, payload::write($field)),)+
                _ => return None,
            };
            let key = Key { number: NUMBER, place: number, index: 0 };
            Some(Item { key, version, payload: payload? })
        }

        /// Returns whether this firmware knows a field and its version.
        pub(crate) const fn knows(number: u8, version: u8) -> bool {
            matches!((number, version), $(($number, $version))|+)
        }

        /// Sets a field from an item. `None` if its payload is unreadable.
        pub(crate) fn take(settings: &mut Settings, item: &Item) -> Option<()> {
            match (item.key.place, item.version) {
                $(($number, $version) => settings.$field = payload::read(&item.payload)?,)+
                _ => {}
            }
            Some(())
        }
    };
}

fields! {
    1, 1, channels;
    2, 1, rate_hz;
    3, 1, stream;
    4, 1, decimation;
    5, 1, status_period_s;
    6, 1, contact_noise_m;
    7, 1, release_m;
    8, 1, least_press_m;
    9, 1, steady_m_per_s;
    10, 1, settling_s;
    11, 1, automatic;
    12, 1, peak_current_a;
    13, 1, end_current_a;
    14, 1, rise_s;
    15, 1, hold_s;
    16, 1, ramps;
    17, 1, ramp_s;
    18, 1, drift;
    19, 1, drift_time_s;
    20, 1, greatest_error;
    21, 1, load_points;
    22, 1, greatest_temperature_c;
    23, 1, greatest_energy_j;
}

/// Checks that the fields' numbers rise, as the order of a save requires.
const _: () = {
    let mut rest = FIELDS;
    while let [one, others @ ..] = rest {
        if let [next, ..] = others {
            assert!(*one < *next, "the numbers of the fields have to rise");
        }
        rest = others;
    }
};
