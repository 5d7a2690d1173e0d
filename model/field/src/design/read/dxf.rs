//! Outlines from DXF drawings: the part of the ASCII format that a cross-section needs.
//!
//! A drawing is a list of groups, each a code on one line and its value on the next (Autodesk, DXF
//! reference, 2012). X is r and Y is x; elevations, invisible entities and paper space are ignored.

use core::f64::consts::TAU;

use super::beside::Beside;
use super::metre;
use crate::design::DesignError;
use crate::geometry::Point;

const UNDERSTOOD: &str = "LINE, ARC, CIRCLE, LWPOLYLINE and POLYLINE: explode blocks, draw splines and ellipses as arcs, move the rest to another layer";
const ASCII: &str = "an ASCII DXF file: lines of group codes, each with its value on the next line";
/// Largest number of lines and arcs on one layer.
const MOST_SIDES: usize = 2_000;
/// Flags 2, 4, 16 and 64 of a POLYLINE: it is a mesh, or a curve through or near its vertices.
const NO_OUTLINE: i32 = 2 | 4 | 16 | 64;
/// Largest number of layers that a message names.
const MOST_LAYERS: usize = 50;

/// A line or an arc of a drawing, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drawn {
    pub(super) from: Point,
    /// A point between the ends of an arc; `None` for a line.
    pub(super) through: Option<Point>,
    pub(super) to: Point,
    /// Line number in the file.
    pub(super) line: usize,
}

impl Drawn {
    /// The same line or arc in the opposite direction.
    pub(super) fn reversed(&self) -> Self {
        Self {
            from: self.to,
            to: self.from,
            ..*self
        }
    }
}

/// A group code with its value.
#[derive(Clone, Copy)]
struct Group<'t> {
    code: i32,
    value: &'t str,
    /// Line number of the value in the file.
    line: usize,
}

/// Unit of length of a drawing.
#[derive(Clone, Copy)]
pub(super) enum DrawingUnit {
    /// The given unit, in m; the unit that the drawing states is ignored.
    Given(f64),
    /// The unit that the drawing states, or the given one, in m, if it states none.
    Named(f64),
}

/// Returns the lines and arcs on a layer of a drawing, and the drawing's unit in words.
pub(super) fn drawn(
    beside: &Beside,
    layer: &str,
    unit: DrawingUnit,
) -> Result<(Vec<Drawn>, String), DesignError> {
    let groups = groups(beside)?;
    let (unit_m, unit) = match unit {
        DrawingUnit::Given(unit_m) => (unit_m, "drawing_unit".to_owned()),
        DrawingUnit::Named(unit_m) => {
            insunits(beside, &groups)?.unwrap_or((unit_m, "length_unit".to_owned()))
        }
    };
    let mut sides = Vec::new();
    let mut layers: Vec<String> = Vec::new();
    for groups in entities(beside, &groups)? {
        let entity = Entity {
            beside,
            groups,
            unit_m,
            unit: &unit,
        };
        let of = unescaped(entity.text(8).unwrap_or("0"));
        let is_drawn = of == layer && ![67, 60].iter().any(|code| entity.text(*code) == Some("1"));
        if is_drawn {
            entity.draw(&mut sides)?;
        }
        if !layers.contains(&of) && layers.len() < MOST_LAYERS {
            layers.push(of);
        }
        if sides.len() > MOST_SIDES {
            let problem = format!("the layer {layer:?} has too many lines and arcs");
            let allowed = format!("at most {MOST_SIDES}");
            return Err(beside.error(entity.line(), problem, &allowed));
        }
    }
    if sides.is_empty() {
        let problem = format!("there is nothing on the layer {layer:?}");
        let mut allowed = format!("a layer that is drawn on: {}", layers.join(", "));
        if let Some(page) = variable(&groups, "$DWGCODEPAGE")
            && !layers.iter().all(|layer| layer.is_ascii())
        {
            let page = page.value;
            allowed.push_str(&format!(
                "; names in {page} are read as UTF-8 or ANSI_1252: save as DXF 2007 or later"
            ));
        }
        return Err(beside.error(1, problem, &allowed));
    }
    Ok((sides, unit))
}

/// Decodes a name in which `\U+XXXX` is the character with this code.
fn unescaped(text: &str) -> String {
    let mut pieces = text.split(r"\U+");
    let mut name = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let code = piece.get(..4).map(|code| u32::from_str_radix(code, 16));
        match (code, piece.get(4..)) {
            (Some(Ok(code)), Some(rest)) => {
                name.push(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
                name.push_str(rest);
            }
            _ => {
                name.push_str(r"\U+");
                name.push_str(piece);
            }
        }
    }
    name
}

fn groups(beside: &Beside) -> Result<Vec<Group<'_>>, DesignError> {
    if beside.text.starts_with("AutoCAD Binary DXF") {
        return Err(beside.error(1, "is a binary DXF file", ASCII));
    }
    let mut lines = (1..).zip(beside.text.lines());
    let mut groups = Vec::new();
    while let Some((line, code)) = lines.next() {
        let code = code.trim();
        let Ok(code) = code.parse::<i32>() else {
            if code.is_empty() && lines.clone().all(|(_, rest)| rest.trim().is_empty()) {
                break;
            }
            let start: String = code.chars().take(40).collect();
            let problem = format!("{start:?} is no group code");
            return Err(beside.error(line, problem, ASCII));
        };
        let Some((line, value)) = lines.next() else {
            return Err(beside.error(line, format!("group {code} has no value"), ASCII));
        };
        let value = value.trim();
        groups.push(Group { code, value, line });
        if code == 0 && value == "EOF" {
            break;
        }
    }
    Ok(groups)
}

/// Value of a variable in the header.
fn variable<'g, 't>(groups: &'g [Group<'t>], name: &str) -> Option<&'g Group<'t>> {
    let named = |pair: &&[Group<'_>]| matches!(pair, [is, _] if is.code == 9 && is.value == name);
    groups.windows(2).find(named).and_then(|pair| pair.last())
}

/// Unit of length that the drawing states, in m and in words.
fn insunits(beside: &Beside, groups: &[Group<'_>]) -> Result<Option<(f64, String)>, DesignError> {
    let Some(unit) = variable(groups, "$INSUNITS") else {
        return Ok(None);
    };
    let name = match unit.value {
        "0" => return Ok(None),
        "1" => "in",
        "4" => "mm",
        "5" => "cm",
        "6" => "m",
        "13" => "um",
        other => {
            let problem = format!("$INSUNITS is {other:?}");
            let allowed = "0 (the design's length_unit), 1 (in), 4 (mm), 5 (cm), 6 (m), 13 (um), or a drawing_unit beside outline_dxf";
            return Err(beside.error(unit.line, problem, allowed));
        }
    };
    Ok(metre(name).map(|metre| (metre, format!("$INSUNITS, {name}"))))
}

/// The groups of each entity, starting with its name; those of a POLYLINE include its vertices.
fn entities<'g, 't>(
    beside: &Beside,
    groups: &'g [Group<'t>],
) -> Result<impl Iterator<Item = &'g [Group<'t>]>, DesignError> {
    let mut sections = groups.split(|group| group.code == 0 && group.value == "SECTION");
    let found = sections.find(|section| {
        matches!(section.first(), Some(name) if name.code == 2 && name.value == "ENTITIES")
    });
    let found = found.unwrap_or_default();
    let mut ends = found.iter();
    let end = ends.position(|group| group.code == 0 && group.value == "ENDSEC");
    if let (None, Some(last)) = (end, found.last()) {
        let problem = "ends in the middle of its ENTITIES";
        return Err(beside.error(last.line, problem, "a whole drawing: save it again"));
    }
    let found = found.get(..end.unwrap_or(0)).unwrap_or_default();
    let starts =
        found.chunk_by(|_, next| next.code != 0 || matches!(next.value, "VERTEX" | "SEQEND"));
    Ok(starts.filter(|entity| entity.first().is_some_and(|group| group.code == 0)))
}

/// One entity of a drawing.
struct Entity<'e, 't> {
    beside: &'e Beside,
    groups: &'e [Group<'t>],
    unit_m: f64,
    unit: &'e str,
}

impl<'t> Entity<'_, 't> {
    /// The first group with this code of the entity itself, not of its vertices.
    fn group(&self, code: i32) -> Option<&Group<'t>> {
        let mut own = self.groups.iter().skip(1);
        let mut own = own.by_ref().take_while(|group| group.code != 0);
        own.find(|group| group.code == code)
    }

    fn text(&self, code: i32) -> Option<&'t str> {
        self.group(code).map(|group| group.value)
    }

    fn name(&self) -> &'t str {
        self.groups.first().map_or("", |group| group.value)
    }

    fn line(&self) -> usize {
        self.groups.first().map_or(1, |group| group.line)
    }

    fn number_of(&self, group: &Group<'_>) -> Result<f64, DesignError> {
        let number = group
            .value
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| {
            let problem = format!("{:?} of {} is no number", group.value, self.name());
            self.beside.error(group.line, problem, "a finite number")
        })
    }

    fn number(&self, code: i32) -> Result<f64, DesignError> {
        let Some(group) = self.group(code) else {
            let problem = format!("{} without group {code}", self.name());
            return Err(self.beside.error(self.line(), problem, ASCII));
        };
        self.number_of(group)
    }

    /// Converts a length to m; rejects lengths above 10 m.
    fn length(&self, value: f64, line: usize) -> Result<f64, DesignError> {
        let metres = value * self.unit_m;
        if metres.abs() <= 10.0 {
            return Ok(metres);
        }
        let problem = format!("{metres} m is out of range");
        let allowed = format!(
            "-10 m to 10 m; the unit is by {}: another by drawing_unit",
            self.unit
        );
        Err(self.beside.error(line, problem, &allowed))
    }

    fn point(&self, r: i32, x: i32) -> Result<Point, DesignError> {
        let [r, x] = [self.number(r)?, self.number(x)?];
        Ok([self.length(r, self.line())?, self.length(x, self.line())?])
    }

    /// Adds the lines and arcs that the entity draws.
    fn draw(&self, sides: &mut Vec<Drawn>) -> Result<(), DesignError> {
        if !["LINE", "ARC", "CIRCLE", "LWPOLYLINE", "POLYLINE"].contains(&self.name()) {
            return Err(self.not_understood());
        }
        self.check_plane()?;
        match self.name() {
            "LINE" => sides.push(Drawn {
                from: self.point(10, 20)?,
                through: None,
                to: self.point(11, 21)?,
                line: self.line(),
            }),
            "ARC" => {
                let [start, end] = [self.number(50)?, self.number(51)?].map(f64::to_radians);
                let turn = (end - start).rem_euclid(TAU);
                sides.push(self.arc(start, turn)?);
            }
            "CIRCLE" => {
                for start in [0.0, 0.5 * TAU] {
                    sides.push(self.arc(start, 0.5 * TAU)?);
                }
            }
            "LWPOLYLINE" => self.polyline(self.groups, sides)?,
            "POLYLINE" if self.flags(70) & NO_OUTLINE == 0 => {
                let vertex = |group: &Group<'_>| group.code == 0 && group.value == "VERTEX";
                let first = self.groups.iter().position(vertex);
                let vertices = first.and_then(|first| self.groups.get(first..));
                self.polyline(vertices.unwrap_or_default(), sides)?;
            }
            _ => return Err(self.not_understood()),
        }
        Ok(())
    }

    fn not_understood(&self) -> DesignError {
        let problem = format!("{:?} on this layer is not supported", self.name());
        self.beside.error(self.line(), problem, UNDERSTOOD)
    }

    /// Rejects an entity in another plane, in which X and Y have another meaning.
    fn check_plane(&self) -> Result<(), DesignError> {
        match self.group(230) {
            Some(group) if (self.number_of(group)? - 1.0).abs() > 1e-6 => {
                let problem = format!("{} is not drawn from above", self.name());
                let allowed = "extrusion along +Z: flatten the drawing, or mirror and explode it";
                Err(self.beside.error(self.line(), problem, allowed))
            }
            _ => Ok(()),
        }
    }

    /// An arc from the angle `start`, counterclockwise by `turn`.
    fn arc(&self, start: f64, turn: f64) -> Result<Drawn, DesignError> {
        let centre = self.point(10, 20)?;
        let radius = self.length(self.number(40)?, self.line())?;
        if radius <= 0.0 || turn <= 0.0 {
            let problem = format!("{} without length", self.name());
            let allowed = "a radius and an angle above 0";
            return Err(self.beside.error(self.line(), problem, allowed));
        }
        let at = |angle: f64| {
            [
                centre[0] + radius * angle.cos(),
                centre[1] + radius * angle.sin(),
            ]
        };
        Ok(Drawn {
            from: at(start),
            through: Some(at(start + 0.5 * turn)),
            to: at(start + turn),
            line: self.line(),
        })
    }

    /// Value of a group with flag bits; 0 if there is no such group.
    fn flags(&self, code: i32) -> i32 {
        let flags = self.text(code).and_then(|flags| flags.parse().ok());
        flags.unwrap_or(0)
    }

    /// Adds the lines and arcs of a polyline from the groups of its vertices. A side's bulge is the
    /// tangent of a quarter of the angle of its arc.
    fn polyline(&self, groups: &[Group<'_>], sides: &mut Vec<Drawn>) -> Result<(), DesignError> {
        let mut vertices: Vec<(Point, f64, usize)> = Vec::new();
        for group in groups.iter().skip(1) {
            match (group.code, vertices.last_mut()) {
                (10, _) => {
                    let r = self.length(self.number_of(group)?, group.line)?;
                    vertices.push(([r, 0.0], 0.0, group.line));
                }
                (20, Some((point, _, _))) => {
                    point[1] = self.length(self.number_of(group)?, group.line)?;
                }
                (42, Some((_, bulge, _))) => *bulge = self.number_of(group)?,
                _ => {}
            }
        }
        let closed = self.flags(70) & 1 == 1;
        let count = vertices.len() - usize::from(!closed && !vertices.is_empty());
        let next = vertices.iter().cycle().skip(1);
        for (&(from, bulge, line), &(to, _, _)) in vertices.iter().zip(next).take(count) {
            let [dr, dx] = [to[0] - from[0], to[1] - from[1]];
            // A counterclockwise arc bulges to the right of its chord.
            let through = [
                0.5 * (from[0] + to[0] + bulge * dx),
                0.5 * (from[1] + to[1] - bulge * dr),
            ];
            sides.push(Drawn {
                from,
                through: (bulge != 0.0).then_some(through),
                to,
                line,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::loops::closed;
    use super::*;

    fn beside(text: &str) -> Beside {
        Beside {
            file: "core.dxf".to_owned(),
            text: text.to_owned(),
        }
    }

    /// A drawing from groups.
    fn drawing(entities: &str) -> String {
        let groups = format!("0 SECTION 2 ENTITIES {entities} 0 ENDSEC 0 EOF");
        groups.split(' ').map(|word| format!("{word}\n")).collect()
    }

    const SQUARE: &str = "0 LINE 8 core 10 1 20 0 11 2 21 0 0 ARC 8 core 10 2 20 1 40 1 50 -90 51 90 \
        0 LWPOLYLINE 8 core 90 3 70 0 10 2 20 2 10 1 20 2 42 0.5 10 1 20 0";

    #[test]
    fn entities_are_read() {
        let sides = drawn(&beside(&drawing(SQUARE)), "core", DrawingUnit::Named(1.0));
        let (sides, _) = sides.expect("sides");
        assert_eq!(sides.len(), 4);
        assert_eq!((sides[0].from, sides[0].to), ([1.0, 0.0], [2.0, 0.0]));
        let near = |a: Point, b: Point| crate::geometry::distance(a, b) < 1e-12;
        assert!(near(sides[1].through.expect("an arc"), [3.0, 1.0]));
        // From (1, 2) down to (1, 0), counterclockwise: the right-hand side is -r.
        assert!(near(sides[3].through.expect("a bulge"), [0.5, 1.0]));
        assert_eq!(closed(&beside(""), sides).expect("a loop").len(), 4);
    }

    proptest! {
        #[test]
        fn no_drawing_panics(
            place in any::<prop::sample::Index>(),
            length in 0..30_usize,
            piece in prop_oneof!["[ -~\n]{0,12}", Just("nan".to_owned()), Just("1e308".to_owned()), Just("\n0\n".to_owned())],
        ) {
            let header = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n";
            let text = format!("{header}{}", drawing(SQUARE));
            let from = place.index(text.len());
            let to = (from + length).min(text.len());
            let beside = beside(&format!("{}{piece}{}", &text[..from], &text[to..]));
            match drawn(&beside, "core", DrawingUnit::Named(1e-3)).and_then(|(sides, _)| closed(&beside, sides)) {
                Ok(sides) => prop_assert!(!sides.is_empty()),
                Err(error) => prop_assert!(error.line > 0 && !error.problem.is_empty()),
            }
        }

        #[test]
        fn no_noise_panics(text in "\\PC*") {
            let beside = beside(&text);
            let drawn = drawn(&beside, "0", DrawingUnit::Given(1e-3));
            let _ = drawn.and_then(|(sides, _)| closed(&beside, sides));
        }
    }
}
