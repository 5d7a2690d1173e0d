#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![deny(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::unreachable,
    clippy::indexing_slicing
)]

mod area;
mod contents;
mod error;
mod item;
mod parts;
mod payload;
mod save;
mod scan;
mod seal;
mod settings;
mod store;

pub use contents::{Contents, Set};
pub use error::Error;
pub use store::Store;

/// Returns whether this firmware knows an item with this key and version.
const fn knows(key: item::Key, version: u8) -> bool {
    match key.number {
        settings::NUMBER => key.index == 0 && settings::knows(key.place, version),
        _ => parts::knows(key, version),
    }
}
