//! Hostile bytes over the links: a board receives commands, near-commands and garbage, in every
//! state, and keeps its promises.
//!
//! - It neither panics nor stops reading bytes.
//! - Every command that arrives complete has exactly one answer, on its own link; answers
//!   go nowhere else, and everything else goes to both links.
//! - The coil carries current only while the device is armed and no fault is latched, and never
//!   more than the drive's limits of current, time and energy allow.
//! - At the end it can be disarmed.
//!
//! The input is a [script] of bytes, so random campaigns, fuzzers and files share one format.

pub mod chance;
pub mod frame;
mod links;
pub mod script;
mod sensor;
mod session;

use std::collections::BTreeMap;

use palpate_sim::native::Wiring;
use palpate_sim::world::Truth;
use palpate_wire::Command;
use palpate_wire::code::State;

use self::sensor::SENSOR;
use self::session::HostileSession;

/// Results of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Number of scripts.
    pub scripts: u64,
    /// Number of frames and other runs of bytes written, and number of bytes.
    pub frames: u64,
    /// See [`frames`](Self::frames).
    pub bytes: u64,
    /// Number of damaged or invalid frames.
    pub refused: u64,
    /// Count of each outcome in an answer, by its name.
    pub outcomes: BTreeMap<&'static str, u64>,
    /// Count of each report that shows how far the board came.
    pub reports: BTreeMap<&'static str, u64>,
    /// Number of observations of the board in each state, by its name, and whether it was armed.
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
    fn see(&mut self, state: Option<(State, bool)>, current_a: f64, truth: &Truth) {
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

/// Plays a script on a newly started board.
///
/// # Errors
/// The violated promise.
pub fn play(script: &[u8]) -> Result<Summary, String> {
    let sensor = SENSOR.as_ref().ok_or("there is no such sensor")?;
    let world = sensor.world().ok_or("there is no such world")?;
    let wiring = Wiring::new(world);
    let mut session = HostileSession::new(&wiring, sensor);
    for (index, of) in script::read(script).iter().enumerate() {
        let done = session.carry_out(of);
        done.map_err(|defect| format!("move {index}, {of:?}: {defect}"))?;
    }
    let ended = session.finish();
    ended.map_err(|defect| format!("at the end: {defect}"))?;
    Ok(Summary {
        scripts: 1,
        ..session.summary
    })
}

/// Commands of a complete configuration, in order of their numbers.
#[must_use]
pub fn configuration() -> &'static [Command] {
    SENSOR.as_ref().map_or(&[], |sensor| &sensor.calibration)
}

/// Plays the scripts of consecutive seeds, until `frames` frames were written.
#[must_use]
pub fn campaign(first: u64, frames: u64) -> Summary {
    let mut summary = Summary::default();
    let mut seed = first;
    while summary.frames < frames && summary.defects.len() < 20 {
        match play(&chance::script(seed)) {
            Ok(one) => summary.merge(one),
            Err(defect) => summary.defects.push((seed, defect)),
        }
        seed += 1;
    }
    summary
}
