//! `palpate flash`: writes firmware to a board, over USB or through a debug probe.

mod drive;
#[cfg(test)]
mod sample;
mod uf2;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::{notice, text};
use palpate_emulator::Image;
use palpate_wire::Command;
use palpate_wire::code::RebootTarget;
use palpate_wire::command::Reboot;
use palpate_wire::record::Hello;
use serde::Serialize;
use uf2::Uf2;

use crate::board::link::{self, Link};
use crate::board::storage;
use crate::interrupt::Interrupt;

/// Longest wait for a drive: a system mounts it within seconds, a person within a minute.
const DRIVE: Duration = Duration::from_secs(60);
/// Time after which a message explains how to mount a missing drive.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest wait for the board's port with the new firmware: it starts within a second, and the
/// system grants access to the port a moment later.
const START: Duration = Duration::from_secs(15);
/// Poll interval of drives and ports.
const POLL: Duration = Duration::from_millis(200);

/// Write firmware onto a board, over USB or through a debug probe
///
/// Over USB, the firmware that runs is asked to start the boot loader, which shows itself as a drive. The file is
/// checked, written there, and the new firmware is asked who it is. Settings and calibration that are stored
/// stay.
#[derive(Args)]
#[command(after_help = "\
Without firmware of palpate on the board, hold its button BOOTSEL while plugging it in; the drive that appears \
is found.

Examples:
  palpate flash palpate-pico.uf2
  palpate flash palpate-pico.uf2 --drive /media/ann/RPI-RP2    # needs a board
  palpate flash palpate-pico.elf --board probe    # needs a probe
  palpate flash palpate-pico.uf2 --board emulated --image palpate-pico.elf")]
pub(crate) struct Arguments {
    /// The firmware: a UF2 file, or the image's ELF file
    #[arg(value_name = "FIRMWARE")]
    file: PathBuf,
    /// The drive of a board in its boot loader, where this program does not find it
    #[arg(long, value_name = "FOLDER")]
    drive: Option<PathBuf>,
    #[command(flatten)]
    link: link::Arguments,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// JSON output.
#[derive(Serialize)]
struct Report {
    /// Number of written flash bytes.
    written_bytes: u32,
    /// Version that the new firmware reports.
    firmware: String,
    /// First 32 bits of the firmware's commit, hexadecimal.
    commit: String,
    /// Whether it was built from changed sources.
    dirty: bool,
    /// Serial number of the board.
    unit: String,
}

/// Flashes a board.
///
/// # Errors
/// If the file is not suitable for the board, no board is found, or the board does not return.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let file = load(&arguments.file)?;
    let hello = if arguments.link.is_emulated() {
        flash_emulated(arguments, &file)?
    } else if arguments.link.flash_through_probe(&file.firmware())? {
        identity(&await_board(&arguments.link)?)?
    } else {
        flash_drive(arguments, &file)?
    };
    print(&file, &hello, arguments.json)
}

/// Reads a file and checks that it is suitable for the board.
fn load(path: &Path) -> Result<Uf2, Failure> {
    let bytes = text::bytes_of_file(path)?;
    let is_elf = bytes.starts_with(b"\x7fELF");
    let bytes = if is_elf {
        let image = Image::load(path);
        image
            .map_err(|error| refused(path, &error.to_string()))?
            .to_uf2()
    } else {
        bytes
    };
    Uf2::check(bytes).map_err(|why| refused(path, &why))
}

fn refused(path: &Path, why: &str) -> Failure {
    Failure::Argument(format!(
        "{}: {why}. Nothing was written. Name the UF2 or ELF file of the firmware of palpate, as in a release \
         or from `cargo xtask firmware`",
        path.display()
    ))
}

fn flash_emulated(arguments: &Arguments, file: &Uf2) -> Result<Hello, Failure> {
    if arguments.drive.is_some() {
        return Err(Failure::Argument(
            "the emulated board has no drive: leave --drive or --board emulated out".to_owned(),
        ));
    }
    let mut link = arguments.link.open()?;
    start_boot_loader(&mut link)?;
    if let Some(board) = link.emulated() {
        board.write_uf2(file.bytes())?;
    }
    link.reconnect(&Interrupt::uncaught())?;
    identity(&link)
}

fn flash_drive(arguments: &Arguments, file: &Uf2) -> Result<Hello, Failure> {
    let drive = match &arguments.drive {
        Some(folder) if drive::is_drive(folder) => folder.clone(),
        Some(folder) => return Err(no_drive(folder)),
        None => find_drive(&arguments.link)?,
    };
    notice::say(format_args!("palpate: writing {}", drive.display()));
    drive::write(&drive, file.bytes()).map_err(|error| {
        Failure::Refused(format!(
            "{}: {error}. The firmware is incomplete, and the board stays in its boot loader: flash it \
             again",
            drive.display()
        ))
    })?;
    identity(&await_board(&arguments.link)?)
}

/// Returns the drive of the only board in its boot loader. If there is none, or the user named a
/// board, starts the boot loader of the board at the link first.
fn find_drive(arguments: &link::Arguments) -> Result<PathBuf, Failure> {
    let before = drive::drives();
    if !before.is_empty() && !arguments.is_named() {
        return only(before);
    }
    let mut link = arguments.open().map_err(without_firmware)?;
    start_boot_loader(&mut link)?;
    // While the port is open, the returning board would get another name.
    drop(link);
    await_drive(&before)
}

fn only(mut drives: Vec<PathBuf>) -> Result<PathBuf, Failure> {
    match (drives.pop(), drives.is_empty()) {
        (Some(drive), true) => Ok(drive),
        (last, _) => {
            let names = drives
                .iter()
                .chain(&last)
                .map(|drive| drive.display().to_string());
            Err(Failure::Argument(format!(
                "several boards are in their boot loader: name one with --drive: {}",
                names.collect::<Vec<_>>().join(", ")
            )))
        }
    }
}

/// Adds the remedy for a board that does not answer before flashing.
fn without_firmware(failure: Failure) -> Failure {
    let Failure::Unconnected(mut finding) = failure else {
        return failure;
    };
    if ["no_board", "silent", "other_firmware", "other_version"].contains(&finding.finding) {
        finding.action =
            "Hold the board's button BOOTSEL while plugging it in, and run this again: a drive \
                          appears that needs no firmware"
                .to_owned();
    }
    Failure::Unconnected(finding)
}

/// Starts the boot loader of a board.
fn start_boot_loader(link: &mut Link) -> Result<(), Failure> {
    let kept = storage::inspect(link)?;
    if kept.stored_crc != kept.in_force_crc {
        notice::say(
            "palpate: active settings that are not stored are lost now; stored ones remain",
        );
    }
    let target = RebootTarget::BootLoader;
    link.send_accepted(&Command::Reboot(Reboot { target }))?;
    Ok(())
}

/// Waits for a new drive.
fn await_drive(before: &[PathBuf]) -> Result<PathBuf, Failure> {
    let begin = Instant::now();
    let mut is_said = false;
    while begin.elapsed() < DRIVE {
        let mut new = drive::drives();
        new.retain(|drive| !before.contains(drive));
        if !new.is_empty() {
            return only(new);
        }
        if begin.elapsed() > PATIENCE && !is_said {
            notice::say(
                "palpate: the board is in its boot loader; waiting for its drive RPI-RP2. Where the system \
                 does not mount it by itself: udisksctl mount -b /dev/disk/by-label/RPI-RP2",
            );
            is_said = true;
        }
        sleep(POLL);
    }
    Err(Failure::Refused(
        "no drive RPI-RP2 has appeared. The board is in its boot loader: mount its drive, and run this again \
         with --drive FOLDER"
            .to_owned(),
    ))
}

fn no_drive(folder: &Path) -> Failure {
    Failure::Argument(format!(
        "--drive {}: there is no INFO_UF2.TXT of an RP2040 in it. Hold BOOTSEL while plugging the board in, and \
         name the folder of the drive RPI-RP2",
        folder.display()
    ))
}

/// Waits for the board with its new firmware.
fn await_board(arguments: &link::Arguments) -> Result<Link, Failure> {
    let begin = Instant::now();
    loop {
        match arguments.open() {
            Err(Failure::Unconnected(_)) if begin.elapsed() < START => sleep(POLL),
            Err(failure) => {
                return Err(Failure::Refused(format!(
                    "the firmware is written, and the board was not reached afterwards: {failure}"
                )));
            }
            Ok(link) => return Ok(link),
        }
    }
}

fn identity(link: &Link) -> Result<Hello, Failure> {
    let hello = link.hello().cloned();
    hello.ok_or_else(|| Failure::Lost("the board does not identify itself".to_owned()))
}

fn print(file: &Uf2, hello: &Hello, json: bool) -> Result<(), Failure> {
    let version = [
        hello.firmware_major,
        hello.firmware_minor,
        hello.firmware_patch,
    ];
    let report = Report {
        written_bytes: file.size,
        firmware: version.map(|number| number.to_string()).join("."),
        commit: format!("{:08x}", hello.commit),
        dirty: hello.dirty,
        unit: format!("{:016X}", hello.unit),
    };
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(&report)?)?);
    }
    let changed = if report.dirty { ", changed" } else { "" };
    Ok(writeln!(
        out,
        "{} bytes written. The board {} runs firmware {} (commit {}{changed}).",
        report.written_bytes, report.unit, report.firmware, report.commit
    )?)
}

#[cfg(test)]
mod tests {
    use palpate_cli::finding::Finding;

    use super::*;

    #[test]
    fn a_file_that_is_refused_says_that_nothing_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("notes.uf2");
        std::fs::write(&file, "no firmware").unwrap();
        let failure = load(&file).unwrap_err();
        let message = failure.to_string();
        assert!(message.contains("Nothing was written"), "{message}");
        assert!(matches!(failure, Failure::Argument(_)));
    }

    #[test]
    fn one_drive_is_taken_and_of_several_one_has_to_be_named() {
        let [first, second] = ["/media/a", "/media/b"].map(PathBuf::from);
        assert_eq!(only(vec![first.clone()]).unwrap(), first);
        let message = only(vec![first, second]).unwrap_err().to_string();
        assert!(message.contains("/media/a, /media/b"), "{message}");
    }

    #[test]
    fn a_board_without_firmware_is_brought_to_its_boot_loader_by_its_button() {
        let of = |name| {
            let finding = Finding::new(name, "cause", "action");
            without_firmware(Failure::Unconnected(finding)).to_string()
        };
        assert!(of("no_board").contains("BOOTSEL"));
        assert!(of("other_version").contains("BOOTSEL"));
        assert!(of("busy").contains("action"));
    }

    #[test]
    fn a_folder_that_is_no_drive_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(no_drive(folder.path()).to_string().contains("BOOTSEL"));
    }
}
