//! Common parts of records and commands.

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

    /// Returns the structure after the header, if there is one: names and units of the fields in
    /// [`Invalid`].
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
