//! Contents of the storage, as reported.

/// A whole set of items.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Set {
    /// Number of the save, counted from 1 since the last erasure. An interrupted save, or one that
    /// changed nothing, does not count.
    pub generation: u32,
    /// Number of items: one per setting, and one per calibration part or chunk.
    pub items: u16,
    /// Number of items that this firmware does not know. A save keeps them.
    pub unknown_items: u16,
    /// [`configuration_crc`](palpate_wire::configuration_crc) over the commands that were saved.
    pub configuration_crc: u32,
}

/// Content of the storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// No set.
    Empty,
    /// A set with every bit as it was saved.
    Whole(Set),
    /// A set that differs from the saved one.
    Damaged,
    /// A set in a format that this firmware does not know.
    Newer,
}
