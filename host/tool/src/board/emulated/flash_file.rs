//! File of the emulated board's flash.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_emulator::Flash;

/// Size of the storage area at the end of the flash, bytes.
const AREA: usize = 64 * 1024;
/// Size of a sector, bytes.
const SECTOR: usize = 4096;

/// The storage area in a file. Only one program can use the file at a time.
pub(crate) struct FlashFile {
    output: OutputFile,
    /// Number of flash operations up to the last write.
    written: usize,
    /// Lock held while the file is in use.
    _lock: File,
}

impl FlashFile {
    /// Opens a file, which need not exist.
    ///
    /// # Errors
    /// If the emulated board has not written the file, another program uses it, or it cannot be
    /// written.
    pub(super) fn open(path: &Path) -> Result<Self, Failure> {
        // Checks the file first, so that no lock is created beside a file of another kind.
        stored(path)?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|reason| unwritable(path, reason))?;
        }
        let output = OutputFile::new("--state", path)?;
        let lock = locked(path)?;
        Ok(Self {
            output,
            written: 0,
            _lock: lock,
        })
    }

    /// Copies settings and calibration of the file, if it exists, into a flash.
    pub(super) fn fill(&mut self, flash: &mut Flash) -> Result<(), Failure> {
        self.written = flash.operations().len();
        let Some(area) = stored(self.output.path())? else {
            return Ok(());
        };
        let mut contents = flash.export();
        let start = contents.len().saturating_sub(AREA);
        if let Some(place) = contents.get_mut(start..)
            && place.len() == area.len()
        {
            place.copy_from_slice(&area);
        }
        flash.import(&contents);
        Ok(())
    }

    /// Writes the file if the storage has changed.
    pub(super) fn follow(&mut self, flash: &Flash) -> Result<(), Failure> {
        let operations = flash.operations().len();
        if operations == self.written || flash.is_busy() {
            return Ok(());
        }
        let contents = flash.export();
        let area = contents.get(contents.len().saturating_sub(AREA)..);
        self.output.write(area.unwrap_or_default())?;
        self.written = operations;
        Ok(())
    }
}

/// Reads the storage area of a file; `None` without a file.
fn stored(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    let unreadable = |reason| Failure::Unreadable {
        file: path.to_path_buf(),
        reason,
    };
    let data = match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        data => data.map_err(unreadable)?,
    };
    if data.is_dir() {
        return Err(no_flash(path, "a folder"));
    }
    // A pipe or a device may never end.
    if !data.is_file() {
        return Err(no_flash(path, "a device, not a file"));
    }
    if data.len() != AREA as u64 {
        let size = format!("{} bytes, where the board keeps {AREA}", data.len());
        return Err(no_flash(path, &size));
    }
    let area = fs::read(path).map_err(unreadable)?;
    if area
        .chunks(SECTOR)
        .filter(|sector| is_begun(sector))
        .count()
        < AREA / SECTOR / 2
    {
        return Err(no_flash(path, "it has no contents of a board's flash"));
    }
    Ok(Some(area))
}

/// Whether a sector looks like one of the storage: its first byte is erased or a written mark, with
/// up to two flipped bits, and some bytes are erased.
fn is_begun(sector: &[u8]) -> bool {
    let ones = sector.first().map_or(0, |first| first.count_ones());
    !(2..=6).contains(&ones) && sector.contains(&0xFF)
}

fn no_flash(path: &Path, what: &str) -> Failure {
    Failure::Argument(format!(
        "--state {}: {what}; name a file that the emulated board has written, or one that does not \
         exist yet",
        path.display()
    ))
}

/// Takes the lock: a file with .lock appended to the whole name, whose contents stay.
fn locked(path: &Path) -> Result<File, Failure> {
    let mut name = path.as_os_str().to_owned();
    name.push(".lock");
    let lock = File::options()
        .write(true)
        .create(true)
        .truncate(false)
        .open(&name)
        .map_err(|reason| unwritable(Path::new(&name), reason))?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(TryLockError::WouldBlock) => Err(Failure::Refused(format!(
            "another program runs the emulated board of {}: end it first, or name another file",
            path.display()
        ))),
        Err(TryLockError::Error(reason)) => Err(unwritable(path, reason)),
    }
}

fn unwritable(path: &Path, reason: io::Error) -> Failure {
    Failure::Unwritable {
        file: path.to_path_buf(),
        argument: "--state",
        reason,
    }
}
