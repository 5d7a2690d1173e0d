//! Copper of a winding: the design's turns as one conductor on a board of two layers.
//!
//! A turn of the design is a closed circle. A real one goes on to the next: it is the same circle, with a jog to
//! the next one at one angle. So the turns keep their radii, and the copper its space; only the ends of the
//! first and the last turn are missing, where they would touch the jog beside them.

use core::f64::consts::{PI, TAU};

use palpate_cli::failure::Failure;
use palpate_field::design::{Design, Rectangle, RingCoil};

/// A point on the board, m, seen from the front.
pub(super) type Place = [f64; 2];

/// Greatest distance of a chord from its curve, m: 1/20 of what a maker of boards tolerates.
const SAGITTA_M: f64 = 5e-6;
/// From copper to the board's edge, m (a usual rule of makers).
const TO_EDGE_M: f64 = 0.3e-3;
/// Width of the tabs beside their pads, m.
const BESIDE_PAD_M: f64 = 0.5e-3;
/// Least diameters of a via and of a pad for a wire, m.
const VIA_M: f64 = 0.45e-3;
const PAD_M: f64 = 1.2e-3;
/// Between the layers of a flexible board, m: film of 50 um with its adhesives.
const FILM_M: f64 = 0.1e-3;
/// Copper on the wall of a plated hole, m (IPC-6012, class 3).
pub(super) const PLATING_M: f64 = 25e-6;

/// A conductor on one layer, in the direction of the current.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Track {
    /// The coil whose turns it has; none for a lead.
    pub(super) coil: Option<usize>,
    pub(super) front: bool,
    /// Middle of its copper along the axis, m.
    pub(super) x_m: f64,
    pub(super) width_m: f64,
    pub(super) thickness_m: f64,
    pub(super) places: Vec<Place>,
}

/// A plated hole with copper around it on both layers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hole {
    /// 1 where the current enters, 2 where it leaves, 3 for a via.
    pub(super) number: u8,
    pub(super) place: Place,
    pub(super) diameter_m: f64,
}

impl Hole {
    /// Diameter of the drill, m.
    pub(super) fn drill_m(&self) -> f64 {
        self.diameter_m - 2.0 * (0.15 * self.diameter_m).max(0.125e-3)
    }
}

/// A tab of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tab {
    pub(super) angle: f64,
    /// Half of its width, m.
    pub(super) half_m: f64,
    /// From the rim to its end, m.
    pub(super) r_m: [f64; 2],
    /// From its back to its front along the axis, m.
    pub(super) x_m: [f64; 2],
}

/// A board with one winding.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Winding {
    pub(super) name: String,
    /// In the order in which the current passes them.
    pub(super) tracks: Vec<Track>,
    pub(super) holes: Vec<Hole>,
    /// The board's edges: the outer one, and that of the hole in its middle.
    pub(super) edges: Vec<Vec<Place>>,
    /// Distance between the middles of the layers, m.
    pub(super) depth_m: f64,
    /// Least distance of its tracks, m.
    pub(super) clearance_m: f64,
}

impl Winding {
    /// All windings of a design, from below. Tracks keep `clearance_m` where the design leaves as much.
    pub(super) fn all(design: &Design, clearance_m: f64) -> Result<Vec<Self>, Failure> {
        let board_of = |ring: &Rectangle| {
            let middle = [ring.r_m, ring.x_m].map(|[from, to]| 0.5 * (from + to));
            design.boards.iter().position(|board| {
                let [r, x] = [board.section.r_m, board.section.x_m];
                (r[0]..r[1]).contains(&middle[0]) && (x[0]..x[1]).contains(&middle[1])
            })
        };
        let mut groups: Vec<(Option<usize>, Vec<usize>)> = Vec::new();
        for (index, coil) in design.coils.iter().enumerate() {
            let board = coil.rings.first().and_then(board_of);
            match groups
                .iter_mut()
                .find(|(of, _)| board.is_some() && *of == board)
            {
                Some((_, coils)) => coils.push(index),
                None => groups.push((board, vec![index])),
            }
        }
        let winding = |(board, coils): &(Option<usize>, Vec<usize>)| {
            Self::of(design, *board, coils, clearance_m)
        };
        groups.iter().map(winding).collect()
    }

    fn of(
        design: &Design,
        board: Option<usize>,
        coils: &[usize],
        clearance_m: f64,
    ) -> Result<Self, Failure> {
        let board = board.and_then(|board| design.boards.get(board));
        let mut layers = Vec::new();
        for &index in coils {
            if let Some(coil) = design.coils.get(index) {
                layers.push(Layer::of(index, coil, clearance_m).map_err(Failure::Refused)?);
            }
        }
        layers.sort_by(|a, b| a.x_m.total_cmp(&b.x_m));
        let name = board.map_or_else(
            || {
                design
                    .coils
                    .get(coils[0])
                    .map_or("", |coil| coil.name.as_str())
            },
            |board| board.name.as_str(),
        );
        let refused =
            |problem: &str| Failure::Refused(format!("{}: {name}: {problem}", design.name));
        let (back, front) = match layers.as_slice() {
            [front] => (None, front),
            [back, front] if back.sense == front.sense => (Some(back), front),
            _ => {
                return Err(refused(
                    "a board has one or two coils here, of the same sense: put the others on a [[board]] of their own",
                ));
            }
        };
        let clearance_m = front
            .clearance_m
            .min(back.map_or(f64::INFINITY, |back| back.clearance_m));
        let copper = |pick: fn(f64, f64) -> f64, start, of: fn(&Layer) -> f64| {
            layers.iter().map(of).fold(start, pick)
        };
        let inner_m = copper(f64::min, f64::INFINITY, |layer| {
            layer.radii_m[0] - 0.5 * layer.width_m
        });
        let outer_m = copper(f64::max, 0.0, |layer| layer.last_m() + 0.5 * layer.width_m);
        let edge_m = TO_EDGE_M + board.map_or(outer_m, |board| outer_m.max(board.section.r_m[1]));
        // A board about a pole has a hole; it is as near to the copper as the edge is.
        let hole_m = board.map_or(0.0, |board| board.section.r_m[0].min(inner_m) - TO_EDGE_M);

        let width_m = front.width_m;
        let via_m = width_m.max(VIA_M);
        // A via that is wider than the track stands inside of the first turn.
        let first_m = front.radii_m[0].min(back.map_or(f64::INFINITY, |back| back.radii_m[0]));
        let via_r_m = if via_m > width_m {
            first_m - 0.5 * (via_m + width_m) - clearance_m
        } else {
            first_m
        };
        if via_r_m - 0.5 * via_m < hole_m.max(0.0) || hole_m < 0.0 {
            return Err(refused(
                "there is no room for the via inside of the first turn: make the winding's inner radius greater",
            ));
        }
        let pad_m = width_m.max(PAD_M);
        let pad_r_m = edge_m + 0.5 * pad_m;
        let depth_m = back.map_or(
            board.map_or(FILM_M, |board| board.section.x_m[1] - board.section.x_m[0]),
            |back| front.x_m - back.x_m,
        );

        // The via is at the angle 0; tracks of the front go outwards anticlockwise, so those of the back,
        // mirrored, go inwards anticlockwise. The pads' tabs must not meet.
        let apart = 2.0 * (pad_m + 2.0 * BESIDE_PAD_M) / edge_m;
        let half = if back.is_some() { 0.5 } else { 1.0 };
        let ends = |layer: &Layer| layer.ends(half * apart);
        let front_ends = ends(front);
        let onto = |places: Vec<Place>, r_m: [f64; 2]| leads(places, r_m);
        let front_places = onto(
            turned(front.places(front_ends), -front_ends[0]),
            [via_r_m, pad_r_m],
        );
        let back_places = back.map_or_else(
            || vec![[via_r_m, 0.0], [pad_r_m, 0.0]],
            |back| {
                let ends = ends(back);
                onto(turned(back.places(ends), -ends[0]), [via_r_m, pad_r_m])
                    .into_iter()
                    .map(|[y, z]| [y, -z])
                    .collect()
            },
        );
        let back_places: Vec<Place> = back_places.into_iter().rev().collect();
        let mut tracks = vec![
            Track {
                coil: back.map(|back| back.coil),
                front: false,
                x_m: front.x_m - depth_m,
                width_m: back.map_or(width_m, |back| back.width_m),
                thickness_m: back.map_or(front.thickness_m, |back| back.thickness_m),
                places: back_places,
            },
            Track {
                coil: Some(front.coil),
                front: true,
                x_m: front.x_m,
                width_m,
                thickness_m: front.thickness_m,
                places: front_places,
            },
        ];
        let pads = [
            tracks[0].places[0],
            tracks[1].places[tracks[1].places.len() - 1],
        ];
        if front.sense < 0.0 {
            tracks.reverse();
            for track in &mut tracks {
                track.places.reverse();
            }
        }
        let number = |track: usize| {
            if (track == 0) == (front.sense > 0.0) {
                1
            } else {
                2
            }
        };
        let hole = |number, place, diameter_m| Hole {
            number,
            place,
            diameter_m,
        };
        let tab = [
            pad_r_m + 0.5 * pad_m + BESIDE_PAD_M,
            0.5 * pad_m + BESIDE_PAD_M,
        ];
        let mut edges = vec![outline(edge_m, &pads, tab)];
        if hole_m > 0.0 {
            edges.push(outline(hole_m, &[], tab));
        }
        Ok(Self {
            name: name.to_owned(),
            tracks,
            holes: vec![
                hole(number(0), pads[0], pad_m),
                hole(number(1), pads[1], pad_m),
                hole(3, [via_r_m, 0.0], via_m),
            ],
            edges,
            depth_m,
            clearance_m,
        })
    }

    /// The tabs of a board whose axis is the design's.
    pub(super) fn tabs(&self) -> impl Iterator<Item = Tab> + '_ {
        let faces = self
            .tracks
            .iter()
            .flat_map(|track| [-0.5, 0.5].map(|side| track.x_m + side * track.thickness_m));
        let x_m = faces.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        });
        let pads = self.holes.iter().filter(|hole| hole.number != 3);
        pads.map(move |pad| {
            let r_m = pad.place[0].hypot(pad.place[1]);
            let half_m = 0.5 * pad.diameter_m + BESIDE_PAD_M;
            Tab {
                angle: pad.place[1].atan2(pad.place[0]),
                half_m,
                r_m: [r_m - 0.5 * pad.diameter_m, r_m + half_m],
                x_m,
            }
        })
    }

    /// The winding in one line.
    pub(super) fn explain(&self) -> String {
        let turns = self.tracks.iter().filter(|track| track.coil.is_some());
        let gap_m = turns.map(Track::least_gap_m).fold(f64::INFINITY, f64::min);
        let ([track, ..], [pad, _, via]) = (self.tracks.as_slice(), self.holes.as_slice()) else {
            return self.name.clone();
        };
        format!(
            "{}: track of {:.3} m, {:.3} by {:.3} mm, at least {gap:.3} mm apart; via of {:.2} mm, pads of {:.2} mm",
            self.name,
            self.length_m(),
            1e3 * track.width_m,
            1e3 * track.thickness_m,
            1e3 * via.diameter_m,
            1e3 * pad.diameter_m,
            gap = 1e3 * gap_m,
        )
    }

    /// Length of the conductor, m, without the via.
    pub(super) fn length_m(&self) -> f64 {
        self.tracks.iter().map(Track::length_m).sum()
    }

    /// Resistance between the pads, Ω.
    pub(super) fn resistance_ohm(&self, resistivity_ohm_m: f64) -> f64 {
        let track = |track: &Track| track.length_m() / (track.width_m * track.thickness_m);
        let tracks: f64 = self.tracks.iter().map(track).sum();
        let via = self.holes.iter().find(|hole| hole.number == 3);
        let via = via.map_or(0.0, |via| self.depth_m / (PI * via.drill_m() * PLATING_M));
        resistivity_ohm_m * (tracks + via)
    }
}

impl Track {
    /// Least distance between the edges of parts of the track that do not follow each other, m.
    pub(super) fn least_gap_m(&self) -> f64 {
        let mut along_m = vec![0.0];
        for ends in self.places.windows(2) {
            along_m.push(along_m[along_m.len() - 1] + distance(ends[0], ends[1]));
        }
        let mut least_m = f64::INFINITY;
        for (place, at_m) in self.places.iter().zip(&along_m) {
            for (ends, from_m) in self.places.windows(2).zip(&along_m) {
                // Behind three widths a track has left its own neighbourhood.
                if from_m - at_m > 3.0 * self.width_m {
                    least_m = least_m.min(to_segment_m(*place, ends[0], ends[1]));
                }
            }
        }
        least_m - self.width_m
    }

    fn length_m(&self) -> f64 {
        let steps = self
            .places
            .windows(2)
            .map(|ends| distance(ends[0], ends[1]));
        steps.sum()
    }
}

/// A coil of the design, as the turns of one layer.
struct Layer {
    coil: usize,
    sense: f64,
    x_m: f64,
    width_m: f64,
    thickness_m: f64,
    /// Radii of the turns, ascending; at least one.
    radii_m: Vec<f64>,
    /// Length over which a turn changes to the next, m.
    jog_m: f64,
    clearance_m: f64,
}

impl Layer {
    fn of(index: usize, coil: &RingCoil, clearance_m: f64) -> Result<Self, String> {
        let refused = |problem: &str| format!("{}: {problem}", coil.name);
        let mut rings = coil.rings.clone();
        rings.sort_by(|a, b| a.r_m[0].total_cmp(&b.r_m[0]));
        let Some(first) = rings.first() else {
            return Err(refused("a coil without a ring"));
        };
        if coil.turns != 1.0 {
            return Err(refused(
                "several turns in one ring are wound of wire, which is no board",
            ));
        }
        let radii_m: Vec<f64> = rings
            .iter()
            .map(|ring| 0.5 * (ring.r_m[0] + ring.r_m[1]))
            .collect();
        let steps = || radii_m.windows(2).map(|pair| pair[1] - pair[0]);
        let least_m = steps().fold(f64::INFINITY, f64::min);
        let greatest_m = steps().fold(0.0, f64::max);
        let width_m = first.r_m[1] - first.r_m[0];
        // A jog needs more room than the turns beside it, so it has to be nearer to its neighbours.
        let clearance_m = clearance_m.min(0.9 * (least_m - width_m));
        if clearance_m <= 0.0 {
            return Err(refused(
                "turns that touch are no winding: make the pitch greater than the width",
            ));
        }
        let mut layer = Self {
            coil: index,
            sense: coil.sense,
            x_m: 0.5 * (first.x_m[0] + first.x_m[1]),
            width_m,
            thickness_m: first.x_m[1] - first.x_m[0],
            jog_m: greatest_m,
            radii_m,
            clearance_m,
        };
        // The steeper a jog is, the shorter are the missing ends, and the nearer is it to the jog beside it.
        while layer.between_jogs_m() < width_m + clearance_m {
            layer.jog_m *= 1.05;
        }
        Ok(layer)
    }

    /// Least distance of the middles of neighbouring jogs, m. It grows with their length up to the turns' own.
    fn between_jogs_m(&self) -> f64 {
        const POINTS: i32 = 30;
        let places = |jog: usize| {
            let over = 1.2 * self.jog(jog).1;
            let angle =
                move |point| TAU * jog as f64 + over * f64::from(point) / f64::from(2 * POINTS);
            (-POINTS..=POINTS).map(move |point| self.place(angle(point)))
        };
        let pairs = (2..self.radii_m.len()).flat_map(|jog| {
            places(jog - 1).flat_map(move |one| places(jog).map(move |other| distance(one, other)))
        });
        pairs.fold(f64::INFINITY, f64::min)
    }

    fn last_m(&self) -> f64 {
        self.radii_m[self.radii_m.len() - 1]
    }

    /// Radii before and after a jog, m, counted from 1, and the angle over which it goes, about the angle 2π jog.
    fn jog(&self, jog: usize) -> ([f64; 2], f64) {
        let radii_m = [self.radii_m[jog - 1], self.radii_m[jog]];
        (radii_m, 2.0 * self.jog_m / (radii_m[0] + radii_m[1]))
    }

    /// Radius at an angle, m.
    fn radius_m(&self, angle: f64) -> f64 {
        let turns = self.radii_m.len();
        if turns == 1 {
            return self.radii_m[0];
        }
        let number = (angle / TAU).round().clamp(1.0, (turns - 1) as f64);
        let ([from, to], over) = self.jog(number as usize);
        let share = ((angle - TAU * number) / over + 0.5).clamp(0.0, 1.0);
        from + share * (to - from)
    }

    fn place(&self, angle: f64) -> Place {
        at(self.radius_m(angle), angle)
    }

    /// Angles of the two ends: as far as they go without touching the turn beside them, and at least the
    /// angle `apart` from each other, seen along the axis.
    fn ends(&self, apart: f64) -> [f64; 2] {
        const STEP: f64 = PI / 3600.0;
        let whole = TAU * self.radii_m.len() as f64;
        let room_m = self.width_m + self.clearance_m;
        let free = |end: f64, side: f64, last: f64| {
            let here = self.place(end);
            let beside = (0..1800).map(|step| end + side * (PI + 4.0 * STEP * f64::from(step)));
            let mut beside = beside.filter(|angle| (0.0..=last).contains(angle));
            beside.all(|angle| distance(here, self.place(angle)) >= room_m)
        };
        let ends = (0..3600).map(|step| STEP * f64::from(step));
        let first = ends
            .clone()
            .find(|&end| free(end, 1.0, whole))
            .unwrap_or(PI);
        let mut ends = ends.map(|end| whole - end);
        let last = ends.find(|&end| free(end, -1.0, whole) && first + whole - end >= apart);
        [first, last.unwrap_or(whole - PI)]
    }

    /// Corners of the track from one angle to another.
    fn places(&self, [from, to]: [f64; 2]) -> Vec<Place> {
        let bends = (1..self.radii_m.len()).flat_map(|jog| {
            let half = 0.5 * self.jog(jog).1;
            [-half, half].map(|side| TAU * jog as f64 + side)
        });
        let mut bends: Vec<f64> = bends.filter(|bend| (from..to).contains(bend)).collect();
        bends.push(to);
        let mut places = vec![self.place(from)];
        let mut angle = from;
        for bend in bends {
            let count = ((bend - angle) / chord(self.radius_m(bend)))
                .ceil()
                .max(1.0);
            for step in 1..=count as u32 {
                let share = f64::from(step) / count;
                places.push(self.place(angle + share * (bend - angle)));
            }
            angle = bend;
        }
        places
    }
}

/// Angle of a chord of a circle.
fn chord(radius_m: f64) -> f64 {
    (8.0 * SAGITTA_M / radius_m).sqrt().min(0.1)
}

fn at(radius_m: f64, angle: f64) -> Place {
    [radius_m * angle.cos(), radius_m * angle.sin()]
}

/// Distance of a place from the straight line between two others, m.
fn to_segment_m(place: Place, from: Place, to: Place) -> f64 {
    let [way, there] = [to, place].map(|end| [end[0] - from[0], end[1] - from[1]]);
    let share = (way[0] * there[0] + way[1] * there[1]) / (way[0] * way[0] + way[1] * way[1]);
    let share = share.clamp(0.0, 1.0);
    distance(there, [share * way[0], share * way[1]])
}

pub(super) fn distance(a: Place, b: Place) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn turned(places: Vec<Place>, by: f64) -> Vec<Place> {
    let (sin, cos) = by.sin_cos();
    let turn = |[y, z]: Place| [y * cos - z * sin, y * sin + z * cos];
    places.into_iter().map(turn).collect()
}

/// Adds straight leads along the radius at both ends, to these radii.
fn leads(mut places: Vec<Place>, [first_m, last_m]: [f64; 2]) -> Vec<Place> {
    let along = |place: Place, radius_m: f64| {
        let scale = radius_m / place[0].hypot(place[1]);
        place.map(|coordinate| scale * coordinate)
    };
    let first = along(places[0], first_m);
    if distance(first, places[0]) > 1e-9 {
        places.insert(0, first);
    }
    places.push(along(places[places.len() - 1], last_m));
    places
}

/// A circle with a tab of half the width `tab[1]` to the radius `tab[0]` at each of the places.
pub(super) fn outline(radius_m: f64, tabs: &[Place], [end_m, half_m]: [f64; 2]) -> Vec<Place> {
    let side = (half_m / radius_m).asin();
    let mut angles: Vec<f64> = tabs
        .iter()
        .map(|[y, z]| z.atan2(*y).rem_euclid(TAU))
        .collect();
    angles.sort_by(f64::total_cmp);
    let mut places = Vec::new();
    let arc = |from: f64, to: f64| {
        let count = ((to - from) / chord(radius_m)).ceil().max(1.0);
        let step = |step: u32| at(radius_m, from + (to - from) * f64::from(step) / count);
        (0..=count as u32).map(step).collect::<Vec<Place>>()
    };
    for (index, &angle) in angles.iter().enumerate() {
        let (sin, cos) = angle.sin_cos();
        let corner = |across: f64| [end_m * cos - across * sin, end_m * sin + across * cos];
        places.extend([corner(-half_m), corner(half_m)]);
        let next = angles.get(index + 1).copied().unwrap_or(angles[0] + TAU);
        places.extend(arc(angle + side, next - side));
    }
    if angles.is_empty() {
        places = arc(0.0, TAU);
        places.pop();
    }
    places
}

#[cfg(test)]
mod tests {
    use palpate_field::design::{Design, builtin, builtin_text};

    use super::*;

    /// Turns and jogs keep the clearance and use it, whatever it is; the conductor is closed from pad to pad.
    #[test]
    fn tracks_keep_their_clearance_and_join() {
        for (name, clearance_m) in [
            ("air", 0.1e-3),
            ("air", 0.2e-3),
            ("air", 0.6e-3),
            ("sensing", 0.2e-3),
        ] {
            for winding in Winding::all(&builtin(name).unwrap(), clearance_m).unwrap() {
                let gaps = winding
                    .tracks
                    .iter()
                    .filter(|track| track.coil.is_some())
                    .map(Track::least_gap_m);
                let gap_m = gaps.fold(f64::INFINITY, f64::min);
                println!("{name} {clearance_m}: {gap_m}");
                assert!(
                    (0.97..1.1).contains(&(gap_m / winding.clearance_m)),
                    "{name}: {gap_m}"
                );
                let [first, second] = winding.tracks.as_slice() else {
                    panic!("two layers")
                };
                let [start, via, end] = [1, 3, 2].map(|number| {
                    winding
                        .holes
                        .iter()
                        .find(|hole| hole.number == number)
                        .unwrap()
                        .place
                });
                let ends = [
                    first.places[0],
                    first.places[first.places.len() - 1],
                    second.places[0],
                    second.places[second.places.len() - 1],
                ];
                assert!(
                    [start, via, via, end]
                        .iter()
                        .zip(ends)
                        .all(|(hole, end)| distance(*hole, end) < 1e-9)
                );
            }
        }
    }

    #[test]
    fn what_is_no_board_is_refused_with_a_reason() {
        let refused = |from: &str, to: &str| {
            let text = builtin_text("air").unwrap().replacen(from, to, 1);
            let design = Design::parse("mine", &text).unwrap();
            Winding::all(&design, 0.2e-3).unwrap_err().to_string()
        };
        assert!(refused("rings = 7", "rings = 7\nturns = 20").contains("wound of wire"));
        assert!(refused("rings = 7", "rings = 7\nsense = \"-\"").contains("same sense"));
    }
}
