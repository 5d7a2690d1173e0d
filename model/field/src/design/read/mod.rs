//! Strict reader of the TOML file format.

mod beside;
mod dxf;
mod file;
mod loops;
mod parts;
mod table;

use core::cell::RefCell;
use core::ops::Range;
use std::collections::BTreeMap;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::expression::evaluate;
use super::{Core, Design, DesignError, FileRead, Rectangle, check};
use crate::material::Material;
use file::{File, MaterialFile, Number, Pair, SpannedNumber};

const UNITS: &str = "\"m\", \"cm\", \"mm\", \"um\", \"in\"";
const MATERIALS: &str = "{ mu_r }, { mu_r, remanence_T }, { mu_r, saturation_A_per_m }, { initial_mu_r, knee_T, exponent } or { bh_table }";

/// A material as written in the file.
struct ReadMaterial {
    law: Material,
    remanence_t: f64,
    conductivity_s_per_m: f64,
    loss_tangent: f64,
}

impl Design {
    /// Reads a design from its text. `file` names the text in messages; files that the text refers
    /// to are read from the folder of `file`.
    ///
    /// ```
    /// use palpate_field::design::{Design, builtin_text};
    ///
    /// let text = builtin_text("A").unwrap_or_default();
    /// assert_eq!(Design::parse("A.toml", text)?.coils.len(), 4);
    ///
    /// let text = text.replace("length_unit = \"mm\"", "");
    /// let error = Design::parse("mine.toml", &text).unwrap_err().to_string();
    /// assert!(error.contains("length_unit: missing; allowed: \"m\", \"cm\", \"mm\", \"um\", \"in\""), "{error}");
    /// # Ok::<(), palpate_field::design::DesignError>(())
    /// ```
    ///
    /// # Errors
    /// [`DesignError`] with line, key and the allowed values.
    pub fn parse(file: &str, text: &str) -> Result<Self, DesignError> {
        let mut reader = Reader {
            file,
            text,
            metre: 1.0,
            parameters: BTreeMap::new(),
            files: RefCell::default(),
        };
        let parsed: File = toml::from_str(text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            reader.error(&span, "", error.message(), "")
        })?;
        if let Some(span) = control_character(text) {
            return Err(reader.error(&span, "", "has a control character", "texts without"));
        }
        let Some(unit) = &parsed.length_unit else {
            return Err(reader.error(&(0..0), "length_unit", "missing", UNITS));
        };
        reader.metre = reader.unit(unit, "length_unit")?;
        for (name, value) in &parsed.parameters {
            let value = reader.finite(&value.span(), name, *value.get_ref())?;
            reader.parameters.insert(name.clone(), value);
        }
        reader
            .design(parsed)
            .map_err(|error| reader.with_files(error))
    }
}

struct Reader<'t> {
    file: &'t str,
    text: &'t str,
    metre: f64,
    parameters: BTreeMap<String, f64>,
    /// Files that have been read for this design so far.
    files: RefCell<Vec<FileRead>>,
}

/// Location of the first text in a file that contains a control character, which a terminal would
/// interpret; `about` is not checked.
fn control_character(text: &str) -> Option<Range<usize>> {
    let mut table = DeTable::parse(text).ok()?.into_inner();
    table.remove("about");
    in_table(&table)
}

fn in_table(table: &DeTable<'_>) -> Option<Range<usize>> {
    let mut entries = table.iter();
    entries.find_map(|(key, value)| controlling(key, key.get_ref()).or_else(|| within(value)))
}

fn within(value: &Spanned<DeValue<'_>>) -> Option<Range<usize>> {
    match value.get_ref() {
        DeValue::String(text) => controlling(value, text),
        DeValue::Array(items) => items.iter().find_map(within),
        DeValue::Table(table) => in_table(table),
        _ => None,
    }
}

fn controlling<T>(place: &Spanned<T>, text: &str) -> Option<Range<usize>> {
    text.contains(char::is_control).then(|| place.span())
}

/// The unit of length with this name, m.
fn metre(name: &str) -> Option<f64> {
    match name {
        "m" => Some(1.0),
        "cm" => Some(1e-2),
        "mm" => Some(1e-3),
        "um" => Some(1e-6),
        "in" => Some(0.0254),
        _ => None,
    }
}

impl Reader<'_> {
    fn error(
        &self,
        span: &Range<usize>,
        place: &str,
        problem: impl Into<String>,
        allowed: &str,
    ) -> DesignError {
        let before = self.text.as_bytes().iter().take(span.start);
        DesignError {
            file: self.file.to_owned(),
            line: 1 + before.filter(|&&byte| byte == b'\n').count(),
            place: place.to_owned(),
            problem: problem.into(),
            allowed: allowed.to_owned(),
        }
    }

    /// Adds the summaries of the files read to an error message: for example, a drawing in another
    /// unit may cause an overlap.
    fn with_files(&self, mut error: DesignError) -> DesignError {
        for file in self.files.take() {
            if error.file == self.file {
                error.problem.push_str(&format!(" (read of {file})"));
            }
        }
        error
    }

    /// Reads a unit of length, m.
    fn unit(&self, unit: &Spanned<String>, place: &str) -> Result<f64, DesignError> {
        metre(unit.get_ref()).ok_or_else(|| {
            let problem = format!("is {:?}", unit.get_ref());
            self.error(&unit.span(), place, problem, UNITS)
        })
    }

    fn finite(&self, span: &Range<usize>, place: &str, value: f64) -> Result<f64, DesignError> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.error(span, place, format!("is {value}"), "a finite number"))
        }
    }

    fn number(&self, value: &SpannedNumber, place: &str) -> Result<f64, DesignError> {
        let number = match value.get_ref() {
            Number::Value(value) => *value,
            Number::Text(text) => evaluate(text, &self.parameters).map_err(|problem| {
                let names: Vec<&str> = self.parameters.keys().map(String::as_str).collect();
                let allowed = format!("a number, or + - * / ( ) with {}", names.join(", "));
                self.error(&value.span(), place, problem, &allowed)
            })?,
        };
        self.finite(&value.span(), place, number)
    }

    fn within(
        &self,
        value: &SpannedNumber,
        place: &str,
        low: f64,
        high: f64,
    ) -> Result<f64, DesignError> {
        let number = self.number(value, place)?;
        if (low..=high).contains(&number) {
            return Ok(number);
        }
        let allowed = format!("{low:e} to {high:e}");
        Err(self.error(
            &value.span(),
            place,
            format!("{number} is out of range"),
            &allowed,
        ))
    }

    /// Reads a length, m; rejects more than 10 m.
    fn length(&self, value: &SpannedNumber, place: &str) -> Result<f64, DesignError> {
        let metres = self.number(value, place)? * self.metre;
        if metres.abs() <= 10.0 {
            return Ok(metres);
        }
        let problem = format!("{metres} m is out of range");
        Err(self.error(&value.span(), place, problem, "-10 m to 10 m"))
    }

    /// Reads a distance from the axis, m; rejects negative ones.
    fn radius(&self, value: &SpannedNumber, place: &str) -> Result<f64, DesignError> {
        let metres = self.length(value, place)?;
        if metres >= 0.0 {
            return Ok(metres);
        }
        Err(self.error(&value.span(), place, "is below the axis", "r of 0 or more"))
    }

    /// Reads two ends that are at least [`check::THINNEST_M`] apart.
    fn range(
        &self,
        pair: &Pair,
        place: &str,
        read: impl Fn(&SpannedNumber, &str) -> Result<f64, DesignError>,
    ) -> Result<[f64; 2], DesignError> {
        let [from, to] = pair.get_ref();
        let range = [read(from, place)?, read(to, place)?];
        if range[1] - range[0] >= check::THINNEST_M {
            return Ok(range);
        }
        let problem = if range[1] >= range[0] {
            format!("has zero thickness: from {} m to {} m", range[0], range[1])
        } else {
            format!("runs backwards: from {} m to {} m", range[0], range[1])
        };
        let allowed = format!("[from, to], at least {:e} m apart", check::THINNEST_M);
        Err(self.error(&pair.span(), place, problem, &allowed))
    }

    fn rectangle(&self, r: &Pair, x: &Pair, place: &str) -> Result<Rectangle, DesignError> {
        Ok(Rectangle {
            r_m: self.range(r, &format!("{place}.r"), |v, p| self.radius(v, p))?,
            x_m: self.range(x, &format!("{place}.x"), |v, p| self.length(v, p))?,
        })
    }

    fn design(&self, file: File) -> Result<Design, DesignError> {
        let core = Core {
            r_m: self.radius(&file.core.r, "core.r")?,
            x_m: self.range(&file.core.x, "core.x", |v, p| self.length(v, p))?,
        };
        if core.r_m < check::THINNEST_M {
            let span = file.core.r.span();
            return Err(self.error(&span, "core.r", "has zero thickness", "a radius above 0"));
        }
        let materials = self.materials(&file.material)?;
        let coils = self.coils(&file.coil)?;
        let (resistivity_ohm_m, current_a) = match &file.conductor {
            Some(conductor) => (
                self.within(
                    &conductor.resistivity,
                    "conductor.resistivity_ohm_m",
                    1e-10,
                    1.0,
                )?,
                self.within(&conductor.current, "conductor.current_A", 1e-6, 1e6)?,
            ),
            None if file.coil.is_empty() => (1.0, 1.0),
            None => {
                let span = file.coil.first().map_or(0..0, Spanned::span);
                let allowed = "[conductor] resistivity_ohm_m and current_A, where there are coils";
                return Err(self.error(&span, "conductor", "missing", allowed));
            }
        };
        let background_t = match &file.background {
            Some(background) => {
                self.within(&background.field, "background.field_T", -10.0, 10.0)?
            }
            None => 0.0,
        };
        let mut lines = check::Lines::default();
        let mut parts = Vec::new();
        for (kind, cast, entries) in [("body", true, &file.body), ("plate", false, &file.plate)] {
            for entry in entries {
                parts.push(self.part(entry, kind, cast, &materials)?);
                lines.parts.push(self.error(&entry.span(), "", "", "").line);
            }
        }
        let boards = file.board.iter().map(|entry| self.board(entry));
        let boards = boards.collect::<Result<Vec<_>, _>>()?;
        lines.boards = self.lines(&file.board);
        lines.coils = self.lines(&file.coil);
        let design = Design {
            name: file.name,
            about: file.about,
            core,
            coils,
            boards,
            parts,
            resistivity_ohm_m,
            current_a,
            background_t,
            files: self.files.take(),
        };
        check::check(self.file, &design, &lines)?;
        Ok(design)
    }

    fn lines<T>(&self, entries: &[Spanned<T>]) -> Vec<usize> {
        let line = |entry: &Spanned<T>| self.error(&entry.span(), "", "", "").line;
        entries.iter().map(line).collect()
    }

    fn materials(
        &self,
        materials: &BTreeMap<String, Spanned<MaterialFile>>,
    ) -> Result<BTreeMap<String, ReadMaterial>, DesignError> {
        let read = |(name, entry): (&String, &Spanned<MaterialFile>)| {
            Ok((name.clone(), self.material(name, entry)?))
        };
        materials.iter().map(read).collect()
    }

    fn material(
        &self,
        name: &str,
        entry: &Spanned<MaterialFile>,
    ) -> Result<ReadMaterial, DesignError> {
        let m = entry.get_ref();
        let number = |value: &Option<SpannedNumber>, key: &str, most: f64| match value {
            Some(value) => self.within(value, &format!("material.{name}.{key}"), 0.0, most),
            None => Ok(0.0),
        };
        Ok(ReadMaterial {
            law: self.law(name, entry)?,
            remanence_t: self.remanence(name, entry)?,
            conductivity_s_per_m: number(&m.conductivity, "conductivity_S_per_m", 1e9)?,
            loss_tangent: number(&m.loss_tangent, "loss_tangent", 10.0)?,
        })
    }

    /// Remanence of a magnet; 0 for any other material.
    fn remanence(&self, name: &str, entry: &Spanned<MaterialFile>) -> Result<f64, DesignError> {
        let m = entry.get_ref();
        let Some(remanence) = &m.remanence else {
            return Ok(0.0);
        };
        let place = format!("material.{name}.remanence_T");
        if m.mu_r.is_none() || m.saturation.is_some() {
            let problem = "stands without mu_r alone";
            let allowed = "{ mu_r, remanence_T }: a magnet with its recoil permeability";
            return Err(self.error(&remanence.span(), &place, problem, allowed));
        }
        self.within(remanence, &place, -5.0, 5.0)
    }

    fn law(&self, name: &str, entry: &Spanned<MaterialFile>) -> Result<Material, DesignError> {
        let place = |key: &str| format!("material.{name}.{key}");
        let m = entry.get_ref();
        match (
            &m.mu_r,
            &m.saturation,
            &m.initial_mu_r,
            &m.knee,
            &m.exponent,
            &m.bh_table,
        ) {
            (Some(mu_r), None, None, None, None, None) => Ok(Material::Linear {
                mu_r: self.within(mu_r, &place("mu_r"), 1e-6, 1e9)?,
            }),
            (Some(mu_r), Some(saturation), None, None, None, None) => Ok(Material::Powder {
                chi: self.within(mu_r, &place("mu_r"), 1.001, 1e6)? - 1.0,
                saturation_a_per_m: self.within(
                    saturation,
                    &place("saturation_A_per_m"),
                    1.0,
                    1e8,
                )?,
            }),
            (None, None, Some(initial), Some(knee), Some(exponent), None) => Ok(Material::Metal {
                initial_mu_r: self.within(initial, &place("initial_mu_r"), 1.0, 1e9)?,
                knee_t: self.within(knee, &place("knee_T"), 1e-3, 100.0)?,
                exponent: self.within(exponent, &place("exponent"), 2.0, 20.0)?,
                fill: 1.0,
            }),
            (None, None, None, None, None, Some(table)) => {
                let curve = self.bh_table(table, &place("bh_table"))?;
                Ok(Material::table(curve))
            }
            _ => {
                let place = format!("material.{name}");
                Err(self.error(&entry.span(), &place, "has an unknown form", MATERIALS))
            }
        }
    }
}
