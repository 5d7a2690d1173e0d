//! `palpate faults`: meaning of the board's faults.

use std::io::{self, Write};

use clap::Args;
use comfy_table::presets::NOTHING;
use comfy_table::{ContentArrangement, Table};
use palpate_cli::failure::Failure;
use palpate_wire::code::FaultCode;
use serde::Serialize;

/// Say what a fault of the board means and what to do, or list all faults
#[derive(Args)]
#[command(after_help = "\
docs/faults.md says for each how it is found and cleared.

Examples:
  palpate faults
  palpate faults 12
  palpate faults sensor_not_oscillating")]
pub(crate) struct Arguments {
    /// Number or name of a fault, as the record `fault` has it. Otherwise all
    #[arg(value_name = "CODE|NAME", value_parser = fault)]
    fault: Option<FaultCode>,
    /// Print JSON, one object a line
    #[arg(long)]
    json: bool,
}

/// A line of the JSON output.
#[derive(Serialize)]
struct FaultLine {
    code: u8,
    name: &'static str,
    meaning: String,
}

fn fault(text: &str) -> Result<FaultCode, String> {
    let name = text.to_lowercase().replace('-', "_");
    let is_meant = |code: &&FaultCode| code.name() == name || name.parse() == Ok(code.number());
    FaultCode::ALL
        .iter()
        .find(is_meant)
        .copied()
        .ok_or_else(|| "there is no such fault; `palpate faults` lists all".to_owned())
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let meant = arguments.fault.as_ref().map(std::slice::from_ref);
    print(meant.unwrap_or(FaultCode::ALL), arguments.json)
}

/// Meaning of a fault as one paragraph. The schema contains the line breaks of its source.
pub(crate) fn meaning(code: FaultCode) -> String {
    let lines: Vec<_> = code.meaning().lines().map(str::trim).collect();
    lines.join(" ")
}

fn print(codes: &[FaultCode], json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        for code in codes {
            let line = FaultLine {
                code: code.number(),
                name: code.name(),
                meaning: meaning(*code),
            };
            writeln!(out, "{}", serde_json::to_string(&line)?)?;
        }
        return Ok(());
    }
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_content_arrangement(ContentArrangement::Dynamic);
    for code in codes {
        table.add_row([
            code.number().to_string(),
            code.name().to_owned(),
            meaning(*code),
        ]);
    }
    Ok(writeln!(out, "{table}")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_found_by_number_and_by_name() {
        for code in FaultCode::ALL {
            assert_eq!(fault(code.name()), Ok(*code));
            assert_eq!(fault(&code.number().to_string()), Ok(*code));
        }
        assert_eq!(fault("Sensor-Absent"), Ok(FaultCode::SensorAbsent));
        for text in ["", "0", "256", "sensor"] {
            assert!(fault(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_meaning_is_one_paragraph() {
        let text = meaning(FaultCode::StorageDamaged);
        assert!(text.starts_with("The stored configuration") && !text.contains('\n'));
        assert!(!text.contains("  "), "{text}");
    }
}
