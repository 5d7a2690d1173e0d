//! The file format: TOML, read strictly.

use core::ops::Range;
use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::expression::evaluate;
use super::{Board, Coil, Core, Cut, Design, DesignError, Part, Rectangle, check};
use crate::geometry::shape::Shape;
use crate::material::Material;

/// A number, or arithmetic with the parameters.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a number, or a text like \"1.64 + gap\"")]
enum Number {
    Value(f64),
    Text(String),
}

type Value = Spanned<Number>;
type Pair = Spanned<[Value; 2]>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    #[serde(default)]
    about: String,
    length_unit: Option<Spanned<String>>,
    #[serde(default)]
    parameters: BTreeMap<String, Spanned<f64>>,
    core: CoreFile,
    conductor: Option<ConductorFile>,
    background: Option<BackgroundFile>,
    #[serde(default)]
    material: BTreeMap<String, Spanned<MaterialFile>>,
    #[serde(default)]
    coil: Vec<Spanned<CoilFile>>,
    #[serde(default)]
    board: Vec<Spanned<BoardFile>>,
    #[serde(default)]
    body: Vec<Spanned<PartFile>>,
    #[serde(default)]
    plate: Vec<Spanned<PartFile>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CoreFile {
    r: Value,
    x: Pair,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConductorFile {
    #[serde(rename = "resistivity_ohm_m")]
    resistivity: Value,
    #[serde(rename = "current_A")]
    current: Value,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BackgroundFile {
    #[serde(rename = "field_T")]
    field: Value,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialFile {
    mu_r: Option<Value>,
    #[serde(rename = "saturation_A_per_m")]
    saturation: Option<Value>,
    initial_mu_r: Option<Value>,
    #[serde(rename = "knee_T")]
    knee: Option<Value>,
    exponent: Option<Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CoilFile {
    name: String,
    r: Pair,
    x: Pair,
    rings: Option<Spanned<u32>>,
    pitch: Option<Value>,
    turns: Option<Value>,
    sense: Option<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoardFile {
    name: String,
    r: Pair,
    x: Pair,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartFile {
    name: String,
    material: Spanned<String>,
    shape: Spanned<ShapeFile>,
    #[serde(default)]
    minus: Vec<Spanned<ShapeFile>>,
    pillars: Option<Spanned<PillarsFile>>,
    slots: Option<Spanned<SlotsFile>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PillarsFile {
    count: u32,
    diameter: Value,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SlotsFile {
    count: u32,
    width: Value,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShapeFile {
    r: Option<Pair>,
    x: Option<Pair>,
    outline: Option<Spanned<Vec<Pair>>>,
    centre_x: Option<Value>,
    semi_r: Option<Value>,
    semi_x: Option<Value>,
}

const UNITS: &str = "\"m\", \"mm\", \"um\"";
const MATERIALS: &str =
    "{ mu_r }, { mu_r, saturation_A_per_m } or { initial_mu_r, knee_T, exponent }";
const SHAPES: &str = "{ r = [from, to], x = [from, to] }, { outline = [[r, x], ...] } or { centre_x, semi_r, semi_x }";
/// A file may ask for so many rings in all, by far more than any board has.
const MOST_RINGS: usize = 2_000;
/// Corners of one outline.
const MOST_CORNERS: usize = 2_000;

/// Reads a design; see [`Design::parse`].
pub(super) fn read(file: &str, text: &str) -> Result<Design, DesignError> {
    let mut reader = Reader {
        file,
        text,
        metre: 1.0,
        parameters: BTreeMap::new(),
    };
    let parsed: File = toml::from_str(text).map_err(|error| {
        let span = error.span().unwrap_or(0..0);
        reader.error(&span, "", error.message(), "")
    })?;
    reader.metre = reader.unit(parsed.length_unit.as_ref())?;
    for (name, value) in &parsed.parameters {
        let value = reader.finite(&value.span(), name, *value.get_ref())?;
        reader.parameters.insert(name.clone(), value);
    }
    reader.design(parsed)
}

struct Reader<'t> {
    file: &'t str,
    text: &'t str,
    metre: f64,
    parameters: BTreeMap<String, f64>,
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

    fn unit(&self, unit: Option<&Spanned<String>>) -> Result<f64, DesignError> {
        let Some(unit) = unit else {
            return Err(self.error(&(0..0), "length_unit", "missing", UNITS));
        };
        match unit.get_ref().as_str() {
            "m" => Ok(1.0),
            "mm" => Ok(1e-3),
            "um" => Ok(1e-6),
            other => {
                let problem = format!("is {other:?}");
                Err(self.error(&unit.span(), "length_unit", problem, UNITS))
            }
        }
    }

    fn finite(&self, span: &Range<usize>, place: &str, value: f64) -> Result<f64, DesignError> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.error(span, place, format!("is {value}"), "a finite number"))
        }
    }

    fn number(&self, value: &Value, place: &str) -> Result<f64, DesignError> {
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

    fn within(&self, value: &Value, place: &str, low: f64, high: f64) -> Result<f64, DesignError> {
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

    /// A length: at most 10 m from the origin.
    fn length(&self, value: &Value, place: &str) -> Result<f64, DesignError> {
        let metres = self.number(value, place)? * self.metre;
        if metres.abs() <= 10.0 {
            return Ok(metres);
        }
        let problem = format!("{metres} m is out of range");
        Err(self.error(&value.span(), place, problem, "-10 m to 10 m"))
    }

    /// A distance from the axis.
    fn radius(&self, value: &Value, place: &str) -> Result<f64, DesignError> {
        let metres = self.length(value, place)?;
        if metres >= 0.0 {
            return Ok(metres);
        }
        Err(self.error(&value.span(), place, "is below the axis", "r of 0 or more"))
    }

    /// From and to, at least [`check::THINNEST_M`] apart.
    fn range(
        &self,
        pair: &Pair,
        place: &str,
        read: impl Fn(&Value, &str) -> Result<f64, DesignError>,
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
    ) -> Result<BTreeMap<String, Material>, DesignError> {
        let read = |(name, entry): (&String, &Spanned<MaterialFile>)| {
            Ok((name.clone(), self.material(name, entry)?))
        };
        materials.iter().map(read).collect()
    }

    fn material(&self, name: &str, entry: &Spanned<MaterialFile>) -> Result<Material, DesignError> {
        let place = |key: &str| format!("material.{name}.{key}");
        let m = entry.get_ref();
        match (
            &m.mu_r,
            &m.saturation,
            &m.initial_mu_r,
            &m.knee,
            &m.exponent,
        ) {
            (Some(mu_r), None, None, None, None) => Ok(Material::Linear {
                mu_r: self.within(mu_r, &place("mu_r"), 1e-6, 1e9)?,
            }),
            (Some(mu_r), Some(saturation), None, None, None) => Ok(Material::Powder {
                chi: self.within(mu_r, &place("mu_r"), 1.001, 1e6)? - 1.0,
                saturation_a_per_m: self.within(
                    saturation,
                    &place("saturation_A_per_m"),
                    1.0,
                    1e8,
                )?,
            }),
            (None, None, Some(initial), Some(knee), Some(exponent)) => Ok(Material::Metal {
                initial_mu_r: self.within(initial, &place("initial_mu_r"), 1.0, 1e9)?,
                knee_t: self.within(knee, &place("knee_T"), 1e-3, 100.0)?,
                exponent: self.within(exponent, &place("exponent"), 2.0, 20.0)?,
            }),
            _ => {
                let place = format!("material.{name}");
                Err(self.error(&entry.span(), &place, "is in no known form", MATERIALS))
            }
        }
    }

    fn coils(&self, entries: &[Spanned<CoilFile>]) -> Result<Vec<Coil>, DesignError> {
        let mut coils = Vec::new();
        let mut total = 0_usize;
        for entry in entries {
            let coil = self.coil(entry)?;
            total += coil.rings.len();
            if total > MOST_RINGS {
                let place = format!("coil {:?}", coil.name);
                let allowed = format!("at most {MOST_RINGS} rings in all");
                return Err(self.error(&entry.span(), &place, "too many rings", &allowed));
            }
            coils.push(coil);
        }
        Ok(coils)
    }

    fn coil(&self, entry: &Spanned<CoilFile>) -> Result<Coil, DesignError> {
        let coil = entry.get_ref();
        let place = format!("coil {:?}", coil.name);
        let first = self.rectangle(&coil.r, &coil.x, &place)?;
        let count = coil.rings.as_ref().map_or(1, |rings| *rings.get_ref());
        if count == 0 || count as usize > MOST_RINGS {
            let problem = format!("{count} rings");
            let allowed = format!("1 to {MOST_RINGS}");
            return Err(self.error(&entry.span(), &place, problem, &allowed));
        }
        let pitch = match &coil.pitch {
            Some(pitch) => self.length(pitch, &format!("{place}.pitch"))?,
            None if count == 1 => 0.0,
            None => {
                let allowed = "the distance from ring to ring, where there are several";
                return Err(self.error(
                    &entry.span(),
                    &format!("{place}.pitch"),
                    "missing",
                    allowed,
                ));
            }
        };
        if count > 1 && pitch < first.r_m[1] - first.r_m[0] {
            let problem = "rings overlap: the pitch is below their width";
            return Err(self.error(
                &entry.span(),
                &place,
                problem,
                "a pitch of the width or more",
            ));
        }
        let sense = match &coil.sense {
            None => 1.0,
            Some(text) if text.get_ref() == "+" => 1.0,
            Some(text) if text.get_ref() == "-" => -1.0,
            Some(text) => {
                let problem = format!("is {:?}", text.get_ref());
                let place = format!("{place}.sense");
                return Err(self.error(&text.span(), &place, problem, "\"+\" or \"-\""));
            }
        };
        let turns = match &coil.turns {
            Some(turns) => self.within(turns, &format!("{place}.turns"), 1e-3, 1e6)?,
            None => 1.0,
        };
        let ring = |k: u32| Rectangle {
            r_m: first.r_m.map(|r| r + f64::from(k) * pitch),
            x_m: first.x_m,
        };
        Ok(Coil {
            name: coil.name.clone(),
            rings: (0..count).map(ring).collect(),
            turns,
            sense,
        })
    }

    fn board(&self, entry: &Spanned<BoardFile>) -> Result<Board, DesignError> {
        let board = entry.get_ref();
        let place = format!("board {:?}", board.name);
        Ok(Board {
            name: board.name.clone(),
            section: self.rectangle(&board.r, &board.x, &place)?,
        })
    }

    fn part(
        &self,
        entry: &Spanned<PartFile>,
        kind: &str,
        cast: bool,
        materials: &BTreeMap<String, Material>,
    ) -> Result<Part, DesignError> {
        let part = entry.get_ref();
        let place = format!("{kind} {:?}", part.name);
        let Some(material) = materials.get(part.material.get_ref()) else {
            let problem = format!("unknown material {:?}", part.material.get_ref());
            let names: Vec<&str> = materials.keys().map(String::as_str).collect();
            return Err(self.error(&part.material.span(), &place, problem, &names.join(", ")));
        };
        let minus = part.minus.iter();
        let minus = minus.map(|shape| self.shape(shape, &format!("{place}.minus")));
        let minus: Vec<Shape> = minus.collect::<Result<_, _>>()?;
        let shape = self.shape(&part.shape, &format!("{place}.shape"))?;
        let (cut, fill) = self.cut(part, cast && minus.is_empty(), &shape, &place)?;
        Ok(Part {
            name: part.name.clone(),
            material_name: part.material.get_ref().clone(),
            material: material.diluted(fill),
            shape,
            minus,
            cut,
            cast,
        })
    }

    /// How a body is cut, and the share of it that is left.
    fn cut(
        &self,
        part: &PartFile,
        may: bool,
        shape: &Shape,
        place: &str,
    ) -> Result<(Cut, f64), DesignError> {
        let (cut, span) = match (&part.pillars, &part.slots) {
            (None, None) => return Ok((Cut::Whole, 1.0)),
            (Some(pillars), None) => {
                let count = pillars.get_ref().count;
                let diameter_m = self.radius(&pillars.get_ref().diameter, place)?;
                (Cut::Pillars { count, diameter_m }, pillars.span())
            }
            (None, Some(slots)) => {
                let count = slots.get_ref().count;
                let width_m = self.radius(&slots.get_ref().width, place)?;
                (Cut::Slots { count, width_m }, slots.span())
            }
            (Some(pillars), Some(_)) => {
                let allowed = "either pillars or slots";
                return Err(self.error(&pillars.span(), place, "has pillars and slots", allowed));
            }
        };
        let r_m = match (shape, &part.shape.get_ref().r) {
            (Shape::Polygon(corners), Some(_)) if may => {
                let radii = corners.iter().map(|corner| corner[0]);
                [
                    radii.clone().fold(f64::INFINITY, f64::min),
                    radii.fold(0.0, f64::max),
                ]
            }
            _ => {
                let allowed = "a body of the shape { r, x } with nothing cut out by minus";
                return Err(self.error(&span, place, "cannot be cut", allowed));
            }
        };
        let fill = cut.fill(r_m);
        if fill > 0.0 && fill <= 1.0 {
            return Ok((cut, fill));
        }
        let problem = format!("leaves {} % of the body", 100.0 * fill);
        Err(self.error(&span, place, problem, "more than 0 %, at most 100 %"))
    }

    fn shape(&self, entry: &Spanned<ShapeFile>, place: &str) -> Result<Shape, DesignError> {
        let shape = entry.get_ref();
        let given = (
            &shape.r,
            &shape.x,
            &shape.outline,
            &shape.centre_x,
            &shape.semi_r,
            &shape.semi_x,
        );
        match given {
            (Some(r), Some(x), None, None, None, None) => {
                let rectangle = self.rectangle(r, x, place)?;
                Ok(Shape::rectangle(rectangle.r_m, rectangle.x_m))
            }
            (None, None, Some(outline), None, None, None) => self.outline(outline, place),
            (None, None, None, Some(centre), Some(semi_r), Some(semi_x)) => {
                let semi = |value: &Value, key: &str| {
                    let place = format!("{place}.{key}");
                    let length = self.radius(value, &place)?;
                    if length >= check::THINNEST_M {
                        return Ok(length);
                    }
                    Err(self.error(
                        &value.span(),
                        &place,
                        "has zero thickness",
                        "a length above 0",
                    ))
                };
                Ok(Shape::Spheroid {
                    centre_x_m: self.length(centre, &format!("{place}.centre_x"))?,
                    semi_r_m: semi(semi_r, "semi_r")?,
                    semi_x_m: semi(semi_x, "semi_x")?,
                })
            }
            _ => Err(self.error(&entry.span(), place, "is in no known form", SHAPES)),
        }
    }

    fn outline(&self, outline: &Spanned<Vec<Pair>>, place: &str) -> Result<Shape, DesignError> {
        let corner = |pair: &Pair| {
            let [r, x] = pair.get_ref();
            Ok([self.radius(r, place)?, self.length(x, place)?])
        };
        let corners: Vec<_> = outline
            .get_ref()
            .iter()
            .map(corner)
            .collect::<Result<_, _>>()?;
        let shape = Shape::Polygon(corners);
        match check::outline(&shape, MOST_CORNERS) {
            Ok(()) => Ok(shape),
            Err((problem, allowed)) => Err(self.error(&outline.span(), place, problem, &allowed)),
        }
    }
}
