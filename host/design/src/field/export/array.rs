//! A touch array as boards: each coil a spiral on the front of a flexible board of two layers, its inner end led out
//! on the back. Coils that overlap lie on boards of their own, one on the other, and each coil has a tab with two
//! pads at the rim, where no other board has copper.

use core::f64::consts::TAU;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_field::design::Design;

use super::filament::{self, Filament};
use super::winding::{Place, Winding, outline};
use super::{Files, dxf, file_stem, kicad};

/// From a board to the next, m: film, copper on both sides, cover films and glue (a usual flexible board).
const BOARD_M: f64 = 0.25e-3;
/// Copper, m.
const COPPER_M: f64 = 35e-6;
/// From the outermost turn to the rim, m: the tabs of `seven` then lie beside each other.
const RIM_M: f64 = 2.1e-3;
/// Least distance of coils on a board, m.
const APART_M: f64 = 1e-3;
/// Half of a tab's width, m: two pads 4.4 mm apart.
const TAB_M: f64 = 3.3e-3;
/// Least coupling that is listed.
const LEAST_COUPLING: f64 = 0.01;

/// A coil of a layout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArrayCoil {
    /// Position of its axis, m.
    pub(crate) centre_m: [f64; 2],
    /// Inner and outer edge of the winding, m.
    pub(crate) radii_m: [f64; 2],
    pub(crate) turns: u32,
}

/// Where the files go, and the least distance of tracks, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Target<'a> {
    pub(crate) kicad: Option<&'a Path>,
    pub(crate) dxf: Option<&'a Path>,
    pub(crate) clearance_m: f64,
}

/// A coil on its board.
struct Placed {
    board: usize,
    winding: Winding,
    filaments: Vec<Filament>,
    /// The layout's own circles.
    circles: Vec<Filament>,
}

/// Writes the boards of an array, after the round trip.
pub(crate) fn write(
    name: &str,
    coils: &[ArrayCoil],
    target: &Target<'_>,
    out: &mut impl io::Write,
) -> Result<(), Failure> {
    let rim_m = rim_m(coils);
    let angles = angles(coils);
    apart(&angles, rim_m)?;
    let mut placed = Vec::new();
    for ((coil, board), angle) in coils.iter().zip(boards(coils, &angles)).zip(&angles) {
        placed.push(place(coil, board, *angle, (rim_m, target.clearance_m))?);
    }
    let count = placed.iter().map(|of| of.board + 1).max().unwrap_or(0);
    let stem = |board: usize| file_stem(&format!("{name}_board_{}", board + 1));
    let boards: Vec<(String, Winding)> = (0..count)
        .map(|board| (stem(board), joined(&placed, board, &angles, rim_m)))
        .collect();
    let about = "made by palpate plan-touch; not built yet";
    let footprints = boards.iter().map(|(stem, board)| {
        let text = kicad::footprint(stem, about, board);
        (format!("{stem}.kicad_mod"), text.into_bytes())
    });
    let drawings = boards
        .iter()
        .map(|(stem, board)| (format!("{stem}.dxf"), dxf::board(board).into_bytes()));
    let files = [
        Files::of("--kicad", target.kicad, footprints.collect())?,
        Files::of("--dxf", target.dxf, drawings.collect())?,
    ];
    write!(out, "{}", explain(&placed, count))?;
    for files in files {
        files.write(out)?;
    }
    Ok(())
}

/// Radius of all boards, m.
fn rim_m(coils: &[ArrayCoil]) -> f64 {
    let reach = |coil: &ArrayCoil| distance_m(coil.centre_m, [0.0; 2]) + coil.radii_m[1];
    coils.iter().map(reach).fold(0.0, f64::max) + RIM_M
}

fn distance_m(a: Place, b: Place) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Directions of the coils' leads: away from the layout's centre. A coil in the centre takes the middle of the
/// greatest gap.
fn angles(coils: &[ArrayCoil]) -> Vec<f64> {
    let angle = |coil: &ArrayCoil| {
        let [x, y] = coil.centre_m;
        (x.hypot(y) > 1e-6).then(|| y.atan2(x).rem_euclid(TAU))
    };
    let mut taken: Vec<f64> = coils.iter().filter_map(angle).collect();
    taken.sort_by(f64::total_cmp);
    let next = taken
        .iter()
        .skip(1)
        .copied()
        .chain(taken.first().map(|first| first + TAU));
    let widest = taken
        .iter()
        .zip(next)
        .max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
    let free = widest.map_or(0.0, |(from, to)| (0.5 * (from + to)).rem_euclid(TAU));
    coils
        .iter()
        .map(|coil| angle(coil).unwrap_or(free))
        .collect()
}

/// Difference of two directions, 0 to π.
fn between(a: f64, b: f64) -> f64 {
    let turn = (a - b).rem_euclid(TAU);
    turn.min(TAU - turn)
}

/// Refuses tabs that lie on each other: their pads could not be reached.
fn apart(angles: &[f64], rim_m: f64) -> Result<(), Failure> {
    for (index, angle) in angles.iter().enumerate() {
        for (other, second) in angles.iter().enumerate().skip(index + 1) {
            if rim_m * between(*angle, *second) < 2.0 * TAB_M {
                return Err(Failure::Refused(format!(
                    "the leads of coils {} and {} leave the boards at one place: move one of the two off the line \
                     through the layout's centre",
                    index + 1,
                    other + 1
                )));
            }
        }
    }
    Ok(())
}

/// The board of each coil: the first one on which it overlaps no coil and no leads.
fn boards(coils: &[ArrayCoil], angles: &[f64]) -> Vec<usize> {
    let mut boards: Vec<usize> = Vec::new();
    for (index, coil) in coils.iter().enumerate() {
        let collides = |board: usize| {
            (0..index).any(|other| {
                boards[other] == board
                    && (overlap(coil, &coils[other])
                        || crosses(coil, angles[index], &coils[other])
                        || crosses(&coils[other], angles[other], coil))
            })
        };
        let board = (0..index).find(|&board| !collides(board)).unwrap_or(index);
        boards.push(board);
    }
    // Numbers without gaps, in the order in which they first appear.
    let mut order: Vec<usize> = Vec::new();
    for board in &boards {
        if !order.contains(board) {
            order.push(*board);
        }
    }
    let number = |board: &usize| order.iter().position(|of| of == board).unwrap_or(0);
    boards.iter().map(number).collect()
}

fn overlap(one: &ArrayCoil, other: &ArrayCoil) -> bool {
    distance_m(one.centre_m, other.centre_m) < one.radii_m[1] + other.radii_m[1] + APART_M
}

/// Whether the leads of `one`, in this direction, cross the other coil.
fn crosses(one: &ArrayCoil, angle: f64, other: &ArrayCoil) -> bool {
    let way = [0, 1].map(|axis| other.centre_m[axis] - one.centre_m[axis]);
    let (sin, cos) = angle.sin_cos();
    let (along, across) = (way[0] * cos + way[1] * sin, way[1] * cos - way[0] * sin);
    along > 0.0 && across.abs() < other.radii_m[1] + TAB_M
}

/// The coil as a board of its own at the origin, by the exporter of designs.
fn alone(coil: &ArrayCoil, x_m: f64, clearance_m: f64) -> Result<(Design, Winding), Failure> {
    let [inner_m, outer_m] = coil.radii_m;
    let turns = f64::from(coil.turns);
    // The edges are those of the outermost tracks, which are as wide as the spaces between them.
    let width_m = (outer_m - inner_m) / (2.0 * turns - 1.0);
    let [low_m, high_m] = [x_m - 0.5 * COPPER_M, x_m + 0.5 * COPPER_M];
    let text = format!(
        "name = \"array\"\nlength_unit = \"m\"\n[core]\nr = {outer_m}\nx = [{}, {}]\n[conductor]\n\
         resistivity_ohm_m = 1.72e-8\ncurrent_A = 1.0\n[[coil]]\nname = \"coil\"\ndriven = false\n\
         r = [{inner_m}, {}]\nx = [{low_m}, {high_m}]\nrings = {}\npitch = {}\n",
        x_m + 1e-3,
        x_m + 2e-3,
        inner_m + width_m,
        coil.turns,
        2.0 * width_m,
    );
    let design = Design::parse("array", &text).map_err(Failure::refused)?;
    let mut windings = Winding::all(&design, clearance_m)?;
    let winding = windings
        .pop()
        .ok_or_else(|| Failure::Refused("a coil without turns".to_owned()))?;
    Ok((design, winding))
}

/// Places a coil on a board, with leads to its tab at the rim.
fn place(
    coil: &ArrayCoil,
    board: usize,
    angle: f64,
    (rim_m, clearance_m): (f64, f64),
) -> Result<Placed, Failure> {
    let x_m = -(board as f64) * BOARD_M;
    let (design, mut winding) = alone(coil, x_m, clearance_m)?;
    // Both pads on either side of the lead's direction.
    let [first, second] = [0, 1].map(|pad| winding.holes[pad].place);
    let middle = 0.5 * (first[1].atan2(first[0]) + second[1].atan2(second[0]));
    let centre_r_m = distance_m(coil.centre_m, [0.0; 2]);
    let pad_x_m = rim_m + 0.5 * winding.holes[0].diameter_m - centre_r_m;
    for track in &mut winding.tracks {
        track.places = track
            .places
            .iter()
            .map(|place| rotated(*place, -middle))
            .collect();
    }
    let to_rim = |place: Place| [pad_x_m, place[1]];
    let start = to_rim(winding.tracks[0].places[0]);
    winding.tracks[0].places.insert(0, start);
    let end = winding.tracks[1].places.last().copied().map(to_rim);
    winding.tracks[1].places.extend(end);
    winding.holes[0].place = start;
    winding.holes[1].place = end.unwrap_or(start);
    winding.holes[2].place = rotated(winding.holes[2].place, -middle);
    let global = |place: Place| {
        let [x, y] = rotated(place, angle);
        [x + coil.centre_m[0], y + coil.centre_m[1]]
    };
    for track in &mut winding.tracks {
        track
            .places
            .iter_mut()
            .for_each(|place| *place = global(*place));
    }
    winding
        .holes
        .iter_mut()
        .for_each(|hole| hole.place = global(hole.place));
    let rings = design.coils.iter().flat_map(|coil| &coil.rings);
    let circles = filament::of_rings(rings.map(|ring| (ring, 1.0)));
    Ok(Placed {
        board,
        filaments: filament::of_windings(&[&winding]),
        circles: circles.iter().map(|of| of.moved(coil.centre_m)).collect(),
        winding,
    })
}

fn rotated([x, y]: Place, angle: f64) -> Place {
    let (sin, cos) = angle.sin_cos();
    [x * cos - y * sin, x * sin + y * cos]
}

/// All coils of a board as one winding; each has its own three holes.
fn joined(placed: &[Placed], board: usize, angles: &[f64], rim_m: f64) -> Winding {
    let mut on_it = placed
        .iter()
        .zip(angles)
        .filter(|(of, _)| of.board == board);
    let mut all = placed[0].winding.clone();
    all.tracks.clear();
    all.holes.clear();
    let mut tabs = Vec::new();
    for (number, (of, angle)) in (0_u8..).zip(&mut on_it) {
        all.tracks.extend(of.winding.tracks.iter().cloned());
        let holes = of.winding.holes.iter().map(|hole| {
            let mut hole = *hole;
            hole.number += 3 * number;
            hole
        });
        all.holes.extend(holes);
        tabs.push(rotated([rim_m, 0.0], *angle));
        all.clearance_m = all.clearance_m.min(of.winding.clearance_m);
    }
    let pad_m = all
        .holes
        .iter()
        .map(|hole| hole.diameter_m)
        .fold(0.0, f64::max);
    all.edges = vec![outline(rim_m, &tabs, [rim_m + pad_m + 0.5e-3, TAB_M])];
    all
}

/// The round trip: inductance of each coil and coupling of its neighbours, by the tracks and by the circles.
fn explain(placed: &[Placed], count: usize) -> String {
    let henry = |filaments: &[Filament]| filament::inductance_h(filaments);
    let of_tracks: Vec<f64> = placed.iter().map(|of| henry(&of.filaments)).collect();
    let of_circles: Vec<f64> = placed.iter().map(|of| henry(&of.circles)).collect();
    let mut text = format!(
        "{count} flexible boards of two layers, {:.2} mm from one to the next: coils of the last lie {:.2} mm deeper than \
         the layout says\n  coil  board  turns' distance mm  R ohm  L of tracks uH  of circles uH    off %\n",
        1e3 * BOARD_M,
        1e3 * BOARD_M * (count.max(1) - 1) as f64,
    );
    for (index, of) in placed.iter().enumerate() {
        let _ = writeln!(
            text,
            "{:>6}{:>7}{:>20.3}{:>7.2}{:>16.4}{:>15.4}{:>+9.2}",
            index + 1,
            of.board + 1,
            1e3 * of.winding.clearance_m,
            of.winding.resistance_ohm(1.72e-8),
            1e6 * of_tracks[index],
            1e6 * of_circles[index],
            100.0 * (of_tracks[index] / of_circles[index] - 1.0)
        );
    }
    text.push_str("  coils   k of tracks  of circles\n");
    for (index, first) in placed.iter().enumerate() {
        for (other, second) in placed.iter().enumerate().skip(index + 1) {
            let coupling = |filaments: fn(&Placed) -> &[Filament], henries: &[f64]| {
                let mutual_h = filament::mutual_h(filaments(first), filaments(second));
                mutual_h / (henries[index] * henries[other]).sqrt()
            };
            let tracks = coupling(|of| &of.filaments, &of_tracks);
            let circles = coupling(|of| &of.circles, &of_circles);
            if tracks.abs().max(circles.abs()) >= LEAST_COUPLING {
                let pair = format!("{} {}", index + 1, other + 1);
                let _ = writeln!(text, "{pair:>7}{tracks:>14.3}{circles:>12.3}");
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    fn ring(count: u32, distance_m: f64) -> Vec<ArrayCoil> {
        let at = |index: u32| rotated([distance_m, 0.0], TAU * f64::from(index) / f64::from(count));
        let centres = std::iter::once([0.0; 2]).chain((0..count).map(at));
        let coil = |centre_m| ArrayCoil {
            centre_m,
            radii_m: [1.75e-3, 6.75e-3],
            turns: 10,
        };
        centres.map(coil).collect()
    }

    #[test]
    fn coils_that_overlap_are_on_boards_of_their_own() {
        let near = ring(3, 6e-3);
        let boards_of = |coils: &[ArrayCoil]| boards(coils, &angles(coils));
        assert_eq!(boards_of(&near), [0, 1, 2, 3]);
        // Far from each other all fit on one board, except where the leads of the middle one would cross another.
        let far = ring(3, 25e-3);
        assert_eq!(boards_of(&far), [0; 4]);
        let six = ring(6, 16e-3);
        let of = boards_of(&six);
        for (one, coil) in six.iter().enumerate() {
            for (other, second) in six.iter().enumerate().skip(one + 1) {
                assert!(of[one] != of[other] || !overlap(coil, second));
            }
        }
        assert!(of.iter().max() < Some(&3), "{of:?}");
    }

    #[test]
    fn leads_that_leave_at_one_place_are_refused() {
        let mut row = ring(1, 6e-3);
        row.push(ArrayCoil {
            centre_m: [12e-3, 0.0],
            ..row[1]
        });
        let refused = apart(&angles(&row), rim_m(&row)).unwrap_err();
        assert!(refused.to_string().contains("coils 2 and 3"), "{refused}");
    }

    /// Two coaxial circles by Maxwell's formula with elliptic integrals, and circles apart by their dipoles.
    #[test]
    fn tracks_couple_as_the_circles_do() {
        let coils = ring(3, 6e-3);
        let angles = angles(&coils);
        let placed: Vec<Placed> = (0..2)
            .map(|index| {
                place(&coils[index], index, angles[index], (rim_m(&coils), 0.1e-3)).unwrap()
            })
            .collect();
        for of in &placed {
            let off =
                filament::inductance_h(&of.filaments) / filament::inductance_h(&of.circles) - 1.0;
            assert!(off.abs() < 0.05, "{off}");
        }
        let k = |filaments: fn(&Placed) -> &Vec<Filament>| {
            let [one, other] = [&placed[0], &placed[1]].map(filaments);
            filament::mutual_h(one, other)
                / (filament::inductance_h(one) * filament::inductance_h(other)).sqrt()
        };
        let (tracks, circles) = (k(|of| &of.filaments), k(|of| &of.circles));
        assert!((tracks - circles).abs() < 0.02, "{tracks} {circles}");
        // Far apart in a plane a coil is a dipole of moment N π r²: M = -μ0/4π m²/d³ per ampere.
        let far_m = 60e-3;
        let far: Vec<Filament> = placed[0]
            .circles
            .iter()
            .map(|of| of.moved([far_m, 0.0]))
            .collect();
        let found = filament::mutual_h(&placed[0].circles, &far);
        let width_m = 5e-3 / 19.0;
        let radii = (0..10).map(|turn| 1.75e-3 + width_m * (2.0 * f64::from(turn) + 0.5));
        let moment: f64 = radii.map(|radius| PI * radius * radius).sum();
        let dipole = -1e-7 * moment * moment / far_m.powi(3);
        assert!((found / dipole - 1.0).abs() < 0.05, "{found} {dipole}");
    }
}
