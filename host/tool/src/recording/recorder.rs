//! Writes a recording beside the reading of the board: a disk that is slow does not stop the board.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use palpate_cli::failure::Failure;

use super::writer::Writer;
use super::{Entry, Logged, Note, Recorded};

/// What may be lost if the program is killed: half of the second that docs/desk.md names.
const CHUNK: Duration = Duration::from_millis(500);
/// Entries that wait for the disk, at most: 16 s at the board's 1 kHz, more than a hard disk takes to spin
/// up, and less than 5 MB.
pub(super) const QUEUE: usize = 1 << 14;

/// A recording that is being written. The file gets its name when it is complete; until then `.partial`
/// follows the name.
pub(crate) struct Recorder {
    path: PathBuf,
    partial: PathBuf,
    queue: SyncSender<Entry>,
    thread: JoinHandle<io::Result<()>>,
    lost: u64,
}

impl Recorder {
    /// Begins a recording in a file that does not exist.
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
                    "{} is there already: name another file, or move it away",
                    existing.display()
                )));
            }
        }
        let file = File::create_new(&partial).map_err(unwritable)?;
        Self::on(file, path).map_err(unwritable)
    }

    /// Begins a recording in a file that is open.
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

    /// Where it is while it is written.
    pub(crate) fn partial(&self) -> &Path {
        &self.partial
    }

    /// Adds a frame, and does not wait for the disk. False if it cannot be written any more:
    /// [`finish`](Self::finish) says why.
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

    /// Adds a note; they are few, and none is lost.
    pub(crate) fn note(&mut self, note: Note) -> bool {
        self.queue.send(Entry::Note(note)).is_ok()
    }

    /// Adds a line of the log, and does not wait for the disk: no data are lost with one.
    pub(crate) fn log(&mut self, line: Logged) {
        let _ = self.queue.try_send(Entry::Log(line));
    }

    /// Frames that are not in the file since the disk did not keep up.
    pub(crate) const fn lost(&self) -> u64 {
        self.lost
    }

    /// Completes the file.
    ///
    /// # Errors
    /// If it cannot be written: the message says what is left, and where.
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

/// The name of a recording while it is written.
fn partial(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    name.into()
}

/// Gives a file its name, unless another one has it meanwhile.
fn named(partial: &Path, path: &Path) -> io::Result<()> {
    // Renaming alone would replace what has the name; taking the name first fails where it is taken.
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

/// Writes what comes, until nothing can come any more.
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
