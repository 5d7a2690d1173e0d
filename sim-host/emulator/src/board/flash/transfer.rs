//! Bytes received while the flash is selected.

use super::geometry::PAGE;

/// Bytes of a command with its address.
pub(super) const ADDRESSED: usize = 4;

/// Bytes received since the flash was selected.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Transfer {
    pub(super) bytes: Vec<u8>,
}

impl Transfer {
    pub(super) fn command(&self) -> Option<u8> {
        self.bytes.first().copied()
    }

    /// Address after the command; `None` until it is complete.
    pub(super) fn address(&self) -> Option<u32> {
        match self.bytes.get(1..ADDRESSED)? {
            &[high, middle, low] => Some(u32::from_be_bytes([0, high, middle, low])),
            _ => None,
        }
    }

    /// Data bytes for a page. They wrap within the page, and a later byte replaces an earlier one
    /// at the same place (datasheet, command 02h).
    pub(super) fn page(&self, address: u32) -> Box<[u8; PAGE]> {
        let mut page = Box::new([0xFF; PAGE]);
        let offsets = (0..PAGE).cycle().skip(address as usize % PAGE);
        for (offset, byte) in offsets.zip(self.bytes.iter().skip(ADDRESSED)) {
            if let Some(place) = page.get_mut(offset) {
                *place = *byte;
            }
        }
        page
    }
}
