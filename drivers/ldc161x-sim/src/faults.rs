//! Faults of the chip, its wires and its supply. Each starts at a time or a transaction that the
//! test selects.

use crate::random::Random;
use crate::time::Time;

/// Largest number of faults that can be scheduled or remembered at once.
pub const FAULT_SLOTS: usize = 16;

/// Registers that a dip of the supply resets. It is unknown which ones it resets in silicon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Lost {
    /// All registers, as in a power-on reset: conversions stop and the bus is silent for the
    /// wake-up time.
    Everything,
    /// Only these registers: each bit selects one register by its address, 0x00 to 0x21.
    Registers(u64),
}

/// Kind of bytes that a bit flip affects, by direction and meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Path {
    /// Bytes that the chip sends.
    ReadData,
    /// Data bytes that the chip receives.
    WriteData,
    /// The register pointer that the chip receives.
    Pointer,
}

/// Which bytes of a [`Path`] a bit flip affects.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Strike {
    /// In each transaction the byte with this number on the path, counted from 0.
    Byte(u32),
    /// Every byte on the path, with this probability, 0 to 1.
    Probability(f64),
}

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ChipFault {
    /// The chip acknowledges no byte after the first `after_bytes` bytes of a transaction.
    /// Addresses and bytes that the chip sent count too; 0 refuses the address.
    Nack {
        /// Number of bytes before the first refused one.
        after_bytes: u32,
    },
    /// The chip does not answer to its address at all.
    Absent,
    /// SDA is held low. With `clocks`, that many SCL pulses end the fault, as after a transfer that
    /// was cut short within a byte; without, the fault ends with its span.
    SdaStuck {
        /// Number of SCL pulses that free the line.
        clocks: Option<u8>,
    },
    /// SCL is held low.
    SclStuck,
    /// A dip of the supply. It takes effect at once; the span of the event is ignored.
    BrownOut(Lost),
    /// One random bit of a byte on the bus is inverted.
    BitFlip {
        /// Kind of the affected bytes.
        path: Path,
        /// Which bytes of that kind are affected.
        strike: Strike,
    },
    /// Bits of a stored register are inverted (a single-event upset). It takes effect at once; the
    /// span of the event is ignored.
    RegisterUpset {
        /// Address of the register, 0x08 to 0x21.
        address: u8,
        /// The bits to invert.
        bits: u16,
    },
    /// Another chip answers: the identity registers return these values.
    WrongIdentity {
        /// Value read from 0x7E.
        manufacturer: u16,
        /// Value read from 0x7F.
        device: u16,
    },
    /// The chip sees a STOP that the master did not send, after this many bytes of a transaction.
    EarlyStop {
        /// Number of bytes before the STOP, addresses included.
        after_bytes: u32,
    },
    /// The INTB line is stuck.
    IntbStuck {
        /// Whether the line is stuck low; otherwise it is stuck high.
        low: bool,
    },
    /// The clock at CLKIN stops.
    ClockLoss,
}

impl ChipFault {
    /// Whether the fault takes effect once and has no duration.
    const fn is_instant(&self) -> bool {
        matches!(self, Self::BrownOut(_) | Self::RegisterUpset { .. })
    }
}

/// When a fault starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Trigger {
    /// At this time; at once if it has passed.
    At(Time),
    /// At the START of the transaction with this number, counted from 0 since the chip was created
    /// (see [`crate::Traffic::transactions`]).
    Transaction(u64),
}

/// How long a fault lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Span {
    /// For this time.
    Time(Time),
    /// For this many transactions: the fault ends with the STOP of the last.
    Transactions(u32),
    /// Until the faults are cleared.
    Forever,
}

/// A fault with its start and duration.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultEvent {
    /// Start of the fault.
    pub trigger: Trigger,
    /// Duration of the fault.
    pub span: Span,
    /// The fault.
    pub fault: ChipFault,
}

impl FaultEvent {
    /// A fault that starts at `time` and lasts for `lasting`.
    #[must_use]
    pub const fn at(time: Time, fault: ChipFault, lasting: Time) -> Self {
        Self {
            trigger: Trigger::At(time),
            span: Span::Time(lasting),
            fault,
        }
    }

    /// A fault in transactions `first` to `first + count - 1`.
    #[must_use]
    pub const fn in_transactions(first: u64, count: u32, fault: ChipFault) -> Self {
        Self {
            trigger: Trigger::Transaction(first),
            span: Span::Transactions(count),
            fault,
        }
    }

    /// A fault that starts at `time` and does not end by itself.
    #[must_use]
    pub const fn from(time: Time, fault: ChipFault) -> Self {
        Self {
            trigger: Trigger::At(time),
            span: Span::Forever,
            fault,
        }
    }
}

/// The state of a scheduled fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultState {
    /// It has not started.
    Waiting,
    /// It has started and not ended.
    Active {
        /// Start time.
        since: Time,
    },
    /// It has ended.
    Over {
        /// Start time.
        since: Time,
        /// End time.
        until: Time,
    },
}

/// Identifier of a scheduled fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultId(u64);

/// Error: all [`FAULT_SLOTS`] slots are taken by waiting or active faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScheduleFull;

impl core::fmt::Display for ScheduleFull {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(formatter, "all {FAULT_SLOTS} slots for faults are taken")
    }
}

impl core::error::Error for ScheduleFull {}

/// Counts of the effects of faults so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Disturbances {
    /// Faults that have started.
    pub begun: u64,
    /// Faults that have ended.
    pub ended: u64,
    /// Bytes that went unacknowledged because of a fault.
    pub nacks: u64,
    /// Bytes with a bit inverted on the bus.
    pub flipped_bytes: u64,
    /// Reads of a false identity.
    pub forged_identities: u64,
    /// STOPs that the chip saw but the controller did not send.
    pub early_stops: u64,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    id: u64,
    event: FaultEvent,
    state: FaultState,
    transactions_left: u32,
}

impl Slot {
    fn is_active(&self) -> bool {
        matches!(self.state, FaultState::Active { .. })
    }

    fn is_over(&self) -> bool {
        matches!(self.state, FaultState::Over { .. })
    }

    /// Time at which the fault starts or ends, unless that depends on transactions.
    fn due(&self) -> Option<Time> {
        match (self.state, self.event.trigger, self.event.span) {
            (FaultState::Waiting, Trigger::At(time), _) => Some(time),
            (FaultState::Active { since }, _, Span::Time(length)) => Some(since + length),
            _ => None,
        }
    }
}

/// A fault that has just started or ended, for its effect on the chip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FaultChange {
    pub(crate) fault: ChipFault,
    pub(crate) begins: bool,
}

/// Slots for faults. Every byte on the bus is checked against them, so never used slots are
/// skipped.
#[derive(Clone, Debug)]
struct Slots {
    all: [Option<Slot>; FAULT_SLOTS],
    /// Index of the first slot that was never used; all later ones are unused, too.
    taken: usize,
}

impl Slots {
    fn put(&mut self, index: usize, slot: Slot) {
        if let Some(entry) = self.all.get_mut(index) {
            *entry = Some(slot);
            self.taken = self.taken.max(index + 1);
        }
    }

    fn iter(&self) -> impl Iterator<Item = &Slot> {
        self.all.iter().take(self.taken).flatten()
    }

    fn iter_mut(&mut self) -> impl Iterator<Item = &mut Slot> {
        self.all.iter_mut().take(self.taken).flatten()
    }
}

/// The scheduled faults and their states.
#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    slots: Slots,
    next_id: u64,
    /// The earliest of all [`Slot::due`], cached because it is needed for every conversion.
    due: Option<Time>,
    random: Random,
    pub(crate) log: Disturbances,
}

impl Schedule {
    pub(crate) fn new(random: Random) -> Self {
        Self {
            slots: Slots {
                all: [None; FAULT_SLOTS],
                taken: 0,
            },
            next_id: 0,
            due: None,
            random,
            log: Disturbances::default(),
        }
    }

    pub(crate) fn add(&mut self, event: FaultEvent) -> Result<FaultId, ScheduleFull> {
        let slot = self.free_slot().ok_or(ScheduleFull)?;
        let id = self.next_id;
        let transactions_left = match event.span {
            Span::Transactions(count) => count,
            Span::Time(_) | Span::Forever => 0,
        };
        self.slots.put(
            slot,
            Slot {
                id,
                event,
                state: FaultState::Waiting,
                transactions_left,
            },
        );
        self.next_id += 1;
        self.find_due();
        Ok(FaultId(id))
    }

    /// Index of an empty slot, or of the oldest fault that is over.
    fn free_slot(&self) -> Option<usize> {
        let empty = self.slots.all.iter().position(Option::is_none);
        empty.or_else(|| {
            (0..)
                .zip(&self.slots.all)
                .filter_map(|(index, slot)| slot.filter(Slot::is_over).map(|slot| (slot.id, index)))
                .min()
                .map(|(_, index)| index)
        })
    }

    /// Ends active faults and removes waiting ones.
    pub(crate) fn clear(&mut self, now: Time) {
        for entry in &mut self.slots.all {
            match entry {
                Some(slot) if slot.is_active() => {
                    finish(slot, now, &mut self.log);
                }
                Some(slot) if slot.state == FaultState::Waiting => *entry = None,
                _ => {}
            }
        }
        self.find_due();
    }

    pub(crate) fn state(&self, id: FaultId) -> Option<FaultState> {
        let slot = self.slots.iter().find(|slot| slot.id == id.0)?;
        Some(slot.state)
    }

    pub(crate) fn due(&self) -> Option<Time> {
        self.due
    }

    fn find_due(&mut self) {
        self.due = self.slots.iter().filter_map(Slot::due).min();
    }

    /// Starts or ends one fault whose time has come, and returns it.
    pub(crate) fn advance(&mut self, now: Time) -> Option<FaultChange> {
        let slot = self
            .slots
            .iter_mut()
            .find(|slot| slot.due().is_some_and(|due| due <= now))?;
        let begins = if slot.is_active() {
            finish(slot, now, &mut self.log);
            false
        } else {
            begin(slot, now, &mut self.log);
            true
        };
        let fault = slot.event.fault;
        self.find_due();
        Some(FaultChange { fault, begins })
    }

    /// Starts one fault that waits for this transaction, and returns it.
    pub(crate) fn begin_transaction(&mut self, number: u64, now: Time) -> Option<FaultChange> {
        let slot = self.slots.iter_mut().find(|slot| {
            slot.state == FaultState::Waiting
                && matches!(slot.event.trigger, Trigger::Transaction(first) if first <= number)
        })?;
        begin(slot, now, &mut self.log);
        let fault = slot.event.fault;
        self.find_due();
        Some(FaultChange {
            fault,
            begins: true,
        })
    }

    /// Handles the end of a transaction: ends one fault whose last transaction this was, and
    /// returns it. Call it again with `counted` false, so that the transaction is not counted
    /// twice, until it returns `None`.
    pub(crate) fn end_transaction(&mut self, now: Time, counted: bool) -> Option<FaultChange> {
        let spans =
            |slot: &Slot| slot.is_active() && matches!(slot.event.span, Span::Transactions(_));
        if counted {
            for slot in self.slots.iter_mut().filter(|slot| spans(slot)) {
                slot.transactions_left = slot.transactions_left.saturating_sub(1);
            }
        }
        let slot = self
            .slots
            .iter_mut()
            .find(|slot| spans(slot) && slot.transactions_left == 0)?;
        finish(slot, now, &mut self.log);
        Some(FaultChange {
            fault: slot.event.fault,
            begins: false,
        })
    }

    /// Counts SCL pulses for the faults that they end.
    pub(crate) fn clock_pulses(&mut self, pulses: u32, now: Time) {
        for slot in self.slots.iter_mut().filter(|slot| slot.is_active()) {
            if let ChipFault::SdaStuck {
                clocks: Some(clocks),
            } = &mut slot.event.fault
            {
                *clocks = clocks.saturating_sub(u8::try_from(pulses).unwrap_or(u8::MAX));
                if *clocks == 0 {
                    finish(slot, now, &mut self.log);
                }
            }
        }
        self.find_due();
    }

    pub(crate) fn is_disturbed(&self) -> bool {
        self.active().next().is_some()
    }

    /// The active faults.
    pub(crate) fn active(&self) -> impl Iterator<Item = &ChipFault> {
        self.slots
            .iter()
            .filter(|slot| slot.is_active())
            .map(|slot| &slot.event.fault)
    }

    /// Latest end of the active faults for which `is_meant` is true; [`Time::MAX`] if one of them
    /// lasts until the test ends it. `None` if there is none.
    pub(crate) fn lasts_until(&self, is_meant: impl Fn(&ChipFault) -> bool) -> Option<Time> {
        self.slots
            .iter()
            .filter(|slot| slot.is_active() && is_meant(&slot.event.fault))
            .map(|slot| slot.due().unwrap_or(Time::MAX))
            .max()
    }

    /// Returns the byte after the active bit flips. `index` is the byte's number on its path in
    /// this transaction.
    pub(crate) fn distort(&mut self, on: Path, index: u32, byte: u8) -> u8 {
        let mut distorted = byte;
        for slot in self.slots.iter().filter(|slot| slot.is_active()) {
            let ChipFault::BitFlip { path, strike } = slot.event.fault else {
                continue;
            };
            let struck = path == on
                && match strike {
                    Strike::Byte(number) => number == index,
                    Strike::Probability(probability) => self.random.chance(probability),
                };
            if struck {
                distorted ^= self.random.bit();
            }
        }
        self.log.flipped_bytes += u64::from(distorted != byte);
        distorted
    }
}

fn begin(slot: &mut Slot, now: Time, log: &mut Disturbances) {
    log.begun += 1;
    slot.state = FaultState::Active { since: now };
    let never_lasts = slot.event.span == Span::Transactions(0);
    if slot.event.fault.is_instant() || never_lasts {
        finish(slot, now, log);
    }
}

fn finish(slot: &mut Slot, now: Time, log: &mut Disturbances) {
    if let FaultState::Active { since } = slot.state {
        log.ended += 1;
        slot.state = FaultState::Over { since, until: now };
    }
}
