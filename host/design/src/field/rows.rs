//! CSV rows of a long computation, to standard output or to a file that an interrupted run left.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use palpate_cli::failure::Failure;

/// Writer that flushes every row at once.
pub(super) struct RowFile {
    out: csv::Writer<Box<dyn Write + Send>>,
    path: Option<PathBuf>,
    /// Number of rows, including those of an earlier run.
    pub(super) count: usize,
    /// Whether there are rows and all of them are refusals, with the reason in the last column.
    pub(super) all_refused: bool,
}

impl RowFile {
    /// Creates a writer to standard output, with the column heads.
    pub(super) fn standard_output(heads: &[String]) -> Result<Self, Failure> {
        Self::begun(Box::new(io::stdout()), None, heads)
    }

    /// Opens a file, or creates it. An existing file must have the same heads, and rows that start
    /// with the values of `first` for their index. Drops an incomplete last line.
    pub(super) fn resumed(
        path: &Path,
        heads: &[String],
        first: impl Fn(usize) -> Vec<String>,
    ) -> Result<Self, Failure> {
        let unwritable = |reason| Failure::Unwritable {
            file: path.to_owned(),
            argument: "--out",
            reason,
        };
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(unwritable(error)),
        };
        let complete = text
            .rfind('\n')
            .map_or("", |end| text.get(..=end).unwrap_or(""));
        if complete.is_empty() && heads.join(",").starts_with(&text) {
            let file = File::create(path).map_err(unwritable)?;
            return Self::begun(Box::new(file), Some(path.to_owned()), heads);
        }
        let (count, all_refused) = known(complete, heads, first).ok_or_else(|| Failure::Input {
            file: path.to_owned(),
            line: 1,
            problem: "holds no rows of this sweep".to_owned(),
            allowed: "a new file for --out, or one that the same command began".to_owned(),
        })?;
        let file = OpenOptions::new()
            .append(true)
            .open(path)
            .map_err(unwritable)?;
        file.set_len(complete.len() as u64).map_err(unwritable)?;
        Ok(Self {
            out: csv::Writer::from_writer(Box::new(file)),
            path: Some(path.to_owned()),
            count,
            all_refused,
        })
    }

    fn begun(
        out: Box<dyn Write + Send>,
        path: Option<PathBuf>,
        heads: &[String],
    ) -> Result<Self, Failure> {
        let out = csv::Writer::from_writer(out);
        let mut rows = Self {
            out,
            path,
            count: 0,
            all_refused: false,
        };
        rows.record(heads)?;
        Ok(rows)
    }

    /// Writes a row. Its last column is the reason of a refused point, empty for any other point.
    pub(super) fn write(&mut self, row: &[String]) -> Result<(), Failure> {
        let refused = row.last().is_some_and(|reason| !reason.is_empty());
        self.all_refused = refused && (self.count == 0 || self.all_refused);
        self.count += 1;
        self.record(row)
    }

    fn record(&mut self, row: &[String]) -> Result<(), Failure> {
        let written = self.out.write_record(row).map_err(io::Error::from);
        let written = written.and_then(|()| self.out.flush());
        written.map_err(|error| match &self.path {
            None => Failure::Output(error),
            Some(path) => Failure::Refused(format!(
                "--out {}: {error}. The rows so far are kept: make room, and run the same command again.",
                path.display()
            )),
        })
    }
}

/// Returns the number of rows in a text, and whether all rows are refusals. `None` if they belong
/// to another sweep.
fn known(
    text: &str,
    heads: &[String],
    first: impl Fn(usize) -> Vec<String>,
) -> Option<(usize, bool)> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let same = reader
        .headers()
        .ok()?
        .iter()
        .eq(heads.iter().map(String::as_str));
    let (mut count, mut all_refused) = (0, true);
    for record in reader.records() {
        let record = record.ok().filter(|_| same)?;
        let meant = first(count);
        if !meant
            .iter()
            .map(String::as_str)
            .eq(record.iter().take(meant.len()))
        {
            return None;
        }
        all_refused &= record
            .iter()
            .next_back()
            .is_some_and(|reason| !reason.is_empty());
        count += 1;
    }
    same.then_some((count, count > 0 && all_refused))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(words: &[&str]) -> Vec<String> {
        words.iter().map(|&word| word.to_owned()).collect()
    }

    #[test]
    fn an_interrupted_file_is_gone_on_with() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.csv");
        let heads = text(&["gap", "mean", "refused"]);
        let first = |row: usize| vec![row.to_string()];
        std::fs::write(&path, "gap,mean,refused\n0,,no gap\n1,2.5").unwrap();
        let mut rows = RowFile::resumed(&path, &heads, first).unwrap();
        assert_eq!((rows.count, rows.all_refused), (1, true));
        rows.write(&text(&["1", "2.5", ""])).unwrap();
        assert!(!rows.all_refused);
        drop(rows);
        let whole = std::fs::read_to_string(&path).unwrap();
        assert_eq!(whole, "gap,mean,refused\n0,,no gap\n1,2.5,\n");
        // The file of another sweep is not changed.
        assert!(RowFile::resumed(&path, &heads, |row| vec![(row + 5).to_string()]).is_err());
        assert!(RowFile::resumed(&path, &text(&["gap"]), first).is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), whole);
    }
}
