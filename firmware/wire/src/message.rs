//! What records and commands have in common.

use crate::frame::frame_size;
use crate::schema::{self, Kind, Structure};
use crate::validation::{self, Invalid};

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
    fn validate(&self) -> Result<(), Invalid> {
        validation::validate(|to| self.show(to))
    }

    /// What follows the header, if anything does: names and units of what [`Invalid`] speaks of.
    fn payload(&self) -> Option<&'static Structure> {
        let mut kinds = Self::KINDS.iter();
        kinds.find(|kind| kind.number == self.kind())?.payload
    }
}

/// How a payload is shown and read: closed to other crates.
pub(crate) mod sealed {
    use crate::reader::Reader;
    use crate::value::Visitor;

    /// A message without its header.
    pub trait Payload: Sized {
        /// Shows the payload.
        fn show(&self, to: &mut dyn Visitor);

        /// Reads the payload of a kind; `None` for a kind of another direction or version.
        fn read(kind: u8, from: &mut Reader<'_>) -> Option<Self>;
    }
}
