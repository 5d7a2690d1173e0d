//! File of presses, sensor by sensor. It gets its name at the end of the run.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use serde::Serialize;
use serde_json::Value;

use super::press::{PlantResult, Press};

/// Writer of the rows. During a run the rows go to a journal in CSV beside the file, since a
/// Parquet file is unreadable without its end. An interrupted run leaves the journal and any older
/// file.
pub(super) struct Rows {
    output: OutputFile,
    journal: PathBuf,
    file: csv::Writer<File>,
    parquet: Option<Parquet>,
}

/// Function that writes rows as Parquet. Each row is an object with the columns of the CSV as keys.
pub type WriteParquet = fn(&[Value]) -> Result<Vec<u8>, String>;

/// Rows for a Parquet file.
struct Parquet {
    write: WriteParquet,
    rows: Vec<Value>,
}

/// A row of the file: a press, or a sensor that could not be calibrated.
#[derive(Clone, Default, Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct Row {
    seed: u64,
    world: String,
    load: String,
    true_N_per_m: Option<f64>,
    estimate_N_per_m: Option<f64>,
    lower_N_per_m: Option<f64>,
    upper_N_per_m: Option<f64>,
    load_ratio: Option<f64>,
    load_ratio_standard_error: Option<f64>,
    reduced_chi_square: Option<f64>,
    two_state_N_per_m: Option<f64>,
    covered: Option<bool>,
    reason: Option<String>,
}

impl Rows {
    /// Starts a file; `stack` is the file of the sensor design, which must not be replaced.
    pub(super) fn create(
        path: &Path,
        stack: &Path,
        parquet: Option<WriteParquet>,
    ) -> Result<Self, Failure> {
        let output = OutputFile::new("--rows", path)?.apart_from(stack)?;
        let is_parquet = path.extension() == Some(OsStr::new("parquet"));
        if is_parquet && parquet.is_none() {
            return Err(Failure::Refused(format!(
                "--rows {}: this program cannot write Parquet. Name a file that ends in .csv, or run `palpate campaign`.",
                path.display()
            )));
        }
        let (journal, file) = if output.is_special() && !is_parquet {
            (path.to_path_buf(), File::options().write(true).open(path))
        } else {
            let journal = beside(path, if is_parquet { ".csv" } else { ".partial" });
            let file = File::create_new(&journal);
            (journal, file)
        };
        let file = file.map_err(|reason| unbegun(&journal, reason))?;
        Ok(Self {
            parquet: parquet.filter(|_| is_parquet).map(|write| Parquet {
                write,
                rows: Vec::new(),
            }),
            output,
            journal,
            file: csv::Writer::from_writer(file),
        })
    }

    pub(super) fn write(&mut self, seed: u64, plant: &PlantResult) -> Result<(), Failure> {
        let rows = match plant {
            Ok(presses) => presses.iter().map(|press| Row::of(seed, press)).collect(),
            Err(reason) => vec![Row {
                seed,
                reason: Some(reason.clone()),
                ..Row::default()
            }],
        };
        rows.iter()
            .try_for_each(|row| self.file.serialize(row))
            .and_then(|()| Ok(self.file.flush()?))
            .map_err(|error| unwritten(&self.journal, &error))?;
        if let Some(parquet) = &mut self.parquet {
            let rows = rows.iter().map(serde_json::to_value);
            parquet
                .rows
                .extend(rows.collect::<Result<Vec<Value>, _>>()?);
        }
        Ok(())
    }

    /// Completes the file.
    pub(super) fn finish(self) -> Result<(), Failure> {
        drop(self.file);
        if let Some(parquet) = self.parquet {
            let file = (parquet.write)(&parquet.rows).map_err(|reason| {
                let path = self.output.path().display();
                Failure::Refused(format!(
                    "--rows {path}: {reason}. The rows are in {path}.csv."
                ))
            })?;
            self.output.write(file)?;
            return fs::remove_file(&self.journal).map_err(|error| {
                Failure::Refused(format!(
                    "{}: {error}. The file of Parquet is complete; remove this one.",
                    self.journal.display()
                ))
            });
        }
        if self.output.is_special() {
            return Ok(());
        }
        let named = fs::rename(&self.journal, self.output.target());
        named.map_err(|error| unwritten(&self.journal, &error))
    }
}

/// Appends an ending to the whole name of a path.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

fn unbegun(journal: &Path, reason: io::Error) -> Failure {
    if reason.kind() == io::ErrorKind::AlreadyExists {
        return Failure::Argument(format!(
            "{} exists already, from an interrupted run: move it away, or name another file with --rows",
            journal.display()
        ));
    }
    Failure::Unwritable {
        file: journal.to_path_buf(),
        argument: "--rows",
        reason,
    }
}

fn unwritten(path: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::Refused(format!(
        "--rows {}: {error}. It has the sensors before this one.",
        path.display()
    ))
}

impl Row {
    fn of(seed: u64, press: &Press) -> Self {
        let truth = press.true_n_per_m;
        let claim = press.outcome.as_ref().ok();
        Self {
            seed,
            world: press.world.name(),
            load: press.load(),
            true_N_per_m: truth.is_finite().then_some(truth),
            estimate_N_per_m: claim.and_then(|claim| claim.estimate_n_per_m),
            lower_N_per_m: claim.map(|claim| claim.lower_n_per_m),
            upper_N_per_m: claim.and_then(|claim| claim.upper_n_per_m),
            load_ratio: claim.map(|claim| claim.load_ratio),
            load_ratio_standard_error: claim.map(|claim| claim.load_ratio_standard_error),
            reduced_chi_square: claim.and_then(|claim| claim.reduced_chi_square),
            two_state_N_per_m: claim.and_then(|claim| claim.two_state_n_per_m),
            covered: claim.map(|claim| claim.holds(truth)),
            reason: press.outcome.as_ref().err().cloned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::press::Claim;
    use crate::campaign::world::World;

    fn press(outcome: Result<Claim, String>) -> Press {
        Press {
            world: World::Hand,
            ratio: 0.5,
            true_ratio: 0.45,
            true_n_per_m: 2_500.062_5,
            outcome,
        }
    }

    fn claim() -> Claim {
        Claim {
            estimate_n_per_m: Some(2_400.25),
            lower_n_per_m: 2_300.125,
            upper_n_per_m: None,
            load_ratio: 2.25,
            load_ratio_standard_error: 0.062_5,
            reduced_chi_square: Some(1.5),
            two_state_n_per_m: Some(-0.1),
        }
    }

    /// Replacement of a Parquet writer.
    fn as_json(rows: &[Value]) -> Result<Vec<u8>, String> {
        serde_json::to_vec(rows).map_err(|error| error.to_string())
    }

    /// Writes three rows. Returns the folder and its entries.
    fn written(name: &str, finish: bool) -> (tempfile::TempDir, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        let mut rows = Rows::create(&path, Path::new("ultrasoft"), Some(as_json)).unwrap();
        let presses = vec![press(Ok(claim())), press(Err("misfit: 2".to_owned()))];
        rows.write(u64::MAX, &Ok(presses)).unwrap();
        rows.write(7, &Err("supply_low".to_owned())).unwrap();
        if finish {
            rows.finish().unwrap();
        }
        let mut entries: Vec<String> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        entries.sort();
        (folder, entries)
    }

    #[test]
    fn rows_for_parquet_are_those_of_csv() {
        let (folder, entries) = written("rows.parquet", true);
        assert_eq!(entries, ["rows.parquet"], "the journal is removed");
        let (beside, entries) = written("rows.csv", true);
        assert_eq!(entries, ["rows.csv"]);
        let rows = fs::read(folder.path().join("rows.parquet")).unwrap();
        let rows: Vec<Value> = serde_json::from_slice(&rows).unwrap();
        let mut csv = csv::Reader::from_path(beside.path().join("rows.csv")).unwrap();
        let heads = csv.headers().unwrap().clone();
        let csv: Vec<csv::StringRecord> = csv.records().map(Result::unwrap).collect();
        assert_eq!((rows.len(), csv.len(), heads.len()), (3, 3, 13));
        for (row, cells) in rows.iter().zip(&csv) {
            for (head, cell) in heads.iter().zip(cells) {
                let value = match &row[head] {
                    Value::Null => String::new(),
                    Value::String(text) => text.clone(),
                    other => other.to_string(),
                };
                assert_eq!(value, *cell, "{head}");
            }
        }
    }

    #[test]
    fn an_interrupted_run_leaves_its_rows_in_the_journal() {
        let (folder, entries) = written("rows.parquet", false);
        assert_eq!(entries, ["rows.parquet.csv"]);
        let text = fs::read_to_string(folder.path().join("rows.parquet.csv")).unwrap();
        assert_eq!(text.lines().count(), 4, "{text}");
    }

    #[test]
    fn without_a_writer_parquet_is_refused() {
        let path = Path::new("rows.parquet");
        let refused = Rows::create(path, Path::new("ultrasoft"), None).err();
        assert!(refused.unwrap().to_string().contains("palpate campaign"));
    }
}
