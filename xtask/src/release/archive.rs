//! A `.tar.gz` that depends only on the files: in order of their names, with one time and no user.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use flate2::{Compression, GzBuilder};
use tar::{Builder, EntryType, Header};

/// Modes of plain files and of programs.
const READ: u32 = 0o644;
const RUN: u32 = 0o755;

/// Writes a folder into an archive, under a name. All files get the same time, s since 1970.
pub(super) fn write(folder: &Path, name: &str, time_s: u64, archive: &Path) -> Result<()> {
    let cannot = || format!("{} cannot be written", archive.display());
    let file = File::create(archive).with_context(cannot)?;
    let gzip = GzBuilder::new().mtime(0).write(file, Compression::best());
    let mut tar = Builder::new(gzip);
    append(&mut tar, folder, Path::new(name), time_s)?;
    tar.into_inner()
        .and_then(|gzip| gzip.finish())
        .with_context(cannot)?;
    Ok(())
}

fn append<W: std::io::Write>(
    tar: &mut Builder<W>,
    path: &Path,
    name: &Path,
    time_s: u64,
) -> Result<()> {
    let cannot = || format!("{} cannot be archived", path.display());
    let mut header = Header::new_gnu();
    header.set_mtime(time_s);
    if path.is_dir() {
        header.set_entry_type(EntryType::Directory);
        header.set_mode(RUN);
        header.set_size(0);
        let nothing = std::io::empty();
        tar.append_data(&mut header, name, nothing)
            .with_context(cannot)?;
        for entry in entries(path)? {
            let of = entry.file_name().with_context(cannot)?;
            append(tar, &entry, &name.join(of), time_s)?;
        }
        return Ok(());
    }
    let contents = fs::read(path).with_context(cannot)?;
    header.set_mode(if is_program(name) { RUN } else { READ });
    header.set_size(contents.len() as u64);
    tar.append_data(&mut header, name, contents.as_slice())
        .with_context(cannot)
}

/// Only the tool is a program: systems with and without file modes then give the same archive.
fn is_program(name: &Path) -> bool {
    name.file_stem().is_some_and(|stem| stem == "palpate")
        && name
            .parent()
            .is_some_and(|folder| folder.components().count() == 1)
}

/// Entries of a folder, in order of their names.
pub(super) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let cannot = || format!("{} cannot be read", folder.display());
    let entries = fs::read_dir(folder).with_context(cannot)?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut paths = paths
        .collect::<std::io::Result<Vec<_>>>()
        .with_context(cannot)?;
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::time::{Duration, SystemTime};

    /// Files in their own folder, with this modification time.
    fn folder(name: &str, changed: SystemTime) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("{name}-{}", std::process::id()));
        fs::create_dir_all(folder.join("man")).unwrap();
        for (file, text) in [
            ("palpate", "program"),
            ("man/palpate.1", "page"),
            ("README.md", "text"),
        ] {
            let path = folder.join(file);
            fs::write(&path, text).unwrap();
            File::options()
                .write(true)
                .open(path)
                .unwrap()
                .set_modified(changed)
                .unwrap();
        }
        folder
    }

    #[test]
    fn an_archive_depends_on_the_files_alone_and_the_tool_can_be_run() {
        let first = folder(
            "palpate-first",
            SystemTime::UNIX_EPOCH + Duration::from_secs(7),
        );
        let second = folder("palpate-second", SystemTime::now());
        let archives = [&first, &second].map(|folder| {
            let archive = folder.with_extension("tar.gz");
            write(folder, "palpate-1.2.3", 1_700_000_000, &archive).unwrap();
            let bytes = fs::read(&archive).unwrap();
            fs::remove_dir_all(folder).unwrap();
            fs::remove_file(archive).unwrap();
            bytes
        });
        assert_eq!(archives[0], archives[1]);
        let unpacked = flate2::read::GzDecoder::new(archives[0].as_slice());
        let mut tar = tar::Archive::new(unpacked);
        let modes = tar.entries().unwrap().map(|entry| {
            let entry = entry.unwrap();
            let name = entry.path().unwrap().to_string_lossy().into_owned();
            (
                name,
                entry.header().mode().unwrap(),
                entry.header().mtime().unwrap(),
            )
        });
        let modes: Vec<_> = modes
            .map(|(name, mode, time)| {
                assert_eq!(time, 1_700_000_000);
                (name, mode)
            })
            .collect();
        let expected = [
            ("palpate-1.2.3", 0o755),
            ("palpate-1.2.3/README.md", 0o644),
            ("palpate-1.2.3/man", 0o755),
            ("palpate-1.2.3/man/palpate.1", 0o644),
            ("palpate-1.2.3/palpate", 0o755),
        ];
        let expected: Vec<_> = expected
            .map(|(name, mode)| (name.to_owned(), mode))
            .to_vec();
        assert_eq!(modes, expected);
    }
}
