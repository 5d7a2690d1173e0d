//! One source for a type, its description and its check.

/// Defines a structure of the format: fields in their order on the wire, quantities with unit and limits
/// in brackets. The unit of a plain number is 1; that of a name or index is empty. A function after
/// `also` checks rules on several fields.
macro_rules! structure {
    (
        $(#[doc = $doc:literal])+
        pub struct $name:ident {
            $(
                $(#[doc = $field_doc:literal])+
                $field:ident: $of:ty $([$unit:tt $(, $low:literal, $high:literal)?])?,
            )+
        }
        $(also $rule:path)?
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[doc = $field_doc])+
                $(
                    #[doc = ""]
                    #[doc = range_doc!($unit $(, $low, $high)?)]
                )?
                #[serde(
                    serialize_with = "crate::field::write",
                    deserialize_with = "crate::field::read"
                )]
                pub $field: $of,
            )+
        }

        impl $name {
            /// Checks every field against its limits and the fields against each other.
            pub fn validate(&self) -> Result<(), $crate::validation::Invalid> {
                $crate::check::check(self)
            }
        }

        impl $crate::schema::Described for $name {
            const TYPE: $crate::schema::Type =
                $crate::schema::Type::Structure(&$crate::schema::Structure {
                    name: stringify!($name),
                    doc: concat!($($doc, "\n"),+),
                    fields: &[$($crate::schema::Field {
                        name: stringify!($field),
                        doc: concat!($($field_doc, "\n"),+),
                        of: <$of as $crate::schema::Described>::TYPE,
                        range: range!($($unit $(, $low, $high)?)?),
                    }),+],
                });
        }

        impl $crate::check::Check for $name {
            fn check(
                &self,
                _: &'static $crate::check::FieldLimits,
                checker: &mut $crate::check::Checker,
            ) {
                $(
                    $crate::check::Check::check(&self.$field, const {
                        &$crate::check::FieldLimits::new(
                            $crate::schema::field_number(
                                &<Self as $crate::schema::Described>::TYPE,
                                stringify!($field),
                            ),
                            &range!($($unit $(, $low, $high)?)?),
                        )
                    }, checker);
                )+
                $(checker.rule(|| $rule(self));)?
            }
        }
    };
}

/// Returns unit and limits of a field, as far as it has them.
macro_rules! range {
    () => {
        $crate::schema::Range::NONE
    };
    ($unit:tt) => {
        $crate::schema::Range {
            unit: $unit,
            ..$crate::schema::Range::NONE
        }
    };
    ($unit:tt, $low:literal, $high:literal) => {
        $crate::schema::Range {
            unit: $unit,
            low: $low as f32,
            high: $high as f32,
        }
    };
}

/// Returns unit and limits as text.
macro_rules! range_doc {
    ("", $low:literal, $high:literal) => {
        concat!("From ", $low, " to ", $high, ".")
    };
    ("1") => {
        "A plain number."
    };
    ("1", $low:literal, $high:literal) => {
        concat!("A plain number, from ", $low, " to ", $high, ".")
    };
    ($unit:tt) => {
        concat!("In ", $unit, ".")
    };
    ($unit:tt, $low:literal, $high:literal) => {
        concat!("In ", $unit, ", from ", $low, " to ", $high, ".")
    };
}

/// Defines an enumeration of the format: variants with their number and their name in text formats.
macro_rules! codes {
    ($(
        $(#[doc = $doc:literal])+
        pub enum $name:ident {
            $(
                $(#[doc = $entry_doc:literal])+
                $variant:ident = $number:literal $text:literal,
            )+
        }
    )+) => {$(
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name {
            $(
                $(#[doc = $entry_doc])+
                #[doc = ""]
                #[doc = concat!("Number ", $number, ".")]
                $variant,
            )+
            /// A number that this version does not know.
            Unknown(u8),
        }

        impl $name {
            /// Every value that this version knows.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// Returns the number on the wire.
            #[inline(never)]
            pub const fn number(self) -> u8 {
                match self {
                    $(Self::$variant => $number,)+
                    Self::Unknown(number) => number,
                }
            }

            /// Returns the value of a number; `Unknown` for a number without a named value.
            pub const fn from_number(number: u8) -> Self {
                match number {
                    $($number => Self::$variant,)+
                    unknown => Self::Unknown(unknown),
                }
            }

            /// Returns the name in text formats.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                    Self::Unknown(_) => "unknown",
                }
            }

            /// Returns the meaning of the value, as text for a person.
            pub const fn meaning(self) -> &'static str {
                match self {
                    $(Self::$variant => concat!($($entry_doc, "\n"),+),)+
                    Self::Unknown(_) => " A number that this version does not know.\n",
                }
            }
        }

        impl ::core::fmt::Display for $name {
            fn fmt(&self, f: &mut ::core::fmt::Formatter<'_>) -> ::core::fmt::Result {
                match *self {
                    Self::Unknown(number) => write!(f, "unknown ({number})"),
                    known => f.write_str(known.name()),
                }
            }
        }

        impl $crate::code::Code for $name {
            const NAMES: &'static [&'static str] = &[$($text),+];

            fn to_number(self) -> u8 {
                self.number()
            }

            fn with_number(number: u8) -> Self {
                Self::from_number(number)
            }

            fn to_name(self) -> Option<&'static str> {
                match self {
                    Self::Unknown(_) => None,
                    known => Some(known.name()),
                }
            }

            fn with_name(name: &str) -> Option<Self> {
                match name {
                    $($text => Some(Self::$variant),)+
                    _ => None,
                }
            }
        }

        impl ::serde::Serialize for $name {
            fn serialize<S: ::serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                $crate::code::serialize(*self, to)
            }
        }

        impl<'de> ::serde::Deserialize<'de> for $name {
            fn deserialize<D: ::serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                $crate::code::deserialize(from)
            }
        }

        impl $crate::schema::Described for $name {
            const TYPE: $crate::schema::Type =
                $crate::schema::Type::Code(&$crate::schema::CodeTable {
                    name: stringify!($name),
                    doc: concat!($($doc, "\n"),+),
                    entries: &[$($crate::schema::Entry {
                        number: $number,
                        name: $text,
                        doc: concat!($($entry_doc, "\n"),+),
                    }),+],
                });
        }

        impl $crate::check::Check for $name {
            fn check(
                &self,
                limits: &'static $crate::check::FieldLimits,
                checker: &mut $crate::check::Checker,
            ) {
                if let Self::Unknown(number) = *self {
                    checker.unknown_code(number, limits);
                }
            }
        }
    )+};
}
