//! Control transfers, stage by stage (USB 2.0 8.5.3).

use std::fmt;

use ldc161x_sim::Time;

use crate::usb::wire::{Reply, Transaction, TransactionKind};

/// Unanswered transactions after which a host gives up a transfer (USB 2.0 10.2.6).
pub(super) const SILENCES: u32 = 3;
/// Longest duration of a request (USB 2.0 9.2.6.1).
const DEADLINE: Time = Time::from_ms(5_000);

/// A transfer on endpoint 0, with any setup packet and any data, valid or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControlTransfer {
    /// bmRequestType, bRequest, wValue, wIndex, wLength (USB 2.0 9.3).
    pub setup: [u8; 8],
    /// Host data of a request to the device. A valid request has wLength bytes.
    pub data: Vec<u8>,
    /// Number of bytes after which the host ends the data stage of a request from the device;
    /// wLength in a valid request.
    pub read_limit: usize,
    /// Longest time from the first setup packet to the end.
    pub deadline: Time,
}

impl ControlTransfer {
    /// A setup packet alone, or with wLength bytes of data from the device.
    #[must_use]
    pub const fn new(setup: [u8; 8]) -> Self {
        Self {
            setup,
            data: Vec::new(),
            read_limit: u16::from_le_bytes([setup[6], setup[7]]) as usize,
            deadline: DEADLINE,
        }
    }

    /// A setup packet with data for the device.
    #[must_use]
    pub fn with_data(setup: [u8; 8], data: &[u8]) -> Self {
        Self {
            data: data.to_vec(),
            ..Self::new(setup)
        }
    }

    const fn reads(&self) -> bool {
        self.setup[0] & 0x80 != 0
    }

    /// wLength.
    const fn length(&self) -> usize {
        u16::from_le_bytes([self.setup[6], self.setup[7]]) as usize
    }
}

/// Outcome of a control transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ControlOutcome {
    /// Success, with the device's data.
    Done(Vec<u8>),
    /// The device refused the request.
    Stalled,
    /// Not complete at its deadline.
    TimedOut,
    /// Three transactions in a row had no answer.
    Silent,
    /// Cancelled by a reset, a suspend or unplugging.
    Cancelled,
    /// The device broke a rule of USB.
    Broken(&'static str),
}

impl ControlOutcome {
    /// Data of a successful transfer.
    #[must_use]
    pub fn data(&self) -> Option<&[u8]> {
        match self {
            Self::Done(data) => Some(data),
            _ => None,
        }
    }
}

impl fmt::Display for ControlOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done(data) => write!(f, "done with {} bytes", data.len()),
            Self::Stalled => f.write_str("the device refused the request with a STALL"),
            Self::TimedOut => f.write_str("the device answered NAK until the deadline"),
            Self::Silent => f.write_str(
                "the device did not answer: its address, or an endpoint that is not enabled",
            ),
            Self::Cancelled => f.write_str("a reset, suspend or unplugging came first"),
            Self::Broken(rule) => write!(f, "the device broke a rule: {rule}"),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Setup,
    DataIn,
    DataOut,
    StatusIn,
    StatusOut,
}

/// A transfer in progress.
#[derive(Clone, Debug)]
pub(super) struct ControlProgress {
    pub(super) transfer: ControlTransfer,
    pub(super) deadline_ps: u64,
    stage: Stage,
    data1: bool,
    received: Vec<u8>,
    sent: usize,
    silences: u32,
}

impl ControlProgress {
    pub(super) fn new(transfer: ControlTransfer, now_ps: u64) -> Self {
        Self {
            deadline_ps: now_ps + transfer.deadline.as_ps(),
            transfer,
            stage: Stage::Setup,
            data1: false,
            received: Vec::new(),
            sent: 0,
            silences: 0,
        }
    }

    /// Next packet of the host to an endpoint 0 with packets of `largest` bytes.
    pub(super) fn next(&self, address: u8, largest: usize) -> Transaction {
        let kind = match self.stage {
            Stage::Setup => TransactionKind::Setup(self.transfer.setup),
            Stage::DataIn | Stage::StatusIn => TransactionKind::In,
            Stage::DataOut => TransactionKind::Out {
                data1: self.data1,
                data: self.chunk(largest).to_vec(),
            },
            Stage::StatusOut => TransactionKind::Out {
                data1: true,
                data: Vec::new(),
            },
        };
        Transaction {
            address,
            endpoint: 0,
            kind,
        }
    }

    fn chunk(&self, largest: usize) -> &[u8] {
        let data = &self.transfer.data;
        let end = data.len().min(self.sent + largest);
        data.get(self.sent..end).unwrap_or_default()
    }

    /// Handles the device's answer; returns the outcome if the transfer has ended.
    pub(super) fn take(&mut self, reply: &Reply, largest: usize) -> Option<ControlOutcome> {
        self.silences = match reply {
            Reply::Silence => self.silences + 1,
            _ => 0,
        };
        match (self.stage, reply) {
            (_, Reply::Silence) => (self.silences >= SILENCES).then_some(ControlOutcome::Silent),
            (_, Reply::Nak) => None,
            (_, Reply::Stall) => Some(ControlOutcome::Stalled),
            (Stage::Setup, _) => {
                self.leave_setup();
                None
            }
            (Stage::DataIn, Reply::Data { data1, data }) => self.receive(*data1, data, largest),
            (Stage::DataOut, _) => {
                self.sent += self.chunk(largest).len();
                self.data1 = !self.data1;
                if self.sent >= self.transfer.data.len() {
                    self.stage = Stage::StatusIn;
                }
                None
            }
            (Stage::StatusIn, Reply::Data { data1: true, data }) => Some(if data.is_empty() {
                self.done()
            } else {
                ControlOutcome::Broken("data in the status stage (USB 2.0 8.5.3.1)")
            }),
            // A repeated packet is acknowledged and dropped (8.6.4).
            (Stage::StatusIn | Stage::DataIn, _) => None,
            (Stage::StatusOut, _) => Some(self.done()),
        }
    }

    fn leave_setup(&mut self) {
        self.data1 = true;
        self.stage = if self.transfer.reads() && self.transfer.read_limit > 0 {
            Stage::DataIn
        } else if !self.transfer.reads() && !self.transfer.data.is_empty() {
            Stage::DataOut
        } else {
            Stage::StatusIn
        };
    }

    fn receive(&mut self, data1: bool, data: &[u8], largest: usize) -> Option<ControlOutcome> {
        if data1 != self.data1 {
            return None;
        }
        self.data1 = !self.data1;
        self.received.extend_from_slice(data);
        if data.len() > largest {
            return Some(ControlOutcome::Broken(
                "a packet larger than bMaxPacketSize0 (USB 2.0 5.5.3)",
            ));
        }
        if self.received.len() > self.transfer.length() {
            return Some(ControlOutcome::Broken(
                "more data than wLength (USB 2.0 8.5.3)",
            ));
        }
        if data.len() < largest || self.received.len() >= self.transfer.read_limit {
            self.stage = Stage::StatusOut;
        }
        None
    }

    fn done(&mut self) -> ControlOutcome {
        ControlOutcome::Done(std::mem::take(&mut self.received))
    }
}
