//! Hardware of the converters' tasks: a bus, an edge reader and a port, all on the simulated chips.

use core::cell::{Cell, RefCell};
use core::future::poll_fn;
use core::task::Poll;
use std::collections::VecDeque;
use std::rc::Rc;

use embedded_hal::i2c::NoAcknowledgeSource;
use embedded_hal_async::i2c::{ErrorType, I2c, Operation, SevenBitAddress};
use ldc161x::FrameRequest;
use ldc161x_sim::{Bus, ExternalClock, I2cError, IntbPin, Time};
use palpate_node::acquisition::{Fetch, MOST_PARTS, Sampled};
use palpate_node::board::Clkin;
use palpate_node::converter::{
    CONVERTERS, ConverterState, EdgeDeadlines, EdgeFrame, EdgeReader, Port, TransferError,
};

use super::wiring::{clkin_hz, micros};
use super::{DrivenWorld, Wiring};

const SCL_HZ: u32 = 400_000;
const ADDRESSES: [SevenBitAddress; CONVERTERS] = [0x2A, 0x2B];
/// An edge counts as missed when INTB has been low for this long without a known edge.
const MISSED_EDGE: Time = Time::from_ms(1);
/// Capacity of the sample queue to the instrument.
const WAITING: usize = 8;

/// State shared by the converters' tasks and the instrument.
#[derive(Default)]
pub(super) struct Shared {
    pub(super) states: RefCell<[ConverterState; CONVERTERS]>,
    pub(super) samples: RefCell<VecDeque<(u8, Sampled)>>,
    /// Latest time of the next poll of each task.
    wakes: [Cell<Time>; CONVERTERS],
}

impl Shared {
    /// Latest time of the next poll of any task.
    pub(super) fn wakes(&self) -> Time {
        let [first, second] = &self.wakes;
        first.get().min(second.get())
    }

    fn wake_at(&self, converter: usize, time: Time) {
        if let Some(wake) = self.wakes.get(converter) {
            wake.set(time);
        }
    }
}

/// I2C bus, whose transfers block for their duration. After each transfer the other converter gets
/// its turn.
pub(super) struct NativeBus<'a> {
    wiring: &'a Wiring,
    shared: Rc<Shared>,
    converter: usize,
    bus: Bus<'a, DrivenWorld>,
}

impl<'a> NativeBus<'a> {
    pub(super) fn new(wiring: &'a Wiring, shared: Rc<Shared>, converter: usize) -> Self {
        Self {
            wiring,
            shared,
            converter,
            bus: Bus::shared(wiring.chips(), SCL_HZ),
        }
    }
}

impl ErrorType for NativeBus<'_> {
    type Error = TransferError;
}

impl I2c for NativeBus<'_> {
    async fn transaction(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), TransferError> {
        let done = blocking(&mut self.bus, address, operations);
        pass_turn(self.wiring, &self.shared, self.converter).await;
        done
    }
}

/// Yields the bus to the other converter.
async fn pass_turn(wiring: &Wiring, shared: &Shared, converter: usize) {
    let since = wiring.now();
    poll_fn(|_| {
        if wiring.now() > since {
            return Poll::Ready(());
        }
        shared.wake_at(converter, since);
        Poll::Pending
    })
    .await;
}

/// A transaction that blocks for its duration.
fn blocking(
    bus: &mut Bus<'_, DrivenWorld>,
    address: SevenBitAddress,
    operations: &mut [Operation<'_>],
) -> Result<(), TransferError> {
    let done = embedded_hal::i2c::I2c::transaction(bus, address, operations);
    done.map_err(transfer)
}

const fn transfer(error: I2cError) -> TransferError {
    match error {
        I2cError::NoAcknowledge(NoAcknowledgeSource::Address) => {
            TransferError::NotAcknowledged { address: true }
        }
        I2cError::NoAcknowledge(_) => TransferError::NotAcknowledged { address: false },
        I2cError::ArbitrationLoss => TransferError::Arbitration,
        I2cError::Bus => TransferError::DataStuck,
        I2cError::Timeout => TransferError::ClockStuck,
        I2cError::Borrowed => TransferError::Aborted,
    }
}

/// Reads a converter's frame after each edge.
pub(super) struct NativeEdges<'a> {
    wiring: &'a Wiring,
    shared: Rc<Shared>,
    converter: usize,
    bus: Bus<'a, DrivenWorld>,
    pointers: Vec<u8>,
    deadlines: EdgeDeadlines,
    /// Number of falling edges of INTB that have been processed.
    taken: u64,
    /// Time of the last processed edge, or of the start of reading.
    known: Time,
}

impl<'a> NativeEdges<'a> {
    pub(super) fn new(wiring: &'a Wiring, shared: Rc<Shared>, converter: usize) -> Self {
        Self {
            wiring,
            shared,
            converter,
            bus: Bus::shared(wiring.chips(), SCL_HZ),
            pointers: Vec::new(),
            deadlines: EdgeDeadlines {
                silence_us: 0,
                parts: 1,
                latest_begin_us: [0; MOST_PARTS],
            },
            taken: 0,
            known: Time::ZERO,
        }
    }

    /// Number of falling edges of INTB so far, and the time of the last one.
    fn falls(&self) -> (u64, Option<Time>) {
        let chip = self.wiring.chips().get(self.converter);
        chip.map_or((0, None), |chip| {
            let chip = chip.borrow();
            (chip.interrupts(), chip.last_interrupt())
        })
    }

    fn intb_is_stuck(&self) -> bool {
        let chip = self.wiring.chips().get(self.converter);
        chip.is_some_and(|chip| chip.borrow().intb_is_stuck().is_some())
    }

    fn intb_is_low(&self) -> bool {
        let chip = self.wiring.chips().get(self.converter);
        chip.is_some_and(|chip| chip.borrow().intb_is_low())
    }

    /// Reads the frame of an edge, part by part, until a part's latest start has passed.
    async fn read(&mut self, edge: Option<Time>) -> Result<EdgeFrame, TransferError> {
        let mut data = vec![[0; 2]; self.pointers.len()];
        // One microsecond more: the device's interrupt takes that long to read the timer.
        let edge_us = edge.map(|edge| micros(edge) + 1);
        let mut ended_us = [0; MOST_PARTS];
        let after_edge = |now: Time| {
            let after_us = edge_us.map_or(0, |edge_us| micros(now).saturating_sub(edge_us));
            u32::try_from(after_us).unwrap_or(u32::MAX)
        };
        let address = ADDRESSES.get(self.converter).copied().unwrap_or_default();
        let first = self.pointers.len() - 2 * (usize::from(self.deadlines.parts) - 1);
        let mut rest = self.pointers.iter().zip(&mut data);
        let limits = self.deadlines.latest_begin_us.iter().zip(&mut ended_us);
        for (part, (latest_us, ended_us)) in limits.take(self.deadlines.parts.into()).enumerate() {
            if part > 0 {
                pass_turn(self.wiring, &self.shared, self.converter).await;
            }
            if after_edge(self.wiring.now()) > *latest_us {
                *ended_us = u32::MAX;
                break;
            }
            let mut operations = Vec::new();
            for (pointer, data) in rest.by_ref().take(if part == 0 { first } else { 2 }) {
                operations.push(Operation::Write(core::slice::from_ref(pointer)));
                operations.push(Operation::Read(data));
            }
            blocking(&mut self.bus, address, &mut operations)?;
            *ended_us = after_edge(self.wiring.now());
        }
        drop(rest);
        Ok(EdgeFrame {
            bytes: data.iter().flatten().copied().collect(),
            fetch: edge_us.map(|edge_us| Fetch {
                edge_us,
                ended_us,
                edges: self.taken as u16,
            }),
        })
    }
}

impl EdgeReader for NativeEdges<'_> {
    fn start(&mut self, request: &FrameRequest, deadlines: EdgeDeadlines) {
        self.pointers = request.pointers().collect();
        self.deadlines = deadlines;
        self.taken = self.falls().0;
        self.known = self.wiring.now();
    }

    async fn next(&mut self) -> Result<EdgeFrame, TransferError> {
        let began = self.wiring.now();
        let silence = Time::from_us(self.deadlines.silence_us.into());
        let edge = poll_fn(|_| {
            let now = self.wiring.now();
            let silent = self.known + silence;
            let (falls, last) = self.falls();
            if self.intb_is_stuck() {
                // INTB is stuck: the converter's edges do not appear on it.
                self.taken = falls;
            } else if falls != self.taken {
                self.taken = falls;
                self.known = last.unwrap_or(now);
                return Poll::Ready(Ok(last));
            }
            if now >= silent {
                self.known = now;
                return Poll::Ready(Err(TransferError::Silent));
            }
            let since = last.map_or(began, |last| last.max(began));
            let missed = since + MISSED_EDGE;
            if self.intb_is_low() && now >= missed {
                return Poll::Ready(Ok(None));
            }
            let wake = if now < missed {
                missed
            } else {
                now + MISSED_EDGE
            };
            self.shared.wake_at(self.converter, silent.min(wake));
            Poll::Pending
        })
        .await?;
        self.read(edge).await
    }

    fn stop(&mut self) {}
}

/// Pins, clock and time of a converter.
pub(super) struct NativePort<'a> {
    wiring: &'a Wiring,
    shared: Rc<Shared>,
    converter: usize,
}

impl<'a> NativePort<'a> {
    pub(super) const fn new(wiring: &'a Wiring, shared: Rc<Shared>, converter: usize) -> Self {
        Self {
            wiring,
            shared,
            converter,
        }
    }
}

impl<'a> Port for NativePort<'a> {
    type Intb = Intb<'a>;

    fn intb(&self) -> Intb<'a> {
        Intb(self.wiring.chips().get(self.converter).map(IntbPin::new))
    }

    fn shut_down(&mut self, off: bool) {
        if let Some(chip) = self.wiring.chips().get(self.converter) {
            chip.borrow_mut().set_shutdown(off);
        }
    }

    fn set_clkin(&mut self, clkin: Clkin) {
        let now = self.wiring.now();
        for chip in self.wiring.chips() {
            let mut chip = chip.borrow_mut();
            let was = chip.settings().external_clock;
            let relative_error = was.map_or(0.0, |was| was.relative_error);
            let clock = ExternalClock {
                relative_error,
                ..ExternalClock::exact(clkin_hz(clkin))
            };
            // A clock that is already set continues without a gap.
            if was != Some(clock) {
                chip.advance_to(now);
                chip.set_external_clock(Some(clock));
            }
        }
    }

    async fn wait_us(&mut self, time_us: u32) {
        let end = self.wiring.now() + Time::from_us(time_us.into());
        poll_fn(|_| {
            if self.wiring.now() >= end {
                return Poll::Ready(());
            }
            self.shared.wake_at(self.converter, end);
            Poll::Pending
        })
        .await;
    }

    fn with_states<T>(&mut self, work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T) -> T {
        work(&mut self.shared.states.borrow_mut())
    }

    fn hand_over(&mut self, sampled: Sampled) -> bool {
        let mut samples = self.shared.samples.borrow_mut();
        let has_room = samples.len() < WAITING;
        if has_room {
            samples.push_back((self.converter as u8, sampled));
        }
        has_room
    }
}

/// INTB; high if the converter is absent.
pub(super) struct Intb<'a>(Option<IntbPin<'a, DrivenWorld>>);

impl embedded_hal::digital::ErrorType for Intb<'_> {
    type Error = core::convert::Infallible;
}

impl embedded_hal::digital::InputPin for Intb<'_> {
    fn is_high(&mut self) -> Result<bool, Self::Error> {
        self.0.as_mut().map_or(Ok(true), |pin| pin.is_high())
    }

    fn is_low(&mut self) -> Result<bool, Self::Error> {
        self.is_high().map(|high| !high)
    }
}
