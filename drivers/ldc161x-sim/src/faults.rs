//! Faults of the chip, its wires and its supply. Each starts at a time or a transaction that the
//! test selects.

use crate::random::Random;
use crate::time::Time;

/// Largest number of faults that can be scheduled or remembered at once.
const FAULT_SLOTS: usize = 16;

/// Registers that a dip of the supply resets. It is unknown which ones it resets in silicon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// All registers, as in a power-on reset: conversions stop and the bus is silent for the
    /// wake-up time.
    Everything,
    /// Only these registers: each bit selects one register by its address, 0x00 to 0x21.
    Registers(u64),
}

/// Kind of bytes that a bit flip affects, by direction and meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
pub enum Strike {
    /// In each transaction the byte with this number on the path, counted from 0.
    Byte(u32),
    /// Every byte on the path, with this probability, 0 to 1.
    Probability(f64),
}

/// A fault.
#[derive(Clone, Copy, Debug, PartialEq)]
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
pub enum Trigger {
    /// At this time; at once if it has passed.
    At(Time),
    /// At the START of the transaction with this number, counted from 0 since the chip was created
    /// (see [`crate::Traffic::transactions`]).
    Transaction(u64),
}

/// How long a fault lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// Error: sixteen faults are waiting or active already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScheduleFull;

impl core::fmt::Display for ScheduleFull {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(formatter, "all {FAULT_SLOTS} slots for faults are taken")
    }
}

impl core::error::Error for ScheduleFull {}

/// The state of a scheduled fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waiting,
    Active { since: Time },
    Over,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    /// Number of the fault, in the order in which they were scheduled.
    number: u64,
    event: FaultEvent,
    state: State,
    transactions_left: u32,
}

impl Slot {
    fn begin(&mut self, now: Time) {
        let never_lasts = self.event.span == Span::Transactions(0);
        self.state = if self.event.fault.is_instant() || never_lasts {
            State::Over
        } else {
            State::Active { since: now }
        };
    }

    fn is_active(&self) -> bool {
        matches!(self.state, State::Active { .. })
    }

    fn is_over(&self) -> bool {
        self.state == State::Over
    }

    /// Time at which the fault starts or ends, unless that depends on transactions.
    fn due(&self) -> Option<Time> {
        match (self.state, self.event.trigger, self.event.span) {
            (State::Waiting, Trigger::At(time), _) => Some(time),
            (State::Active { since }, _, Span::Time(length)) => Some(since + length),
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

/// Slots for faults. Slots that were never used are skipped, since every byte on the bus is checked
/// against all others.
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
    /// Number of the next fault.
    next: u64,
    /// The earliest of all [`Slot::due`], cached because it is needed for every conversion.
    due: Option<Time>,
    random: Random,
}

impl Schedule {
    pub(crate) fn new(random: Random) -> Self {
        Self {
            slots: Slots {
                all: [None; FAULT_SLOTS],
                taken: 0,
            },
            next: 0,
            due: None,
            random,
        }
    }

    pub(crate) fn add(&mut self, event: FaultEvent) -> Result<(), ScheduleFull> {
        let slot = self.free_slot().ok_or(ScheduleFull)?;
        let transactions_left = match event.span {
            Span::Transactions(count) => count,
            Span::Time(_) | Span::Forever => 0,
        };
        self.slots.put(
            slot,
            Slot {
                number: self.next,
                event,
                state: State::Waiting,
                transactions_left,
            },
        );
        self.next += 1;
        self.find_due();
        Ok(())
    }

    /// Index of an empty slot, or of the oldest fault that is over.
    fn free_slot(&self) -> Option<usize> {
        let empty = self.slots.all.iter().position(Option::is_none);
        empty.or_else(|| {
            (0..)
                .zip(&self.slots.all)
                .filter_map(|(index, slot)| {
                    slot.filter(Slot::is_over).map(|slot| (slot.number, index))
                })
                .min()
                .map(|(_, index)| index)
        })
    }

    /// Ends active faults and removes waiting ones.
    pub(crate) fn clear(&mut self) {
        for entry in &mut self.slots.all {
            match entry {
                Some(slot) if slot.is_active() => slot.state = State::Over,
                Some(slot) if slot.state == State::Waiting => *entry = None,
                _ => {}
            }
        }
        self.find_due();
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
            slot.state = State::Over;
            false
        } else {
            slot.begin(now);
            true
        };
        let fault = slot.event.fault;
        self.find_due();
        Some(FaultChange { fault, begins })
    }

    /// Starts one fault that waits for this transaction, and returns it.
    pub(crate) fn begin_transaction(&mut self, number: u64, now: Time) -> Option<FaultChange> {
        let slot = self.slots.iter_mut().find(|slot| {
            slot.state == State::Waiting
                && matches!(slot.event.trigger, Trigger::Transaction(first) if first <= number)
        })?;
        slot.begin(now);
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
    pub(crate) fn end_transaction(&mut self, counted: bool) -> Option<FaultChange> {
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
        slot.state = State::Over;
        Some(FaultChange {
            fault: slot.event.fault,
            begins: false,
        })
    }

    /// Counts SCL pulses for the faults that they end.
    pub(crate) fn clock_pulses(&mut self, pulses: u32) {
        for slot in self.slots.iter_mut().filter(|slot| slot.is_active()) {
            if let ChipFault::SdaStuck {
                clocks: Some(clocks),
            } = &mut slot.event.fault
            {
                *clocks = clocks.saturating_sub(u8::try_from(pulses).unwrap_or(u8::MAX));
                if *clocks == 0 {
                    slot.state = State::Over;
                }
            }
        }
        self.find_due();
    }

    /// The active faults.
    pub(crate) fn active(&self) -> impl Iterator<Item = &ChipFault> {
        self.slots
            .iter()
            .filter(|slot| slot.is_active())
            .map(|slot| &slot.event.fault)
    }

    /// Latest end of the active faults for which `is_meant` is true; [`Time::MAX`] if one of them
    /// lasts until the test ends it. `None` if no such fault is active.
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
        distorted
    }
}
