//! The host: a PC's root port at full speed, in virtual time.
//!
//! A frame starts every millisecond with its SOF. Within it, control, interrupt and bulk
//! transactions take turns, each with its time on the wire. After a NAK an endpoint is polled again
//! in its next turn, and after a number of NAKs in the next frame.

mod control;
mod enumeration;
mod pipe;

use std::collections::VecDeque;

pub use control::{ControlOutcome, ControlTransfer};
pub use enumeration::EnumerationFailure;

use control::ControlProgress;
use enumeration::{Enumeration, Request, line_state};
use ldc161x_sim::Time;
use pipe::{Pipe, Progress};

use super::controller::UsbController;
use super::description::UsbDescription;
use super::wire::{
    FRAME_PS, LARGEST_PACKET, Reply, Transaction, end_of_frame_ps, start_of_frame_ps, token_ps,
};

/// Time from attachment of a device to its reset (USB 2.0 7.1.7.3, minimum).
const DEBOUNCE: Time = Time::from_ms(100);
/// Duration of a reset (USB 2.0 7.1.7.5, minimum).
const RESET: Time = Time::from_ms(10);
/// Time after a reset in which a device need not answer (USB 2.0 7.1.7.5).
const RESET_RECOVERY: Time = Time::from_ms(10);
/// Duration of a resume, and the device's recovery time after it (USB 2.0 7.1.7.7).
const RESUME: Time = Time::from_ms(20);
const RESUME_RECOVERY: Time = Time::from_ms(10);
/// Recovery time after SET_ADDRESS (USB 2.0 9.2.6.3).
const ADDRESS_RECOVERY: Time = Time::from_ms(2);
/// Sizes of endpoint 0's packets (USB 2.0 9.6.1).
const CONTROL_PACKETS: [usize; 4] = [8, 16, 32, 64];

/// Number of NAKs of an endpoint, without any other answer, after which it is not polled for the
/// rest of the frame. Host controllers differ; guess.
const NAKS_PER_FRAME: u32 = 16;

/// State of the device as the host sees it: those of USB 2.0 9.1.1, and earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UsbState {
    /// No cable.
    Unplugged,
    /// VBUS, without a visible device.
    Powered,
    /// A device is visible; its contacts may still bounce.
    Attached,
    /// The bus is being reset.
    Resetting,
    /// The device has address 0.
    Default,
    /// The device has its own address.
    Addressed,
    /// The device is configured.
    Configured,
    /// The bus is suspended or resuming.
    Suspended,
}

/// Identifier of a submitted control transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TransferId(u32);

/// Counts since the creation of the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UsbCounts {
    /// Starts of frame.
    pub frames: u64,
    /// Repeated packets of the device.
    pub repeated: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Port {
    Unplugged,
    Powered,
    Attached,
    Resetting,
    Enabled,
    Suspended,
    Resuming,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Plug,
    Unplug,
    Reset,
    Suspend,
    Resume,
    Enumerate,
}

/// Origin of a control transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Origin {
    Caller(TransferId),
    Enumeration,
}

/// Pipe that has its turn in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Turn {
    Control,
    Notification,
    Output,
    Input,
}

const TURNS: [Turn; 4] = [Turn::Control, Turn::Notification, Turn::Output, Turn::Input];

/// The pipes of the serial port.
#[derive(Clone, Debug)]
struct Pipes {
    notification: Option<Pipe>,
    output: Pipe,
    input: Pipe,
}

impl Pipes {
    fn all(&mut self) -> impl Iterator<Item = &mut Pipe> {
        let Self {
            notification,
            output,
            input,
        } = self;
        notification.iter_mut().chain([output, input])
    }
}

/// A transaction in transmission.
#[derive(Clone, Debug)]
struct Flight {
    turn: Turn,
    transaction: Transaction,
    reply: Reply,
    end_ps: u64,
}

/// The host at the other end of the USB cable. Orders take effect with the next step of the board.
/// A clone is a snapshot.
#[derive(Clone, Debug)]
pub struct UsbHost {
    gives_up_within_frame: bool,
    actions: VecDeque<Action>,
    port: Port,
    port_due_ps: Option<u64>,
    /// End of the next start of frame, while frames run.
    frame_due_ps: Option<u64>,
    /// End of the next token, if anything is queued.
    token_due_ps: Option<u64>,
    /// Earliest start of the next transaction.
    quiet_ps: u64,
    flight: Option<Flight>,
    address: u8,
    control_packet: usize,
    configuration: u8,
    waiting: VecDeque<(Origin, ControlTransfer)>,
    control: Option<(Origin, ControlProgress)>,
    results: Vec<(TransferId, ControlOutcome)>,
    submitted: u32,
    pipes: Option<Pipes>,
    last_turn: usize,
    /// Number of NAKs in this frame, by turn.
    naks: [u32; TURNS.len()],
    outgoing: VecDeque<u8>,
    incoming: Vec<u8>,
    reading: bool,
    enumerates: bool,
    enumeration: Option<Enumeration>,
    enumerated: Option<Result<UsbDescription, EnumerationFailure>>,
    counts: UsbCounts,
}

impl UsbHost {
    pub(super) fn new() -> Self {
        Self {
            gives_up_within_frame: false,
            actions: VecDeque::new(),
            port: Port::Unplugged,
            port_due_ps: None,
            frame_due_ps: None,
            token_due_ps: None,
            quiet_ps: 0,
            flight: None,
            address: 0,
            control_packet: LARGEST_PACKET,
            configuration: 0,
            waiting: VecDeque::new(),
            control: None,
            results: Vec::new(),
            submitted: 0,
            pipes: None,
            last_turn: 0,
            naks: [0; TURNS.len()],
            outgoing: VecDeque::new(),
            incoming: Vec::new(),
            reading: true,
            enumerates: false,
            enumeration: None,
            enumerated: None,
            counts: UsbCounts::default(),
        }
    }

    // ---- orders ----

    /// Sets whether a control transfer is given up within a frame, so that the next one starts in
    /// that frame; initially it starts in the next frame. PCs differ.
    pub const fn give_up_within_frame(&mut self, within: bool) {
        self.gives_up_within_frame = within;
    }

    /// Plugs the cable: VBUS rises, and a visible device is reset after 100 ms. No request is sent
    /// before [`enumerate`](Self::enumerate) or [`submit`](Self::submit).
    pub fn plug(&mut self) {
        self.actions.push_back(Action::Plug);
    }

    /// Unplugs the cable, in any state.
    pub fn unplug(&mut self) {
        self.actions.push_back(Action::Unplug);
    }

    /// Resets the bus for 10 ms, in any state; no effect without a device. A host that enumerates
    /// does so again.
    pub fn reset(&mut self) {
        self.actions.push_back(Action::Reset);
    }

    /// Suspends the bus, in any state.
    pub fn suspend(&mut self) {
        self.actions.push_back(Action::Suspend);
    }

    /// Resumes a suspended bus: 20 ms, and 10 ms more before any request.
    pub fn resume(&mut self) {
        self.actions.push_back(Action::Resume);
    }

    /// Enumerates the device as a PC does, now and each time it becomes visible again: its
    /// descriptors and strings, an address, a configuration, and for a serial port line coding and
    /// DTR. See [`enumerated`](Self::enumerated).
    pub fn enumerate(&mut self) {
        self.actions.push_back(Action::Enumerate);
    }

    /// Appends a control transfer to the queue, which waits during an enumeration.
    /// [`take_results`](Self::take_results) returns its result. A SET_ADDRESS, SET_CONFIGURATION or
    /// CLEAR_FEATURE also changes the host's own state of the device.
    pub fn submit(&mut self, transfer: ControlTransfer) -> TransferId {
        let id = TransferId(self.submitted);
        self.submitted += 1;
        self.waiting.push_back((Origin::Caller(id), transfer));
        id
    }

    /// Submits a change of DTR and RTS; `None` without a serial port.
    pub fn set_dtr(&mut self, is_open: bool) -> Option<TransferId> {
        let interface = self.description()?.cdc()?.control_interface;
        Some(self.submit(line_state(interface, is_open)))
    }

    /// Appends bytes for the serial port. They wait until the device is configured; a reset or
    /// unplugging loses them.
    pub fn write(&mut self, bytes: &[u8]) {
        self.outgoing.extend(bytes);
    }

    /// Sets whether a program on the PC reads from the serial port. If not, the device is not
    /// polled, and its buffers fill. Initially it reads.
    pub const fn set_reading(&mut self, reading: bool) {
        self.reading = reading;
    }

    // ---- state and results ----

    /// State of the device as the host sees it.
    #[must_use]
    pub const fn state(&self) -> UsbState {
        match self.port {
            Port::Unplugged => UsbState::Unplugged,
            Port::Powered => UsbState::Powered,
            Port::Attached => UsbState::Attached,
            Port::Resetting => UsbState::Resetting,
            Port::Suspended | Port::Resuming => UsbState::Suspended,
            Port::Enabled if self.configuration != 0 => UsbState::Configured,
            Port::Enabled if self.address != 0 => UsbState::Addressed,
            Port::Enabled => UsbState::Default,
        }
    }

    /// Description from the last enumeration, or its failure; `None` before its end.
    #[must_use]
    pub const fn enumerated(&self) -> Option<&Result<UsbDescription, EnumerationFailure>> {
        self.enumerated.as_ref()
    }

    /// Description from the last successful enumeration.
    #[must_use]
    pub fn description(&self) -> Option<&UsbDescription> {
        self.enumerated.as_ref()?.as_ref().ok()
    }

    /// Control transfers that have ended since the last call, in order.
    pub fn take_results(&mut self) -> Vec<(TransferId, ControlOutcome)> {
        std::mem::take(&mut self.results)
    }

    /// Bytes received from the serial port since the last call.
    pub fn read(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.incoming)
    }

    /// Number of bytes for the serial port that the device has not accepted yet.
    #[must_use]
    pub fn unwritten(&self) -> usize {
        self.outgoing.len()
    }

    /// Endpoints of the serial port that have stalled or do not answer, by address.
    #[must_use]
    pub fn halted(&self) -> Vec<u8> {
        let mut pipes = self.pipes.clone();
        let all = pipes.iter_mut().flat_map(Pipes::all);
        let halted = all.filter(|pipe| pipe.halted);
        halted.map(|pipe| pipe.endpoint.address).collect()
    }

    /// Counts of the bus.
    #[must_use]
    pub const fn counts(&self) -> UsbCounts {
        self.counts
    }

    // ---- time ----

    pub(super) fn next_event(&self) -> Option<u64> {
        let due = [
            self.port_due_ps,
            self.frame_due_ps,
            self.token_due_ps,
            self.flight.as_ref().map(|flight| flight.end_ps),
        ];
        due.iter().flatten().min().copied()
    }

    /// Processes events that are due.
    pub(super) fn service(&mut self, device: &mut UsbController, now_ps: u64) {
        let is_due = |due_ps: &mut u64| *due_ps <= now_ps;
        if self.port_due_ps.take_if(is_due).is_some() {
            self.advance_port(device, now_ps);
        }
        if let Some(flight) = self.flight.take_if(|flight| flight.end_ps <= now_ps) {
            self.end_transaction(device, flight, now_ps);
        }
        if self.token_due_ps.take_if(is_due).is_some() {
            self.begin_transaction(device, now_ps);
        }
        if self.frame_due_ps.is_some_and(|due_ps| due_ps <= now_ps) {
            self.begin_frame(device, now_ps);
        }
    }

    /// Executes pending orders.
    pub(super) fn act(&mut self, device: &mut UsbController, now_ps: u64) {
        while let Some(action) = self.actions.pop_front() {
            self.perform(action, device, now_ps);
        }
        self.follow(device, now_ps);
        self.look_for_work(now_ps);
    }

    fn perform(&mut self, action: Action, device: &mut UsbController, now_ps: u64) {
        match (action, self.port) {
            (Action::Plug, Port::Unplugged) => self.port = Port::Powered,
            (Action::Unplug, port) if port != Port::Unplugged => {
                self.lose_device();
                self.port = Port::Unplugged;
                device.unplug(now_ps);
            }
            (Action::Reset, Port::Enabled | Port::Suspended | Port::Resuming | Port::Resetting) => {
                self.outgoing.clear();
                self.reset_again(device, now_ps);
            }
            (Action::Suspend, Port::Enabled) => {
                self.stop_frames();
                self.cancel();
                self.port = Port::Suspended;
            }
            (Action::Resume, Port::Suspended) => {
                device.begin_resume();
                self.port = Port::Resuming;
                self.port_due_ps = Some(now_ps + RESUME.as_ps());
            }
            (Action::Enumerate, port) => {
                self.enumerates = true;
                if port == Port::Enabled {
                    self.reset_again(device, now_ps);
                }
            }
            _ => {}
        }
    }

    /// Resets the bus and restarts the enumeration.
    fn reset_again(&mut self, device: &mut UsbController, now_ps: u64) {
        self.cancel();
        self.enumerated = None;
        self.control_packet = LARGEST_PACKET;
        self.begin_reset(device, now_ps);
    }

    // ---- the port ----

    /// Detects a device that appears, disappears or wakes the host.
    pub(super) fn follow(&mut self, device: &mut UsbController, now_ps: u64) {
        match (self.port, device.is_attached()) {
            (Port::Powered, true) => {
                self.port = Port::Attached;
                self.port_due_ps = Some(now_ps + DEBOUNCE.as_ps());
            }
            (Port::Unplugged | Port::Powered, _) => {}
            (_, false) => {
                self.lose_device();
                self.port = Port::Powered;
            }
            (_, true) => {}
        }
    }

    fn lose_device(&mut self) {
        self.cancel();
        let waiting = std::mem::take(&mut self.waiting);
        for (origin, _) in waiting {
            self.report(origin, ControlOutcome::Cancelled);
        }
        self.enumerated = None;
        self.control_packet = LARGEST_PACKET;
        self.outgoing.clear();
        self.forget_device();
        self.port_due_ps = None;
    }

    /// Clears the host's state of the device, as any reset does.
    fn forget_device(&mut self) {
        self.stop_frames();
        self.address = 0;
        self.configuration = 0;
        self.pipes = None;
    }

    fn stop_frames(&mut self) {
        self.frame_due_ps = None;
        self.token_due_ps = None;
        self.flight = None;
    }

    /// Cancels the present control transfer, and an enumeration.
    fn cancel(&mut self) {
        if let Some(enumeration) = self.enumeration.take() {
            let failure = enumeration.failure(ControlOutcome::Cancelled);
            self.enumerated = Some(Err(failure));
        }
        self.waiting
            .retain(|(origin, _)| *origin != Origin::Enumeration);
        if let Some((origin, _)) = self.control.take() {
            self.report(origin, ControlOutcome::Cancelled);
        }
    }

    fn report(&mut self, origin: Origin, outcome: ControlOutcome) {
        if let Origin::Caller(id) = origin {
            self.results.push((id, outcome));
        }
    }

    fn begin_reset(&mut self, device: &mut UsbController, now_ps: u64) {
        self.forget_device();
        device.begin_reset();
        self.port = Port::Resetting;
        self.port_due_ps = Some(now_ps + RESET.as_ps());
    }

    fn advance_port(&mut self, device: &mut UsbController, now_ps: u64) {
        match self.port {
            Port::Attached => self.begin_reset(device, now_ps),
            Port::Resetting => {
                device.end_reset(now_ps);
                self.enable(now_ps, RESET_RECOVERY);
                self.go_on_enumerating(device, now_ps);
            }
            Port::Resuming => {
                device.end_resume(now_ps);
                self.enable(now_ps, RESUME_RECOVERY);
            }
            Port::Unplugged | Port::Powered | Port::Enabled | Port::Suspended => {}
        }
    }

    /// Starts frames; transactions follow after a recovery time.
    fn enable(&mut self, now_ps: u64, recovery: Time) {
        self.port = Port::Enabled;
        self.frame_due_ps = Some(now_ps + start_of_frame_ps());
        self.quiet_ps = now_ps + recovery.as_ps();
    }

    // ---- enumeration ----

    fn go_on_enumerating(&mut self, device: &mut UsbController, now_ps: u64) {
        if !self.enumerates {
            return;
        }
        let begins = self.enumeration.is_none();
        let enumeration = self.enumeration.get_or_insert_with(Enumeration::new);
        if begins {
            self.enumerated = None;
        } else {
            enumeration.was_reset();
        }
        self.ask(device, now_ps);
    }

    fn ask(&mut self, device: &mut UsbController, now_ps: u64) {
        let request = self.enumeration.as_ref().map(Enumeration::request);
        match request {
            Some(Request::Transfer(transfer)) => {
                self.waiting.push_front((Origin::Enumeration, transfer));
            }
            Some(Request::Reset) => self.begin_reset(device, now_ps),
            Some(Request::Done) => {
                self.enumerated = self.enumeration.take().map(|it| Ok(it.found));
            }
            None => {}
        }
    }

    fn answer(&mut self, outcome: ControlOutcome, device: &mut UsbController, now_ps: u64) {
        let Some(enumeration) = &mut self.enumeration else {
            return;
        };
        match enumeration.answer(outcome) {
            Ok(()) => self.ask(device, now_ps),
            Err(failure) => {
                self.enumeration = None;
                self.enumerated = Some(Err(failure));
            }
        }
    }

    // ---- frames and transactions ----

    fn begin_frame(&mut self, device: &mut UsbController, now_ps: u64) {
        debug_assert!(self.flight.is_none(), "a transaction in a start of frame");
        self.frame_due_ps = Some(now_ps + FRAME_PS);
        self.counts.frames += 1;
        device.start_of_frame((self.counts.frames & 0x7FF) as u16, now_ps);
        self.naks = [0; TURNS.len()];
        self.give_up_late(device, now_ps);
        self.look_for_work(now_ps);
    }

    fn give_up_late(&mut self, device: &mut UsbController, now_ps: u64) {
        let is_late = |(_, control): &mut (Origin, ControlProgress)| control.deadline_ps <= now_ps;
        if let Some((origin, _)) = self.control.take_if(is_late) {
            self.end_control(origin, None, ControlOutcome::TimedOut, device, now_ps);
        }
    }

    /// Starts a token if the wire is free. Its transaction is chosen only at the token's end; there
    /// may be none.
    fn look_for_work(&mut self, now_ps: u64) {
        if self.port == Port::Enabled && self.flight.is_none() && self.token_due_ps.is_none() {
            let begin_ps = now_ps.max(self.quiet_ps);
            let is_this_frame = self.frame_due_ps.is_some_and(|due_ps| begin_ps < due_ps);
            self.token_due_ps = is_this_frame.then_some(begin_ps + token_ps());
        }
    }

    fn begin_transaction(&mut self, device: &mut UsbController, now_ps: u64) {
        if self.gives_up_within_frame {
            self.give_up_late(device, now_ps);
        }
        let Some((turn, transaction)) = self.next_transaction(now_ps) else {
            return;
        };
        let frame_end_ps = self
            .frame_due_ps
            .map_or(0, |due_ps| due_ps - start_of_frame_ps() - end_of_frame_ps());
        if now_ps + transaction.longest_ps() > frame_end_ps {
            return;
        }
        self.last_turn = turn as usize;
        let reply = device.begin(&transaction, now_ps);
        let end_ps = now_ps + transaction.time_ps(&reply);
        self.flight = Some(Flight {
            turn,
            transaction,
            reply,
            end_ps,
        });
    }

    /// Next transaction, with the endpoints in turn.
    fn next_transaction(&mut self, now_ps: u64) -> Option<(Turn, Transaction)> {
        self.next_control(now_ps);
        (1..=TURNS.len()).find_map(|step| {
            let index = (self.last_turn + step) % TURNS.len();
            let turn = *TURNS.get(index)?;
            let is_left_alone = *self.naks.get(index)? >= NAKS_PER_FRAME;
            (!is_left_alone)
                .then(|| self.of_turn(turn))?
                .map(|it| (turn, it))
        })
    }

    /// Queues the next control transfer; during an enumeration only its requests.
    fn next_control(&mut self, now_ps: u64) {
        let enumerates = self.enumeration.is_some();
        let may_begin =
            |(origin, _): &(Origin, ControlTransfer)| !enumerates || *origin == Origin::Enumeration;
        if self.control.is_none() && self.waiting.front().is_some_and(may_begin) {
            let next = self.waiting.pop_front();
            self.control =
                next.map(|(origin, transfer)| (origin, ControlProgress::new(transfer, now_ps)));
        }
    }

    fn of_turn(&self, turn: Turn) -> Option<Transaction> {
        let usable = |pipe: &&Pipe| !pipe.halted;
        match turn {
            Turn::Control => {
                let (_, control) = self.control.as_ref()?;
                Some(control.next(self.address, self.control_packet))
            }
            Turn::Notification => {
                let pipe = self.pipes.as_ref()?.notification.as_ref().filter(usable)?;
                let is_due = self.reading && pipe.polled_from <= self.counts.frames;
                is_due.then(|| pipe.next(self.address, None))
            }
            Turn::Output => {
                let pipe = self.pipes.as_ref().map(|it| &it.output).filter(usable)?;
                let data: Vec<u8> = self.outgoing.iter().take(pipe.largest()).copied().collect();
                (!data.is_empty()).then(|| pipe.next(self.address, Some(data)))
            }
            Turn::Input => {
                let pipe = self.pipes.as_ref().map(|it| &it.input).filter(usable)?;
                self.reading.then(|| pipe.next(self.address, None))
            }
        }
    }

    fn end_transaction(&mut self, device: &mut UsbController, flight: Flight, now_ps: u64) {
        let Flight {
            turn,
            transaction,
            reply,
            ..
        } = flight;
        self.count(turn, &reply);
        if matches!(reply, Reply::Ack | Reply::Data { .. }) {
            device.end(&transaction, now_ps);
        }
        match turn {
            Turn::Control => self.advance_control(&reply, device, now_ps),
            Turn::Notification => {
                let frames = self.counts.frames;
                if let Some(pipe) = self.pipes.as_mut().and_then(|it| it.notification.as_mut()) {
                    pipe.polled_from = frames + u64::from(pipe.endpoint.interval);
                    pipe.take(reply);
                }
            }
            Turn::Output => self.advance_output(reply),
            Turn::Input => self.advance_input(reply),
        }
        self.look_for_work(now_ps);
    }

    fn count(&mut self, turn: Turn, reply: &Reply) {
        if let Some(naks) = self.naks.get_mut(turn as usize) {
            *naks = match reply {
                Reply::Nak | Reply::Silence => *naks + 1,
                _ => 0,
            };
        }
    }

    fn advance_output(&mut self, reply: Reply) {
        let Some(pipe) = self.pipes.as_mut().map(|it| &mut it.output) else {
            return;
        };
        if pipe.take(reply) == Progress::Sent {
            let sent = pipe.largest().min(self.outgoing.len());
            self.outgoing.drain(..sent);
        }
    }

    fn advance_input(&mut self, reply: Reply) {
        let Some(pipe) = self.pipes.as_mut().map(|it| &mut it.input) else {
            return;
        };
        match pipe.take(reply) {
            Progress::Received(data) => self.incoming.extend(data),
            Progress::Repeated => self.counts.repeated += 1,
            Progress::Refused | Progress::Sent => {}
        }
    }

    fn advance_control(&mut self, reply: &Reply, device: &mut UsbController, now_ps: u64) {
        let largest = self.control_packet;
        let Some((origin, control)) = &mut self.control else {
            return;
        };
        if let Some(outcome) = control.take(reply, largest) {
            let (origin, setup) = (*origin, control.transfer.setup);
            self.control = None;
            self.end_control(origin, Some(setup), outcome, device, now_ps);
        }
    }

    fn end_control(
        &mut self,
        origin: Origin,
        setup: Option<[u8; 8]>,
        outcome: ControlOutcome,
        device: &mut UsbController,
        now_ps: u64,
    ) {
        if let (Some(setup), ControlOutcome::Done(data)) = (setup, &outcome) {
            self.follow_request(setup, data, now_ps);
        }
        match origin {
            Origin::Caller(_) => self.report(origin, outcome),
            Origin::Enumeration => self.answer(outcome, device, now_ps),
        }
    }

    /// Applies the host's side of a standard request (USB 2.0 9.4).
    fn follow_request(&mut self, setup: [u8; 8], data: &[u8], now_ps: u64) {
        let [kind, request, value, value_high, index, ..] = setup;
        match (kind, request) {
            (0x80, 6) if value_high == 1 => {
                let size = data.get(7).map(|&size| usize::from(size));
                let known = size.filter(|size| CONTROL_PACKETS.contains(size));
                self.control_packet = known.unwrap_or(self.control_packet);
            }
            (0, 5) => {
                self.address = value & 0x7F;
                self.quiet_ps = now_ps + ADDRESS_RECOVERY.as_ps();
            }
            (0, 9) => self.configure(value),
            (1, 11) => self.restart(|_| true),
            (2, 1) if value == 0 => self.restart(|address| address == index),
            _ => {}
        }
    }

    fn configure(&mut self, value: u8) {
        self.configuration = value;
        let found = match &self.enumeration {
            Some(enumeration) => Some(&enumeration.found),
            None => self.description(),
        };
        let cdc = found.and_then(UsbDescription::cdc).filter(|_| value != 0);
        self.pipes = cdc.map(|cdc| Pipes {
            notification: cdc.notification.map(Pipe::new),
            output: Pipe::new(cdc.output),
            input: Pipe::new(cdc.input),
        });
    }

    fn restart(&mut self, is_meant: impl Fn(u8) -> bool) {
        let all = self.pipes.iter_mut().flat_map(Pipes::all);
        for pipe in all.filter(|pipe| is_meant(pipe.endpoint.address)) {
            pipe.restart();
        }
    }
}
