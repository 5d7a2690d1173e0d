//! `SHA256SUMS`, as `sha256sum --check` reads it.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use sha2::{Digest, Sha256};

use super::archive::entries;
use super::files::write;

const FILE: &str = "SHA256SUMS";

/// Writes the checksums of all files in a folder into that folder.
pub(super) fn write_for_folder(folder: &Path) -> Result<()> {
    let files = files(folder)?;
    let files: Vec<_> = files.iter().map(PathBuf::as_path).collect();
    write_for_files(folder, &files)
}

/// Writes the checksums of files in or below a folder into that folder.
pub(super) fn write_for_files(folder: &Path, files: &[&Path]) -> Result<()> {
    let mut lines = String::new();
    for file in files {
        let contents =
            fs::read(file).with_context(|| format!("{} cannot be read", file.display()))?;
        let name = file
            .strip_prefix(folder)
            .context("a file lies in its folder")?;
        // The names have slashes on every system, so that the archive is the same.
        let name = name.to_string_lossy().replace('\\', "/");
        writeln!(lines, "{}  {name}", checksum(&contents))?;
    }
    write(&folder.join(FILE), &lines)
}

fn checksum(contents: &[u8]) -> String {
    Sha256::digest(contents)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in entries(folder)? {
        if entry.is_dir() {
            files.extend(self::files(&entry)?);
        } else {
            files.push(entry);
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_is_that_of_the_standard() {
        // FIPS 180-2, appendix B.1.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(checksum(b"abc"), abc);
    }
}
