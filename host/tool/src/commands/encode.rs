//! `palpate encode`: commands for the device as frames.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::text;
use palpate_wire::{Command, Message, Sequencer, encode};

/// Turn commands into frames on standard output: JSON from standard input, one command a line, or
/// a calibration from a TOML file
#[derive(Args)]
#[command(after_help = "\
A command is an object with its name as the key, or the name alone if it has no fields:
  {\"set_coil\": {\"resistance_ohm\": 0.39, ...}}
  \"arm\"

A calibration file holds the same commands as tables, or as arrays of tables where there are \
several of a kind; they are sent in the order of the device's own answers to get_calibration:
  [set_settings]
  channels = 1
  ...
  [[set_tank]]
  sensor = 0
  ...

docs/protocol.md names every field with unit and range; what is out of range is refused here, with \
exit code 2. A command takes effect only if it is addressed to the device's present run.

Examples:
  echo '\"identify\"' | palpate encode > commands.bin
  palpate encode --calibration calibration.toml --boot 305419896 > commands.bin")]
pub(crate) struct Arguments {
    /// Boot id of the device's present run, from its records; 0 for commands that any run executes
    #[arg(long, default_value_t = 0)]
    boot: u32,
    /// Number of the first command, which its answer repeats
    #[arg(long, default_value_t = 0)]
    sequence: u32,
    /// A calibration, instead of commands from standard input
    #[arg(long, value_name = "FILE.toml")]
    calibration: Option<PathBuf>,
}

/// Names of commands in the order of sending a calibration.
const ORDER: [&str; 16] = [
    "set_settings",
    "set_tank",
    "set_deformation_curve",
    "set_crosstalk",
    "set_springs",
    "set_stiffening",
    "set_stiffening_curve",
    "set_attraction",
    "set_temperature_effect",
    "set_coil",
    "set_current_correction",
    "set_temperature_coefficients",
    "set_tip",
    "set_contact",
    "set_creep",
    "set_calibration_identity",
];

/// Name of standard input in errors.
const STANDARD_INPUT: &str = "standard input";

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let input = arguments.calibration.as_deref();
    let commands = match input {
        Some(file) => calibration(file)?,
        None => from_lines(io::stdin().lock())?,
    };
    if commands.is_empty() {
        return Err(Failure::Input {
            file: input.unwrap_or(Path::new(STANDARD_INPUT)).to_path_buf(),
            line: 1,
            problem: "no command".to_owned(),
            allowed: "one at least".to_owned(),
        });
    }
    let bytes = frames(&commands, arguments.boot, arguments.sequence)?;
    let mut out = io::stdout().lock();
    out.write_all(&bytes)?;
    Ok(out.flush()?)
}

fn frames(commands: &[Command], boot: u32, sequence: u32) -> Result<Vec<u8>, Failure> {
    let mut sequencer = Sequencer::new(boot);
    let mut bytes = Vec::new();
    let mut buffer = [0; Command::MAX_FRAME];
    for (index, command) in (0..).zip(commands) {
        let header = palpate_wire::Header {
            sequence: sequence.wrapping_add(index),
            ..sequencer.stamp(0)
        };
        let frame = encode(&header, command, &mut buffer)
            .map_err(|error| Failure::Refused(format!("{command:?}: {error}")))?;
        bytes.extend(frame);
    }
    Ok(bytes)
}

pub(crate) fn from_lines(from: impl Read) -> Result<Vec<Command>, Failure> {
    let numbered = numbered_lines(from, Path::new(STANDARD_INPUT))?;
    Ok(numbered.into_iter().map(|(_, command)| command).collect())
}

/// Reads commands, one per line, with line numbers from 1. Skips empty lines.
///
/// # Errors
/// With the location of a line that is not a command, or has a value out of range.
pub(crate) fn numbered_lines(
    from: impl Read,
    input: &Path,
) -> Result<Vec<(u64, Command)>, Failure> {
    let text = text::of(from, input)?;
    let mut commands = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        if line.trim().is_empty() {
            continue;
        }
        let command = serde_json::from_str(line).map_err(|error| Failure::Input {
            file: input.to_path_buf(),
            line: number,
            problem: error.to_string(),
            allowed: "a command of docs/protocol.md".to_owned(),
        })?;
        commands.push((number, checked(command, input, number)?));
    }
    Ok(commands)
}

fn checked(command: Command, file: &Path, line: u64) -> Result<Command, Failure> {
    match command.validate() {
        Ok(()) => Ok(command),
        Err(invalid) => Err(Failure::Input {
            file: file.to_path_buf(),
            line,
            problem: invalid.named(command.payload()).to_string(),
            allowed: "a value as in docs/protocol.md".to_owned(),
        }),
    }
}

fn calibration(file: &Path) -> Result<Vec<Command>, Failure> {
    from_toml(&text::of_file(file)?, file)
}

fn from_toml(text: &str, file: &Path) -> Result<Vec<Command>, Failure> {
    let wrong = |line: u64, problem: String, allowed: &str| Failure::Input {
        file: file.to_path_buf(),
        line,
        problem,
        allowed: allowed.to_owned(),
    };
    let document: toml::Table = text.parse().map_err(|error: toml::de::Error| {
        let at = error.span().map_or(0, |span| span.start);
        let before = text.get(..at).unwrap_or_default();
        let line = before.lines().count().max(1) as u64;
        wrong(line, error.message().to_owned(), "TOML")
    })?;
    if let Some(name) = document.keys().find(|name| !ORDER.contains(&name.as_str())) {
        return Err(wrong(line_of(text, name), name.clone(), &ORDER.join(", ")));
    }
    let mut commands = Vec::new();
    for name in ORDER {
        let parts = match document.get(name) {
            Some(toml::Value::Array(parts)) => parts.clone(),
            Some(one) => vec![one.clone()],
            None => continue,
        };
        let line = line_of(text, name);
        for part in parts {
            let command = serde_json::json!({ name: part });
            let command = serde_json::from_value(command)
                .map_err(|error| wrong(line, format!("{name}: {error}"), "docs/protocol.md"))?;
            commands.push(checked(command, file, line)?);
        }
    }
    Ok(commands)
}

/// First line that contains a name.
fn line_of(text: &str, name: &str) -> u64 {
    let found = text.lines().position(|line| line.contains(name));
    found.map_or(1, |index| index as u64 + 1)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use palpate_wire::CommandDecoder;

    use super::*;

    const COIL: &str = "[set_coil]\nresistance_ohm = 0.39\ncopper_capacity_j_per_k = 0.8\n\
        pad_capacity_j_per_k = 60.0\ncopper_to_pad_k_per_w = 2.0\npad_to_ambient_k_per_w = 10.0\n\
        current_uncertainty = 0.0\n\
        [[set_tank]]\nsensor = 0\nchannel = 0\ncapacitance_f = 330e-12\nrest_frequency_hz = 3.06e6\n";

    #[test]
    fn commands_come_out_as_they_went_in() {
        let commands =
            from_lines(&b"\"arm\"\n\n{\"clear_fault\":{\"code\":\"bridge\"}}\n"[..]).unwrap();
        let bytes = frames(&commands, 7, 41).unwrap();
        let mut decoder = CommandDecoder::new();
        let read: Vec<_> = decoder.frames(&bytes).map(Result::unwrap).collect();
        assert_eq!(read.len(), 2);
        assert_eq!((read[1].header.boot_id, read[1].header.sequence), (7, 42));
        assert_eq!(read[0].message, Command::Arm);
    }

    #[test]
    fn a_calibration_is_sent_in_its_order() {
        let commands = from_toml(COIL, Path::new("mine.toml")).unwrap();
        assert!(matches!(
            commands[..],
            [Command::SetTank(_), Command::SetCoil(_)]
        ));
    }

    #[test]
    fn what_is_out_of_range_is_refused_with_its_place() {
        let text = COIL.replace("0.39", "-0.39");
        let error = from_toml(&text, Path::new("mine.toml")).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("mine.toml, line 1"), "{message}");
        let error = from_toml("[set_col]\n", Path::new("mine.toml")).unwrap_err();
        assert!(error.to_string().contains("set_coil"), "{error}");
        assert!(from_lines(&b"\"fly\"\n"[..]).is_err());
    }

    /// Encodes a text as UTF-16 with a byte order mark, as Windows editors do.
    fn utf_16(text: &str) -> Vec<u8> {
        let units = text.encode_utf16();
        [0xFF, 0xFE]
            .into_iter()
            .chain(units.flat_map(u16::to_le_bytes))
            .collect()
    }

    #[test]
    fn a_mark_before_utf_8_is_passed_over_and_other_texts_are_refused_with_their_line() {
        let commands = from_lines(&b"\xEF\xBB\xBF\"arm\"\r\n\"abort\"\r\n"[..]).unwrap();
        assert_eq!(commands, [Command::Arm, Command::Abort]);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.toml");
        fs::write(&file, format!("\u{FEFF}{COIL}")).unwrap();
        assert_eq!(calibration(&file).unwrap().len(), 2);

        fs::write(&file, utf_16(COIL)).unwrap();
        let refused = [
            (calibration(&file), "line 1: it is UTF-16"),
            (from_lines(&utf_16("\"arm\"\n")[..]), "line 1: it is UTF-16"),
            (
                from_lines(&b"\"arm\"\n\"a\xE9\"\n"[..]),
                "line 2: it is not UTF-8",
            ),
        ];
        for (refused, part) in refused {
            let failure = refused.unwrap_err();
            assert!(matches!(failure, Failure::Input { .. }), "{failure:?}");
            let message = failure.to_string();
            assert!(
                message.contains(part) && message.contains("save it as UTF-8"),
                "{message}"
            );
        }
    }

    #[test]
    fn the_number_after_the_greatest_is_zero() {
        let commands = [Command::Arm, Command::Abort];
        let bytes = frames(&commands, 7, u32::MAX).unwrap();
        let mut decoder = CommandDecoder::new();
        let frames = decoder.frames(&bytes).map(Result::unwrap);
        let numbers: Vec<_> = frames.map(|frame| frame.header.sequence).collect();
        assert_eq!(numbers, [u32::MAX, 0]);
    }
}
