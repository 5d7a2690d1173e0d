//! The round trip: compares the exported tracks with the design.

use core::f64::consts::TAU;
use std::fmt::Write as _;

use palpate_cli::failure::Failure;
use palpate_field::design::{Design, RingCoil};
use palpate_field::solve::Excitation;

use super::super::drive::{field_of, reached};
use super::super::input::Effort;
use super::filament;
use super::winding::{Track, Winding};

/// Windings in series.
pub(super) struct Series<'w> {
    pub(super) name: String,
    pub(super) windings: Vec<&'w Winding>,
    /// Their coils in the design.
    pub(super) coils: Vec<usize>,
    /// The current that they are meant for, A; none for a sensing coil.
    pub(super) current_a: Option<f64>,
}

impl<'w> Series<'w> {
    /// The driven windings in series, then each of the others.
    pub(super) fn all(design: &Design, windings: &'w [Winding]) -> Vec<Self> {
        let coils_of = |winding: &Winding| -> Vec<usize> {
            winding
                .tracks
                .iter()
                .filter_map(|track| track.coil)
                .collect()
        };
        let driven = |winding: &&Winding| {
            let coils = coils_of(winding);
            coils
                .iter()
                .all(|&coil| design.coils.get(coil).is_some_and(|coil| coil.driven))
        };
        let (in_series, alone): (Vec<_>, Vec<_>) = windings.iter().partition(driven);
        let mut all = Vec::new();
        if !in_series.is_empty() {
            let names = in_series.iter().map(|winding| winding.name.as_str());
            all.push(Self {
                name: format!("{} in series", names.collect::<Vec<_>>().join(" and ")),
                coils: in_series
                    .iter()
                    .flat_map(|winding| coils_of(winding))
                    .collect(),
                windings: in_series,
                current_a: Some(design.current_a),
            });
        }
        all.extend(alone.into_iter().map(|winding| Self {
            name: winding.name.clone(),
            coils: coils_of(winding),
            windings: vec![winding],
            current_a: None,
        }));
        all
    }

    fn of_design<'d>(&self, design: &'d Design) -> impl Iterator<Item = &'d RingCoil> {
        self.coils.iter().filter_map(|&coil| design.coils.get(coil))
    }
}

/// A quantity of the tracks and of the design, each in SI units.
struct Row {
    name: &'static str,
    unit: &'static str,
    scale: f64,
    tracks: f64,
    design: f64,
}

/// Results for the tracks of windings in series.
pub(super) struct RoundTrip {
    rows: Vec<Row>,
    /// Field across the axis at the core's middle, relative to that along it.
    across: f64,
    pub(super) inductance_in_air_h: f64,
}

impl RoundTrip {
    pub(super) fn of(
        design: &Design,
        series: &Series<'_>,
        effort: &Effort,
    ) -> Result<Self, Failure> {
        let tracks = filament::of_windings(&series.windings);
        let rings = series
            .of_design(design)
            .flat_map(|coil| coil.rings.iter().map(|ring| (ring, coil.sense)));
        let rings = filament::of_rings(rings);
        let resistances = series
            .windings
            .iter()
            .map(|winding| winding.resistance_ohm(design.resistivity_ohm_m));
        let of_design = series
            .of_design(design)
            .map(|coil| design.coil_resistance_ohm(coil));
        // Thin tracks refine the mesh, so the accuracy is better than requested: with 1e-3 instead of 5e-3, L
        // of the built-in sensing coil changes by less than 1e-5, and takes twice the time.
        let effort = match series.current_a {
            Some(_) => effort.clone(),
            None => effort.at_most_accurate(5e-3),
        };
        let [of_tracks, of_rings] = [
            as_tracks(design, series),
            (design.clone(), series.coils.clone()),
        ]
        .map(|(design, coils)| with_iron(&design, &coils, &effort));
        let (of_tracks, of_rings) = (of_tracks?, of_rings?);
        let [axial, one, other] = filament::field_t(&tracks, [design.core.middle_m(), 0.0, 0.0]);
        let row = |name, unit, scale, tracks, design| Row {
            name,
            unit,
            scale,
            tracks,
            design,
        };
        let inductance_in_air_h = filament::inductance_h(&tracks);
        let core = |filaments: &[_]| filament::core_mean_t(filaments, &design.core);
        Ok(Self {
            rows: vec![
                row(
                    "resistance at 20 C",
                    "ohm",
                    1.0,
                    resistances.sum(),
                    of_design.sum(),
                ),
                row(
                    "L in air",
                    "uH",
                    1e6,
                    inductance_in_air_h,
                    filament::inductance_h(&rings),
                ),
                row("core mean in air", "uT/A", 1e6, core(&tracks), core(&rings)),
                row("L", "uH", 1e6, of_tracks[0], of_rings[0]),
                row("core mean", "uT/A", 1e6, of_tracks[1], of_rings[1]),
            ],
            across: one.hypot(other) / axial.abs(),
            inductance_in_air_h,
        })
    }

    pub(super) fn explain(&self, series: &Series<'_>) -> String {
        let mut text = format!(
            "{}\n  {:<22}{:>14}{:>14}{:>9}\n",
            series.name, "", "tracks", "design", "off %"
        );
        for Row {
            name,
            unit,
            scale,
            tracks,
            design,
        } in &self.rows
        {
            let off = 100.0 * (tracks / design - 1.0);
            let _ = writeln!(
                text,
                "  {:<22}{:>14.4}{:>14.4}{off:>+9.2}",
                format!("{name} {unit}"),
                scale * tracks,
                scale * design
            );
        }
        let _ = writeln!(
            text,
            "  field across the axis at the core's middle, in air: {:.2} % of that along it",
            100.0 * self.across
        );
        text
    }
}

/// The design with the tracks' mean around the axis in place of the turns of these coils, and its coils.
fn as_tracks(design: &Design, series: &Series<'_>) -> (Design, Vec<usize>) {
    let mut changed = design.clone();
    let mut coils = Vec::new();
    let tracks = series.windings.iter().flat_map(|winding| &winding.tracks);
    for track in tracks {
        let Some((index, coil)) = track
            .coil
            .and_then(|index| Some((index, design.coils.get(index)?)))
        else {
            continue;
        };
        for (number, share) in shares(track, coil).into_iter().enumerate() {
            let turn = RingCoil {
                rings: coil.rings.get(number).into_iter().copied().collect(),
                turns: share,
                ..coil.clone()
            };
            // The first ring stays where the coil was, so that the others keep their numbers.
            match changed.coils.get_mut(index) {
                Some(first) if number == 0 => {
                    *first = turn;
                    coils.push(index);
                }
                _ => {
                    coils.push(changed.coils.len());
                    changed.coils.push(turn);
                }
            }
        }
    }
    (changed, coils)
}

/// Number of turns of a track at each ring's radius; a part between two rings is divided between them.
fn shares(track: &Track, coil: &RingCoil) -> Vec<f64> {
    let radii: Vec<f64> = coil
        .rings
        .iter()
        .map(|ring| 0.5 * (ring.r_m[0] + ring.r_m[1]))
        .collect();
    let mut shares = vec![0.0; radii.len()];
    for ends in track.places.windows(2) {
        let [[y0, z0], [y1, z1]] = [ends[0], ends[1]];
        let turns = (y0 * z1 - z0 * y1).atan2(y0 * y1 + z0 * z1).abs() / TAU;
        let radius = (0.5 * (y0 + y1)).hypot(0.5 * (z0 + z1));
        let distance = |index: &usize| (radii[*index] - radius).abs();
        let mut nearest: Vec<usize> = (0..radii.len()).collect();
        nearest.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        match nearest.as_slice() {
            [one, other, ..] => {
                let share = ((radius - radii[*one]) / (radii[*other] - radii[*one])).max(0.0);
                shares[*one] += turns * (1.0 - share);
                shares[*other] += turns * share;
            }
            _ => shares[0] += turns,
        }
    }
    shares
}

/// Inductance, H, and core mean, T, per ampere in these coils, far below saturation.
fn with_iron(design: &Design, coils: &[usize], effort: &Effort) -> Result<[f64; 2], Failure> {
    let mut excitation = Excitation::small(design, 0.0);
    for &coil in coils {
        if let Some(current) = excitation.currents_a.get_mut(coil) {
            *current = 1.0;
        }
    }
    let solved = field_of(design, &excitation, effort)?;
    reached(design, &solved)?;
    let linkages = coils.iter().map(|&coil| solved.linkage_wb(design, coil));
    Ok([linkages.sum(), solved.figures.core_mean_t])
}
