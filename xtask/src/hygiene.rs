//! Content that must not be in the repository: paths of a machine, marks of unfinished work,
//! retired words, build output, and a microcontroller's name outside of its board's folder.
//!
//! The check reads the files that git tracks or would add, so it finds a new file before it is
//! committed.

use std::fmt;
use std::fs;

use anyhow::{Context, Result, bail};

use crate::process::Workspace;
use crate::repository;

/// First folders of absolute paths that exist on one machine only.
const MACHINE_FOLDERS: &[&str] = &["home", "root", "Users", "tmp", "work", "mnt"];

/// Words that mark unfinished work, each split in two, so that this file passes its own check.
const MARKS: &[&str] = &[
    concat!("TO", "DO"),
    concat!("FIX", "ME"),
    concat!("XX", "X"),
    concat!("to", "do!"),
    concat!("unimpl", "emented!"),
];

/// Pairs of a retired word and the field's own word, which `docs` and code use instead. Split as
/// the words of [`MARKS`] are.
const RETIRED: &[(&str, &str)] = &[
    (concat!("to", "ld"), "reported, sent, measured"),
    (concat!("fe", "lt"), "deformation, contact"),
    (concat!("he", "ard"), "received, last seen"),
    (concat!("ob", "ey"), "apply, execute"),
    (concat!("ob", "eyed"), "applied, executed"),
    (concat!("ob", "eys"), "applies, executes"),
    (concat!("ast", "ray"), "tracking error, off target"),
    (concat!("rec", "kon"), "compute"),
    (concat!("rec", "koned"), "computed"),
    (concat!("no", "body"), "the name of the part that does not"),
    (concat!("who", "ever"), "the name of the part that does"),
];
/// Folder of the pages written by campaigns, with the words of their time.
const WRITTEN_PAGES: &str = "docs/evidence/";

/// Crates of a microcontroller. Only the one folder of the firmware's sources below may name them:
/// the instrument's logic is tested on a PC, and another board needs another folder.
const MICROCONTROLLER: &[&str] = &["rp2040_pac", "rp2040_hal", "rp2040_boot2", "cortex_m"];
const FIRMWARE_SOURCES: &str = "firmware/src/";
const BOARD_FOLDER: &str = "firmware/src/board/rp2040/";
/// The only line outside of that folder that may name a microcontroller's crate, where RTIC needs
/// the device.
const RTIC_DEVICE: (&str, &str) = ("firmware/src/main.rs", "#[rtic::app(device = rp2040_pac,");

/// Folders of build output; below, endings of its file names.
const OUTPUT_FOLDERS: &[&str] = &["target", "__pycache__", "node_modules"];
const OUTPUT_ENDINGS: &[&str] = &[
    ".o", ".a", ".d", ".elf", ".hex", ".map", ".profraw", ".pyc", ".rlib", ".rmeta", ".so", ".uf2",
];

/// First bytes of compiled files: ELF, archives, Windows programs.
const OUTPUT_MAGIC: &[&[u8]] = &[b"\x7fELF", b"!<arch>", b"MZ\x90"];

/// A violation in the repository.
#[derive(Debug, PartialEq, Eq)]
struct Finding {
    /// The file, with the line number if there is one.
    place: String,
    /// Description of the violation.
    fault: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.fault)
    }
}

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
    let lines: Vec<_> = findings.iter().map(ToString::to_string).collect();
    bail!("{} findings:\n    {}", lines.len(), lines.join("\n    "));
}

/// All violations in one file.
fn check_file(name: &str, content: &[u8]) -> Vec<Finding> {
    if is_build_output(name, content) {
        return vec![Finding {
            place: name.to_owned(),
            fault: "is build output".to_owned(),
        }];
    }
    let Ok(text) = std::str::from_utf8(content) else {
        return Vec::new();
    };
    let has_our_words = !name.starts_with(WRITTEN_PAGES)
        && [".rs", ".md", ".toml"]
            .iter()
            .any(|ending| name.ends_with(ending));
    text.lines()
        .enumerate()
        .flat_map(|(index, line)| {
            let place = format!("{name}:{}", index + 1);
            let words = has_our_words.then(|| retired_words(line));
            let faults = faults(line)
                .chain(words.into_iter().flatten())
                .chain(misplaced(name, line));
            faults.map(move |fault| Finding {
                place: place.clone(),
                fault,
            })
        })
        .collect()
}

/// Whether a file is build output, by its name and its first bytes.
fn is_build_output(name: &str, content: &[u8]) -> bool {
    name.split('/')
        .rev()
        .skip(1)
        .any(|folder| OUTPUT_FOLDERS.contains(&folder))
        || OUTPUT_ENDINGS.iter().any(|ending| name.ends_with(ending))
        || OUTPUT_MAGIC.iter().any(|magic| content.starts_with(magic))
}

/// All violations in one line.
fn faults(line: &str) -> impl Iterator<Item = String> {
    let paths = MACHINE_FOLDERS
        .iter()
        .map(|folder| format!("/{folder}/"))
        .filter(|start| names_a_path(line, start))
        .map(|start| format!("has a path of one machine, below {start}"));
    let marks = MARKS
        .iter()
        .filter(|mark| has_word(line, mark))
        .map(|mark| format!("has the mark {mark} of unfinished work"));
    paths.chain(marks).collect::<Vec<_>>().into_iter()
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

/// Retired words in a line, alone or as a part of a name.
fn retired_words(line: &str) -> Vec<String> {
    let words = line.split(|c: char| !c.is_alphabetic()).flat_map(parts);
    words
        .filter_map(|word| {
            let retired = RETIRED
                .iter()
                .find(|(retired, _)| word.eq_ignore_ascii_case(retired));
            retired.map(|(word, instead)| format!("has the word \"{word}\"; instead: {instead}"))
        })
        .collect()
}

/// Parts of a name in CamelCase; a name in capitals is one part.
fn parts(name: &str) -> Vec<&str> {
    let is_capitals = !name.contains(|c: char| c.is_lowercase());
    let mut parts = Vec::new();
    let mut begin = 0;
    for (at, c) in name.char_indices().skip(1) {
        if c.is_uppercase() && !is_capitals {
            parts.push(&name[begin..at]);
            begin = at;
        }
    }
    parts.push(&name[begin..]);
    parts
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

/// Whether the line contains the word alone.
fn has_word(line: &str, word: &str) -> bool {
    let joins = |c: char| c.is_alphanumeric() || c == '_';
    line.match_indices(word).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + word.len()..].chars().next();
        !before.is_some_and(joins) && (word.ends_with('!') || !after.is_some_and(joins))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(line: &str) -> usize {
        faults(line).count()
    }

    #[test]
    fn an_absolute_path_of_a_machine_is_found_wherever_it_stands() {
        for folder in MACHINE_FOLDERS {
            for line in [
                format!("/{folder}/someone/project"),
                format!("path = \"/{folder}/x\""),
                format!("see file:///{folder}/x.html"),
                format!("run /{folder}/x --now"),
            ] {
                assert_eq!(count(&line), 1, "{line}");
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
                assert_eq!(count(&line), 0, "{line}");
            }
        }
    }

    #[test]
    fn a_mark_of_unfinished_work_is_found_as_a_word() {
        for mark in MARKS {
            assert_eq!(count(&format!("    // {mark}: later")), 1, "{mark}");
            assert_eq!(count(&format!("{mark}(\"later\")")), 1, "{mark}");
            assert_eq!(count(&format!("prefix_{mark}")), 0, "{mark}");
        }
        assert_eq!(count("todo = \"warn\""), 0);
        assert_eq!(count("unimplemented = \"warn\""), 0);
    }

    #[test]
    fn a_retired_word_is_found_alone_and_in_every_kind_of_name() {
        for (word, _) in RETIRED {
            let capital = word[..1].to_uppercase() + &word[1..];
            for line in [
                format!("/// It is {word}."),
                format!("let {word}_a = 1;"),
                format!("struct Last{capital}Value;"),
                format!("const {}: u8 = 1;", word.to_uppercase()),
            ] {
                assert_eq!(retired_words(&line).len(), 1, "{line}");
                assert_eq!(check_file("src/a.rs", line.as_bytes()).len(), 1, "{line}");
                assert!(check_file("docs/evidence/a.md", line.as_bytes()).is_empty());
            }
            assert!(retired_words(&format!("thresh{word}s")).is_empty());
        }
    }

    #[test]
    fn a_microcontroller_is_named_in_its_boards_folder_and_where_rtic_gets_it() {
        for line in [
            "use rp2040_pac::I2C0;",
            "use rp2040_hal::pac;",
            "    cortex_m::asm::nop();",
            "use cortex_m_rt::exception;",
            "static B: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;",
        ] {
            for name in ["firmware/src/main.rs", "firmware/src/tasks/coil.rs"] {
                assert_eq!(check_file(name, line.as_bytes()).len(), 1, "{name}: {line}");
            }
            for name in ["firmware/src/board/rp2040/mod.rs", "firmware/examples/a.rs"] {
                assert!(
                    check_file(name, line.as_bytes()).is_empty(),
                    "{name}: {line}"
                );
            }
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

    #[test]
    fn a_finding_names_file_and_line() {
        let text = format!("fine\n// {}\n", MARKS[0]);
        let findings = check_file("src/a.rs", text.as_bytes());
        assert_eq!(findings.len(), 1);
        assert!(findings[0].to_string().starts_with("src/a.rs:2: "));
    }

    #[test]
    fn binary_data_is_not_read_as_text() {
        assert!(check_file("recording.dat", &[0xff, 0xfe, 0x00, 0x01]).is_empty());
    }
}
