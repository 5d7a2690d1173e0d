//! `palpate words`: conversion words to frequencies, with uncertainty and verdict.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use clap::Args;
use comfy_table::{CellAlignment, Table, presets};
use ldc161x::{
    Code28, Hypothesis, PlausibilityCount, Quality, Rational, Rcount, Reading, Scale, Word,
};
use palpate_cli::failure::Failure;
use palpate_cli::notice::printable;
use palpate_cli::text;
use serde::Serialize;

/// Decode LDC161x conversion words: frequency, standard uncertainty, and the ratio of counts
/// M/N, where the word is one.
#[derive(Args)]
#[command(after_help = "\
The file is CSV with the columns source, fref_hz, rcount, kind and value, in any order; \
lines that begin with # are comments. kind is `word` (value: DATAx in \
hexadecimal behind 0x, with or without its error flags) or `hz` (value: a frequency from which the word is recovered).

Example:
  palpate words docs/examples/words.csv --json")]
pub struct Arguments {
    /// The file to decode
    file: PathBuf,
    /// Print a JSON array instead of a table
    #[arg(long)]
    json: bool,
}

const COLUMNS: [&str; 5] = ["source", "fref_hz", "rcount", "kind", "value"];
/// Allowed reference frequencies, Hz: from the slowest clock (2 MHz) over the largest divider to
/// the fastest internal oscillator.
const REFERENCE_HZ: std::ops::RangeInclusive<f64> = 1_955.0..=55e6;

/// One decoded word.
#[derive(Debug, Serialize)]
struct WordRow {
    source: String,
    fref_hz: f64,
    rcount: u16,
    word: String,
    frequency_hz: f64,
    sigma_hz: f32,
    m: u32,
    n: u32,
    residual_lsb: f32,
    /// Whether the word is plausible; `None` for a sensor too slow for a verdict, and for a word
    /// without a result.
    plausible: Option<bool>,
    /// Probability that a random word is called plausible.
    false_accept: f32,
    /// Verdict from flags and value.
    quality: Quality,
    /// Whether the frequency is at or above a quarter of the reference, outside the chip's stated
    /// limit.
    above_quarter_reference: bool,
}

/// Runs the verb.
///
/// # Errors
/// Refusals and failures, with a remedy.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let rows = decode_file(&arguments.file)?;
    let mut out = io::stdout().lock();
    if arguments.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        writeln!(out)?;
    } else {
        writeln!(out, "{}", table(&rows))?;
        writeln!(out, "{}", summary(&rows))?;
    }
    Ok(())
}

fn decode_file(path: &Path) -> Result<Vec<WordRow>, Failure> {
    let text = text::of_file(path)?;
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(text.as_bytes());
    let header = reader
        .headers()
        .map_err(|error| csv_failure(path, &error))?
        .clone();
    let columns = Columns::find(path, &header)?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| csv_failure(path, &error))?;
        // The line is found only on an error, since counting lines reads the text up to the record.
        let fail = |(problem, allowed): (String, String)| Failure::Input {
            file: path.to_owned(),
            line: (record.position()).map_or(0, |place| line_from(&text, place.byte())),
            problem,
            allowed,
        };
        if record.len() != header.len() {
            return Err(fail((
                format!("{} fields", record.len()),
                format!("{} fields, as in the header", header.len()),
            )));
        }
        rows.push(decode_record(&columns, &record).map_err(fail)?);
    }
    if rows.is_empty() {
        return Err(Failure::Input {
            file: path.to_owned(),
            line: 2,
            problem: "no words".into(),
            allowed: "at least one line below the header".into(),
        });
    }
    Ok(rows)
}

/// Line of the record at or behind a byte. The CSV reader's own count is one too small where lines
/// end with two characters.
fn line_from(text: &str, byte: u64) -> u64 {
    let start = text.get(byte as usize..).unwrap_or_default();
    let blank = start.len() - start.trim_start().len();
    let before = text.get(..byte as usize + blank).unwrap_or(text);
    1 + before.matches('\n').count() as u64
}

fn csv_failure(path: &Path, error: &csv::Error) -> Failure {
    match error.kind() {
        csv::ErrorKind::Io(reason) => Failure::Unreadable {
            file: path.to_owned(),
            reason: io::Error::new(reason.kind(), reason.to_string()),
        },
        _ => Failure::Input {
            file: path.to_owned(),
            line: error.position().map_or(1, csv::Position::line),
            problem: error.to_string(),
            allowed: "text in UTF-8".into(),
        },
    }
}

/// Indices of the five columns in a file.
struct Columns([usize; 5]);

impl Columns {
    fn find(path: &Path, header: &csv::StringRecord) -> Result<Self, Failure> {
        let fail = |problem: String| Failure::Input {
            file: path.to_owned(),
            line: header.position().map_or(1, csv::Position::line).max(1),
            problem,
            allowed: format!("the columns {}, each once", COLUMNS.join(", ")),
        };
        if header.is_empty() {
            return Err(fail("no header: the file is empty".into()));
        }
        if let Some(unknown) = header.iter().find(|name| !COLUMNS.contains(name)) {
            return Err(fail(format!("unknown column '{unknown}'")));
        }
        let mut places = [0; 5];
        for (slot, name) in places.iter_mut().zip(COLUMNS) {
            let mut found = header
                .iter()
                .enumerate()
                .filter(|(_, column)| *column == name);
            let Some((index, _)) = found.next() else {
                return Err(fail(format!("column '{name}' is missing")));
            };
            if found.next().is_some() {
                return Err(fail(format!("column '{name}' stands twice")));
            }
            *slot = index;
        }
        Ok(Self(places))
    }

    fn fields<'a>(&self, record: &'a csv::StringRecord) -> [&'a str; 5] {
        self.0.map(|index| record.get(index).unwrap_or_default())
    }
}

/// Problem of a field, and the allowed values.
type FieldError = (String, String);

fn decode_record(columns: &Columns, record: &csv::StringRecord) -> Result<WordRow, FieldError> {
    let [source, fref_hz, rcount, kind, value] = columns.fields(record);
    let fref_hz = reference(fref_hz)?;
    let rcount = reference_count(rcount)?;
    let word = word(kind, value, fref_hz)?;
    let code = word.code();
    let scale = Scale::undivided(fref_hz, rcount);
    let ratio = scale.rational(code);
    let reading = Reading {
        word,
        above_quarter_reference: scale.above_quarter_reference(code),
        ..Reading::default()
    };
    Ok(WordRow {
        source: source.into(),
        fref_hz,
        rcount: rcount.get(),
        word: format!("{:#09x}", word.bits()),
        frequency_hz: scale.frequency_hz(code),
        sigma_hz: scale.sigma_hz(code),
        m: ratio.m,
        n: ratio.n,
        residual_lsb: ratio.residual_lsb,
        // An aborted conversion has no complete count, so no verdict.
        plausible: ratio.plausible.filter(|_| !word.flags().watchdog),
        false_accept: ratio.false_accept,
        quality: reading.quality(),
        above_quarter_reference: reading.above_quarter_reference,
    })
}

fn reference(text: &str) -> Result<f64, FieldError> {
    text.parse()
        .ok()
        .filter(|hz| REFERENCE_HZ.contains(hz))
        .ok_or_else(|| {
            let allowed = format!("{} to {} Hz", REFERENCE_HZ.start(), REFERENCE_HZ.end());
            (format!("fref_hz is '{text}'"), allowed)
        })
}

fn reference_count(text: &str) -> Result<Rcount, FieldError> {
    text.parse().ok().and_then(Rcount::new).ok_or_else(|| {
        (
            format!("rcount is '{text}'"),
            format!("a whole number, {} to 65535", Rcount::MIN.get()),
        )
    })
}

fn word(kind: &str, value: &str, fref_hz: f64) -> Result<Word, FieldError> {
    match kind {
        "word" => value
            .strip_prefix("0x")
            .or_else(|| value.strip_prefix("0X"))
            // `from_str_radix` alone would accept a sign.
            .filter(|digits| digits.bytes().all(|byte| byte.is_ascii_hexdigit()))
            .and_then(|digits| u32::from_str_radix(digits, 16).ok())
            .map(Word::from_bits)
            .ok_or_else(|| {
                (
                    format!("value is '{value}'"),
                    "DATAx in hexadecimal behind 0x, 0x0 to 0xffffffff: a word of 28 bits, and above it its error flags"
                        .into(),
                )
            }),
        "hz" => value
            .parse()
            .ok()
            .filter(|hz: &f64| hz.is_finite() && *hz >= 0.0 && *hz < fref_hz)
            .and_then(|hz| Code28::new((hz / fref_hz * f64::from(1 << 28)).round() as u32))
            .map(|code| Word::from_bits(code.get()))
            .ok_or_else(|| {
                (
                    format!("value is '{value}'"),
                    format!("a frequency from 0 to below fref_hz, {fref_hz} Hz"),
                )
            }),
        _ => Err((format!("kind is '{kind}'"), "word or hz".into())),
    }
}

fn table(rows: &[WordRow]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header([
        "source",
        "word",
        "frequency/Hz",
        "sigma/Hz",
        "M",
        "N",
        "residual/LSB",
        "M/N",
        "note",
    ]);
    for row in rows {
        table.add_row([
            printable(&row.source),
            row.word.clone(),
            format!("{:.3}", row.frequency_hz),
            format!("{:.2}", row.sigma_hz),
            row.m.to_string(),
            row.n.to_string(),
            format!("{:+.2}", row.residual_lsb),
            match row.plausible {
                Some(true) => "plausible",
                Some(false) => "implausible",
                None => "not judged",
            }
            .into(),
            note(row.quality).into(),
        ]);
    }
    for column in table.column_iter_mut().skip(2).take(5) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn note(quality: Quality) -> &'static str {
    match quality {
        Quality::UnderRange => "under range, or no result",
        Quality::OverRange => "over range",
        Quality::Watchdog => "given up by the watchdog",
        Quality::AboveQuarterReference => "above fref/4",
        Quality::Amplitude => "amplitude",
        Quality::Good | Quality::AfterGap | Quality::Repeated | Quality::Differs => "",
    }
}

/// Summarises whether the words of this file are ratios of counts.
fn summary(rows: &[WordRow]) -> String {
    let mut count = PlausibilityCount::default();
    for row in rows {
        count.add(&Rational {
            m: row.m,
            n: row.n,
            residual_lsb: row.residual_lsb,
            plausible: row.plausible,
            false_accept: row.false_accept,
        });
    }
    let verdict = match count.hypothesis() {
        Hypothesis::Holds => "these words are ratios of counts: an implausible one is corrupt",
        Hypothesis::Fails => "these words are not ratios of counts: the verdicts mean nothing",
        Hypothesis::Undecided => "too few words, or too long conversions, to judge the verdicts",
    };
    format!(
        "\n{} of {} words plausible, {:.2} expected by chance: {verdict}.",
        count.plausible, count.words, count.expected_by_chance
    )
}
