//! Outlines of DXF drawings: what of the ASCII format a cross-section needs.
//!
//! A drawing is a list of groups, a code on one line and its value on the next (Autodesk, DXF reference, 2012).
//! X is r and Y is x; elevations are not read.

use core::f64::consts::TAU;

use super::beside::Beside;
use crate::design::DesignError;
use crate::geometry::Point;

const UNDERSTOOD: &str = "LINE, ARC, CIRCLE and LWPOLYLINE; explode or remove anything else";
const ASCII: &str = "an ASCII DXF file: lines of group codes, each with its value on the next line";
/// Lines and arcs on one layer.
const MOST_SIDES: usize = 2_000;

/// A line or an arc of a drawing, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drawn {
    pub(super) from: Point,
    /// A point of the arc; none for a line.
    pub(super) through: Option<Point>,
    pub(super) to: Point,
    /// Line of the file.
    pub(super) line: usize,
}

impl Drawn {
    /// The same from the other end.
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
    /// Line of the value.
    line: usize,
}

/// The lines and arcs on a layer of a drawing. A drawing without a unit is in `unit_m`.
pub(super) fn drawn(beside: &Beside, layer: &str, unit_m: f64) -> Result<Vec<Drawn>, DesignError> {
    let groups = groups(beside)?;
    let unit_m = unit(beside, &groups)?.unwrap_or(unit_m);
    let mut sides = Vec::new();
    let mut layers: Vec<&str> = Vec::new();
    for groups in entities(&groups) {
        let entity = Entity {
            beside,
            groups,
            unit_m,
        };
        let of = entity.text(8).unwrap_or("0");
        if !layers.contains(&of) && layers.len() < MOST_SIDES {
            layers.push(of);
        }
        if of == layer && entity.text(67) != Some("1") {
            entity.draw(&mut sides)?;
        }
        if sides.len() > MOST_SIDES {
            let problem = format!("the layer {layer:?} has too many lines and arcs");
            let allowed = format!("at most {MOST_SIDES}");
            return Err(beside.error(entity.line(), problem, &allowed));
        }
    }
    if sides.is_empty() {
        let problem = format!("there is nothing on the layer {layer:?}");
        let allowed = format!("a layer that is drawn on: {}", layers.join(", "));
        return Err(beside.error(1, problem, &allowed));
    }
    Ok(sides)
}

fn groups(beside: &Beside) -> Result<Vec<Group<'_>>, DesignError> {
    if beside.text.starts_with("AutoCAD Binary DXF") {
        return Err(beside.error(1, "is a binary DXF file", ASCII));
    }
    let mut lines = (1..).zip(beside.text.lines());
    let mut groups = Vec::new();
    while let Some((line, code)) = lines.next() {
        let code = code.trim_start_matches('\u{feff}').trim();
        let Ok(code) = code.parse::<i32>() else {
            if code.is_empty() && lines.clone().all(|(_, rest)| rest.trim().is_empty()) {
                break;
            }
            let problem = format!("{code:?} is no group code");
            return Err(beside.error(line, problem, ASCII));
        };
        let Some((line, value)) = lines.next() else {
            return Err(beside.error(line, format!("group {code} has no value"), ASCII));
        };
        let value = value.trim();
        groups.push(Group { code, value, line });
    }
    Ok(groups)
}

/// The unit that the drawing names, m.
fn unit(beside: &Beside, groups: &[Group<'_>]) -> Result<Option<f64>, DesignError> {
    let named = |pair: &&[Group<'_>]| matches!(pair, [name, _] if name.code == 9 && name.value == "$INSUNITS");
    let Some([_, unit]) = groups.windows(2).find(named) else {
        return Ok(None);
    };
    match unit.value {
        "0" => Ok(None),
        "1" => Ok(Some(0.0254)),
        "4" => Ok(Some(1e-3)),
        "5" => Ok(Some(1e-2)),
        "6" => Ok(Some(1.0)),
        "13" => Ok(Some(1e-6)),
        other => {
            let problem = format!("$INSUNITS is {other:?}");
            let allowed = "0 (the design's length_unit), 1 (in), 4 (mm), 5 (cm), 6 (m), 13 (um)";
            Err(beside.error(unit.line, problem, allowed))
        }
    }
}

/// The groups of each entity, from its name on.
fn entities<'g, 't>(groups: &'g [Group<'t>]) -> impl Iterator<Item = &'g [Group<'t>]> {
    let mut inside = false;
    let mut section = groups.split(|group| group.code == 0 && group.value == "SECTION");
    let found = section.find(|section| {
        inside =
            matches!(section.first(), Some(name) if name.code == 2 && name.value == "ENTITIES");
        inside
    });
    let found = found.unwrap_or_default();
    let end = found
        .iter()
        .position(|group| group.code == 0 && group.value == "ENDSEC");
    let found = found.get(..end.unwrap_or(found.len())).unwrap_or_default();
    let starts = found.chunk_by(|_, next| next.code != 0);
    starts.filter(|entity| entity.first().is_some_and(|group| group.code == 0))
}

/// One entity of a drawing.
struct Entity<'e, 't> {
    beside: &'e Beside,
    groups: &'e [Group<'t>],
    unit_m: f64,
}

impl<'t> Entity<'_, 't> {
    fn group(&self, code: i32) -> Option<&Group<'t>> {
        self.groups.iter().skip(1).find(|group| group.code == code)
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

    /// A length, m: at most 10 m.
    fn length(&self, value: f64, line: usize) -> Result<f64, DesignError> {
        let metres = value * self.unit_m;
        if metres.abs() <= 10.0 {
            return Ok(metres);
        }
        let problem = format!("{metres} m is out of range");
        Err(self.beside.error(line, problem, "-10 m to 10 m"))
    }

    fn point(&self, r: i32, x: i32) -> Result<Point, DesignError> {
        let [r, x] = [self.number(r)?, self.number(x)?];
        Ok([self.length(r, self.line())?, self.length(x, self.line())?])
    }

    /// Adds what it draws.
    fn draw(&self, sides: &mut Vec<Drawn>) -> Result<(), DesignError> {
        let upward = match self.group(230) {
            Some(group) => self.number_of(group)? > 0.0,
            None => true,
        };
        if !upward {
            let problem = format!("{} is drawn from below", self.name());
            let allowed = "extrusion along +Z: flatten the drawing";
            return Err(self.beside.error(self.line(), problem, allowed));
        }
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
            "LWPOLYLINE" => self.polyline(sides)?,
            other => {
                let problem = format!("{other:?} on this layer is not understood");
                return Err(self.beside.error(self.line(), problem, UNDERSTOOD));
            }
        }
        Ok(())
    }

    /// Counterclockwise from an angle.
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

    /// A polyline's sides; each vertex has a bulge, the tangent of a quarter of its arc's angle.
    fn polyline(&self, sides: &mut Vec<Drawn>) -> Result<(), DesignError> {
        let mut vertices: Vec<(Point, f64, usize)> = Vec::new();
        for group in self.groups.iter().skip(1) {
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
        let closed = match self.group(70) {
            Some(group) => group.value.parse::<i32>().is_ok_and(|flags| flags & 1 == 1),
            None => false,
        };
        let count = vertices.len() - usize::from(!closed && !vertices.is_empty());
        let next = vertices.iter().cycle().skip(1);
        for (&(from, bulge, line), &(to, _, _)) in vertices.iter().zip(next).take(count) {
            let [dr, dx] = [to[0] - from[0], to[1] - from[1]];
            // Counterclockwise arcs bulge to the right of their chord.
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

    /// Groups as a drawing.
    fn drawing(entities: &str) -> String {
        let groups = format!("0 SECTION 2 ENTITIES {entities} 0 ENDSEC 0 EOF");
        groups.split(' ').map(|word| format!("{word}\n")).collect()
    }

    const SQUARE: &str = "0 LINE 8 core 10 1 20 0 11 2 21 0 0 ARC 8 core 10 2 20 1 40 1 50 -90 51 90 \
        0 LWPOLYLINE 8 core 90 3 70 0 10 2 20 2 10 1 20 2 42 0.5 10 1 20 0";

    #[test]
    fn entities_are_read() {
        let sides = drawn(&beside(&drawing(SQUARE)), "core", 1.0).expect("sides");
        assert_eq!(sides.len(), 4);
        assert_eq!((sides[0].from, sides[0].to), ([1.0, 0.0], [2.0, 0.0]));
        let near = |a: Point, b: Point| crate::geometry::distance(a, b) < 1e-12;
        assert!(near(sides[1].through.expect("an arc"), [3.0, 1.0]));
        // From (1, 2) down to (1, 0), counterclockwise: to the right of the way is -r.
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
            match drawn(&beside, "core", 1e-3).and_then(|sides| closed(&beside, sides)) {
                Ok(sides) => prop_assert!(!sides.is_empty()),
                Err(error) => prop_assert!(error.line > 0 && !error.problem.is_empty()),
            }
        }

        #[test]
        fn no_noise_panics(text in "\\PC*") {
            let beside = beside(&text);
            let _ = drawn(&beside, "0", 1e-3).and_then(|sides| closed(&beside, sides));
        }
    }
}
