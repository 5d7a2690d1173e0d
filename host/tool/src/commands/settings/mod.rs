//! `palpate settings`: read, change, store, export and import a board's settings and calibration.

pub(crate) mod change;
mod file;
mod tip;

use std::io::{self, Write};
use std::path::PathBuf;

use change::Assignment;
use clap::{Args, Subcommand};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use palpate_cli::confirmation::{can_be_confirmed, is_confirmed};
use palpate_cli::failure::Failure;
use palpate_wire::Command;
use palpate_wire::command::Settings;
use palpate_wire::record::Storage;
use serde::Serialize;

use crate::board::configuration;
use crate::board::link::{self, Link};
use crate::board::storage;

/// Read, change, store, export and import a board's settings and calibration
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Get(Get),
    Set(Set),
    Store(Store),
    Erase(Erase),
    Export(Export),
    Import(Import),
    Tip(tip::TipArguments),
}

/// Print all active settings, and whether they are stored
#[derive(Args)]
#[command(after_help = "\
Example:
  palpate settings get --board emulated")]
struct Get {
    #[command(flatten)]
    link: link::Arguments,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Change some settings; all others stay
#[derive(Args)]
#[command(after_help = "\
The change is active at once, and lost at power-off unless it is stored. `palpate settings get` lists \
names, units and what is allowed. Exit code 2 for a name or value that is not allowed, 1 if the board \
refuses it.

Example:
  palpate settings set rate_hz=500 drift=linear --store")]
struct Set {
    #[command(flatten)]
    link: link::Arguments,
    /// Settings with their new values
    #[arg(required = true, value_name = "NAME=VALUE", value_parser = change::assignment)]
    assignments: Vec<Assignment>,
    /// Store the active configuration afterwards
    #[arg(long)]
    store: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Store the active settings and calibration, so that they survive power-off
#[derive(Args)]
#[command(after_help = "\
Example:
  palpate settings store")]
struct Store {
    #[command(flatten)]
    link: link::Arguments,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Erase what is stored, the calibration included
#[derive(Args)]
#[command(after_help = "\
The active configuration stays until the board restarts. Export it first: an erased calibration cannot \
be restored.

Example:
  palpate settings export board.jsonl && palpate settings erase")]
struct Erase {
    #[command(flatten)]
    link: link::Arguments,
    /// Erase without asking
    #[arg(long)]
    yes: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Write the active settings and calibration to a file
#[derive(Args)]
#[command(after_help = "\
The file has a command on each line, as `palpate encode` takes them: the settings if any were set, \
each active part of the calibration, and its identity.

Example:
  palpate settings export board.jsonl")]
struct Export {
    #[command(flatten)]
    link: link::Arguments,
    /// The file, which is replaced if it exists
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Activate settings and calibration of a file
#[derive(Args)]
#[command(after_help = "\
The board must have exactly the file's configuration afterwards: its configuration_crc is compared. An \
active part that is not in the file is named; to remove it, erase and restart the board.

Example:
  palpate settings import board.jsonl --store")]
struct Import {
    #[command(flatten)]
    link: link::Arguments,
    /// A file that `palpate settings export` has written
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Store the active configuration afterwards
    #[arg(long)]
    store: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.what {
        What::Get(arguments) => get(arguments),
        What::Set(arguments) => set(arguments),
        What::Store(arguments) => store(arguments),
        What::Erase(arguments) => erase(arguments),
        What::Export(arguments) => file::export(&arguments.link, &arguments.file, arguments.json),
        What::Import(arguments) => file::import(
            &arguments.link,
            &arguments.file,
            arguments.store,
            arguments.json,
        ),
        What::Tip(arguments) => tip::run(arguments),
    }
}

/// Configuration in force and storage, as JSON.
#[derive(Serialize)]
struct SettingsLine<'l> {
    simulated: bool,
    settings: &'l Settings,
    storage: &'l Storage,
}

fn get(arguments: &Get) -> Result<(), Failure> {
    let mut link = arguments.link.open()?;
    let settings = configuration::settings(&mut link)?;
    let storage = storage::inspect(&mut link)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        let line = SettingsLine {
            simulated: arguments.link.is_simulated(&link),
            settings: &settings,
            storage: &storage,
        };
        return Ok(writeln!(out, "{}", serde_json::to_string(&line)?)?);
    }
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["setting", "active", "unit", "allowed"]);
    for field in change::fields() {
        table.add_row([
            field.name.to_owned(),
            change::value_of(&settings, field)?,
            change::unit(field).to_owned(),
            change::allowed(field),
        ]);
    }
    writeln!(out, "{table}")?;
    Ok(writeln!(out, "{}", storage::describe(&storage))?)
}

fn set(arguments: &Set) -> Result<(), Failure> {
    let mut link = arguments.link.open()?;
    let [before, after] = change_on(&mut link, &arguments.assignments)?;
    let storage = storage::store_if(arguments.store, &mut link)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        let line = SettingsLine {
            simulated: arguments.link.is_simulated(&link),
            settings: &after,
            storage: &storage,
        };
        return Ok(writeln!(out, "{}", serde_json::to_string(&line)?)?);
    }
    for field in change::fields() {
        let values = [
            change::value_of(&before, field)?,
            change::value_of(&after, field)?,
        ];
        if let [old, new] = &values
            && old != new
        {
            let unit = change::unit_behind(field);
            writeln!(out, "{}: {new}{unit} (was {old}{unit})", field.name)?;
        }
    }
    writeln!(out, "{}", storage::describe(&storage))?;
    if storage.stored_crc != storage.in_force_crc {
        writeln!(out, "{}", storage::lasts(arguments.link.is_emulated()))?;
    }
    Ok(())
}

/// Changes settings of a board; returns those before and after.
pub(crate) fn change_on(
    link: &mut Link,
    assignments: &[Assignment],
) -> Result<[Settings; 2], Failure> {
    let before = configuration::settings(link)?;
    let after = change::changed(&before, assignments)?;
    link.send_accepted(&Command::Disarm)?;
    let done = link.send_accepted(&Command::SetSettings(after.clone()));
    done.map_err(|failure| with_names(failure, assignments))?;
    Ok([before, after])
}

/// Adds the changed settings' names to a refusal, since the board does not report which one it
/// refuses.
fn with_names(failure: Failure, assignments: &[Assignment]) -> Failure {
    let names: Vec<_> = assignments.iter().map(Assignment::name).collect();
    match failure {
        Failure::Refused(reason) => Failure::Refused(format!(
            "{reason} Not changed: {}. All settings are as before",
            names.join(", ")
        )),
        other => other,
    }
}

fn store(arguments: &Store) -> Result<(), Failure> {
    let mut link = arguments.link.open()?;
    link.send_accepted(&Command::Disarm)?;
    let storage = storage::store(&mut link)?;
    print(&storage, arguments.json)
}

fn erase(arguments: &Erase) -> Result<(), Failure> {
    if !arguments.yes {
        can_be_confirmed("erasing")?;
    }
    let mut link = arguments.link.open()?;
    let question = format!(
        "Erase the settings and calibration stored in {}?",
        link.name()
    );
    if !arguments.yes && !is_confirmed(&question)? {
        return Err(Failure::Refused("nothing was erased".to_owned()));
    }
    link.send_accepted(&Command::Disarm)?;
    let storage = storage::erase(&mut link)?;
    print(&storage, arguments.json)
}

fn print(storage: &Storage, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(storage)?)?);
    }
    Ok(writeln!(out, "{}", storage::describe(storage))?)
}
