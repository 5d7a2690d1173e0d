//! State of the board in the boot loader.

use crate::image::uf2::Download;

/// Start parameters of the boot loader.
#[derive(Clone, Debug)]
pub struct BootLoader {
    /// Pins that show the drive's activity, one bit each; 0 for none.
    pub activity_pins: u32,
    /// Bit 0: no drive; bit 1: no PICOBOOT.
    pub disabled_interfaces: u32,
    pub(super) download: Download,
}

impl BootLoader {
    pub(super) fn new([activity_pins, disabled_interfaces]: [u32; 2]) -> Self {
        Self {
            activity_pins,
            disabled_interfaces,
            download: Download::default(),
        }
    }
}
