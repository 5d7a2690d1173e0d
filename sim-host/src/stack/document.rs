//! Strict TOML reader: an unknown, repeated or missing key, a value of the wrong kind or out of
//! range is an error that names file, line, key and allowed values.

use core::fmt;
use core::ops::Range;
use std::borrow::Cow;

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

impl fmt::Display for FileError {
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

/// A text with its name, which finds lines by offset.
#[derive(Clone, Copy, Debug)]
struct Source<'t> {
    file: &'t str,
    text: &'t str,
}

impl Source<'_> {
    fn line(&self, span: &Range<usize>) -> usize {
        let before = self.text.as_bytes().iter().take(span.start);
        1 + before.filter(|&&byte| byte == b'\n').count()
    }

    fn error(&self, span: &Range<usize>, key: &str, problem: String, allowed: String) -> FileError {
        FileError {
            file: self.file.to_owned(),
            line: self.line(span),
            key: key.to_owned(),
            problem,
            allowed,
        }
    }
}

#[derive(Debug)]
struct TableEntry<'t> {
    key: Cow<'t, str>,
    key_span: Range<usize>,
    value: Spanned<DeValue<'t>>,
}

/// A table that is being read. The allowed keys are given when it is opened, so a misspelt key or
/// one in another unit is reported as unknown, and the right one is not reported as missing.
#[derive(Debug)]
pub struct TableSection<'t> {
    source: Source<'t>,
    /// "", or the name of the section with a dot.
    prefix: String,
    span: Range<usize>,
    entries: Vec<TableEntry<'t>>,
}

impl<'t> TableSection<'t> {
    /// Parses a whole text, with its allowed keys. `file` appears only in messages.
    ///
    /// # Errors
    /// [`FileError`] if the text is not TOML or has an unknown key.
    pub fn parse(file: &'t str, text: &'t str, keys: &[&str]) -> Result<Self, FileError> {
        let source = Source { file, text };
        let table = DeTable::parse(text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            source.error(&span, "", error.message().to_owned(), String::new())
        })?;
        let span = table.span();
        Self::of(source, String::new(), span, table.into_inner(), keys)
    }

    fn of(
        source: Source<'t>,
        prefix: String,
        span: Range<usize>,
        table: DeTable<'t>,
        keys: &[&str],
    ) -> Result<Self, FileError> {
        let entries: Vec<TableEntry<'t>> = table
            .into_iter()
            .map(|(key, value)| TableEntry {
                key_span: key.span(),
                key: key.into_inner(),
                value,
            })
            .collect();
        let section = Self {
            source,
            prefix,
            span,
            entries,
        };
        section.refuse_unknown(keys)?;
        Ok(section)
    }

    /// Refuses the first key that is not allowed.
    fn refuse_unknown(&self, keys: &[&str]) -> Result<(), FileError> {
        let unknown = self
            .entries
            .iter()
            .filter(|entry| !keys.contains(&entry.key.as_ref()));
        match unknown.min_by_key(|entry| entry.key_span.start) {
            None => Ok(()),
            Some(entry) => self.refuse(
                &entry.key_span,
                &entry.key,
                "unknown key".to_owned(),
                keys.join(", "),
            ),
        }
    }

    /// Refuses a table without any of these keys, each given with its allowed values. `remedy` says
    /// where to find all keys.
    ///
    /// # Errors
    /// [`FileError`] with every missing key.
    pub(super) fn require(&self, keys: &[(&str, String)], remedy: &str) -> Result<(), FileError> {
        let missing: Vec<_> = keys.iter().filter(|(key, _)| !self.has(key)).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let names: Vec<_> = missing.iter().map(|(key, _)| *key).collect();
        let allowed = match missing.as_slice() {
            [(_, allowed)] => format!("{allowed}; {remedy}"),
            _ => remedy.to_owned(),
        };
        self.refuse(&self.span, &names.join(", "), "missing".to_owned(), allowed)
    }

    fn full(&self, key: &str) -> String {
        format!("{}{key}", self.prefix)
    }

    fn take(
        &mut self,
        key: &str,
        allowed: impl fmt::Display,
    ) -> Result<Spanned<DeValue<'t>>, FileError> {
        match self.entries.iter().position(|entry| entry.key == key) {
            Some(index) => Ok(self.entries.swap_remove(index).value),
            None => Err(self.source.error(
                &self.span,
                &self.full(key),
                "missing".to_owned(),
                allowed.to_string(),
            )),
        }
    }

    fn refuse<T>(
        &self,
        span: &Range<usize>,
        key: &str,
        problem: String,
        allowed: impl fmt::Display,
    ) -> Result<T, FileError> {
        let key = self.full(key);
        Err(self.source.error(span, &key, problem, allowed.to_string()))
    }

    /// A table within this one, with its allowed keys.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, not a table, or has an unknown key.
    pub fn section(&mut self, key: &str, keys: &[&str]) -> Result<Self, FileError> {
        let allowed = format!("a section [{key}]");
        let value = self.take(key, &allowed)?;
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => {
                let prefix = format!("{}{key}.", self.prefix);
                Self::of(self.source, prefix, span, table, keys)
            }
            other => self.refuse(&span, key, kind(&other), allowed),
        }
    }

    /// Whether the table has this key.
    #[must_use]
    pub fn has(&self, key: &str) -> bool {
        self.entries.iter().any(|entry| entry.key == key)
    }

    /// A list of tables, `[[key]]` each, not empty, with the allowed keys of each.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, empty, not a list of tables, or one has an unknown key.
    pub fn sections(&mut self, key: &str, keys: &[&str]) -> Result<Vec<Self>, FileError> {
        let allowed = format!("one section [[{key}]] or more");
        let value = self.take(key, &allowed)?;
        let span = value.span();
        let items = match value.into_inner() {
            DeValue::Array(items) if !items.is_empty() => items,
            other => return self.refuse(&span, key, kind(&other), allowed),
        };
        let section = |item: Spanned<DeValue<'t>>| {
            let span = item.span();
            match item.into_inner() {
                DeValue::Table(table) => {
                    let prefix = format!("{}{key}.", self.prefix);
                    Self::of(self.source, prefix, span, table, keys)
                }
                other => self.refuse(&span, key, kind(&other), &allowed),
            }
        };
        items.into_iter().map(section).collect()
    }

    /// A list of texts, each converted by `parse`.
    ///
    /// # Errors
    /// [`FileError`] with the message of `parse`, or if it is missing or not a list of texts.
    pub fn texts<T>(
        &mut self,
        key: &str,
        allowed: &str,
        parse: impl Fn(&str) -> Result<T, String>,
    ) -> Result<Vec<T>, FileError> {
        let value = self.take(key, allowed)?;
        let span = value.span();
        let items = match value.into_inner() {
            DeValue::Array(items) => items,
            other => return self.refuse(&span, key, kind(&other), allowed),
        };
        let each = |item: &Spanned<DeValue<'t>>| match item.get_ref() {
            DeValue::String(text) => {
                parse(text).or_else(|problem| self.refuse(&item.span(), key, problem, allowed))
            }
            other => self.refuse(&item.span(), key, kind(other), allowed),
        };
        items.iter().map(each).collect()
    }

    /// A number within a range.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, not a number, or out of range.
    pub fn number_within(&mut self, key: &str, allowed: &Allowed) -> Result<f64, FileError> {
        let value = self.take(key, allowed.bounds())?;
        let span = value.span();
        let number = self.number(&span, key, value.get_ref(), allowed.bounds())?;
        match Quantity::Fixed(number).check(allowed) {
            Ok(()) => Ok(number),
            Err(problem) => self.refuse(&span, key, problem, allowed.bounds()),
        }
    }

    /// A text that is not empty and has no control character.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, empty, not a text, or has a control character.
    pub fn text(&mut self, key: &str) -> Result<String, FileError> {
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
        &mut self,
        key: &str,
        allowed: &str,
        parse: impl FnOnce(&str) -> Result<T, String>,
    ) -> Result<T, FileError> {
        let value = self.take(key, allowed)?;
        let span = value.span();
        match value.get_ref() {
            DeValue::String(text) => {
                parse(text).or_else(|problem| self.refuse(&span, key, problem, allowed))
            }
            other => self.refuse(&span, key, kind(other), allowed),
        }
    }

    /// A quantity in any of the forms of [`Quantity`], within a range.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, in no such form, or extends out of the range.
    pub fn quantity(&mut self, key: &str, allowed: &Allowed) -> Result<Quantity, FileError> {
        let value = self.take(key, allowed)?;
        let span = value.span();
        let quantity = match value.into_inner() {
            DeValue::Table(table) => self.range(key, span.clone(), table, allowed)?,
            other => Quantity::Fixed(self.number(&span, key, &other, allowed)?),
        };
        quantity
            .check(allowed)
            .or_else(|problem| self.refuse(&span, key, problem, allowed))?;
        Ok(quantity)
    }

    /// A list of numbers, not empty, each within a range.
    ///
    /// # Errors
    /// [`FileError`] if it is missing, empty, not a list of numbers, or one is out of range.
    pub fn numbers(&mut self, key: &str, allowed: &Allowed) -> Result<Vec<f64>, FileError> {
        let list = format!("a list of numbers, each {}", allowed.bounds());
        let value = self.take(key, &list)?;
        let span = value.span();
        let items = match value.into_inner() {
            DeValue::Array(items) if !items.is_empty() => items,
            other => return self.refuse(&span, key, kind(&other), list),
        };
        items
            .iter()
            .map(|item| {
                let number = self.number(&item.span(), key, item.get_ref(), &list)?;
                Quantity::Fixed(number)
                    .check(allowed)
                    .or_else(|problem| self.refuse(&item.span(), key, problem, &list))?;
                Ok(number)
            })
            .collect()
    }

    /// Parses the forms `{ nominal, spread }`, `{ min, max }` and `{ log_min, log_max }`.
    fn range(
        &self,
        key: &str,
        span: Range<usize>,
        table: DeTable<'t>,
        allowed: &Allowed,
    ) -> Result<Quantity, FileError> {
        let number = |name: &str| {
            let found = table.iter().find(|(key, _)| key.get_ref() == name);
            found.map(|(_, value)| self.number(&value.span(), key, value.get_ref(), allowed))
        };
        let pair = |first: &str, second: &str| match (table.len(), number(first), number(second)) {
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
        let keys: Vec<&str> = table.keys().map(|key| key.get_ref().as_ref()).collect();
        let problem = format!("unknown form {{ {} }}", keys.join(", "));
        self.refuse(&span, key, problem, allowed)
    }

    fn number(
        &self,
        span: &Range<usize>,
        key: &str,
        value: &DeValue<'_>,
        allowed: impl fmt::Display,
    ) -> Result<f64, FileError> {
        let number = match value {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok(),
            _ => None,
        };
        match number {
            Some(number) => Ok(number),
            None => self.refuse(span, key, kind(value), allowed),
        }
    }
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
