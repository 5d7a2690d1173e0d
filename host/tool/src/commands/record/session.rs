//! Recording from a board to a file.

use std::collections::HashMap;
use std::path::PathBuf;
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_wire::code::State;
use palpate_wire::loss::Tally;
use palpate_wire::{Command, MINOR_VERSION, Record, SCHEMA_HASH, VERSION};

use super::inspection;
use crate::board::link::{Arrival, Link};
use crate::interrupt::Interrupt;
use crate::recording::date::{self, NS_PER_S};
use crate::recording::{ABOUT, Contents, END, Logged, Note, Recorded, Recorder};

/// Longest time of one receive call.
const POLL: Duration = Duration::from_millis(10);
/// Interval of comparisons between the clocks of board and computer. The clocks drift apart by 1 ms
/// at most in this interval (`DeviceClock`), as much as the uncertainty of an exchange over USB.
const COMPARE: Duration = Duration::from_secs(10);

/// A running recording.
pub(super) struct RecordingSession {
    link: Link,
    recorder: Recorder,
    contents: Contents,
    /// Zero of the link's clock, ns since 1970.
    zero_ns: u64,
    /// Link time less device time by boot, with its uncertainty, s.
    offsets: HashMap<u32, (f64, f64)>,
    /// Boot that was last asked for its identity.
    boot_id: Option<u32>,
    compared: Duration,
    /// Whether every contact is measured.
    measures: bool,
}

impl RecordingSession {
    /// Starts with a board that has answered.
    pub(super) fn new(mut link: Link, mut recorder: Recorder, measures: bool) -> Self {
        let now_ns = date::now_ns();
        let passed_ns = u64::try_from(link.now().as_nanos()).unwrap_or_default();
        recorder.note(about(link.name(), now_ns));
        // Log lines are kept from here on.
        link.take_logged();
        Self {
            zero_ns: now_ns.saturating_sub(passed_ns),
            compared: link.now(),
            link,
            recorder,
            contents: Contents::default(),
            offsets: HashMap::new(),
            boot_id: None,
            measures,
        }
    }

    /// Records until a time has passed or an interrupt.
    pub(super) fn run(
        &mut self,
        duration: Option<Duration>,
        interrupt: &Interrupt,
    ) -> Result<(), Failure> {
        let end = duration.map(|duration| self.link.now() + duration);
        let mut is_there = true;
        while !interrupt.is_asked() && end.is_none_or(|end| self.link.now() < end) {
            let turned = if is_there {
                self.turn()
            } else {
                self.link.reconnect(interrupt).map(|()| true)
            };
            match turned {
                Ok(goes_on) if !goes_on => return Ok(()),
                Ok(_) => is_there = true,
                Err(failure) => {
                    is_there = self.survives(&failure, is_there)?;
                }
            }
        }
        Ok(())
    }

    /// Returns whether the board is still connected after a failure.
    fn survives(&mut self, failure: &Failure, is_there: bool) -> Result<bool, Failure> {
        let is_lost = matches!(failure, Failure::Lost(_));
        if is_lost && self.link.emulated().is_some() {
            return Err(Failure::Lost(failure.to_string()));
        }
        if is_there {
            notice::say(failure);
        }
        Ok(is_there && !is_lost)
    }

    /// Processes the received frames. Returns `false` once the file can no longer be written.
    fn turn(&mut self) -> Result<bool, Failure> {
        let listened = self.link.listen(POLL);
        let boot_id = self.link.account().current().map(Tally::boot_id);
        let asked = match boot_id {
            _ if listened.is_err() => listened,
            Some(boot_id) if self.boot_id != Some(boot_id) => return self.inspect(boot_id),
            _ => self.compare(),
        };
        let arrivals = self.link.take();
        self.store(&arrivals, asked)
    }

    /// Asks a restarted board for its identity and configuration in force.
    fn inspect(&mut self, boot_id: u32) -> Result<bool, Failure> {
        self.boot_id = Some(boot_id);
        let (arrivals, asked) = inspection::inspect(&mut self.link);
        self.compared = self.link.now();
        self.learn_offset();
        let note = inspection::note(boot_id, arrivals.iter().map(|of| &of.frame));
        self.recorder.note(self.with_offset(note, boot_id));
        self.store(&arrivals, asked)
    }

    /// Compares the clocks when due. The answer also shows changed settings.
    fn compare(&mut self) -> Result<(), Failure> {
        if self.link.now() < self.compared + COMPARE {
            return Ok(());
        }
        self.compared = self.link.now();
        self.link.ask(&Command::GetSettings)?;
        self.learn_offset();
        Ok(())
    }

    fn learn_offset(&mut self) {
        let clock = self.link.clock();
        if let Some(offset) = clock.offset_s() {
            self.offsets.insert(clock.boot_id(), offset);
        }
    }

    /// Adds the offset of the clocks to a note.
    fn with_offset(&self, note: Note, boot_id: u32) -> Note {
        let Some(&(offset_s, within_s)) = self.offsets.get(&boot_id) else {
            return note;
        };
        note.with("device_zero_ns", self.host_ns(offset_s))
            .with("device_zero_within_s", within_s)
    }

    /// Writes the frames, then reports the earlier failure.
    fn store(&mut self, arrivals: &[Arrival], asked: Result<(), Failure>) -> Result<bool, Failure> {
        let had_lost = self.recorder.lost();
        for (at, line) in self.link.take_logged() {
            let host_ns = self.host_ns(at.as_secs_f64());
            self.recorder.log(Logged { host_ns, line });
        }
        for arrival in arrivals {
            if self.measures && is_contact(&arrival.frame.message) {
                // The answer is recorded too.
                self.link.send(&Command::Measure)?;
            }
            let recorded = self.recorded(arrival);
            self.contents.enter_frame(&recorded);
            if !self.recorder.add(recorded) {
                return Ok(false);
            }
        }
        if had_lost == 0 && self.recorder.lost() > 0 {
            notice::say(
                "The disk is too slow: records are lost. Their number is reported at the end.",
            );
        }
        asked.map(|()| true)
    }

    fn recorded(&self, arrival: &Arrival) -> Recorded {
        let header = &arrival.frame.header;
        let host_ns = self.host_ns(arrival.at.as_secs_f64());
        // Before the first comparison of the clocks the arrival time is the best estimate.
        let device_ns = self.offsets.get(&header.boot_id);
        let device_ns = device_ns.map_or(host_ns, |(offset_s, _)| {
            self.host_ns(header.time_us as f64 * 1e-6 + offset_s)
        });
        Recorded {
            host_ns,
            device_ns,
            frame: arrival.frame.clone(),
        }
    }

    /// Converts a time of the link's clock, s, to ns since 1970.
    fn host_ns(&self, at_s: f64) -> u64 {
        self.zero_ns
            .saturating_add_signed((at_s * NS_PER_S as f64).round() as i64)
    }

    /// Number of frames that were damaged or not understood.
    pub(super) fn unreadable(&self) -> u32 {
        self.link.unreadable()
    }

    /// Number of records that the disk did not accept in time.
    pub(super) const fn not_written(&self) -> u64 {
        self.recorder.lost()
    }

    /// Completes the file.
    pub(super) fn finish(mut self) -> (Contents, Result<PathBuf, Failure>) {
        let note = self.end_note();
        self.recorder.note(note);
        (self.contents, self.recorder.finish())
    }

    fn end_note(&self) -> Note {
        let boots = serde_json::to_string(&self.contents.boots()).unwrap_or_default();
        let note = Note::new(END)
            .with("ended_at", date::text(date::now_ns()))
            .with("boots", boots)
            .with("unreadable", self.unreadable())
            .with("not_written", self.not_written());
        self.boot_id
            .map_or(note.clone(), |boot_id| self.with_offset(note, boot_id))
    }
}

/// Whether a contact begins.
fn is_contact(record: &Record) -> bool {
    matches!(record, Record::State(change)
        if change.state == State::Contact && change.previous != State::Contact)
}

/// Note at the start of the recording.
pub(crate) fn about(board: &str, now_ns: u64) -> Note {
    Note::new(ABOUT)
        .with("tool", concat!("palpate ", env!("CARGO_PKG_VERSION")))
        .with("protocol", format_args!("{VERSION}.{MINOR_VERSION}"))
        .with("schema_hash", format_args!("0x{SCHEMA_HASH:08x}"))
        .with("board", board)
        .with("began_at", date::text(now_ns))
}
