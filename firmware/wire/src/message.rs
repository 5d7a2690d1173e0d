//! What records and commands have in common.

use crate::frame::frame_size;
use crate::schema::{self, Kind, Structure};
use crate::validation::Invalid;

/// The messages of one direction: [`Record`](crate::Record) or [`Command`](crate::Command).
pub trait Message: sealed::Payload {
    /// Every kind, in no particular order.
    const KINDS: &'static [Kind];

    /// Greatest size of a payload in bytes.
    const MAX_PAYLOAD: usize = schema::max_payload(Self::KINDS);

    /// Greatest size of a frame in bytes, the zero at its end included.
    const MAX_FRAME: usize = frame_size(Self::MAX_PAYLOAD);

    /// Number of the kind, the second byte of the frame.
    fn kind(&self) -> u8;

    /// Name of the kind in text formats.
    fn name(&self) -> &'static str;

    /// Checks every field against its documented limits.
    ///
    /// A device does this with every command before it acts on it. A record is not refused for
    /// its values: there the check finds defects of the device.
    fn validate(&self) -> Result<(), Invalid>;

    /// What follows the header, if anything does: names and units of what [`Invalid`] speaks of.
    fn payload(&self) -> Option<&'static Structure> {
        let mut kinds = Self::KINDS.iter();
        kinds.find(|kind| kind.number == self.kind())?.payload
    }
}

/// How a payload is written and read: closed to other crates.
pub(crate) mod sealed {
    use postcard::{Deserializer, Result, Serializer, de_flavors, ser_flavors};

    /// Writes to a buffer.
    pub(crate) type Writer<'buffer> = Serializer<ser_flavors::Slice<'buffer>>;

    /// Reads the bytes of one frame.
    pub(crate) type Reader<'frame> = Deserializer<'frame, de_flavors::Slice<'frame>>;

    /// A message without its header.
    pub trait Payload: Sized {
        /// Writes the payload.
        fn write(&self, to: &mut Writer<'_>) -> Result<()>;

        /// Reads the payload of a kind; `None` for a kind of another direction or version.
        fn read(kind: u8, from: &mut Reader<'_>) -> Option<Result<Self>>;
    }
}
