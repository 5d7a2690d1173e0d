//! Output files.
//!
//! A verb checks before its run that it can write a file. The file gets its name when it is
//! complete, so a failed or interrupted run leaves an older file as it is.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::failure::Failure;

/// An output file, written at the end of a run.
#[derive(Clone, Debug)]
pub struct OutputFile {
    path: PathBuf,
    /// The argument that names the file or its folder.
    argument: &'static str,
}

impl OutputFile {
    /// Checks that the file can be written. The check changes no file and leaves none.
    pub fn new(argument: &'static str, path: &Path) -> Result<Self, Failure> {
        let output = Self {
            path: path.to_path_buf(),
            argument,
        };
        match output.check() {
            Ok(()) => Ok(output),
            Err(reason) => Err(Failure::Unwritable {
                file: path.to_path_buf(),
                argument,
                reason,
            }),
        }
    }

    /// Same as [`OutputFile::new`] for an optional argument.
    pub fn optional(
        argument: &'static str,
        path: Option<&PathBuf>,
    ) -> Result<Option<Self>, Failure> {
        path.map(|path| Self::new(argument, path)).transpose()
    }

    /// Creates output files in a folder, which is created if it does not exist.
    pub fn in_folder<const N: usize>(
        argument: &'static str,
        folder: &Path,
        names: [String; N],
    ) -> Result<Vec<Self>, Failure> {
        fs::create_dir_all(folder).map_err(|reason| Failure::Unwritable {
            file: folder.to_path_buf(),
            argument,
            reason,
        })?;
        let files = names.iter().map(|name| folder.join(name));
        files.map(|file| Self::new(argument, &file)).collect()
    }

    /// Returns output file `number`, counted from 1: the first keeps the given name, the second is
    /// FILE-2.EXTENSION, and so on.
    pub fn numbered(&self, number: u32) -> Self {
        if number == 1 {
            return self.clone();
        }
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let extension = self.path.extension().unwrap_or_default().to_string_lossy();
        Self {
            path: self
                .path
                .with_file_name(format!("{stem}-{number}.{extension}")),
            ..*self
        }
    }

    /// Fails if the output is also the input, since writing would replace the input.
    pub fn apart_from(self, input: &Path) -> Result<Self, Failure> {
        if self.is_special() || place(&self.path) != place(input) {
            return Ok(self);
        }
        Err(Failure::Argument(format!(
            "{} {}: this file is read. Name another file.",
            self.argument,
            self.path.display()
        )))
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the contents.
    pub fn write(&self, contents: impl AsRef<[u8]>) -> Result<(), Failure> {
        self.write_with(|file| file.write_all(contents.as_ref()))
    }

    /// Writes the file through the closure `write`.
    pub fn write_with(
        &self,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Failure> {
        self.replace(write).map_err(|error| {
            Failure::Refused(format!(
                "{} {}: {error}. The file was not written: make room there, or name another file.",
                self.argument,
                self.path.display()
            ))
        })
    }

    fn check(&self) -> io::Result<()> {
        if self.is_special() {
            return Ok(());
        }
        if self.path.exists() {
            OpenOptions::new().write(true).open(&self.path)?;
        }
        let temporary = self.temporary()?;
        begun(&temporary)?;
        fs::remove_file(&temporary)
    }

    fn replace(&self, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
        if self.is_special() {
            return filled(File::options().write(true).open(&self.path)?, write);
        }
        let temporary = self.temporary()?;
        let written = begun(&temporary)
            .and_then(|file| filled(file, write))
            .and_then(|()| fs::rename(&temporary, self.target()));
        if written.is_err() {
            // A temporary file that cannot be removed stays; the caller gets the write error.
            let _ = fs::remove_file(&temporary);
        }
        written
    }

    /// Whether the path is a device or a pipe, such as /dev/stdout. These are written directly.
    pub fn is_special(&self) -> bool {
        fs::metadata(&self.path).is_ok_and(|data| !data.is_file() && !data.is_dir())
    }

    /// Returns the file behind a symbolic link.
    pub fn target(&self) -> PathBuf {
        fs::canonicalize(&self.path).unwrap_or_else(|_| self.path.clone())
    }

    /// Returns the temporary name used until the file is complete.
    fn temporary(&self) -> io::Result<PathBuf> {
        let target = self.target();
        let name = target
            .file_name()
            .ok_or_else(|| io::Error::from(io::ErrorKind::IsADirectory))?;
        let name = name.to_string_lossy();
        Ok(target.with_file_name(format!(".{name}.{}.part", std::process::id())))
    }
}

/// Fails if two arguments name the same file, since the second output would replace the first.
pub fn distinct<'o>(outputs: impl IntoIterator<Item = &'o OutputFile>) -> Result<(), Failure> {
    let mut places = HashMap::new();
    for output in outputs.into_iter().filter(|output| !output.is_special()) {
        if let Some(argument) = places.insert(place(&output.path), output.argument) {
            return Err(Failure::Argument(format!(
                "{argument} and {} {}: this is the same file. Name two files.",
                output.argument,
                output.path.display()
            )));
        }
    }
    Ok(())
}

/// Resolves a path, whether the file exists or only its folder.
fn place(path: &Path) -> PathBuf {
    let beside = || {
        // The folder of a bare name is the empty path.
        let folder = Path::new(".").join(path.parent()?);
        Some(fs::canonicalize(folder).ok()?.join(path.file_name()?))
    };
    let place = fs::canonicalize(path).ok().or_else(beside);
    place.unwrap_or_else(|| path.to_path_buf())
}

/// Creates the temporary file. Replaces one that a killed program left.
fn begun(temporary: &Path) -> io::Result<File> {
    match fs::remove_file(temporary) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => File::create_new(temporary),
    }
}

fn filled(file: File, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufWriter::new(file);
    write(&mut file)?;
    file.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<String> = entries
            .map(|entry| name(entry).to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_check_leaves_nothing_and_writing_leaves_the_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("report.html");
        let output = OutputFile::new("--report", &file).unwrap();
        assert!(entries(folder.path()).is_empty());
        output.write("new").unwrap();
        assert_eq!(entries(folder.path()), ["report.html"]);
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        OutputFile::new("--report", &file).unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
    }

    #[test]
    fn contents_that_fail_leave_the_older_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("trace.vcd");
        fs::write(&file, "old").unwrap();
        let output = OutputFile::new("--trace", &file).unwrap();
        let failed = output.write_with(|file| {
            file.write_all(b"half of it")?;
            Err(io::Error::other("the disk is full"))
        });
        let message = failed.unwrap_err().to_string();
        assert!(message.contains("trace.vcd: the disk is full"), "{message}");
        assert_eq!(fs::read_to_string(&file).unwrap(), "old");
        assert_eq!(entries(folder.path()), ["trace.vcd"]);
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing").join("r.html");
        for file in [missing.as_path(), folder.path(), Path::new("..")] {
            let message = OutputFile::new("--report", file).unwrap_err().to_string();
            let named = format!("--report {}: ", file.display());
            assert!(message.starts_with(&named), "{message}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        OutputFile::new("--report", &link)
            .unwrap()
            .write("new")
            .unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn the_first_file_has_the_name_and_the_next_ones_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("finger.vcd");
        let output = OutputFile::new("--trace", &file).unwrap();
        assert_eq!(output.numbered(1).path(), file);
        let third = folder.path().join("finger-3.vcd");
        assert_eq!(output.numbered(3).path(), third);
    }
}
