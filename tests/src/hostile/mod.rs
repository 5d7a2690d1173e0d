//! Hostile bytes over the links: a board receives commands, near-commands and garbage, in every
//! state, and keeps its promises.
//!
//! - It neither panics nor stops reading bytes.
//! - Every command that arrives complete has exactly one answer, on its own link. Answers
//!   go to no other link; all other records go to both links.
//! - The coil carries current only while the device is armed and no fault is latched, and never
//!   more than the drive's limits of current, time and energy allow.
//! - At the end the board can be disarmed.
//!
//! The input is a [script] of bytes, so random campaigns, fuzzers and files share one format.

pub mod chance;
pub mod frame;
mod links;
pub mod script;
mod sensor;
mod session;
mod summary;

use palpate_sim::native::Wiring;
use palpate_wire::Command;

use self::sensor::SENSOR;
use self::session::HostileSession;
pub use self::summary::Summary;

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
