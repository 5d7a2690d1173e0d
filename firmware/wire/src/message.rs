//! Common parts of records and commands, whose kinds are in `record/mod.rs` and `command/mod.rs`.

use crate::frame::frame_size;
use crate::schema::{self, Kind, Structure};
use crate::validation::Invalid;

/// Messages of one direction: [`Record`](crate::Record) or [`Command`](crate::Command).
pub trait Message: sealed::Payload {
    /// All kinds, in no particular order.
    const KINDS: &'static [Kind];

    /// Largest size of a payload in bytes.
    const MAX_PAYLOAD: usize = schema::max_payload(Self::KINDS);

    /// Largest size of a frame in bytes, including the zero at its end.
    const MAX_FRAME: usize = frame_size(Self::MAX_PAYLOAD);

    /// Returns the number of the kind, the second byte of the frame.
    fn kind(&self) -> u8;

    /// Returns the name of the kind in text formats.
    fn name(&self) -> &'static str;

    /// Checks every field against its documented limits.
    ///
    /// A device checks every command before it executes it. A record is not refused for its values; the
    /// check of a record finds defects of the device.
    fn validate(&self) -> Result<(), Invalid>;

    /// Returns the structure of the payload, if there is one. It gives names and units to the field
    /// numbers of [`Invalid`].
    fn payload(&self) -> Option<&'static Structure> {
        let mut kinds = Self::KINDS.iter();
        kinds.find(|kind| kind.number == self.kind())?.payload
    }
}

/// Reading and writing of payloads, closed to other crates.
pub(crate) mod sealed {
    use postcard::{Deserializer, Result, Serializer, de_flavors, ser_flavors};

    /// Writer into a buffer.
    pub(crate) type Writer<'buffer> = Serializer<ser_flavors::Slice<'buffer>>;

    /// Reader of the bytes of one frame.
    pub(crate) type Reader<'frame> = Deserializer<'frame, de_flavors::Slice<'frame>>;

    /// A message without its header.
    pub trait Payload: Sized {
        /// Writes the payload.
        fn write(&self, to: &mut Writer<'_>) -> Result<()>;

        /// Reads the payload of a kind; `None` for a kind of another direction or version.
        fn read(kind: u8, from: &mut Reader<'_>) -> Option<Result<Self>>;
    }
}

/// Defines the messages of one direction: kinds with their number and their name in text formats.
macro_rules! messages {
    (
        $(#[doc = $doc:literal])+
        pub enum $name:ident {
            bare {$(
                $(#[doc = $bare_doc:literal])+
                $bare:ident = $bare_number:literal $bare_text:literal,
            )*}
            with payload {$(
                $(#[doc = $kind_doc:literal])+
                $variant:ident($payload:ty) = $number:literal $text:literal,
            )*}
        }
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Debug, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        pub enum $name {
            $(
                $(#[doc = $bare_doc])+
                #[doc = ""]
                #[doc = concat!("Kind ", $bare_number, ".")]
                #[serde(rename = $bare_text)]
                $bare,
            )*
            $(
                $(#[doc = $kind_doc])+
                #[doc = ""]
                #[doc = concat!("Kind ", $number, ".")]
                #[serde(rename = $text)]
                $variant($payload),
            )*
        }

        impl $crate::message::Message for $name {
            const KINDS: &'static [$crate::schema::Kind] = &[
                $($crate::schema::Kind {
                    number: $bare_number,
                    name: $bare_text,
                    doc: concat!($($bare_doc, "\n"),+),
                    payload: None,
                },)*
                $($crate::schema::Kind {
                    number: $number,
                    name: $text,
                    doc: concat!($($kind_doc, "\n"),+),
                    payload: <$payload as $crate::schema::Described>::TYPE.structure(),
                },)*
            ];

            fn kind(&self) -> u8 {
                match self {
                    $(Self::$bare => $bare_number,)*
                    $(Self::$variant(_) => $number,)*
                }
            }

            fn name(&self) -> &'static str {
                match self {
                    $(Self::$bare => $bare_text,)*
                    $(Self::$variant(_) => $text,)*
                }
            }

            fn validate(&self) -> Result<(), $crate::validation::Invalid> {
                match self {
                    $(Self::$bare => Ok(()),)*
                    $(Self::$variant(payload) => payload.validate(),)*
                }
            }
        }

        impl $crate::message::sealed::Payload for $name {
            fn write(&self, to: &mut $crate::message::sealed::Writer<'_>) -> ::postcard::Result<()> {
                match self {
                    $(Self::$bare => Ok(()),)*
                    $(Self::$variant(payload) => ::serde::Serialize::serialize(payload, to),)*
                }
            }

            fn read(
                kind: u8,
                from: &mut $crate::message::sealed::Reader<'_>,
            ) -> Option<::postcard::Result<Self>> {
                Some(match kind {
                    $($bare_number => Ok(Self::$bare),)*
                    $($number => {
                        <$payload as ::serde::Deserialize>::deserialize(from).map(Self::$variant)
                    })*
                    _ => return None,
                })
            }
        }
    };
}
pub(crate) use messages;
