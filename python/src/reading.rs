//! Recordings: their tables, and their estimates computed again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use palpate::library::{compare, nothing_compared};
use palpate::recording::tables::modulus;
use palpate::recording::{Entry, Reader, Recorded};
use palpate_cli::failure::Failure;
use palpate_cli::modulus::DeclaredTip;
use palpate_wire::{Frame, Message, Record as WireRecord};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;

use crate::errors::raised;
use crate::record::Record;
use crate::table::{GrowingTable, Table, as_dict, refused};

/// Tables while records are added, one for each kind of record and one of moduli.
#[derive(Default)]
pub(crate) struct GrowingTables {
    tables: BTreeMap<&'static str, GrowingTable>,
    declared: DeclaredTip,
}

impl GrowingTables {
    pub(crate) fn add(&mut self, recorded: &Recorded) -> Result<(), Failure> {
        let message = &recorded.frame.message;
        let kind = message.name();
        let mut value = serde_json::to_value(message)?;
        let payload = value.get_mut(kind).map(Value::take).unwrap_or_default();
        self.tables
            .entry(kind)
            .or_insert_with(|| GrowingTable::of_kind(kind))
            .add(kind, recorded, &payload);
        if let Some(row) = modulus::row(&mut self.declared, message) {
            self.tables
                .entry(modulus::TABLE)
                .or_insert_with(|| GrowingTable::with(modulus::columns()))
                .add(modulus::TABLE, recorded, &row);
        }
        Ok(())
    }

    pub(crate) fn finish(self) -> PyResult<BTreeMap<&'static str, Table>> {
        let tables = self.tables.into_iter();
        let finished = tables.map(|(kind, table)| Ok((kind, table.finish().map_err(refused)?)));
        finished.collect()
    }
}

/// Reads a recording: its tables by name, and remarks about what could not be read.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, file: PathBuf) -> PyResult<(Bound<'_, PyDict>, Vec<String>)> {
    let (tables, remarks) = py.detach(|| {
        let (tables, remarks) = tables_of(&file).map_err(raised)?;
        Ok::<_, PyErr>((tables.finish()?, remarks))
    })?;
    Ok((as_dict(py, tables)?, remarks))
}

fn tables_of(file: &Path) -> Result<(GrowingTables, Vec<String>), Failure> {
    let mut reader = Reader::open(file)?;
    let mut tables = GrowingTables::default();
    for entry in &mut reader {
        if let Entry::Frame(recorded) = entry {
            tables.add(&recorded)?;
        }
    }
    reader.refuse_empty(file)?;
    Ok((tables, reader.remarks(file)))
}

/// Computes the results in a recording again: estimates and refusals.
#[pyfunction]
pub(crate) fn estimate(py: Python<'_>, file: PathBuf) -> PyResult<Vec<Record>> {
    let computed = py.detach(|| computed_again(&file));
    let records = computed.map_err(raised)?.into_iter();
    let records = records.map(|(frame, matches)| Record::computed(frame, matches));
    Ok(records.collect())
}

fn computed_again(file: &Path) -> Result<Vec<(Frame<WireRecord>, bool)>, Failure> {
    let mut results = Vec::new();
    let mut is_replayed = false;
    compare(file, |compared| {
        for pair in compared {
            let Ok(message) = &pair.replayed else {
                continue;
            };
            is_replayed = true;
            if matches!(message, WireRecord::Estimate(_) | WireRecord::Refusal(_)) {
                let frame = Frame {
                    header: pair.frame.header,
                    message: message.clone(),
                };
                results.push((frame, pair.is_identical() == Some(true)));
            }
        }
    })?;
    if is_replayed {
        Ok(results)
    } else {
        Err(nothing_compared(&[file.display().to_string()]))
    }
}
