//! Builds one closed outline from lines and arcs that are in any order.

use super::beside::Beside;
use super::dxf::Drawn;
use crate::design::DesignError;
use crate::geometry::{Point, distance};

/// Distance below which the ends of two sides are joined, m: more than the rounding of drawings,
/// and a tenth of the thinnest part.
const JOINED_M: f64 = 1e-7;

const MEETING: &str = "lines and arcs that meet within 0.1 um, or end on the axis, r = 0";

/// Orders the sides and reverses some, so that each starts where the previous one ends. An outline
/// may be open along the axis.
pub(super) fn closed(beside: &Beside, drawn: Vec<Drawn>) -> Result<Vec<Drawn>, DesignError> {
    let line = drawn.first().map_or(1, |side| side.line);
    let mut rest: Vec<Drawn> = drawn.into_iter().map(on_axis).filter(has_length).collect();
    if rest.is_empty() {
        return Err(beside.error(line, "has no length", "lines and arcs with a length"));
    }
    for side in &rest {
        if let Some(&below) = [side.from, side.to].iter().find(|end| end[0] < 0.0) {
            let problem = format!("lies below the axis, {}", near(below));
            return Err(beside.error(side.line, problem, "X of 0 or more: X is r, Y is x"));
        }
    }
    let mut chain: Vec<Drawn> = rest.drain(..rest.len().min(1)).collect();
    extend(beside, &mut chain, &mut rest)?;
    let [Some(start), Some(mut end)] = [chain.first(), chain.last()].map(|side| side.copied())
    else {
        return Ok(chain);
    };
    let mut start = start;
    if !rest.is_empty() && distance(start.from, end.to) > JOINED_M {
        // The first side may be in the middle of the outline: reverse the chain and extend its
        // other end.
        chain = chain.iter().rev().map(Drawn::reversed).collect();
        extend(beside, &mut chain, &mut rest)?;
        (start, end) = (
            chain.first().copied().unwrap_or(start),
            chain.last().copied().unwrap_or(end),
        );
    }
    let is_open = distance(start.from, end.to) > JOINED_M;
    if let Some((gap_m, place, line)) = nearest([start.from, end.to], &rest).filter(|_| is_open) {
        let gap_mm = 1e3 * gap_m;
        let problem = format!("the outline has a gap of {gap_mm:.4} mm, {}", near(place));
        return Err(beside.error(line, problem, MEETING));
    }
    if let Some(other) = rest.first() {
        let problem = format!("belongs to no outline with the rest, {}", near(other.from));
        let allowed = "one closed outline on a layer; holes by minus, from a layer of their own";
        return Err(beside.error(other.line, problem, allowed));
    }
    if !is_open {
        if let Some(last) = chain.last_mut() {
            last.to = start.from;
        }
    } else if start.from[0] == 0.0 && end.to[0] == 0.0 {
        chain.push(Drawn {
            from: end.to,
            through: None,
            to: start.from,
            line: end.line,
        });
    } else {
        let problem = format!(
            "the outline is open by {:.4} mm, {} and {}",
            1e3 * distance(start.from, end.to),
            near(start.from),
            near(end.to)
        );
        return Err(beside.error(end.line, problem, MEETING));
    }
    Ok(chain)
}

/// Extends a chain side by side, as long as an unused side has an end where the chain ends.
fn extend(
    beside: &Beside,
    chain: &mut Vec<Drawn>,
    rest: &mut Vec<Drawn>,
) -> Result<(), DesignError> {
    while let Some(&last) = chain.last() {
        let starts = chain
            .first()
            .is_some_and(|first| chain.len() > 1 && distance(first.from, last.to) <= JOINED_M);
        let meets = |point: Point| distance(point, last.to) <= JOINED_M;
        let mut meeting = rest.iter().enumerate();
        let mut meeting = meeting
            .by_ref()
            .filter(|(_, side)| meets(side.from) || meets(side.to));
        let (next, branch) = (meeting.next(), meeting.next());
        if let Some((_, side)) = if starts { next } else { branch } {
            let problem = format!("three sides meet {}", near(last.to));
            let allowed = "one closed outline on a layer, without lines inside and without a side drawn twice";
            return Err(beside.error(side.line, problem, allowed));
        }
        let Some((index, &side)) = next else {
            break;
        };
        rest.remove(index);
        let side = if meets(side.from) {
            side
        } else {
            side.reversed()
        };
        chain.push(Drawn {
            from: last.to,
            ..side
        });
    }
    Ok(())
}

/// The end of any side that is nearest to one of two points: its distance, m, its position, and the
/// side's line number.
fn nearest(places: [Point; 2], sides: &[Drawn]) -> Option<(f64, Point, usize)> {
    let ends = sides
        .iter()
        .flat_map(|side| [(side.from, side.line), (side.to, side.line)]);
    let apart = ends.map(|(end, line)| {
        let [first, second] = places.map(|place| distance(place, end));
        (first.min(second), end, line)
    });
    apart.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Whether the side is longer than a point: drawing programs repeat vertices and write lines of
/// zero length.
fn has_length(side: &Drawn) -> bool {
    let [through, to] = [side.through.unwrap_or(side.from), side.to];
    distance(side.from, through).max(distance(side.from, to)) > JOINED_M
}

/// Moves ends that lie on the axis within the joining distance exactly onto it.
fn on_axis(side: Drawn) -> Drawn {
    let snapped = |[r, x]: Point| [if r.abs() <= JOINED_M { 0.0 } else { r }, x];
    Drawn {
        from: snapped(side.from),
        to: snapped(side.to),
        ..side
    }
}

fn near([r, x]: Point) -> String {
    format!("near r = {:.4} mm, x = {:.4} mm", 1e3 * r, 1e3 * x)
}
