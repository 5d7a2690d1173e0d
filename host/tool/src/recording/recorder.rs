//! Writes a recording in a thread, so that a slow disk does not stop the board.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use palpate_cli::failure::Failure;

use super::writer::Writer;
use super::{Entry, Logged, Note, Recorded};

/// Interval of flushes: a killed program loses at most this much, half of the second that
/// docs/desk.md states.
const CHUNK: Duration = Duration::from_millis(500);
/// Maximum number of entries that wait for the disk: 16 s at the board's 1 kHz, more than the
/// spin-up of a hard disk, and less than 5 MB.
pub(super) const QUEUE: usize = 1 << 14;

/// A recording during writing. The file has `.partial` appended to its name until it is complete.
pub(crate) struct Recorder {
    path: PathBuf,
    partial: PathBuf,
    queue: SyncSender<Entry>,
    thread: JoinHandle<io::Result<()>>,
    lost: u64,
}

impl Recorder {
    /// Starts a recording in a new file.
    pub(crate) fn create(path: &Path) -> Result<Self, Failure> {
        let partial = partial(path);
        let unwritable = |reason| Failure::Unwritable {
            file: path.to_path_buf(),
            argument: "record",
            reason,
        };
        for existing in [path, &partial] {
            if fs::symlink_metadata(existing).is_ok() {
                return Err(Failure::Argument(format!(
                    "{} exists already: name another file, or move it away",
                    existing.display()
                )));
            }
        }
        let file = File::create_new(&partial).map_err(unwritable)?;
        Self::on(file, path).map_err(unwritable)
    }

    /// Starts a recording in an open file.
    pub(super) fn on(file: File, path: &Path) -> io::Result<Self> {
        let writer = Writer::new(BufWriter::new(file))?;
        let (queue, entries) = sync_channel(QUEUE);
        let thread = thread::spawn(move || {
            let mut file = write(writer, &entries)?;
            file.flush()?;
            file.get_ref().sync_all()
        });
        Ok(Self {
            path: path.to_path_buf(),
            partial: partial(path),
            queue,
            thread,
            lost: 0,
        })
    }

    /// Path of the file during writing.
    pub(crate) fn partial(&self) -> &Path {
        &self.partial
    }

    /// Adds a frame without waiting for the disk. Returns `false` if writing has failed;
    /// [`finish`](Self::finish) returns the error.
    pub(crate) fn add(&mut self, frame: Recorded) -> bool {
        match self.queue.try_send(Entry::Frame(frame)) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.lost += 1;
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// Adds a frame, and waits for the disk: for frames that do not come from a board.
    pub(crate) fn add_patiently(&mut self, frame: Recorded) -> bool {
        self.queue.send(Entry::Frame(frame)).is_ok()
    }

    /// Adds a note. Notes are few; this waits, so that none is lost.
    pub(crate) fn note(&mut self, note: Note) -> bool {
        self.queue.send(Entry::Note(note)).is_ok()
    }

    /// Adds a line of the log without waiting for the disk. Drops it if the queue is full.
    pub(crate) fn log(&mut self, line: Logged) {
        let _ = self.queue.try_send(Entry::Log(line));
    }

    /// Number of frames dropped because the disk was too slow.
    pub(crate) const fn lost(&self) -> u64 {
        self.lost
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If it cannot be written: the message says where the rest is.
    pub(crate) fn finish(self) -> Result<PathBuf, Failure> {
        drop(self.queue);
        let written = match self.thread.join() {
            Ok(written) => written,
            Err(_) => Err(io::Error::other("the writing thread ended")),
        };
        let finished = written.and_then(|()| named(&self.partial, &self.path));
        finished.map_err(|error| unfinished(&self.partial, &error))?;
        Ok(self.path)
    }
}

/// Name of a recording during writing.
fn partial(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    name.into()
}

/// Gives a file its final name, unless another file has taken it.
fn named(partial: &Path, path: &Path) -> io::Result<()> {
    // Renaming alone would replace an existing file; creating the name first fails if it exists.
    File::create_new(path)?;
    fs::rename(partial, path)
}

fn unfinished(partial: &Path, error: &io::Error) -> Failure {
    let what = match error.kind() {
        ErrorKind::AlreadyExists => {
            "another file has taken the recording's name meanwhile: rename this one"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "the disk is full: make room there",
        _ => "record to another disk",
    };
    Failure::Refused(format!(
        "{}: {error}; {what}. What was recorded before is in this file, and `palpate info` and `palpate \
         export` read it.",
        partial.display()
    ))
}

/// Writes entries until the queue is closed.
fn write<W: Write>(mut writer: Writer<W>, entries: &Receiver<Entry>) -> io::Result<W> {
    let mut due = Instant::now();
    loop {
        match entries.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(entry) => writer.add(&entry)?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return writer.finish(),
        }
        if Instant::now() >= due {
            writer.flush()?;
            due = Instant::now() + CHUNK;
        }
    }
}
