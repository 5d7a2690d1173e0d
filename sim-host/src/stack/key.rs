//! Tables of quantities, each declared once: field, key, allowed range and meaning.

use super::quantity::Allowed;

/// A key of a table that denotes a quantity.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Name, ending with the unit.
    pub name: &'static str,
    /// Allowed values.
    pub allowed: Allowed,
    /// Meaning.
    pub meaning: &'static str,
}

/// Declares a table: the fields that are no quantities, each with its reader, then the quantities.
macro_rules! table {
    (
        $(#[$about:meta])*
        $table:ident {
            $($(#[$meaning:meta])+ $other:ident: $type:ty = $name:literal, $read:expr;)*
            $($field:ident = $key:literal, $least:literal to $most:literal $unit:literal, $text:literal;)+
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $table {
            $($(#[$meaning])+ pub $other: $type,)*
            $(
                #[doc = concat!($text, ", ", stringify!($least to $most), " ", $unit)]
                pub $field: $crate::stack::quantity::Quantity,
            )+
        }

        impl $table {
            /// Keys of the table's quantities.
            pub const KEYS: [$crate::stack::Key; [$($key),+].len()] = [$(
                $crate::stack::Key {
                    name: $key,
                    allowed: $crate::stack::quantity::Allowed::new($least, $most, $unit),
                    meaning: $text,
                },
            )+];

            /// The table's quantities, in the order of their keys.
            #[must_use]
            pub const fn quantities(&self) -> [$crate::stack::quantity::Quantity; Self::KEYS.len()] {
                [$(self.$field),+]
            }
        }

        impl $crate::stack::document::Table for $table {
            const NAMES: &'static [&'static str] = &[$($name,)* $($key),+];

            fn read(
                table: &$crate::stack::document::TableSection<'_>,
            ) -> Result<Self, $crate::stack::document::FileError> {
                let [$($field),+] = &Self::KEYS;
                Ok(Self {
                    $($other: $read(table, $name)?,)*
                    $($field: table.quantity($field.name, &$field.allowed)?,)+
                })
            }
        }
    };
}
pub(super) use table;
