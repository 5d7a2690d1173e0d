//! The two wires of the bus with the converters on them, and faults of the wires.

use ldc161x_sim::{Ack, Chip, Time, TrueConversion};

use crate::board::converters::{Converters, SecondChip};
use crate::board::plant::Plant;
use crate::trace::{Change, Signal, SignalValue};

/// A fault of a wire, caused outside of both chips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFault {
    /// SDA is pulled low from a bit of the next transaction on.
    SdaLow {
        /// Number of bits of the transaction before the fault.
        bit: u32,
        /// Duration of the fault; `None` for a fault without end.
        lasting: Option<Time>,
        /// Number of SCL pulses that end the fault, as when a target was interrupted within a byte.
        clocks: Option<u32>,
    },
    /// SCL is held low from a bit of the next transaction on.
    SclHeld {
        /// Number of bits of the transaction before the fault.
        bit: u32,
        /// Duration of the fault; `None` for a fault without end.
        lasting: Option<Time>,
    },
}

impl LineFault {
    const fn bit(&self) -> u32 {
        match *self {
            Self::SdaLow { bit, .. } | Self::SclHeld { bit, .. } => bit,
        }
    }
}

/// Record of the bus traffic, enabled by [`crate::Options::record`].
#[derive(Clone, Debug, Default)]
pub struct WireLog {
    /// Conversions in the order in which the firmware fetched their results.
    pub fetched: Vec<TrueConversion>,
    /// Delays from a falling edge of INTB on an idle bus to the START of the next transaction.
    pub edge_to_start: Vec<Time>,
    /// Times of the falling edges of INTB.
    pub edges: Vec<Time>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Hold {
    /// Time until which the wire is low.
    until_ps: u64,
    clocks: Option<u32>,
}

impl Hold {
    fn is_low(&self, now_ps: u64) -> bool {
        now_ps < self.until_ps && self.clocks != Some(0)
    }
}

/// SDA and SCL, with the converters on them.
#[derive(Clone, Debug)]
pub(crate) struct Wire<P> {
    pub(crate) converters: Converters<P>,
    pub(crate) log: Option<WireLog>,
    armed: Option<LineFault>,
    sda: Hold,
    scl: Hold,
    in_transaction: bool,
    /// Number of bits since the last START.
    bits: u32,
    last_edge_ps: Option<u64>,
    /// Levels of SCL and SDA while they are plain outputs; `None` otherwise.
    plain: Option<(bool, bool)>,
    /// Changes of the wires, if traced.
    pub(crate) changes: Option<Vec<Change>>,
}

impl<P: Plant> Wire<P> {
    pub(crate) fn new(
        chip: Chip<P>,
        second: Option<SecondChip>,
        record: bool,
        trace: bool,
    ) -> Self {
        Self {
            converters: Converters::new(chip, second),
            log: record.then(WireLog::default),
            armed: None,
            sda: Hold::default(),
            scl: Hold::default(),
            in_transaction: false,
            bits: 0,
            last_edge_ps: None,
            plain: None,
            changes: trace.then(Vec::new),
        }
    }

    /// Traces the level of a wire from a time on, which may be in the past.
    pub(crate) fn trace(&mut self, at_ps: u64, signal: Signal, value: SignalValue) {
        if let Some(changes) = &mut self.changes {
            changes.push(Change {
                at_ps,
                signal,
                value,
            });
        }
    }

    pub(crate) fn arm(&mut self, fault: LineFault) {
        self.armed = Some(fault);
    }

    /// Ends every fault of the wires.
    pub(crate) fn release(&mut self) {
        self.armed = None;
        self.sda = Hold::default();
        self.scl = Hold::default();
    }

    pub(crate) fn is_disturbed(&self, now_ps: u64) -> bool {
        self.armed.is_some() || self.sda.is_low(now_ps) || self.scl.is_low(now_ps)
    }

    /// Whether something other than the master holds SDA low.
    pub(crate) fn sda_is_low(&mut self, now_ps: u64) -> bool {
        self.sda.is_low(now_ps) || self.converters.sda_is_low(Time::from_ps(now_ps))
    }

    /// Time until which something other than the master holds SCL low.
    pub(crate) fn scl_low_until(&mut self, now_ps: u64) -> Option<u64> {
        let own = self.scl.is_low(now_ps).then_some(self.scl.until_ps);
        let converters = self.converters.scl_low_until(Time::from_ps(now_ps));
        own.max(converters.map(Time::as_ps))
    }

    /// INTB falls.
    pub(crate) fn falling_edge(&mut self, now_ps: u64) {
        self.last_edge_ps = (!self.in_transaction).then_some(now_ps);
        if let Some(log) = &mut self.log {
            log.edges.push(Time::from_ps(now_ps));
        }
    }

    /// START or repeated START.
    pub(crate) fn start(&mut self, now_ps: u64) {
        if !self.in_transaction {
            self.in_transaction = true;
            self.bits = 0;
            if let (Some(log), Some(edge_ps)) = (&mut self.log, self.last_edge_ps.take()) {
                log.edge_to_start.push(Time::from_ps(now_ps - edge_ps));
            }
        }
        self.count_bit(now_ps);
    }

    /// Counts a bit; a fault may start with it.
    pub(crate) fn count_bit(&mut self, now_ps: u64) {
        if let Some(fault) = self.armed.filter(|fault| fault.bit() <= self.bits) {
            self.armed = None;
            let until = |lasting: Option<Time>| {
                lasting.map_or(u64::MAX, |time| now_ps.saturating_add(time.as_ps()))
            };
            match fault {
                LineFault::SdaLow {
                    lasting, clocks, ..
                } => {
                    self.sda = Hold {
                        until_ps: until(lasting),
                        clocks,
                    };
                }
                LineFault::SclHeld { lasting, .. } => {
                    self.scl = Hold {
                        until_ps: until(lasting),
                        clocks: None,
                    };
                }
            }
        }
        self.bits += 1;
    }

    pub(crate) fn address(&mut self, now_ps: u64, byte: u8) -> bool {
        self.converters.start(Time::from_ps(now_ps), byte)
    }

    pub(crate) fn write(&mut self, now_ps: u64, byte: u8) -> bool {
        self.converters.write(Time::from_ps(now_ps), byte)
    }

    pub(crate) fn read(&mut self, now_ps: u64, acknowledged: bool) -> u8 {
        let ack = if acknowledged { Ack::Ack } else { Ack::Nack };
        let byte = self.converters.read(Time::from_ps(now_ps), ack);
        self.note_what_was_fetched();
        byte
    }

    pub(crate) fn stop(&mut self, now_ps: u64) {
        self.in_transaction = false;
        self.converters.stop(Time::from_ps(now_ps));
    }

    /// The master releases the wires without a STOP.
    pub(crate) fn abandon(&mut self) {
        self.in_transaction = false;
    }

    /// Adds newly fetched conversions to the record after each byte: a converter that is reset
    /// before the STOP would have lost its own record by then.
    fn note_what_was_fetched(&mut self) {
        let Some(log) = &mut self.log else {
            return;
        };
        for channel in 0..4 {
            let Some(read) = self.converters.first.last_read(channel) else {
                continue;
            };
            let known = log.fetched.iter().rev().take(8);
            let is_known = known
                .into_iter()
                .any(|old| (old.channel, old.number, old.end) == (channel, read.number, read.end));
            if !is_known {
                log.fetched.push(*read);
            }
        }
    }

    /// Levels of SCL and SDA as plain outputs; `None` when the pins are not plain outputs. A pulse
    /// of SCL may free SDA, and SDA rising while SCL is high is a STOP.
    pub(crate) fn plain(&mut self, now_ps: u64, levels: Option<(bool, bool)>) {
        let before = std::mem::replace(&mut self.plain, levels);
        let (Some((scl_was, sda_was)), Some((scl, sda))) = (before, levels) else {
            return;
        };
        if !scl_was && scl && !self.scl.is_low(now_ps) {
            self.converters.clock_pulse(Time::from_ps(now_ps));
            if let Some(clocks) = &mut self.sda.clocks {
                *clocks = clocks.saturating_sub(1);
            }
        }
        if scl && scl_was && !sda_was && sda && !self.sda_is_low(now_ps) {
            self.stop(now_ps);
        }
    }
}
