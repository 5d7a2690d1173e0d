//! Connection to a board's firmware: commands there, records back.
//!
//! All verbs use one [`Link`]; a [`Transport`] covers the differences between serial port, debug
//! probe, TCP and emulated board.

mod address;
mod clock;
mod emulated;
mod playback;
#[cfg_attr(not(feature = "probe"), path = "without_probe.rs")]
mod probe;
pub(crate) mod serial;
mod tcp;
#[cfg(test)]
mod tests;
mod transport;
mod watched;

use std::io;
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use palpate_cli::notice;
use palpate_wire::code::Outcome;
use palpate_wire::loss::Account;
use palpate_wire::record::Hello;
use palpate_wire::{
    Command, Frame, FrameError, Invalid, Message, Problem, Record, RecordDecoder, Sequencer,
    VERSION, encode,
};

use crate::board::emulated::PluggedBoard;
use crate::board::log::{Log, LogLine, LogStream};
use crate::interrupt::{self, Interrupt};
pub(crate) use address::{Arguments, Run, no_board};
pub(crate) use address::{open_port, ports};
use clock::DeviceClock;
use transport::{PATIENCE, Transport};
pub(crate) use watched::Watched;

/// Interval at which a starting board is asked for its identity.
const AGAIN: Duration = Duration::from_millis(500);
/// Longest time of one receive call.
const POLL: Duration = Duration::from_millis(10);
/// Interval of commands to the board while it drives a current, s; the board's limit is 100 ms.
pub(crate) const KEEP_ALIVE_S: f64 = 0.04;
/// Message of a port's server to a second program, before it closes the connection. It ends like a
/// frame, so that a decoder finds the next one.
pub(crate) const BUSY: &[u8] = b"palpate: another program is connected; close it first\n\0";
/// Number of bytes received before the board's identity that are kept for error messages: more than
/// a line.
const FIRST_BYTES: usize = 160;
/// Longest time for a board to restart, including its USB port.
const RESTART: Duration = Duration::from_secs(10);

/// A frame with its arrival time by the link's clock.
#[derive(Clone, Debug)]
pub(crate) struct Arrival {
    pub(crate) at: Duration,
    pub(crate) frame: Frame<Record>,
}

/// A record with its device time, s.
pub(crate) type Reported = (f64, Record);

/// Connection to a board.
pub(crate) struct Link {
    name: String,
    transport: Box<dyn Transport>,
    decoder: RecordDecoder,
    sequencer: Sequencer,
    account: Account,
    clock: DeviceClock,
    hello: Option<Hello>,
    received: Vec<Arrival>,
    /// First bytes received since the request for the identity.
    first: Vec<u8>,
    /// Another version of the protocol, if received.
    other_version: Option<u8>,
    /// Whether this link has armed the board.
    has_armed: bool,
    /// Decoder of the board's log, if it is shown.
    log: Option<LogStream>,
    /// Log lines for a recording, with arrival times by the link's clock; `None` without a
    /// recording.
    logged: Option<Vec<(Duration, LogLine)>>,
}

impl Link {
    /// Connects and asks the board for its identity.
    fn open(
        name: String,
        transport: Box<dyn Transport>,
        log: Option<Log>,
    ) -> Result<Self, Failure> {
        let mut link = Self::new(name, transport, log);
        link.greet()?;
        Ok(link)
    }

    /// Connects to an emulated board of this model, for tests.
    #[cfg(test)]
    pub(crate) fn of_model(model: &crate::board::emulated::Model) -> Result<Self, Failure> {
        let board = emulated::Emulated::new(model.plug(None)?, false);
        Self::open("the emulated board".to_owned(), Box::new(board), None)
    }

    fn new(name: String, transport: Box<dyn Transport>, log: Option<Log>) -> Self {
        Self {
            name,
            transport,
            decoder: RecordDecoder::new(),
            sequencer: Sequencer::new(0),
            account: Account::new(),
            clock: DeviceClock::default(),
            hello: None,
            received: Vec::new(),
            first: Vec::new(),
            other_version: None,
            has_armed: false,
            log: log.map(LogStream::new),
            logged: None,
        }
    }

    /// Creates a link to a recording of the board `hello`.
    fn play(name: String, transport: Box<dyn Transport>, hello: Hello) -> Self {
        let mut link = Self::new(name, transport, None);
        link.hello = Some(hello);
        link
    }

    /// Asks for the identity until the board answers: a starting board drops the first requests.
    ///
    /// # Errors
    /// If the board does not answer, or is not a palpate board.
    pub(crate) fn greet(&mut self) -> Result<(), Failure> {
        self.greet_until(&Interrupt::uncaught())
    }

    /// Asks for the identity until the board answers, or until Ctrl-C.
    fn greet_until(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        self.sequencer = Sequencer::new(0);
        self.hello = None;
        self.first.clear();
        let asked = self.ask_who_it_is(interrupt);
        if asked.is_err() {
            // Receives a last message, in which a server may say that it is busy.
            let _ = self.listen(POLL);
        }
        if self.hello.is_some() {
            return Ok(());
        }
        match (asked, self.not_a_board()) {
            (Err(failure), finding) if finding.finding == "silent" => Err(failure),
            (_, finding) => Err(Failure::Unconnected(finding)),
        }
    }

    fn ask_who_it_is(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        let end = self.now() + self.transport.patience();
        while self.now() < end {
            self.send(&Command::Identify)?;
            let again = self.now() + AGAIN;
            while self.now() < again {
                interrupt.go_on()?;
                self.listen(POLL)?;
                if self.hello.is_some() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Finding for a device that does not send its identity.
    fn not_a_board(&self) -> Finding {
        let name = &self.name;
        let text = String::from_utf8_lossy(&self.first);
        let text = text.trim_matches(['\0', '\n', '\r', ' ']);
        if let Some(found) = self.other_version {
            Finding::new(
                "other_version",
                format!(
                    "{name}: the firmware has version {found} of the protocol, and this tool version {VERSION}"
                ),
                "Flash the image that belongs to this tool, or use the tool that belongs to the firmware",
            )
        } else if self.first.starts_with(BUSY) {
            Finding::new(
                "busy",
                format!("{name}: another program is connected"),
                "Close that first",
            )
        } else if text.is_empty() {
            Finding::new(
                "silent",
                format!("{name}: nothing answers"),
                "Check whether its LED blinks. If not, flash the firmware of palpate; if it does, plug \
                 it in again",
            )
        } else {
            Finding::new(
                "other_firmware",
                format!(
                    "{name}: the device is not running the firmware of palpate; it sends {text:?}"
                ),
                "Name another board with --board, or flash the firmware of palpate",
            )
        }
    }

    /// Location of the board.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Last received identity of the board.
    pub(crate) const fn hello(&self) -> Option<&Hello> {
        self.hello.as_ref()
    }

    /// Time that passes during waits. For the emulated board it is the board's own time.
    pub(crate) fn now(&self) -> Duration {
        self.transport.now()
    }

    /// The device's clock relative to the link's.
    pub(crate) const fn clock(&self) -> &DeviceClock {
        &self.clock
    }

    /// Lost frames by boot.
    pub(crate) const fn account(&self) -> &Account {
        &self.account
    }

    /// Number of frames that were damaged or not understood.
    pub(crate) fn unreadable(&self) -> u32 {
        let counts = self.decoder.counts();
        counts.damaged().wrapping_add(counts.not_understood())
    }

    /// Whether this is a recording. It accepts no commands, and its end is reported as
    /// [lost](Failure::Lost).
    pub(crate) fn is_recording(&self) -> bool {
        self.transport.is_recording()
    }

    /// The emulated board of this program, if connected.
    pub(crate) fn emulated(&mut self) -> Option<&mut PluggedBoard> {
        self.transport.emulated()
    }

    /// Sends a command. Returns its number.
    pub(crate) fn send(&mut self, command: &Command) -> Result<u32, Failure> {
        self.has_armed |= *command == Command::Arm;
        let header = self.sequencer.stamp(0);
        let mut buffer = [0; Command::MAX_FRAME];
        let bytes = encode(&header, command, &mut buffer)
            .map_err(|error| Failure::Refused(format!("{}: {error}", command.name())))?;
        let sent = self.transport.write(bytes);
        sent.map_err(|error| self.lost(&error))?;
        Ok(header.sequence)
    }

    /// Sends a command and waits for the answer. Returns device time of the answer, s, and outcome.
    pub(crate) fn ask(&mut self, command: &Command) -> Result<(f64, Outcome), Failure> {
        let left = self.now();
        let number = self.send(command)?;
        let mut seen = self.received.len();
        while self.now() < left + PATIENCE {
            self.listen(POLL)?;
            for arrival in self.received.get(seen..).unwrap_or_default() {
                let header = &arrival.frame.header;
                if let Record::Acknowledgement(answer) = &arrival.frame.message
                    && (answer.kind, answer.command) == (command.kind(), number)
                {
                    let stamp_us = header.time_us;
                    self.clock.enter(header.boot_id, left, stamp_us, arrival.at);
                    return Ok((stamp_us as f64 * 1e-6, answer.outcome));
                }
            }
            seen = self.received.len();
        }
        Err(Failure::Refused(format!(
            "{} does not answer {}: check its LED, and plug it in again",
            self.name,
            command.name()
        )))
    }

    /// Sends a command that must be accepted. Returns the device time of the answer, s.
    pub(crate) fn send_accepted(&mut self, command: &Command) -> Result<f64, Failure> {
        let (at_s, outcome) = self.ask(command)?;
        if outcome == Outcome::Accepted {
            return Ok(at_s);
        }
        Err(self.refusal(command, outcome))
    }

    /// Failure for an answer other than acceptance.
    pub(crate) fn refusal(&self, command: &Command, outcome: Outcome) -> Failure {
        Failure::Refused(match outcome {
            Outcome::NotCalibrated => {
                "the board is not calibrated: `palpate calibrate sensor`, or import an export with \
                 `palpate settings import`"
                    .to_owned()
            }
            Outcome::Faulted => format!(
                "the board has a fault{}; docs/faults.md says what to do and how it is cleared",
                self.fault()
                    .map_or_else(String::new, |of| format!(" ({of})"))
            ),
            other => format!(
                "the board answers {} to {}: {}",
                other,
                command.name(),
                self.beyond(command)
                    .unwrap_or_else(|| other.meaning().trim().to_owned())
            ),
        })
    }

    /// Describes the refused value, with its limits, in the last answer to such a command.
    fn beyond(&self, command: &Command) -> Option<String> {
        let mut latest = self.received.iter().rev();
        let answer = latest.find_map(|arrival| match &arrival.frame.message {
            Record::Acknowledgement(answer) if answer.kind == command.kind() => Some(answer),
            _ => None,
        })?;
        let problem = Problem::OutOfRange {
            value: answer.value?,
            low: answer.low?,
            high: answer.high?,
        };
        let invalid = Invalid {
            field: answer.field?,
            item: answer.item,
            problem,
        };
        Some(format!("{}.", invalid.named(command.payload())))
    }

    fn fault(&self) -> Option<String> {
        let latest = self.received.iter().rev();
        let mut faults = latest.filter_map(|arrival| match &arrival.frame.message {
            Record::Fault(fault) if fault.active => Some(fault.code.to_string()),
            _ => None,
        });
        faults.next()
    }

    /// Receives for at most `wait`; returns after the first bytes.
    pub(crate) fn listen(&mut self, wait: Duration) -> Result<(), Failure> {
        interrupt::go_on()?;
        let bytes = self.transport.read(wait);
        let bytes = bytes.map_err(|error| self.lost(&error))?;
        let at = self.now();
        self.show_log(at);
        let room = FIRST_BYTES.saturating_sub(self.first.len());
        self.first.extend(bytes.iter().take(room));
        for frame in self.decoder.frames(&bytes) {
            let frame = match frame {
                Ok(frame) => frame,
                Err(FrameError::Version { found }) => {
                    self.other_version = Some(found);
                    continue;
                }
                // A frame of an unknown kind has a header and counts as received. A damaged frame,
                // or one that started before the connection, does not count.
                Err(error) => {
                    error.header().map(|header| self.account.take(header));
                    continue;
                }
            };
            self.sequencer.address(frame.header.boot_id);
            self.account.take(&frame.header);
            if let Record::Hello(hello) = &frame.message {
                self.hello = Some(hello.clone());
            }
            self.received.push(Arrival { at, frame });
        }
        Ok(())
    }

    /// Prints the received log, if requested.
    fn show_log(&mut self, at: Duration) {
        // Reads the log even if it is not shown, since the unread bytes would accumulate.
        let bytes = self.transport.take_log();
        let Some(log) = &mut self.log else {
            return;
        };
        for line in log.lines(&bytes) {
            notice::say(&line);
            if let Some(logged) = &mut self.logged {
                logged.push((at, line));
            }
        }
    }

    /// Returns the log lines since the last call, with arrival times by the link's clock. The first
    /// call returns none and starts the collection.
    pub(crate) fn take_logged(&mut self) -> Vec<(Duration, LogLine)> {
        self.logged.replace(Vec::new()).unwrap_or_default()
    }

    fn lost(&mut self, error: &io::Error) -> Failure {
        if error.kind() == io::ErrorKind::Unsupported {
            return Failure::Argument(format!("{error}: name a board with --board"));
        }
        if self.is_recording() {
            return Failure::Lost(format!("{}: the recording has ended", self.name));
        }
        if self.emulated().is_some() {
            return Failure::Lost(format!("{}: {error}", self.name));
        }
        Failure::Lost(format!(
            "{}: the board was disconnected ({error}): check its cable and plug it in again",
            self.name
        ))
    }

    /// Receives for a time, which is emulated time for the emulated board. Fails if a fault occurs.
    pub(crate) fn pass(&mut self, time_s: f64) -> Result<(), Failure> {
        let before = self.received.len();
        self.collect(time_s)?;
        self.no_fault(before)
    }

    /// Receives for a time and ignores faults.
    pub(crate) fn collect(&mut self, time_s: f64) -> Result<(), Failure> {
        let end = self.now() + Duration::from_secs_f64(time_s);
        while self.now() < end {
            self.listen(end.saturating_sub(self.now()).min(POLL))?;
        }
        Ok(())
    }

    /// Receives for a time while the board drives a current, with a command every [`KEEP_ALIVE_S`].
    pub(crate) fn drive_on(&mut self, time_s: f64) -> Result<(), Failure> {
        let mut left_s = time_s;
        while left_s > 0.0 {
            self.pass(left_s.min(KEEP_ALIVE_S))?;
            self.send_accepted(&Command::GetSettings)?;
            left_s -= KEEP_ALIVE_S;
        }
        Ok(())
    }

    fn no_fault(&self, since: usize) -> Result<(), Failure> {
        let mut new = self.received.get(since..).into_iter().flatten();
        let fault = new.find_map(|arrival| match &arrival.frame.message {
            Record::Fault(fault) if fault.active => Some((fault.code, fault.value)),
            _ => None,
        });
        fault.map_or(Ok(()), |(code, value)| {
            let value = value.map_or_else(String::new, |value| format!(", {value}"));
            Err(Failure::Refused(format!(
                "the board: {code}{value}. {} docs/faults.md says what to do.",
                code.meaning().trim()
            )))
        })
    }

    /// Waits until `of` accepts a record. Also tests the records already received.
    pub(crate) fn wait_for<T>(
        &mut self,
        patience_s: f64,
        what: &str,
        of: impl Fn(&Record) -> Option<T>,
    ) -> Result<T, Failure> {
        let mut seen = 0;
        let end = self.now() + Duration::from_secs_f64(patience_s);
        loop {
            let new = self.received.get(seen..).into_iter().flatten();
            if let Some(found) = new.rev().find_map(|arrival| of(&arrival.frame.message)) {
                return Ok(found);
            }
            if self.now() >= end {
                return Err(Failure::Refused(format!("the board sent no {what}")));
            }
            seen = self.received.len();
            self.pass(POLL.as_secs_f64())?;
        }
    }

    /// Received frames that [`take`](Self::take) has not taken.
    pub(crate) fn received(&self) -> &[Arrival] {
        &self.received
    }

    /// Takes the received frames.
    pub(crate) fn take(&mut self) -> Vec<Arrival> {
        std::mem::take(&mut self.received)
    }

    /// Takes the received records, each with its device time.
    pub(crate) fn take_records(&mut self) -> Vec<Reported> {
        let arrivals = self.take().into_iter();
        let timed = arrivals.map(|of| (of.frame.header.time_us as f64 * 1e-6, of.frame.message));
        timed.collect()
    }

    /// Waits for a board that is gone or restarts, then asks for its identity. Ctrl-C ends the
    /// wait.
    ///
    /// # Errors
    /// If the board does not return in time, does not answer, or is not a palpate board, or after
    /// an interrupt.
    pub(crate) fn reconnect(&mut self, interrupt: &Interrupt) -> Result<(), Failure> {
        let end = self.now() + RESTART;
        loop {
            interrupt.go_on()?;
            let opened = self.transport.reopen();
            if self.is_recording() {
                return opened.map_err(|error| self.lost(&error));
            }
            self.decoder = RecordDecoder::new();
            match opened {
                Ok(()) => {
                    // The board's clock restarts with the power, even if its boot id repeats.
                    self.clock = DeviceClock::default();
                    return self.greet_until(interrupt);
                }
                Err(error) if self.now() > end => return Err(self.lost(&error)),
                Err(_) => std::thread::sleep(POLL),
            }
        }
    }
}

impl Drop for Link {
    /// Disarms the board if this link armed it, so that no current continues. (The board alone
    /// would stop the current after 100 ms.)
    fn drop(&mut self) {
        if self.has_armed {
            let _ = self.send(&Command::Disarm);
        }
    }
}
