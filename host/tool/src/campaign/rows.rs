//! The file of presses, sensor by sensor. It gets its name at the end of the run.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use palpate_cli::failure::Failure;
use palpate_cli::output::OutputFile;
use serde::Serialize;

use super::PlantResult;
use super::press::Press;

/// Until the run is complete its rows are in a journal beside the file, as CSV, which an interrupted run leaves
/// there: an older file stays until then, and a file of Parquet cannot be read before its end is written.
pub(super) struct Rows {
    output: OutputFile,
    journal: PathBuf,
    file: csv::Writer<File>,
    #[cfg(feature = "parquet")]
    parquet: Option<parquet::Rows>,
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
    /// Begins a file; the sensors are drawn from a stack's file.
    pub(super) fn create(path: &Path, stack: &Path) -> Result<Self, Failure> {
        let output = OutputFile::new("--rows", path)?.apart_from(stack)?;
        let is_parquet = path.extension() == Some(OsStr::new("parquet"));
        if is_parquet && cfg!(not(feature = "parquet")) {
            return Err(Failure::Refused(format!(
                "--rows {}: this build cannot write Parquet. Name a file that ends in .csv, or build with the feature \
                 `parquet`.",
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
            #[cfg(feature = "parquet")]
            parquet: is_parquet.then(|| parquet::Rows::to(output.clone())),
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
        #[cfg(feature = "parquet")]
        if let Some(parquet) = &mut self.parquet {
            parquet.keep(rows);
        }
        Ok(())
    }

    /// Completes the file.
    pub(super) fn finish(self) -> Result<(), Failure> {
        drop(self.file);
        #[cfg(feature = "parquet")]
        if let Some(parquet) = self.parquet {
            parquet.write()?;
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

/// The path with this behind its whole name.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

fn unbegun(journal: &Path, reason: io::Error) -> Failure {
    if reason.kind() == io::ErrorKind::AlreadyExists {
        return Failure::Argument(format!(
            "{} is there already, of a run that was interrupted: move it away, or name another file with --rows",
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

#[cfg(feature = "parquet")]
mod parquet {
    use palpate_cli::failure::Failure;
    use palpate_cli::output::OutputFile;
    use serde_json::Value;

    use super::Row;
    use crate::parquet_file::{Head, Kind, ParquetFile};

    /// The columns, in the order of a row's fields.
    const HEADS: [Head<'_>; 13] = [
        head("seed", Kind::Integer(64), ""),
        head("world", Kind::Text, ""),
        head("load", Kind::Text, ""),
        head("true_N_per_m", Kind::Double, "N/m"),
        head("estimate_N_per_m", Kind::Double, "N/m"),
        head("lower_N_per_m", Kind::Double, "N/m"),
        head("upper_N_per_m", Kind::Double, "N/m"),
        head("load_ratio", Kind::Double, "1"),
        head("load_ratio_standard_error", Kind::Double, "1"),
        head("reduced_chi_square", Kind::Double, "1"),
        head("two_state_N_per_m", Kind::Double, "N/m"),
        head("covered", Kind::Bool, ""),
        head("reason", Kind::Text, ""),
    ];

    const fn head(name: &'static str, kind: Kind, unit: &'static str) -> Head<'static> {
        Head {
            name,
            kind,
            unit,
            optional: true,
        }
    }

    /// Rows for a file of Parquet.
    pub(super) struct Rows {
        output: OutputFile,
        rows: Vec<Row>,
    }

    impl Rows {
        pub(super) const fn to(output: OutputFile) -> Self {
            Self {
                output,
                rows: Vec::new(),
            }
        }

        pub(super) fn keep(&mut self, rows: Vec<Row>) {
            self.rows.extend(rows);
        }

        pub(super) fn write(&self) -> Result<(), Failure> {
            let file = file_of(&self.rows).map_err(|reason| {
                let path = self.output.path().display();
                Failure::Refused(format!(
                    "--rows {path}: {reason}. The rows are in {path}.csv."
                ))
            })?;
            self.output.write(file)
        }
    }

    /// The bytes of a file.
    fn file_of(rows: &[Row]) -> Result<Vec<u8>, String> {
        let mut file = ParquetFile::begin(Vec::new(), "press", &HEADS).map_err(text)?;
        for row in rows {
            let row = serde_json::to_value(row).map_err(text)?;
            let cell = |head: &Head<'_>| row.get(head.name).filter(|cell| !cell.is_null()).cloned();
            file.add(HEADS.iter().map(cell).collect::<Vec<Option<Value>>>())
                .map_err(text)?;
        }
        file.finish().map_err(text)
    }

    fn text(error: impl ToString) -> String {
        error.to_string()
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn columns_are_the_fields_of_a_row() {
            let mut csv = csv::Writer::from_writer(Vec::new());
            csv.serialize(Row::default()).unwrap();
            let csv = String::from_utf8(csv.into_inner().unwrap()).unwrap();
            let names = HEADS.map(|head| head.name).join(",");
            assert_eq!(csv.lines().next(), Some(names.as_str()));
        }
    }
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

#[cfg(all(test, feature = "parquet"))]
mod tests {
    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    use ::parquet::record::{Field, RowAccessor};

    use super::*;
    use crate::campaign::press::Claim;
    use crate::campaign::world::World;

    fn press(outcome: Result<Claim, String>) -> Press {
        Press {
            world: World::Hand,
            ratio: 0.5,
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

    /// Writes three rows and returns the folder with what is in it.
    fn written(name: &str, finish: bool) -> (tempfile::TempDir, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        let mut rows = Rows::create(&folder.path().join(name), Path::new("ultrasoft")).unwrap();
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
    fn rows_of_parquet_are_read_back_as_those_of_csv() {
        let (folder, entries) = written("rows.parquet", true);
        assert_eq!(entries, ["rows.parquet"], "the journal is removed");
        let (beside, entries) = written("rows.csv", true);
        assert_eq!(entries, ["rows.csv"]);

        let file = File::open(folder.path().join("rows.parquet")).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let mut csv = csv::Reader::from_path(beside.path().join("rows.csv")).unwrap();
        let heads = csv.headers().unwrap().clone();
        let csv: Vec<csv::StringRecord> = csv.records().map(Result::unwrap).collect();
        let rows: Vec<_> = reader
            .get_row_iter(None)
            .unwrap()
            .map(Result::unwrap)
            .collect();
        assert_eq!((rows.len(), csv.len()), (3, 3));
        for (row, cells) in rows.iter().zip(&csv) {
            let columns = row.get_column_iter().zip(heads.iter().zip(cells));
            for ((name, field), (head, cell)) in columns {
                assert_eq!(name, head);
                let field = match field {
                    Field::Null => String::new(),
                    Field::Str(text) => text.clone(),
                    // As CSV writes it.
                    Field::Double(number) => serde_json::to_string(number).unwrap(),
                    Field::Bool(is) => is.to_string(),
                    Field::ULong(number) => number.to_string(),
                    other => panic!("{name}: {other:?}"),
                };
                assert_eq!(field, *cell, "{name}");
            }
        }
        assert_eq!(rows[0].get_ulong(0).unwrap(), u64::MAX);
        assert_eq!(rows[0].get_double(3).unwrap(), 2_500.062_5);
        let metadata = reader.metadata().file_metadata();
        let units = metadata.key_value_metadata().unwrap().iter();
        let units = units.clone().find(|of| of.key == "units").unwrap();
        assert!(
            units
                .value
                .as_ref()
                .unwrap()
                .contains("\"true_N_per_m\":\"N/m\"")
        );
    }

    #[test]
    fn an_interrupted_run_leaves_its_rows_in_the_journal() {
        let (folder, entries) = written("rows.parquet", false);
        assert_eq!(entries, ["rows.parquet.csv"]);
        let text = fs::read_to_string(folder.path().join("rows.parquet.csv")).unwrap();
        assert_eq!(text.lines().count(), 4, "{text}");
    }
}
