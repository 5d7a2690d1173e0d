//! The native board: the firmware's own crates on a PC, against the simulated converters and plant, on
//! the virtual clock.
//!
//! It runs the code of the real board (`palpate-node` with driver, procedure and control law) and
//! sends the same records. This module replaces the RTIC tasks of the microcontroller: it polls the
//! converters' tasks when an event concerns them, the coil's manager once a millisecond, and the
//! instrument after both. The control law sets the coil's current in the simulated circuit, period
//! by period.
//!
//! ```
//! use palpate_sim::Time;
//! use palpate_sim::device::Device;
//! use palpate_sim::native::{NativeBoard, Wiring};
//! use palpate_sim::parameters::draw;
//! use palpate_sim::stack::{Disturbances, Stack};
//! use palpate_sim::switches::Switches;
//! use palpate_sim::world::{Setup, World};
//!
//! let plant = draw(&Stack::builtin("ultrasoft")?, &Disturbances::builtin()?, 1);
//! let wiring = Wiring::new(World::new(&plant, Switches::all(), Setup::default())?);
//! let mut board = NativeBoard::new(&wiring);
//! board.run_until(Time::from_ms(500))?;
//! let records = board.take_records();
//! assert!(records.len() > 400, "samples at 1 kHz after the start");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod coil;
mod converter;
mod drive;
mod flash;
mod identity;
mod links;
mod wiring;

use core::fmt;
use core::future::Future;
use core::pin::{Pin, pin};
use core::task::{Context, Poll, Waker};
use std::rc::Rc;

use ldc161x_sim::Time;
use palpate_node::coil::{CoilManager, POLL_US};
use palpate_node::converter::{CONVERTERS, ConverterState, ConverterTask};
use palpate_node::instrument::{self, Instrument, Usage};
use palpate_node::storage::StorageTask;
use palpate_procedure::storage::{StorageOrder, StorageReport};
use palpate_procedure::{Link, Procedure};
use palpate_wire::code::RebootTarget;
use palpate_wire::{Command, Frame, Header, Message, Record, Sequencer};

use self::coil::NativeCoil;
use self::converter::{NativeBus, NativeEdges, NativePort, Shared};
use self::links::Links;
use self::wiring::micros;
use crate::device::Device;
use crate::world::World;

pub use flash::{Flash, FlashError};
pub use identity::FIRST_BOOT_ID;
pub use wiring::{DrivenWorld, Wiring};

/// Settings of the instrument after a start.
#[must_use]
pub fn default_settings() -> palpate_wire::command::Settings {
    palpate_procedure::configuration::DEFAULT_SETTINGS
}

/// Interval between two polls of the coil's drive.
const POLL: Time = Time::from_us(POLL_US);
/// Longest time for the converters' identification, as on the device.
const IDENTITY: Time = Time::from_ms(60);
/// Longest wait for an answer; a command that arrives during the coil's test is answered after it.
const ANSWER: Time = Time::from_ms(500);

/// Error of the native board.
#[derive(Clone, Debug, PartialEq)]
pub enum BoardError {
    /// A command of this kind was not answered.
    NoAnswer {
        /// Kind of the command.
        kind: u8,
    },
}

impl fmt::Display for BoardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAnswer { kind } => {
                write!(f, "the command 0x{kind:02x} was not answered")
            }
        }
    }
}

impl core::error::Error for BoardError {}

/// Task of a converter; it never ends.
type Task<'a> = Pin<Box<dyn Future<Output = ()> + 'a>>;

/// A running board.
pub struct NativeBoard<'a> {
    hardware: NativeHardware<'a>,
    instrument: Instrument,
    tasks: [Task<'a>; CONVERTERS],
    /// Latest start time of the instrument; `None` once the instrument has started.
    begins: Option<Time>,
    next_poll: Time,
    commands_sent: u32,
}

impl fmt::Debug for NativeBoard<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("NativeBoard")
            .field("instrument", &self.instrument)
            .finish_non_exhaustive()
    }
}

/// Hardware of the instrument.
struct NativeHardware<'a> {
    wiring: &'a Wiring,
    shared: Rc<Shared>,
    coil: CoilManager<NativeCoil<'a>>,
    /// Number of this run; each restart raises it by one.
    boot_id: u32,
    /// Sequence numbers of `frames`.
    sequencer: Sequencer,
    /// Frames sent over the probe's link, unless a PC reads that link's bytes.
    frames: Vec<Frame<Record>>,
    links: Links,
    storage: StorageTask<Flash>,
    /// Pending order to the storage.
    order: Option<StorageOrder>,
    /// Whether a restart is pending.
    restarts: bool,
}

impl<'a> instrument::Hardware for NativeHardware<'a> {
    type Coil = NativeCoil<'a>;

    fn now_us(&self) -> u64 {
        micros(self.wiring.now())
    }

    fn with_coil<T>(
        &mut self,
        work: impl FnOnce(&mut CoilManager<NativeCoil<'a>>) -> T,
    ) -> Option<T> {
        Some(work(&mut self.coil))
    }

    fn with_converters<T>(
        &mut self,
        work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T,
    ) -> T {
        work(&mut self.shared.states.borrow_mut())
    }

    fn send(&mut self, to: Option<Link>, at_us: u64, record: &Record) {
        self.links.send(to, at_us, record);
        if to != Some(Link::Usb) {
            self.frames.push(Frame {
                header: self.sequencer.stamp(at_us),
                message: record.clone(),
            });
        }
    }

    fn order(&mut self, order: StorageOrder) {
        self.order = Some(order);
    }

    fn restart(&mut self, _: RebootTarget) {
        self.restarts = true;
    }

    /// The native board has no LED.
    fn locate(&mut self, _: u64) {}

    fn usage(&mut self) -> Usage {
        Usage::default()
    }
}

impl NativeHardware<'_> {
    /// Next report of the storage.
    fn storage_reports(&mut self) -> Option<StorageReport> {
        let going = pin!(self.storage.work(self.order.take()));
        // A flash in memory never waits.
        match going.poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(report) => report,
            Poll::Pending => None,
        }
    }
}

impl<'a> NativeBoard<'a> {
    /// A board that starts now, with the settings and calibration in the wiring's flash. An empty
    /// flash means default settings and no calibration.
    #[must_use]
    pub fn new(wiring: &'a Wiring) -> Self {
        let shared = Rc::new(Shared::default());
        let task = |converter: usize| -> Task<'a> {
            let bus = NativeBus::new(wiring, Rc::clone(&shared), converter);
            let edges = NativeEdges::new(wiring, Rc::clone(&shared), converter);
            let port = NativePort::new(wiring, Rc::clone(&shared), converter);
            let mut task = ConverterTask::new(converter, bus, edges, port);
            Box::pin(async move { task.run().await })
        };
        let now = wiring.now();
        Self {
            tasks: [0, 1].map(task),
            hardware: NativeHardware {
                wiring,
                coil: CoilManager::new(NativeCoil::new(wiring), wiring.supervisor.clone()),
                shared,
                boot_id: FIRST_BOOT_ID,
                sequencer: Sequencer::new(FIRST_BOOT_ID),
                frames: Vec::new(),
                links: Links::new(FIRST_BOOT_ID),
                storage: StorageTask::new(wiring.flash().clone()),
                order: None,
                restarts: false,
            },
            instrument: Instrument::new(),
            begins: Some(now + IDENTITY),
            next_poll: now,
            commands_sent: 0,
        }
    }

    /// Sends a command without waiting for its answer; returns its number.
    pub fn post(&mut self, command: Command) -> u32 {
        while !self.instrument.has_begun() {
            self.advance_to(self.now() + IDENTITY);
        }
        let sequence = self.commands_sent;
        let header = Header {
            boot_id: self.hardware.boot_id,
            sequence,
            time_us: 0,
            dropped: 0,
        };
        self.commands_sent += 1;
        let frame = Frame {
            header,
            message: command,
        };
        self.instrument
            .received(&mut self.hardware, Link::Probe, &Ok(frame));
        sequence
    }

    /// Writes bytes to a link, as a PC does. The board processes one frame of each link per turn,
    /// as the device does. From the first call on, [`Self::read`] returns the bytes that the board
    /// sends over the link.
    pub fn write(&mut self, link: Link, bytes: &[u8]) {
        self.hardware.links.with_cable(link, |cable| {
            cable.is_open = true;
            cable.down.extend(bytes);
        });
    }

    /// Number of bytes written to a link and not yet read by the board.
    #[must_use]
    pub fn unread(&self, link: Link) -> usize {
        let links = &self.hardware.links;
        links.with_cable(link, |cable| cable.down.len())
    }

    /// Returns the bytes that the board has sent over a link since the last call, or since the
    /// first [`Self::write`].
    #[must_use]
    pub fn read(&mut self, link: Link) -> Vec<u8> {
        let links = &self.hardware.links;
        links.with_cable(link, |cable| core::mem::take(&mut cable.up))
    }

    /// Boot id: [`FIRST_BOOT_ID`] at first, and one more after every restart.
    #[must_use]
    pub const fn boot_id(&self) -> u32 {
        self.hardware.boot_id
    }

    /// The procedure, to read; `None` until the instrument has started.
    #[must_use]
    pub const fn procedure(&self) -> Option<&Procedure> {
        self.instrument.procedure()
    }

    /// Advances to the next event for a task, to `end` at most.
    fn advance_to(&mut self, end: Time) {
        let wiring = self.hardware.wiring;
        let now = wiring.now();
        let due = end.min(self.next_poll).min(self.hardware.shared.wakes());
        wiring.advance_to_edge(due.max(now + Time::from_us(1)));
        wiring.advance_world();
        self.poll_tasks();
        let polls = self.wiring_now() >= self.next_poll;
        if polls {
            self.next_poll += POLL;
            self.hardware.coil.poll();
        }
        self.run_instrument(polls);
        wiring.advance_world();
    }

    fn wiring_now(&self) -> Time {
        self.hardware.wiring.now()
    }

    fn poll_tasks(&mut self) {
        let mut context = Context::from_waker(Waker::noop());
        for task in &mut self.tasks {
            // A task never ends.
            let _ = task.as_mut().poll(&mut context);
        }
    }

    fn run_instrument(&mut self, polls: bool) {
        if let Some(latest) = self.begins {
            if !Instrument::is_ready(&mut self.hardware) && self.wiring_now() < latest {
                return;
            }
            self.begins = None;
            let boot_id = self.hardware.boot_id;
            self.instrument
                .begin(&mut self.hardware, identity::identity(boot_id));
            // With empty storage the instrument starts at once.
            self.run_storage();
        }
        let mut stepped = false;
        // Until the instrument has started, samples and commands stay queued.
        if !self.instrument.has_begun() {
            self.instrument.poll(&mut self.hardware, stepped);
            return self.run_storage();
        }
        loop {
            let next = self.hardware.shared.samples.borrow_mut().pop_front();
            let Some((converter, sampled)) = next else {
                break;
            };
            self.instrument
                .sampled(&mut self.hardware, converter, &sampled);
            stepped = true;
        }
        if stepped || polls {
            stepped |= self.receive();
            self.instrument.poll(&mut self.hardware, stepped);
            self.run_storage();
        }
        if core::mem::take(&mut self.hardware.restarts) {
            self.restart();
        }
    }

    /// Runs the storage: its pending order, or the next part of one. The storage makes one report
    /// per turn, as on the device, and takes no virtual time.
    fn run_storage(&mut self) {
        if let Some(report) = self.hardware.storage_reports() {
            self.instrument.stored(&mut self.hardware, &report);
        }
    }

    /// Processes one frame of each link; returns whether there was one.
    fn receive(&mut self) -> bool {
        let mut has_received = false;
        for link in Link::ALL {
            if let Some(received) = self.hardware.links.receive(link) {
                self.instrument
                    .received(&mut self.hardware, link, &received);
                has_received = true;
            }
        }
        has_received
    }

    /// Restarts the instrument, which keeps only stored data, and configures the converters again.
    fn restart(&mut self) {
        self.hardware.boot_id += 1;
        self.hardware.sequencer = Sequencer::new(self.hardware.boot_id);
        self.hardware.links.restart(self.hardware.boot_id);
        let flash = self.hardware.wiring.flash().clone();
        self.hardware.storage = StorageTask::new(flash);
        self.hardware.order = None;
        self.instrument = Instrument::new();
        self.begins = Some(self.wiring_now() + IDENTITY);
    }
}

impl Device for NativeBoard<'_> {
    type Error = BoardError;

    fn now(&self) -> Time {
        self.wiring_now()
    }

    fn send(&mut self, command: Command) -> Result<(), Self::Error> {
        let kind = command.kind();
        let seen = self.hardware.frames.len();
        let sequence = self.post(command);
        let is_answer = |record: &Record| match record {
            Record::Acknowledgement(answer) => answer.command == sequence,
            _ => false,
        };
        let frames = self.hardware.frames.get(seen..).unwrap_or_default();
        let is_answered = frames.iter().any(|frame| is_answer(&frame.message));
        let end = self.now() + ANSWER;
        if is_answered || self.run_to(end, is_answer)? {
            return Ok(());
        }
        Err(BoardError::NoAnswer { kind })
    }

    fn advance(&mut self, end: Time) -> Result<(), Self::Error> {
        self.advance_to(end);
        Ok(())
    }

    fn frames(&mut self) -> &mut Vec<Frame<Record>> {
        &mut self.hardware.frames
    }

    fn with_world<T>(&mut self, look: impl FnOnce(&mut World) -> T) -> T {
        look(&mut self.hardware.wiring.world().borrow_mut())
    }
}
