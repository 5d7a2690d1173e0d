//! Start of a fit without an earlier press.

use super::array::Array;
use super::estimate::{Prior, Scan, State};
use super::profile::Table;
use crate::math::{ln, sqrt};
use crate::units::Metre;

/// The candidate whose best force leaves the least misfit: places between the coil of the largest
/// reading and the others, between the coils' centroid and the others, and the centroid of the
/// readings above zero; all with the indenter's mean radius.
///
/// Without Psi the readings are linear in the force, which follows in closed form.
pub(super) fn start(array: &Array, scan: &Scan, prior: &Prior) -> Option<State> {
    let coils = array.coils();
    let readings = coils.iter().zip(scan.straight());
    let (largest, _) = readings.max_by(|a, b| a.1.total_cmp(b.1))?;
    let between = |from: [f32; 2], share: f32| {
        coils.iter().map(move |coil| {
            let [x, y] = from;
            [x + share * (coil.x.0 - x), y + share * (coil.y.0 - y)]
        })
    };
    let (near, centre) = ([largest.x.0, largest.y.0], mean(array));
    let places = between(near, 0.0)
        .take(1)
        .chain(between(near, 1.0 / 3.0))
        .chain(between(near, 2.0 / 3.0))
        .chain(between(centre, 0.0).take(1))
        .chain(between(centre, 0.5))
        .chain(centroid(array, scan));
    let table = array.profile.table(prior.start);
    let mut best: Option<(f32, State)> = None;
    for [x, y] in places {
        let Some((misfit, force)) = force(array, scan, [x, y], &table) else {
            continue;
        };
        if best.as_ref().is_none_or(|(least, _)| misfit < *least) {
            let ln_force = ln(force);
            let ln_radius = prior.start + prior.exponent * ln_force;
            let [x, y] = [x, y].map(|of| array.profile.knots(Metre(of)));
            best = Some((misfit, State([x, y, ln_force, ln_radius])));
        }
    }
    best.map(|(_, state)| state)
}

/// Centroid of the coils.
fn mean(array: &Array) -> [f32; 2] {
    let coils = array.coils();
    let share = 1.0 / coils.len() as f32;
    coils.iter().fold([0.0; 2], |[x, y], coil| {
        [x + share * coil.x.0, y + share * coil.y.0]
    })
}

/// Mean place of the readings above zero, weighted by their squares.
fn centroid(array: &Array, scan: &Scan) -> Option<[f32; 2]> {
    let mut sums = [0.0; 3];
    for (coil, straight) in array.coils().iter().zip(scan.straight()) {
        let weight = straight.max(0.0) * straight.max(0.0);
        let parts = [weight, weight * coil.x.0, weight * coil.y.0];
        for (sum, part) in sums.iter_mut().zip(parts) {
            *sum += part;
        }
    }
    let [weight, x, y] = sums;
    (weight > 0.0).then(|| [x / weight, y / weight])
}

/// The best force at a place, with its misfit; `None` if it is not above zero.
fn force(array: &Array, scan: &Scan, [x, y]: [f32; 2], table: &Table) -> Option<(f32, f32)> {
    let [mut square, mut cross, mut own] = [0.0; 3];
    for (coil, (straight, weight)) in array
        .coils()
        .iter()
        .zip(scan.straight().iter().zip(scan.weights()))
    {
        let [dx, dy] = [x - coil.x.0, y - coil.y.0];
        let distance = array.profile.knots(Metre(sqrt(dx * dx + dy * dy)));
        let predicted = weight * table.value(distance);
        let found = weight * straight;
        square += predicted * predicted;
        cross += predicted * found;
        own += found * found;
    }
    let force = cross / square;
    (force > 0.0 && force.is_finite()).then_some((own - force * cross, force))
}
