//! Links to PCs: RTT through a debug probe, and USB. Their common part is `palpate_node::link`.

pub mod log;
pub mod reset_interface;
pub mod rtt;
mod up_channel;
pub mod usb;

use palpate_node::instrument::Received;
use palpate_node::link::{FrameSender, Inbox, Outbox};
use palpate_procedure::Link;
use palpate_wire::{Message, Record};

use rtt::{RttCommands, RttRecords};
use usb::{UsbCommands, UsbLink};
use usb_device::bus::UsbBusAllocator;

use crate::board::usb::Bus;

/// Senders of records, one per link.
pub struct Outboxes {
    probe: Outbox<RttRecords>,
    usb: Outbox<FrameSender<'static>>,
    buffer: [u8; Record::MAX_FRAME],
}

impl Outboxes {
    /// Creates the senders of both links for the run with this boot id.
    pub const fn new(probe: RttRecords, usb: FrameSender<'static>, boot_id: u32) -> Self {
        Self {
            probe: Outbox::new(probe, boot_id),
            usb: Outbox::new(usb, boot_id),
            buffer: [0; Record::MAX_FRAME],
        }
    }

    /// Returns whether frames wait for USB.
    pub fn has_usb_frames(&self) -> bool {
        self.usb.sink().has_frames()
    }

    /// Sends a record and its time over one link, or over all of them.
    pub fn send(&mut self, to: Option<Link>, time_us: u64, record: &Record) {
        let goes_by = |link| to.is_none_or(|to| to == link);
        if goes_by(Link::Probe) {
            self.probe.send(&mut self.buffer, time_us, record);
        }
        if goes_by(Link::Usb) {
            self.usb.send(&mut self.buffer, time_us, record);
        }
    }
}

/// Receivers of commands, one per link.
pub struct Inboxes {
    probe: Inbox<RttCommands>,
    usb: Inbox<UsbCommands>,
}

impl Inboxes {
    /// Creates the receivers of both links.
    pub const fn new(probe: RttCommands, usb: UsbCommands) -> Self {
        Self {
            probe: Inbox::new(probe),
            usb: Inbox::new(usb),
        }
    }

    /// Returns the next whole frame of a link, reading at most `bytes` bytes.
    pub fn receive(&mut self, link: Link, bytes: usize) -> Option<Received> {
        match link {
            Link::Probe => self.probe.receive(bytes),
            Link::Usb => self.usb.receive(bytes),
        }
    }
}

/// Sets both links up. Call it once.
pub fn set_up(
    memory: &'static mut usb::Memory,
    bus: Option<UsbBusAllocator<Bus>>,
    unit: u64,
    boot_id: u32,
) -> ((Outboxes, Inboxes), UsbLink) {
    let (probe_records, probe_commands) = rtt::set_up();
    let (usb_records, usb_commands, link) = usb::set_up(memory, bus, unit);
    let outboxes = Outboxes::new(probe_records, usb_records, boot_id);
    let inboxes = Inboxes::new(probe_commands, usb_commands);
    ((outboxes, inboxes), link)
}
