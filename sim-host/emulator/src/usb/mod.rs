//! The RP2040's USB controller and the host at the other end of the cable.
//!
//! The controller is a device at full speed (RP2040 datasheet 4.1). The host sends the packets of a
//! PC, at their times on the wire; [`UsbHost`] takes orders for it.

mod controller;
mod description;
mod host;
mod memory;
mod wire;

#[cfg(test)]
mod tests;

pub use description::UsbDescription;
pub use host::{
    ControlOutcome, ControlTransfer, EnumerationFailure, TransferId, UsbCounts, UsbHost, UsbState,
};

use controller::UsbController;

/// Whether an address is in the window of the controller's memory.
pub(crate) const fn is_memory(address: u32) -> bool {
    address & !0xFFF == crate::rp2040::base::USB_MEMORY
}

/// Controller, cable and host.
#[derive(Clone, Debug)]
pub(crate) struct Usb {
    controller: UsbController,
    pub(crate) host: UsbHost,
}

impl Usb {
    pub(crate) fn new() -> Self {
        Self {
            controller: UsbController::new(),
            host: UsbHost::new(),
        }
    }

    /// Resets the controller; the host stays, and detects that the device disappears.
    pub(crate) fn reset(&mut self, now_ps: u64) {
        self.controller = UsbController::new();
        self.host.follow(&mut self.controller, now_ps);
    }

    /// Whether the controller is visible to a host.
    pub(crate) const fn is_attached(&self) -> bool {
        self.controller.is_attached()
    }

    /// Latest time within a frame at which a bulk IN packet became available.
    pub(crate) const fn latest_bulk(&self) -> ldc161x_sim::Time {
        self.controller.latest_bulk()
    }

    /// Number of setup packets that arrived while a packet of endpoint 0 was available.
    pub(crate) const fn answered_before(&self) -> u32 {
        self.controller.answered_before()
    }

    /// Number of writes to the control word of a buffer that stayed available.
    pub(crate) const fn rewritten(&self) -> u32 {
        self.controller.memory.rewritten()
    }

    pub(crate) fn next_event(&self) -> Option<u64> {
        let events = [self.controller.next_event(), self.host.next_event()];
        events.iter().flatten().min().copied()
    }

    /// Processes events that are due; returns a request that the emulator does not model.
    pub(crate) fn service(&mut self, now_ps: u64) -> Option<&'static str> {
        while let Some(due_ps) = self.next_event().filter(|&due_ps| due_ps <= now_ps) {
            self.controller.service(due_ps);
            self.host.service(&mut self.controller, due_ps);
        }
        self.host.act(&mut self.controller, now_ps);
        self.controller.take_problem()
    }

    pub(crate) fn line(&self) -> bool {
        self.controller.line()
    }

    pub(crate) fn read(&mut self, offset: u32) -> Option<u32> {
        self.controller.read(offset)
    }

    /// Writes a register through one of its four views.
    pub(crate) fn write(&mut self, view: u32, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        self.controller.write(view, offset, value, now_ps)?;
        self.host.follow(&mut self.controller, now_ps);
        Some(())
    }

    /// A word of the memory, by its offset.
    pub(crate) fn read_memory(&self, offset: u32) -> Option<u32> {
        self.controller.memory.word(offset as usize)
    }

    /// Writes one, two or four bytes of the memory.
    pub(crate) fn write_memory(&mut self, offset: u32, value: &[u8], now_ps: u64) -> Option<()> {
        self.controller.memory.write(offset as usize, value, now_ps)
    }
}
