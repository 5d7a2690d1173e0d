//! Summary of the scripts played.

use std::collections::BTreeMap;

use palpate_sim::world::Truth;
use palpate_wire::code::State;

/// Results of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Number of scripts.
    pub scripts: u64,
    /// Number of frames and other runs of bytes written.
    pub frames: u64,
    /// Number of bytes written.
    pub bytes: u64,
    /// Number of damaged or invalid frames.
    pub refused: u64,
    /// Count of each outcome in an answer, by its name.
    pub outcomes: BTreeMap<&'static str, u64>,
    /// Count of each report that shows how far the board came.
    pub reports: BTreeMap<&'static str, u64>,
    /// Number of observations of the board, by the name of its state and whether it was armed.
    pub states: BTreeMap<(&'static str, bool), u64>,
    /// Number of restarts.
    pub restarts: u64,
    /// Greatest current, A.
    pub greatest_a: f64,
    /// Greatest heat in the copper during a script, J.
    pub heat_j: f64,
    /// Highest temperature of the copper, degrees Celsius.
    pub copper_c: f64,
    /// Violated promises: seed and description.
    pub defects: Vec<(u64, String)>,
}

impl Summary {
    pub(super) fn see(&mut self, state: Option<(State, bool)>, current_a: f64, truth: &Truth) {
        let name = |(state, is_armed): (State, bool)| (state.name(), is_armed);
        let seen = state.map_or(("starting", false), name);
        *self.states.entry(seen).or_default() += 1;
        self.greatest_a = self.greatest_a.max(current_a);
        self.heat_j = self.heat_j.max(truth.heat_in_j);
        self.copper_c = self.copper_c.max(truth.copper_c);
    }

    /// Adds another summary.
    pub fn merge(&mut self, other: Self) {
        self.scripts += other.scripts;
        self.frames += other.frames;
        self.bytes += other.bytes;
        self.refused += other.refused;
        self.restarts += other.restarts;
        for (name, count) in other.outcomes {
            *self.outcomes.entry(name).or_default() += count;
        }
        for (name, count) in other.reports {
            *self.reports.entry(name).or_default() += count;
        }
        for (name, count) in other.states {
            *self.states.entry(name).or_default() += count;
        }
        self.greatest_a = self.greatest_a.max(other.greatest_a);
        self.heat_j = self.heat_j.max(other.heat_j);
        self.copper_c = self.copper_c.max(other.copper_c);
        self.defects.extend(other.defects);
    }
}
