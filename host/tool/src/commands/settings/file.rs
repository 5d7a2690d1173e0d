//! Configuration files: one command per line.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use palpate_wire::{Command, Message, configuration_crc};
use serde::Serialize;

use crate::board::configuration;
use crate::board::link::{self, Link};
use crate::board::storage;
use crate::commands::encode;

/// JSON output of an export or import.
#[derive(Serialize)]
struct SettingsFileLine {
    simulated: bool,
    file: String,
    commands: usize,
    configuration_crc: u32,
    /// Whether the configuration is stored in the board.
    stored: bool,
}

/// Writes the configuration in force.
pub(super) fn export(board: &link::Arguments, file: &Path, json: bool) -> Result<(), Failure> {
    let output = OutputFile::new("FILE", file)?;
    let mut link = board.open()?;
    let commands = configuration::read(&mut link)?;
    let lines: Result<Vec<_>, _> = commands.iter().map(serde_json::to_string).collect();
    let lines = lines?.into_iter().map(|line| line + "\n");
    output.write(lines.collect::<String>())?;
    let storage = storage::inspect(&mut link)?;
    let line = SettingsFileLine {
        simulated: board.is_simulated(&link),
        file: file.display().to_string(),
        commands: commands.len(),
        configuration_crc: storage.in_force_crc,
        stored: storage.stored_crc == storage.in_force_crc,
    };
    print(&line, "is written to", json)
}

/// Puts a file's configuration in force.
pub(super) fn import(
    board: &link::Arguments,
    file: &Path,
    store: bool,
    json: bool,
) -> Result<(), Failure> {
    let commands = read(file)?;
    let mut link = board.open()?;
    let done = put_in_force(&mut link, &commands);
    if let Err(failure) = done {
        // Puts the stored configuration in force again.
        let _ = link.ask(&Command::Load);
        return Err(failure);
    }
    let storage = storage::store_if(store, &mut link)?;
    let line = SettingsFileLine {
        simulated: board.is_simulated(&link),
        file: file.display().to_string(),
        commands: commands.len(),
        configuration_crc: storage.in_force_crc,
        stored: storage.stored_crc == storage.in_force_crc,
    };
    print(&line, "is active, from", json)
}

/// Reads the commands of a file, in the order of a configuration.
fn read(file: &Path) -> Result<Vec<Command>, Failure> {
    let opened = File::open(file).map_err(|reason| Failure::Unreadable {
        file: PathBuf::from(file),
        reason,
    })?;
    let numbered = encode::numbered_lines(opened, file)?;
    let mut commands = Vec::new();
    for (line, command) in numbered {
        let Some(place) = configuration::place(&command) else {
            return Err(Failure::Input {
                file: file.to_path_buf(),
                line,
                problem: format!("{} sets nothing", command.name()),
                allowed: "commands whose names begin with set_".to_owned(),
            });
        };
        commands.push((place, command));
    }
    if commands.is_empty() {
        return Err(Failure::Input {
            file: file.to_path_buf(),
            line: 1,
            problem: "it has no command".to_owned(),
            allowed: "what `palpate settings export` writes".to_owned(),
        });
    }
    commands.sort_by_key(|(place, _)| *place);
    Ok(commands.into_iter().map(|(_, command)| command).collect())
}

fn put_in_force(link: &mut Link, commands: &[Command]) -> Result<(), Failure> {
    link.send_accepted(&Command::Disarm)?;
    for command in commands {
        link.send_accepted(command)?;
    }
    let in_force_crc = storage::inspect(link)?.in_force_crc;
    if in_force_crc == configuration_crc(commands) {
        return Ok(());
    }
    let besides = besides(&configuration::read(link)?, commands);
    Err(Failure::Refused(if besides.is_empty() {
        format!(
            "the board has configuration {in_force_crc:08x} and the file {:08x}: the board rounds or \
             omits values of the file. Export it again",
            configuration_crc(commands)
        )
    } else {
        format!(
            "the board has active parts that the file does not have: {}. Erase the stored ones \
             (`palpate settings erase`), restart the board, and import again",
            besides.join(", ")
        )
    }))
}

/// Names of the commands in force that the file does not replace.
fn besides(in_force: &[Command], commands: &[Command]) -> Vec<&'static str> {
    let places: Vec<_> = commands.iter().map(configuration::place).collect();
    let others = in_force.iter();
    let others = others.filter(|command| !places.contains(&configuration::place(command)));
    let mut names: Vec<_> = others.map(Command::name).collect();
    names.dedup();
    names
}

fn print(line: &SettingsFileLine, done: &str, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(line)?)?);
    }
    let stored = if line.stored {
        "It is stored."
    } else {
        "It is not stored: it is lost at power-off."
    };
    Ok(writeln!(
        out,
        "Configuration {:08x} {done} {}. {stored}",
        line.configuration_crc, line.file
    )?)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn read_text(text: &str) -> Result<Vec<Command>, Failure> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("board.jsonl");
        fs::write(&file, text).unwrap();
        read(&file)
    }

    const SPRINGS: &str = r#"{"set_springs":{"sensing_n_per_m":1000.0,"sensing_uncertainty":0.0,"actuated_n_per_m":1000.0,"actuated_uncertainty":0.0,"force_scale_uncertainty":0.0,"zero_uncertainty_m":0.0,"bend":0.0}}"#;
    const TANK: &str = r#"{"set_tank":{"sensor":0,"channel":0,"capacitance_f":3.3e-10,"rest_frequency_hz":3060000.0}}"#;

    #[test]
    fn a_file_is_sent_in_the_order_of_a_configuration() {
        let commands = read_text(&format!("{SPRINGS}\n\n{TANK}\n")).unwrap();
        let names: Vec<_> = commands.iter().map(Command::name).collect();
        assert_eq!(names, ["set_tank", "set_springs"]);
    }

    #[test]
    fn a_command_that_sets_nothing_is_refused_with_its_line() {
        let said = read_text(&format!("{TANK}\n\"arm\"\n")).unwrap_err();
        let said = said.to_string();
        assert!(
            said.contains("line 2") && said.contains("arm sets nothing"),
            "{said}"
        );
    }

    #[test]
    fn what_the_file_lacks_is_named() {
        let all = read_text(&format!("{SPRINGS}\n{TANK}\n")).unwrap();
        let tank = read_text(TANK).unwrap();
        assert_eq!(besides(&all, &tank), ["set_springs"]);
        assert!(besides(&tank, &all).is_empty());
    }
}
