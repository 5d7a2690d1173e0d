//! Strict TOML reader: an unknown, repeated or missing key, a value of the wrong kind or out of
//! range is an error that names file, line, key and allowed values.

use core::fmt::{self, Display};
use core::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::quantity::{Allowed, Quantity};

/// Error in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    /// Name of the file, as its reader gave it.
    pub file: String,
    /// Line, counted from 1.
    pub line: usize,
    /// The key, with its section before a dot; empty if the text is not TOML.
    pub key: String,
    /// Description of the error.
    pub problem: String,
    /// Allowed values; empty for an error of TOML syntax.
    pub allowed: String,
}

impl Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: ", self.file, self.line)?;
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.problem)?;
        if !self.allowed.is_empty() {
            write!(f, "; allowed: {}", self.allowed)?;
        }
        Ok(())
    }
}

impl core::error::Error for FileError {}

/// Text of a file's bytes, without a leading byte order mark. `file` appears only in messages.
///
/// # Errors
/// [`FileError`] with the line at which it is not UTF-8.
pub fn text_of(file: &str, bytes: Vec<u8>) -> Result<String, FileError> {
    let is_utf_16 = bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]);
    let text = String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let before = error.as_bytes().iter().take(valid);
        let encoding = if is_utf_16 {
            "it is UTF-16"
        } else {
            "it is not UTF-8"
        };
        FileError {
            file: file.to_owned(),
            line: 1 + before.filter(|&&byte| byte == b'\n').count(),
            key: String::new(),
            problem: encoding.to_owned(),
            allowed: "UTF-8: save it as UTF-8".to_owned(),
        }
    })?;
    Ok(text.strip_prefix('\u{FEFF}').unwrap_or(&text).to_owned())
}

/// A table of a file.
pub(super) trait Table: Sized {
    /// Names of all its keys; each key is required.
    const NAMES: &'static [&'static str];

    /// Reads the table's values.
    ///
    /// # Errors
    /// [`FileError`] for a value that is missing or refused.
    fn read(table: &TableSection<'_>) -> Result<Self, FileError>;
}

/// A table that is being read. The allowed keys are given when it is opened. A misspelt key, or one
/// in another unit, is therefore reported as unknown before the correct key is reported missing.
#[derive(Debug)]
pub struct TableSection<'t> {
    file: &'t str,
    text: &'t str,
    /// "", or the name of the section with a dot.
    prefix: String,
    span: Range<usize>,
    table: DeTable<'t>,
}

impl<'t> TableSection<'t> {
    /// Parses a whole text, with its allowed keys. `file` appears only in messages.
    ///
    /// # Errors
    /// [`FileError`] if the text is not TOML or has an unknown key.
    pub fn parse(file: &'t str, text: &'t str, keys: &[&str]) -> Result<Self, FileError> {
        let mut section = Self {
            file,
            text,
            prefix: String::new(),
            span: 0..0,
            table: DeTable::new(),
        };
        let table = DeTable::parse(text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            section.error(&span, "", error.message(), "")
        })?;
        section.span = table.span();
        section.table = table.into_inner();
        section.refuse_unknown(keys)?;
        Ok(section)
    }

    /// Refuses the first key that is not allowed.
    fn refuse_unknown(&self, keys: &[&str]) -> Result<(), FileError> {
        let names = self.table.keys();
        let unknown = names.filter(|name| !keys.contains(&name.get_ref().as_ref()));
        match unknown.min_by_key(|name| name.span().start) {
            None => Ok(()),
            Some(name) => {
                Err(self.error(&name.span(), name.get_ref(), "unknown key", keys.join(", ")))
            }
        }
    }

    /// Refuses a table that lacks several of these keys, and names them all. `remedy` says where to
    /// find all keys. A single missing key is refused when it is read, with its range.
    pub(super) fn require(&self, keys: &[&str], remedy: &str) -> Result<(), FileError> {
        let missing = keys.iter().copied().filter(|key| !self.has(key));
        let missing: Vec<&str> = missing.collect();
        if missing.len() < 2 {
            return Ok(());
        }
        Err(self.error(&self.span, &missing.join(", "), "missing", remedy))
    }

    fn error(
        &self,
        span: &Range<usize>,
        key: &str,
        problem: impl Into<String>,
        allowed: impl Display,
    ) -> FileError {
        let before = self.text.as_bytes().iter().take(span.start);
        FileError {
            file: self.file.to_owned(),
            line: 1 + before.filter(|&&byte| byte == b'\n').count(),
            key: format!("{}{key}", self.prefix),
            problem: problem.into(),
            allowed: allowed.to_string(),
        }
    }

    /// Whether the table has this key.
    #[must_use]
    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Reads an optional key; `None` if the key is missing.
    ///
    /// # Errors
    /// [`FileError`] of `read`.
    pub fn if_given<T>(
        &self,
        key: &str,
        read: impl FnOnce(&str) -> Result<T, FileError>,
    ) -> Result<Option<T>, FileError> {
        self.has(key).then(|| read(key)).transpose()
    }

    /// Refuses a key that does not fit the table's other keys.
    ///
    /// # Errors
    /// [`FileError`] if the table has the key.
    pub fn refuse(&self, key: &str, allowed: &str) -> Result<(), FileError> {
        self.if_given(key, |key| {
            self.value(key, allowed, |of| Err::<(), _>(kind(of)))
        })
        .map(drop)
    }

    /// The value of a key, converted by `convert`, whose error is a message.
    fn value<'s, T>(
        &'s self,
        key: &str,
        allowed: impl Display,
        convert: impl FnOnce(&'s DeValue<'t>) -> Result<T, String>,
    ) -> Result<T, FileError> {
        match self.table.get(key) {
            Some(value) => convert(value.get_ref())
                .map_err(|problem| self.error(&value.span(), key, problem, allowed)),
            None => Err(self.error(&self.span, key, "missing", allowed)),
        }
    }

    /// The items of a list, at least `least` of them, each converted by `convert`.
    fn list<'s, T>(
        &'s self,
        key: &str,
        allowed: &str,
        least: usize,
        convert: impl Fn(&'s Spanned<DeValue<'t>>) -> Result<T, String>,
    ) -> Result<Vec<T>, FileError> {
        let items = self.value(key, allowed, |value| match value {
            DeValue::Array(items) if items.len() >= least => Ok(items),
            other => Err(kind(other)),
        })?;
        let each =
            |item| convert(item).map_err(|problem| self.error(&item.span(), key, problem, allowed));
        items.iter().map(each).collect()
    }

    /// A table within this one, with its allowed keys.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, not a table, or has an unknown key.
    pub fn section(&self, key: &str, keys: &[&str]) -> Result<Self, FileError> {
        let table = self.value(key, format!("a section [{key}]"), table)?;
        let span = self.table.get(key).map_or(0..0, Spanned::span);
        self.within(key, span, table, keys)
    }

    /// A table within this one, whose allowed keys its type declares.
    pub(super) fn table<T: Table>(&self, key: &str) -> Result<T, FileError> {
        T::read(&self.section(key, T::NAMES)?)
    }

    /// A list of tables, `[[key]]` each, not empty, with the allowed keys of each.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, empty, not a list of tables, or one has an unknown key.
    pub fn sections(&self, key: &str, keys: &[&str]) -> Result<Vec<Self>, FileError> {
        let allowed = format!("one section [[{key}]] or more");
        let tables = self.list(key, &allowed, 1, |item| {
            Ok((item.span(), table(item.get_ref())?))
        })?;
        let tables = tables.into_iter();
        tables
            .map(|(span, table)| self.within(key, span, table, keys))
            .collect()
    }

    fn within(
        &self,
        key: &str,
        span: Range<usize>,
        table: &DeTable<'t>,
        keys: &[&str],
    ) -> Result<Self, FileError> {
        let section = Self {
            prefix: format!("{}{key}.", self.prefix),
            span,
            table: table.clone(),
            ..*self
        };
        section.refuse_unknown(keys)?;
        Ok(section)
    }

    /// A list of texts, each converted by `parse`.
    ///
    /// # Errors
    /// [`FileError`] with the message of `parse`, or if it is missing or not a list of texts.
    pub fn texts<T>(
        &self,
        key: &str,
        allowed: &str,
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Result<Vec<T>, FileError> {
        self.list(key, allowed, 0, |item| {
            text(item.get_ref()).and_then(&parse)
        })
    }

    /// A number within a range.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, not a number, or out of range.
    pub fn number_within(&self, key: &str, allowed: &Allowed) -> Result<f64, FileError> {
        self.value(key, allowed.bounds(), |value| number_in(value, allowed))
    }

    /// A whole number within a range.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, not a whole number, or out of range.
    pub fn whole_within(&self, key: &str, allowed: &Allowed) -> Result<u32, FileError> {
        let whole = format!("a whole number, {}", allowed.bounds());
        self.value(key, whole, |value| {
            let number = number_in(value, allowed)?;
            if number.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&number) {
                return Err(format!("is {number}"));
            }
            Ok(number as u32)
        })
    }

    /// A list of numbers, not empty, each within a range.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, empty, not a list of numbers, or one is out of range.
    pub fn numbers(&self, key: &str, allowed: &Allowed) -> Result<Vec<f64>, FileError> {
        let list = format!("a list of numbers, each {}", allowed.bounds());
        self.list(key, &list, 1, |item| number_in(item.get_ref(), allowed))
    }

    /// A text that is not empty and has no control character.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, empty, not a text, or has a control character.
    pub fn text(&self, key: &str) -> Result<String, FileError> {
        self.parsed(key, "a text", |text| {
            if text.is_empty() {
                Err("empty".to_owned())
            } else if text.contains(char::is_control) {
                Err("has a control character".to_owned())
            } else {
                Ok(text.to_owned())
            }
        })
    }

    /// A text, converted by `parse`.
    ///
    /// # Errors
    /// [`FileError`] with the message of `parse`, or if it is missing or not a text.
    pub fn parsed<T>(
        &self,
        key: &str,
        allowed: &str,
        parse: impl FnOnce(&str) -> Result<T, String>,
    ) -> Result<T, FileError> {
        self.value(key, allowed, |value| text(value).and_then(parse))
    }

    /// The value for the given name; `choices` has the allowed names with their values.
    ///
    /// # Errors
    /// [`FileError`] if it is missing or none of the names.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)]) -> Result<T, FileError> {
        let names: Vec<String> = choices
            .iter()
            .map(|(name, _)| format!("{name:?}"))
            .collect();
        self.parsed(key, &names.join(" or "), |text| {
            let chosen = choices.iter().find(|(name, _)| *name == text);
            chosen.map_or_else(|| Err(format!("is {text:?}")), |(_, of)| Ok(*of))
        })
    }

    /// A quantity in any of the forms of [`Quantity`], within a range.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, in no such form, or extends out of the range.
    pub fn quantity(&self, key: &str, allowed: &Allowed) -> Result<Quantity, FileError> {
        self.value(key, allowed, |value| {
            let quantity = match value {
                DeValue::Table(table) => range(table)?,
                other => Quantity::Fixed(number(other)?),
            };
            quantity.check(allowed)?;
            Ok(quantity)
        })
    }
}

fn table<'s, 't>(value: &'s DeValue<'t>) -> Result<&'s DeTable<'t>, String> {
    match value {
        DeValue::Table(table) => Ok(table),
        other => Err(kind(other)),
    }
}

fn text<'s>(value: &'s DeValue<'_>) -> Result<&'s str, String> {
    match value {
        DeValue::String(text) => Ok(text),
        other => Err(kind(other)),
    }
}

fn number(value: &DeValue<'_>) -> Result<f64, String> {
    let number = match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok(),
        _ => None,
    };
    number.ok_or_else(|| kind(value))
}

fn number_in(value: &DeValue<'_>, allowed: &Allowed) -> Result<f64, String> {
    let number = number(value)?;
    Quantity::Fixed(number).check(allowed)?;
    Ok(number)
}

/// Reads the forms `{ nominal, spread }`, `{ min, max }` and `{ log_min, log_max }`.
fn range(table: &DeTable<'_>) -> Result<Quantity, String> {
    let of = |name: &str| table.get(name).map(|value| number(value.get_ref()));
    let pair = |first: &str, second: &str| match (table.len(), of(first), of(second)) {
        (2, Some(first), Some(second)) => Some(first.and_then(|first| Ok((first, second?)))),
        _ => None,
    };
    if let Some(pair) = pair("nominal", "spread") {
        return pair.map(|(nominal, spread)| Quantity::Spread { nominal, spread });
    }
    if let Some(pair) = pair("min", "max") {
        return pair.map(|(min, max)| Quantity::Uniform { min, max });
    }
    if let Some(pair) = pair("log_min", "log_max") {
        return pair.map(|(min, max)| Quantity::LogUniform { min, max });
    }
    let names: Vec<&str> = table.keys().map(|key| key.get_ref().as_ref()).collect();
    Err(format!("unknown form {{ {} }}", names.join(", ")))
}

/// Name of a value's kind, for messages about a wrong kind.
fn kind(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("is the text {text:?}"),
        DeValue::Integer(_) => "is an integer".to_owned(),
        DeValue::Float(_) => "is a number".to_owned(),
        DeValue::Boolean(truth) => format!("is {truth}"),
        DeValue::Datetime(_) => "is a date".to_owned(),
        DeValue::Array(items) if items.is_empty() => "is an empty list".to_owned(),
        DeValue::Array(_) => "is a list".to_owned(),
        DeValue::Table(_) => "is a table".to_owned(),
    }
}
