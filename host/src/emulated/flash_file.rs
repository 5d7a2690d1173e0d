//! The emulated board's flash in a file.

use std::fs::{self, File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use palpate_emulator::Flash;

use crate::failure::Failure;

/// Bytes at the end of the flash that keep settings and calibration.
const AREA: usize = 64 * 1024;

/// The flash's contents in a file. One program has it at a time.
pub(crate) struct FlashFile {
    path: PathBuf,
    /// Operations up to what was written.
    written: usize,
    /// Held as long as the file is used.
    _lock: File,
}

impl FlashFile {
    /// Takes a file, which need not be there yet.
    pub(super) fn open(path: &Path) -> Result<Self, Failure> {
        let unwritable = |reason| unwritable(path, reason);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(unwritable)?;
        }
        let lock = File::create(path.with_extension("lock")).map_err(unwritable)?;
        match lock.try_lock() {
            Ok(()) => Ok(Self {
                path: path.to_path_buf(),
                written: 0,
                _lock: lock,
            }),
            Err(TryLockError::WouldBlock) => Err(Failure::Refused(format!(
                "another program runs the emulated board of {}: end it first, or name another file",
                path.display()
            ))),
            Err(TryLockError::Error(reason)) => Err(unwritable(reason)),
        }
    }

    /// Brings the settings and calibration of the file, if there is one, into a flash.
    pub(super) fn fill(&mut self, flash: &mut Flash) -> Result<(), Failure> {
        self.written = flash.operations().len();
        let area = match fs::read(&self.path) {
            Ok(area) => area,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            Err(reason) => {
                return Err(Failure::Unreadable {
                    file: self.path.clone(),
                    reason,
                });
            }
        };
        let mut contents = flash.export();
        let start = contents.len().saturating_sub(AREA);
        match contents.get_mut(start..) {
            Some(place) if place.len() == area.len() => place.copy_from_slice(&area),
            _ => {
                return Err(Failure::Argument(format!(
                    "{}: {} bytes, where the board keeps {AREA}; name a file that the emulated board has \
                     written, or one that is not there yet",
                    self.path.display(),
                    area.len()
                )));
            }
        }
        flash.import(&contents);
        Ok(())
    }

    /// Writes the file, if something was stored since: anew beside it, then in its place.
    pub(super) fn follow(&mut self, flash: &Flash) -> Result<(), Failure> {
        let operations = flash.operations().len();
        if operations == self.written || flash.is_busy() {
            return Ok(());
        }
        let contents = flash.export();
        let area = contents.get(contents.len().saturating_sub(AREA)..);
        let beside = self.path.with_extension("partial");
        let written = fs::write(&beside, area.unwrap_or_default());
        written
            .and_then(|()| fs::rename(&beside, &self.path))
            .map_err(|reason| unwritable(&self.path, reason))?;
        self.written = operations;
        Ok(())
    }
}

fn unwritable(path: &Path, reason: std::io::Error) -> Failure {
    Failure::Unwritable {
        file: path.to_path_buf(),
        argument: "the emulated board's flash",
        reason,
    }
}
