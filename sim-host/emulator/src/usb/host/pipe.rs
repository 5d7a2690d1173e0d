//! A pipe of bulk or interrupt packets: data toggle, NAKs and halts (USB 2.0 8.5.2, 8.6).

use super::control::SILENCES;
use crate::usb::description::UsbEndpoint;
use crate::usb::wire::{Reply, Transaction, TransactionKind};

/// Effect of an endpoint's answer on its pipe.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// NAK or no answer: repeat later.
    Refused,
    /// The device accepted the host's packet.
    Sent,
    /// A packet of the device, in sequence.
    Received(Vec<u8>),
    /// A repeated packet; it is dropped (8.6.4).
    Repeated,
}

/// The host's end of a pipe.
#[derive(Clone, Debug)]
pub(super) struct Pipe {
    pub(super) endpoint: UsbEndpoint,
    data1: bool,
    /// Number of missing answers in a row.
    silences: u32,
    /// Whether the endpoint has stalled or does not answer: nothing is sent to it.
    pub(super) halted: bool,
    /// Frame of the next poll, for an interrupt endpoint.
    pub(super) polled_from: u64,
}

impl Pipe {
    pub(super) const fn new(endpoint: UsbEndpoint) -> Self {
        Self {
            endpoint,
            data1: false,
            silences: 0,
            halted: false,
            polled_from: 0,
        }
    }

    /// Restarts with DATA0 after a new configuration or a cleared halt (USB 2.0 9.4.5).
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.endpoint);
    }

    pub(super) fn largest(&self) -> usize {
        usize::from(self.endpoint.largest_packet)
    }

    /// Transaction that sends these bytes, or requests data for `None`.
    pub(super) fn next(&self, address: u8, data: Option<Vec<u8>>) -> Transaction {
        let kind = match data {
            Some(data) => TransactionKind::Out {
                data1: self.data1,
                data,
            },
            None => TransactionKind::In,
        };
        Transaction {
            address,
            endpoint: self.endpoint.address & 0xF,
            kind,
        }
    }

    /// Handles the endpoint's answer.
    pub(super) fn take(&mut self, reply: Reply) -> Progress {
        self.silences = match reply {
            Reply::Silence => self.silences + 1,
            _ => 0,
        };
        match reply {
            Reply::Data { data1, .. } if data1 != self.data1 => Progress::Repeated,
            Reply::Data { data, .. } => {
                self.data1 = !self.data1;
                Progress::Received(data)
            }
            Reply::Ack => {
                self.data1 = !self.data1;
                Progress::Sent
            }
            Reply::Silence | Reply::Nak | Reply::Stall => {
                self.halted |= reply == Reply::Stall || self.silences >= SILENCES;
                Progress::Refused
            }
        }
    }
}
