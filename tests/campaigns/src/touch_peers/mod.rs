//! `cargo campaign touch-peers`: contacts of the simulated touch sensors beside ContactMechanics, from the
//! Python package index, and beside published solutions.

mod cases;
mod published;

use std::env;
use std::f64::consts::PI;
use std::fs;
use std::process::Command;

use cases::{CASES, Case};
use palpate_cli::failure::Failure;
use palpate_sim::touch::TouchTruth;
use published::Published;
use serde::Deserialize;

use crate::{evidence, python, tool};

/// Folder of script and cases, in the folder of the run.
const FOLDER: &str = "target/touch-peers";

/// Installed version, so that the figures can be reproduced.
const PACKAGE: &str = "ContactMechanics==1.8.3";

/// Greatest relative error of forces and areas.
const LIMIT: f64 = 0.01;

/// What the peer finds on one grid.
#[derive(Clone, Copy, Debug, Deserialize)]
struct PeerContact {
    force_n: f64,
    area_m2: f64,
    centre_m: f64,
}

/// Greatest errors, which decide the claim.
#[derive(Debug, Default)]
struct Worst {
    /// Of presses by the integral equation.
    round: f64,
    /// Of presses on a grid: force and area.
    grid: [f64; 2],
    /// Of published forces and areas.
    published: f64,
}

/// Runs everything and prints the result.
pub(crate) fn run() -> Result<(), Failure> {
    let mut worst = Worst::default();
    let published = published_table(&mut worst);
    let peer = peer_table(&by_peer(&CASES)?, &mut worst);
    let [force, area] = worst.grid.map(percent);
    evidence::print(&format!(
        "Balls and pins: forces and areas within {} of ContactMechanics and within {} of published solutions. On the grid, \
         which tilted pins, bars and two balls take: forces within {force}, areas within {area}.\n\n{peer}\n{published}",
        percent(worst.round),
        percent(worst.published),
    ));
    if worst.round.max(worst.published) <= LIMIT {
        return Ok(());
    }
    Err(Failure::Refused(format!(
        "a ball or a pin is off by more than {}",
        percent(LIMIT)
    )))
}

/// Installs the peer and lets it press all cases; each on all grids, from coarse to fine.
fn by_peer(cases: &[Case]) -> Result<Vec<Vec<PeerContact>>, Failure> {
    let folder = env::current_dir()?.join(FOLDER);
    fs::create_dir_all(&folder)?;
    let python = python::with_packages(&folder, &[PACKAGE])?;
    let (script, file) = (
        folder.join("with_contactmechanics.py"),
        folder.join("cases.json"),
    );
    fs::write(&script, include_str!("with_contactmechanics.py"))?;
    let cases: Vec<_> = cases.iter().map(Case::json).collect();
    fs::write(&file, serde_json::to_string(&cases)?)?;
    let printed = tool::printed(Command::new(python).arg(script).arg(file))?;
    let contacts = printed
        .lines()
        .map(serde_json::from_str)
        .collect::<Result<Vec<Vec<PeerContact>>, _>>()?;
    if contacts.len() == cases.len() && contacts.iter().all(|grids| grids.len() >= 2) {
        return Ok(contacts);
    }
    Err(Failure::refused("the peer did not press all cases"))
}

/// Table of all cases beside the peer.
fn peer_table(contacts: &[Vec<PeerContact>], worst: &mut Worst) -> String {
    let mut table = format!(
        "Beside {PACKAGE} on ever finer grids, of which the last counts; its change from the one before is stated. Shear \
         modulus 20 kPa, no friction. Differences are palpate's from the peer's; an area counts where no edge \
         gives it; the peer's under a ball ends where the square of its pressure vanishes, others are sums of cells.\n\n\
         | indenter | layer | Poisson's ratio | depth, mm | force, N | peer's | difference | peer's last change | area, mm² | \
         peer's | difference | peer's last change | centres apart, mm |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    );
    for (case, grids) in CASES.iter().zip(contacts) {
        if let [.., before, last] = grids.as_slice() {
            let found = case.simulated();
            table += &peer_row(case, &found, (before, last), worst);
        }
    }
    table
}

fn peer_row(
    case: &Case,
    found: &TouchTruth,
    (before, last): (&PeerContact, &PeerContact),
    worst: &mut Worst,
) -> String {
    let area_m2 = area_m2(found);
    let force = found.force_n / last.force_n - 1.0;
    let area = area_m2 / last.area_m2 - 1.0;
    let counted = if case.has_free_area() { area } else { 0.0 };
    if case.is_round() {
        worst.round = worst.round.max(force.abs()).max(counted.abs());
    } else {
        for (worst, error) in worst.grid.iter_mut().zip([force, counted]) {
            *worst = worst.max(error.abs());
        }
    }
    let areas = if case.has_free_area() {
        format!(
            "{:.3} | {:.3} | {} | {}",
            1e6 * area_m2,
            1e6 * last.area_m2,
            signed(area),
            signed(last.area_m2 / before.area_m2 - 1.0)
        )
    } else {
        " | | |".to_owned()
    };
    let [x_m, _] = found.place_m;
    format!(
        "| {} | {:.5} | {:.5} | {} | {} | {areas} | {:.3} |\n",
        case.name(),
        found.force_n,
        last.force_n,
        signed(force),
        signed(last.force_n / before.force_n - 1.0),
        1e3 * (x_m - last.centre_m).abs()
    )
}

/// Table of published solutions, a row for each source; prints each press.
fn published_table(worst: &mut Worst) -> String {
    let mut table = String::from(
        "Beside published solutions, differences from the least to the greatest:\n\n\
         | solution | presses | forces | areas |\n|---|---|---|---|\n",
    );
    let found: Vec<Difference> = published::all().iter().map(difference).collect();
    for of_source in found.chunk_by(|one, other| one.source == other.source) {
        let forces: Vec<f64> = of_source.iter().map(|of| of.force).collect();
        let areas: Vec<f64> = of_source.iter().filter_map(|of| of.area).collect();
        for error in forces.iter().chain(&areas) {
            worst.published = worst.published.max(error.abs());
        }
        let source = of_source.first().map_or("", |of| of.source);
        table += &format!(
            "| {source} | {} | {} | {} |\n",
            forces.len(),
            range(&forces),
            range(&areas)
        );
    }
    table
}

/// Differences of a press from its published solution.
struct Difference {
    source: &'static str,
    force: f64,
    area: Option<f64>,
}

fn difference(published: &Published) -> Difference {
    let found = published.case.simulated();
    let force = found.force_n / published.force_n - 1.0;
    println!(
        "{}, {}: {}",
        published.source,
        published.case.name(),
        signed(force)
    );
    Difference {
        source: published.source,
        force,
        area: published
            .area_m2
            .map(|expected_m2| area_m2(&found) / expected_m2 - 1.0),
    }
}

fn range(shares: &[f64]) -> String {
    let least = shares.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = shares.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if shares.is_empty() {
        String::new()
    } else {
        format!("{} to {}", signed(least), signed(greatest))
    }
}

/// Area of a contact, m².
fn area_m2(found: &TouchTruth) -> f64 {
    PI * found.radius_m * found.radius_m
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

fn signed(share: f64) -> String {
    format!("{:+.2} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_and_pins_are_the_published_ones() {
        let found: Vec<Difference> = published::all().iter().map(difference).collect();
        assert!(found.len() > 10);
        for of in found {
            let area = of.area.unwrap_or(0.0);
            assert!(
                of.force.abs().max(area.abs()) < LIMIT,
                "{}: {} {area}",
                of.source,
                of.force
            );
        }
    }
}
