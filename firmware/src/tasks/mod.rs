//! Bodies of the tasks, one file each.

mod coil;
mod instrument;
mod sensing;
mod storage;
mod supervisor;

pub use coil::coil;
pub use instrument::{Channels, Run, StorageClient, instrument};
pub use sensing::{Sensing, second_sensing, sensing};
pub use storage::{StorageWork, storage};
pub use supervisor::supervisor;
