//! Content that must not be in the repository: paths of a machine, build output, and a
//! microcontroller's name outside of its board's folder.
//!
//! The check reads the files that git tracks or would add, so it finds a new file before it is
//! committed.

use std::fs;

use anyhow::{Context, Result, bail};

use crate::process::Workspace;
use crate::repository;

/// First folders of absolute paths that exist on one machine only.
const MACHINE_FOLDERS: &[&str] = &["home", "root", "Users", "tmp", "work", "mnt"];

/// Crates of a microcontroller. Within the firmware's sources, only the board's folder may name
/// them: the instrument's logic is tested on a PC, and another board needs another folder.
const MICROCONTROLLER: &[&str] = &["rp2040_pac", "rp2040_hal", "rp2040_boot2", "cortex_m"];
const FIRMWARE_SOURCES: &str = "firmware/src/";
const BOARD_FOLDER: &str = "firmware/src/board/rp2040/";
/// The only line outside of that folder that may name a microcontroller's crate, where RTIC needs
/// the device.
const RTIC_DEVICE: (&str, &str) = ("firmware/src/main.rs", "#[rtic::app(device = rp2040_pac,");

/// Folders of build output, and endings of its file names.
const OUTPUT_FOLDERS: &[&str] = &["target", "__pycache__", "node_modules"];
const OUTPUT_ENDINGS: &[&str] = &[
    ".o", ".a", ".d", ".elf", ".hex", ".map", ".profraw", ".pyc", ".rlib", ".rmeta", ".so", ".uf2",
];

/// First bytes of compiled files: ELF, archives, Windows programs.
const OUTPUT_MAGIC: &[&[u8]] = &[b"\x7fELF", b"!<arch>", b"MZ\x90"];

/// Checks every file of the repository.
pub(crate) fn check_workspace(workspace: &Workspace) -> Result<String> {
    let files = repository::files(workspace)?;
    let mut findings = Vec::new();
    for name in &files {
        let path = workspace.root().join(name);
        // A link or a submodule has no content of its own, and a deleted file has none.
        if path.symlink_metadata().is_ok_and(|entry| entry.is_file()) {
            let content = fs::read(&path)
                .with_context(|| format!("{name} could not be read for checking"))?;
            findings.extend(check_file(name, &content));
        }
    }
    if findings.is_empty() {
        return Ok(format!("{} files are clean", files.len()));
    }
    bail!(
        "{} findings:\n    {}",
        findings.len(),
        findings.join("\n    ")
    );
}

/// All violations in one file, each with its location.
fn check_file(name: &str, content: &[u8]) -> Vec<String> {
    if is_build_output(name, content) {
        return vec![format!("{name}: is build output")];
    }
    let text = std::str::from_utf8(content).unwrap_or_default();
    let lines = (1..).zip(text.lines());
    lines
        .flat_map(|(number, line)| {
            let faults = machine_path(line).into_iter().chain(misplaced(name, line));
            faults.map(move |fault| format!("{name}:{number}: {fault}"))
        })
        .collect()
}

/// Whether a file is build output, by its name and its first bytes.
fn is_build_output(name: &str, content: &[u8]) -> bool {
    let mut folders = name.split('/').rev().skip(1);
    folders.any(|folder| OUTPUT_FOLDERS.contains(&folder))
        || OUTPUT_ENDINGS.iter().any(|ending| name.ends_with(ending))
        || OUTPUT_MAGIC.iter().any(|magic| content.starts_with(magic))
}

/// A path of one machine in a line.
fn machine_path(line: &str) -> Option<String> {
    let starts = MACHINE_FOLDERS.iter().map(|folder| format!("/{folder}/"));
    let mut named = starts.filter(|start| names_a_path(line, start));
    let start = named.next()?;
    Some(format!("has a path of one machine, below {start}"))
}

/// Whether the line contains an absolute path with this start and something below it.
fn names_a_path(line: &str, start: &str) -> bool {
    line.match_indices(start).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + start.len()..].chars().next();
        let is_absolute = !before.is_some_and(|c| c.is_alphanumeric() || "._-~)}>*".contains(c));
        is_absolute && after.is_some_and(|c| c.is_alphanumeric() || "._-$".contains(c))
    })
}

/// Microcontroller crate that a line of the firmware names outside of the board's folder.
fn misplaced(name: &str, line: &str) -> Option<String> {
    let is_free = !name.starts_with(FIRMWARE_SOURCES) || name.starts_with(BOARD_FOLDER);
    if is_free || (name == RTIC_DEVICE.0 && line.starts_with(RTIC_DEVICE.1)) {
        return None;
    }
    let named = MICROCONTROLLER.iter().find(|part| line.contains(*part))?;
    Some(format!("names {named}: that belongs into {BOARD_FOLDER}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absolute_path_of_a_machine_is_found_wherever_it_stands() {
        for folder in MACHINE_FOLDERS {
            for line in [
                format!("/{folder}/someone/project"),
                format!("path = \"/{folder}/x\""),
                format!("see file:///{folder}/x.html"),
                format!("run /{folder}/x --now"),
            ] {
                let found = check_file("src/a.rs", format!("fine\n{line}").as_bytes());
                assert_eq!(found.len(), 1, "{line}");
                assert!(found[0].starts_with("src/a.rs:2: "), "{found:?}");
            }
        }
    }

    #[test]
    fn a_relative_path_or_an_address_is_none() {
        for folder in MACHINE_FOLDERS {
            for line in [
                format!("docs/{folder}/x.md"),
                format!("../{folder}/x"),
                format!("https://example.org/{folder}/x"),
                format!("the folder /{folder}/ itself"),
            ] {
                assert_eq!(machine_path(&line), None, "{line}");
            }
        }
    }

    #[test]
    fn a_microcontroller_is_named_in_its_boards_folder_and_where_rtic_gets_it() {
        let line = b"    cortex_m::asm::nop();";
        for (name, found) in [
            ("firmware/src/main.rs", 1),
            ("firmware/src/tasks/coil.rs", 1),
            ("firmware/src/board/rp2040/mod.rs", 0),
            ("firmware/examples/a.rs", 0),
        ] {
            assert_eq!(check_file(name, line).len(), found, "{name}");
        }
        let device = b"#[rtic::app(device = rp2040_pac, dispatchers = [SW0_IRQ])]";
        assert!(check_file("firmware/src/main.rs", device).is_empty());
        assert_eq!(check_file("firmware/src/tasks/mod.rs", device).len(), 1);
    }

    #[test]
    fn build_output_is_found_by_folder_ending_and_content() {
        for name in ["target/x.txt", "a/target/debug/x", "fw/image.uf2", "b.rlib"] {
            assert!(is_build_output(name, b""), "{name}");
        }
        assert!(is_build_output("tool", b"\x7fELF\x02"));
        assert!(!is_build_output("docs/target.md", b"# Target"));
        assert!(!is_build_output("src/elf.rs", b"//! Reads ELF files"));
    }
}
