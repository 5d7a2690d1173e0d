//! Reading coils, boards, bodies and plates of a file.

use std::collections::BTreeMap;

use toml::Spanned;

use super::dxf::{DrawingUnit, Drawn, drawn};
use super::file::{BoardFile, CoilFile, OutlineEntry, PartFile, ShapeFile, SpannedNumber};
use super::loops::closed;
use super::{ReadMaterial, Reader};
use crate::design::{CircuitBoard, Cut, DesignError, MagneticPart, Rectangle, RingCoil, check};
use crate::geometry::Point;
use crate::geometry::path::Path;
use crate::geometry::shape::Shape;

const SHAPES: &str = "{ r = [from, to], x = [from, to] }, { outline = [[r, x], ...] }, { outline_dxf = \"FILE\", layer = \"NAME\", drawing_unit = \"mm\" (where the drawing does not say it) } or { centre_x, semi_r, semi_x }";
const ARCS: &str = "corner, { through = [r, x] }, corner: an arc from one to the other through a point beside their line";
/// Largest number of rings in all coils together, far more than any board has.
const MOST_RINGS: usize = 2_000;
/// Largest number of corners of one outline.
const MOST_CORNERS: usize = 2_000;

impl Reader<'_> {
    pub(super) fn coils(
        &self,
        entries: &[Spanned<CoilFile>],
    ) -> Result<Vec<RingCoil>, DesignError> {
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

    fn coil(&self, entry: &Spanned<CoilFile>) -> Result<RingCoil, DesignError> {
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
        let own_current_a = self.own_current_a(coil, &place)?;
        let ring = |k: u32| Rectangle {
            r_m: first.r_m.map(|r| r + f64::from(k) * pitch),
            x_m: first.x_m,
        };
        Ok(RingCoil {
            name: coil.name.clone(),
            rings: (0..count).map(ring).collect(),
            turns,
            sense,
            driven: coil.driven.unwrap_or(own_current_a.is_none()),
            own_current_a,
        })
    }

    /// Constant current of a coil that is not in series with the others, A.
    fn own_current_a(&self, coil: &CoilFile, place: &str) -> Result<Option<f64>, DesignError> {
        let Some(current) = &coil.current else {
            return Ok(None);
        };
        let place = format!("{place}.current_A");
        if coil.driven.is_some() {
            let problem = "stands beside driven";
            let allowed = "either: a coil with a current of its own is not in series";
            return Err(self.error(&current.span(), &place, problem, allowed));
        }
        self.within(current, &place, -1e6, 1e6).map(Some)
    }

    pub(super) fn board(&self, entry: &Spanned<BoardFile>) -> Result<CircuitBoard, DesignError> {
        let board = entry.get_ref();
        let place = format!("board {:?}", board.name);
        Ok(CircuitBoard {
            name: board.name.clone(),
            section: self.rectangle(&board.r, &board.x, &place)?,
        })
    }

    pub(super) fn part(
        &self,
        entry: &Spanned<PartFile>,
        kind: &str,
        cast: bool,
        materials: &BTreeMap<String, ReadMaterial>,
    ) -> Result<MagneticPart, DesignError> {
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
        if cut != Cut::Whole && material.conductivity_s_per_m > 0.0 {
            let problem = "is cut, and conducts: no current runs in circles through it";
            let allowed =
                "a material without conductivity_S_per_m, or a body without pillars and slots";
            return Err(self.error(&part.material.span(), &place, problem, allowed));
        }
        if cut != Cut::Whole && material.remanence_t != 0.0 {
            let problem = "is cut, and a magnet";
            let allowed = "a material without remanence_T, or a body without pillars and slots";
            return Err(self.error(&part.material.span(), &place, problem, allowed));
        }
        Ok(MagneticPart {
            name: part.name.clone(),
            material_name: part.material.get_ref().clone(),
            material: material.law.diluted(fill),
            shape,
            minus,
            conductivity_s_per_m: material.conductivity_s_per_m,
            remanence_t: material.remanence_t,
            loss_tangent: material.loss_tangent,
            cut,
            cast,
        })
    }

    /// Reads how a body is cut; returns the cut and the remaining fraction of the body's area.
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
            &shape.outline_dxf,
            &shape.layer,
            &shape.drawing_unit,
            &shape.centre_x,
            &shape.semi_r,
            &shape.semi_x,
        );
        match given {
            (Some(r), Some(x), None, None, None, None, None, None, None) => {
                let rectangle = self.rectangle(r, x, place)?;
                Ok(Shape::rectangle(rectangle.r_m, rectangle.x_m))
            }
            (None, None, Some(outline), None, None, None, None, None, None) => {
                self.outline(outline, place)
            }
            (None, None, None, Some(file), Some(layer), unit, None, None, None) => {
                let unit = match unit {
                    Some(unit) => {
                        DrawingUnit::Given(self.unit(unit, &format!("{place}.drawing_unit"))?)
                    }
                    None => DrawingUnit::Named(self.metre),
                };
                self.outline_dxf(file, layer.get_ref(), unit, place)
            }
            (None, None, None, None, None, None, Some(centre), Some(semi_r), Some(semi_x)) => {
                let semi = |value: &SpannedNumber, key: &str| {
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
            _ => Err(self.error(&entry.span(), place, "has an unknown form", SHAPES)),
        }
    }

    fn outline(
        &self,
        outline: &Spanned<Vec<Spanned<OutlineEntry>>>,
        place: &str,
    ) -> Result<Shape, DesignError> {
        let point =
            |[r, x]: &[SpannedNumber; 2]| Ok([self.radius(r, place)?, self.length(x, place)?]);
        let mut sides: Vec<Side> = Vec::new();
        for (index, entry) in outline.get_ref().iter().enumerate() {
            match (entry.get_ref(), sides.last_mut()) {
                (OutlineEntry::Corner(corner), _) => sides.push(Side {
                    from: point(corner)?,
                    through: None,
                }),
                (OutlineEntry::Through(through), Some(side)) if side.through.is_none() => {
                    side.through = Some((point(through)?, index));
                }
                (OutlineEntry::Through(_), _) => {
                    let problem = "through stands behind no corner";
                    return Err(self.error(&entry.span(), place, problem, ARCS));
                }
            }
        }
        let spans: Vec<_> = outline.get_ref().iter().map(Spanned::span).collect();
        let shape = joined(&sides).map_err(|(side, problem, allowed)| {
            let span = sides.get(side).and_then(|side| side.through.as_ref());
            let span = span.map_or(outline.span(), |(_, entry)| {
                spans.get(*entry).cloned().unwrap_or(outline.span())
            });
            self.error(&span, place, problem, allowed)
        })?;
        match check::outline(&shape, MOST_CORNERS) {
            Ok(()) => Ok(shape),
            Err((problem, allowed)) => Err(self.error(&outline.span(), place, problem, &allowed)),
        }
    }

    /// Reads an outline from a layer of a drawing.
    fn outline_dxf(
        &self,
        name: &Spanned<String>,
        layer: &str,
        unit: DrawingUnit,
        place: &str,
    ) -> Result<Shape, DesignError> {
        let beside = self.beside(name, &format!("{place}.outline_dxf"))?;
        let (drawn, unit) = drawn(&beside, layer, unit)?;
        let drawn = closed(&beside, drawn)?;
        // Drawing programs write a tiny bulge, due to rounding, for a straight side.
        let bent = |side: &Drawn, through| Path::arc_through(side.from, through, side.to).is_some();
        let side = |side: &Drawn| Side {
            from: side.from,
            through: side
                .through
                .filter(|&through| bent(side, through))
                .map(|through| (through, side.line)),
        };
        let sides: Vec<Side> = drawn.iter().map(side).collect();
        let line = |side: usize| drawn.get(side).map_or(1, |side| side.line);
        let shape = joined(&sides)
            .map_err(|(side, problem, allowed)| beside.error(line(side), problem, allowed))?;
        check::outline(&shape, MOST_CORNERS)
            .map_err(|(problem, allowed)| beside.error(line(0), problem, &allowed))?;
        let [r, x] = [0, 1].map(|axis: usize| {
            let places = shape.extremes().into_iter().map(|place| 1e3 * place[axis]);
            let [low, high] = [f64::min, f64::max].map(|pick| places.clone().reduce(pick));
            format!("{:.3} to {:.3} mm", low.unwrap_or(0.0), high.unwrap_or(0.0))
        });
        let sides = drawn.len();
        self.note(
            &beside,
            format!("layer {layer:?}: r {r}, x {x}, {sides} sides; unit by {unit}"),
        );
        Ok(shape)
    }
}

/// Joins sides, of which each ends where the next one starts, to an outline. On failure returns the
/// index of the wrong side, the problem and what is allowed.
fn joined(sides: &[Side]) -> Result<Shape, (usize, &'static str, &'static str)> {
    if sides.iter().all(|side| side.through.is_none()) {
        return Ok(Shape::Polygon(sides.iter().map(|side| side.from).collect()));
    }
    let mut paths = Vec::new();
    let next = sides.iter().cycle().skip(1);
    for (index, (side, next)) in sides.iter().zip(next).enumerate() {
        let Some((through, _)) = side.through else {
            paths.push(Path::line(side.from, next.from));
            continue;
        };
        let Some(arc) = Path::arc_through(side.from, through, next.from) else {
            let problem = "through lies on the line between its corners";
            return Err((index, problem, ARCS));
        };
        if arc
            .iter()
            .flat_map(Path::extremes)
            .any(|[r, _]| r < -check::SAME_M)
        {
            let allowed = "r of 0 or more, all along the arc";
            return Err((index, "the arc runs below the axis", allowed));
        }
        paths.extend(arc);
    }
    Ok(Shape::Outline(paths))
}

/// A side of an outline: its start and, for an arc, a point on it; each with its location in the
/// file.
struct Side {
    from: Point,
    through: Option<(Point, usize)>,
}
