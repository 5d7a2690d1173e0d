//! A recording in place of a board: plays its records with the recorded intervals.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind};
use std::iter::Peekable;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_wire::record::Hello;
use palpate_wire::{Message, Record, encode};

use super::transport::Transport;
use crate::recording::{Entry, Note, Reader, Recorded};

/// Longest gap between two records that is played. Longer gaps are skipped, as when the board was
/// unplugged: a recorded board sends several records a second.
const LONGEST_GAP: Duration = Duration::from_secs(600);

/// A recording during playback.
pub(super) struct Playback {
    file: PathBuf,
    frames: Peekable<Frames>,
    /// Recorded time at the start of the playback, ns since 1970.
    zero_ns: i128,
    /// Playback position.
    now: Duration,
    /// Ratio of recorded to real time; `None` for as fast as possible.
    speed: Option<f64>,
    began: Instant,
}

/// The records of a file.
struct Frames(Reader<BufReader<File>>);

impl Iterator for Frames {
    type Item = Recorded;

    fn next(&mut self) -> Option<Recorded> {
        self.0.find_map(|entry| match entry {
            Entry::Frame(recorded) => Some(recorded),
            Entry::Note(_) | Entry::Log(_) => None,
        })
    }
}

impl Playback {
    /// Opens a recording. Returns it with the board's identity.
    pub(super) fn open(file: &Path, speed: Option<f64>) -> Result<(Self, Hello), Failure> {
        let mut records = Frames(Reader::open(file)?);
        let first = records.next();
        if first.is_none() {
            records.0.refuse_empty(file)?;
        }
        let hello = Reader::boot_notes(file)?.iter().find_map(hello);
        let (Some(first), Some(hello)) = (first, hello) else {
            return Err(Failure::Argument(format!(
                "{}: the identity of its board is missing: name a recording of `palpate record`",
                file.display()
            )));
        };
        let frames = Frames(Reader::open(file)?).peekable();
        let playback = Self {
            file: file.to_path_buf(),
            zero_ns: first.host_ns.into(),
            frames,
            now: Duration::ZERO,
            speed,
            began: Instant::now(),
        };
        Ok((playback, hello))
    }

    /// Time of the next record. Skips a gap above [`LONGEST_GAP`]: a time stamp may be damaged, or
    /// the clock may have been set.
    fn next_at(&mut self) -> Option<Duration> {
        let next_ns = i128::from(self.frames.peek()?.host_ns);
        let now_ns = self.zero_ns + self.now.as_nanos() as i128;
        let gap_ns = next_ns - now_ns;
        if gap_ns.abs() > LONGEST_GAP.as_nanos() as i128 {
            self.zero_ns += gap_ns;
            notice::say(format_args!(
                "{}: the next record has a time stamp {}: the time between is left out.",
                self.file.display(),
                apart(gap_ns)
            ));
        }
        let at_ns = u64::try_from(next_ns - self.zero_ns).unwrap_or_default();
        Some(Duration::from_nanos(at_ns))
    }

    fn play_to(&mut self, at: Duration) {
        self.now = self.now.max(at);
        if let Some(speed) = self.speed {
            let due = self.now.div_f64(speed);
            sleep(due.saturating_sub(self.began.elapsed()));
        }
    }
}

/// Describes a gap.
fn apart(gap_ns: i128) -> String {
    let hours = gap_ns.abs() as f64 / 3.6e12;
    let years = hours / (24.0 * 365.25);
    let long = if years >= 1.0 {
        format!("{years:.0} years")
    } else {
        format!("{hours:.1} hours")
    };
    format!("{long} {}", if gap_ns > 0 { "later" } else { "earlier" })
}

/// Returns the board's identity from a boot note.
fn hello(note: &Note) -> Option<Hello> {
    match serde_json::from_str(note.fields.get("hello")?).ok()? {
        Record::Hello(hello) => Some(hello),
        _ => None,
    }
}

impl Transport for Playback {
    fn now(&self) -> Duration {
        self.now
    }

    fn write(&mut self, _: &[u8]) -> io::Result<()> {
        Err(io::Error::new(
            ErrorKind::Unsupported,
            format!(
                "{} is a recording: it takes no commands",
                self.file.display()
            ),
        ))
    }

    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>> {
        let Some(at) = self.next_at() else {
            return Err(ErrorKind::UnexpectedEof.into());
        };
        let end = self.now + wait;
        self.play_to(at.min(end));
        let mut bytes = Vec::new();
        while self.next_at().is_some_and(|at| at <= self.now)
            && let Some(recorded) = self.frames.next()
        {
            let mut buffer = [0; Record::MAX_FRAME];
            let frame = &recorded.frame;
            let encoded = encode(&frame.header, &frame.message, &mut buffer);
            bytes.extend_from_slice(encoded.map_err(|error| io::Error::other(error.to_string()))?);
        }
        Ok(bytes)
    }

    fn reopen(&mut self) -> io::Result<()> {
        Err(ErrorKind::UnexpectedEof.into())
    }

    fn is_recording(&self) -> bool {
        true
    }
}
