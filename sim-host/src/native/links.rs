//! Links of the native board, byte by byte: the bytes that a PC writes and reads at the other end
//! of a cable.

use core::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use palpate_node::instrument::Received;
use palpate_node::link::{BYTES_A_TURN, ByteSource, FrameSink, Inbox, Outbox};
use palpate_procedure::Link;
use palpate_wire::{Message, Record};

pub(super) struct Links {
    probe: NativeLink,
    usb: NativeLink,
    buffer: [u8; Record::MAX_FRAME],
}

impl Links {
    /// Links of the run with this boot id, without a PC.
    pub(super) fn new(boot_id: u32) -> Self {
        let link = || NativeLink::new(Rc::default(), boot_id);
        Self {
            probe: link(),
            usb: link(),
            buffer: [0; Record::MAX_FRAME],
        }
    }

    /// Restarts the board's side. Unread bytes stay in the cables.
    pub(super) fn restart(&mut self, boot_id: u32) {
        for link in [&mut self.probe, &mut self.usb] {
            *link = NativeLink::new(Rc::clone(&link.cable.0), boot_id);
        }
    }

    /// Calls `look` with the cable of a link.
    pub(super) fn with_cable<T>(&self, link: Link, look: impl FnOnce(&mut Cable) -> T) -> T {
        let link = match link {
            Link::Probe => &self.probe,
            Link::Usb => &self.usb,
        };
        look(&mut link.cable.0.borrow_mut())
    }

    /// Sends a record with its time over a link, or over all links.
    pub(super) fn send(&mut self, to: Option<Link>, time_us: u64, record: &Record) {
        for (link, of) in [(Link::Probe, &mut self.probe), (Link::Usb, &mut self.usb)] {
            if to.is_none_or(|to| to == link) {
                of.outbox.send(&mut self.buffer, time_us, record);
            }
        }
    }

    /// Next complete frame of a link; `None` if none is complete in this turn.
    pub(super) fn receive(&mut self, link: Link) -> Option<Received> {
        let link = match link {
            Link::Probe => &mut self.probe,
            Link::Usb => &mut self.usb,
        };
        link.inbox.receive(BYTES_A_TURN)
    }
}

/// Bytes in transit; the capacity is unlimited.
#[derive(Debug, Default)]
pub(super) struct Cable {
    /// Whether a PC is connected.
    pub(super) is_open: bool,
    /// Bytes to the board.
    pub(super) down: VecDeque<u8>,
    /// Bytes to the PC.
    pub(super) up: Vec<u8>,
}

/// One end of a cable.
#[derive(Clone)]
struct End(Rc<RefCell<Cable>>);

impl FrameSink for End {
    fn write(&mut self, frame: &[u8]) -> bool {
        self.0.borrow_mut().up.extend_from_slice(frame);
        true
    }

    fn is_open(&self) -> bool {
        self.0.borrow().is_open
    }

    fn take_discarded(&mut self) -> u32 {
        0
    }
}

impl ByteSource for End {
    fn read(&mut self) -> Option<u8> {
        self.0.borrow_mut().down.pop_front()
    }
}

struct NativeLink {
    cable: End,
    outbox: Outbox<End>,
    inbox: Inbox<End>,
}

impl NativeLink {
    fn new(cable: Rc<RefCell<Cable>>, boot_id: u32) -> Self {
        let cable = End(cable);
        Self {
            outbox: Outbox::new(cable.clone(), boot_id),
            inbox: Inbox::new(cable.clone()),
            cable,
        }
    }
}
