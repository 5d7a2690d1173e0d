//! `palpate devices`: list of the connected boards.

use std::io::{self, Write};

use clap::Args;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use palpate_wire::code::{Board, Chip, ResetCause};
use palpate_wire::record::Hello;
use serde::Serialize;

use crate::board::link::no_board;
use crate::board::link::{open_port, ports, serial::Port};

/// List the boards that are plugged in
///
/// Asks each who it is, and changes nothing. A board that another program uses is listed with the reason
/// why it was not asked.
#[derive(Args)]
#[command(after_help = "\
With --json, one list of all boards, which is empty if there is none. Exit code 0 in any case.

Example:
  palpate devices")]
pub(crate) struct Arguments {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A board at a serial port.
#[derive(Clone, Debug, Serialize)]
struct Device {
    path: String,
    /// Serial number from USB.
    serial_number: Option<String>,
    /// Identity that the board reports; absent if it was not asked.
    identity: Option<Identity>,
    /// Reason why it was not asked, with a remedy.
    problem: Option<Finding>,
}

/// Identity that a board reports.
#[derive(Clone, Debug, Serialize)]
struct Identity {
    firmware: String,
    /// First 32 bits of the firmware's commit, hexadecimal.
    commit: String,
    board: Board,
    unit: u64,
    converters: [Chip; 2],
    configuration_crc: u32,
    reset_cause: ResetCause,
}

impl Identity {
    fn of(hello: &Hello) -> Self {
        Self {
            firmware: format!(
                "{}.{}.{}",
                hello.firmware_major, hello.firmware_minor, hello.firmware_patch
            ),
            commit: format!("{:08x}{}", hello.commit, if hello.dirty { "+" } else { "" }),
            board: hello.board,
            unit: hello.unit,
            converters: [hello.chip, hello.second_chip],
            configuration_crc: hello.configuration_crc,
            reset_cause: hello.reset_cause,
        }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let devices = found()?;
    let mut out = io::stdout().lock();
    if arguments.json {
        return Ok(writeln!(out, "{}", serde_json::to_string(&devices)?)?);
    }
    Ok(write!(out, "{}", described(&devices))?)
}

fn found() -> Result<Vec<Device>, Failure> {
    Ok(ports()?.into_iter().map(examined).collect())
}

/// Asks a board for its identity.
fn examined(port: Port) -> Device {
    let opened = open_port(&port.path);
    let identity = opened.as_ref().ok().and_then(|link| link.hello());
    let identity = identity.map(Identity::of);
    Device {
        path: port.path,
        serial_number: port.serial_number,
        identity,
        problem: opened.err().map(Finding::of),
    }
}

fn described(devices: &[Device]) -> String {
    if devices.is_empty() {
        return format!("{}.\n", no_board());
    }
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header([
        "port",
        "serial number",
        "firmware",
        "board",
        "unit",
        "converters",
        "configuration",
        "last start",
    ]);
    for device in devices {
        table.add_row(row(device));
    }
    let problems = devices.iter().filter_map(|device| device.problem.as_ref());
    let problems = problems.map(|problem| format!("{problem}.\n"));
    format!("{table}\n{}", problems.collect::<String>())
}

fn row(device: &Device) -> Vec<String> {
    let number = device.serial_number.clone().unwrap_or_default();
    let mut row = vec![device.path.clone(), number];
    if let Some(identity) = &device.identity {
        let [first, second] = identity.converters;
        row.extend([
            format!("{} ({})", identity.firmware, identity.commit),
            identity.board.to_string(),
            format!("{:016X}", identity.unit),
            format!("{first}, {second}"),
            format!("{:08x}", identity.configuration_crc),
            identity.reset_cause.to_string(),
        ]);
    } else if let Some(problem) = &device.problem {
        row.push(problem.finding.to_owned());
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    const HELLO: Hello = Hello {
        minor_version: 2,
        schema_hash: 0,
        firmware_major: 1,
        firmware_minor: 2,
        firmware_patch: 3,
        commit: 0xABC,
        dirty: true,
        simulated: false,
        board: Board::Pico,
        unit: 0xE660_C0D1,
        reset_cause: ResetCause::Watchdog,
        chip: Chip::Ldc161x,
        second_chip: Chip::Absent,
        configuration_crc: 0x1234,
    };

    #[test]
    fn a_board_is_listed_with_what_it_says_and_another_with_why_it_was_not_asked() {
        let asked = Device {
            path: "/dev/ttyACM0".to_owned(),
            serial_number: Some("E660C0D1".to_owned()),
            identity: Some(Identity::of(&HELLO)),
            problem: None,
        };
        let busy = Device {
            path: "/dev/ttyACM1".to_owned(),
            serial_number: None,
            identity: None,
            problem: Some(Finding::new("busy", "/dev/ttyACM1: busy", "Close that")),
        };
        let text = described(&[asked.clone(), busy]);
        for part in [
            "1.2.3 (00000abc+)",
            "pico",
            "00000000E660C0D1",
            "ldc161x, absent",
            "00001234",
            "watchdog",
            "/dev/ttyACM1: busy. Close that.",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let json = serde_json::to_value(&asked).unwrap();
        assert_eq!(json["identity"]["converters"][0], "ldc161x");
        assert!(described(&[]).contains("Connect one by USB"));
    }
}
