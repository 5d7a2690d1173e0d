//! The file of presses, written sensor by sensor.

use std::fs::File;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::PlantResult;
use super::press::Press;
use crate::failure::Failure;
use crate::output::OutputFile;

pub(super) struct Rows {
    path: PathBuf,
    file: csv::Writer<File>,
}

/// A row of the file: a press, or a sensor that could not be calibrated.
#[derive(Default, Serialize)]
#[allow(non_snake_case, reason = "keys carry units")]
struct Row {
    seed: u64,
    world: String,
    load: String,
    true_N_per_m: Option<f64>,
    estimate_N_per_m: Option<f64>,
    lower_N_per_m: Option<f64>,
    upper_N_per_m: Option<f64>,
    load_ratio: Option<f64>,
    load_ratio_standard_error: Option<f64>,
    two_state_N_per_m: Option<f64>,
    covered: Option<bool>,
    reason: Option<String>,
}

impl Rows {
    pub(super) fn create(path: &Path) -> Result<Self, Failure> {
        OutputFile::new("--rows", path)?;
        let file = File::create(path).map_err(|error| Self::unwritten(path, &error))?;
        Ok(Self {
            path: path.to_path_buf(),
            file: csv::Writer::from_writer(file),
        })
    }

    fn unwritten(path: &Path, error: &dyn std::fmt::Display) -> Failure {
        Failure::Refused(format!(
            "--rows {}: {error}. It has the sensors before this one.",
            path.display()
        ))
    }

    pub(super) fn write(&mut self, seed: u64, plant: &PlantResult) -> Result<(), Failure> {
        let rows = match plant {
            Ok(presses) => presses.iter().map(|press| Row::of(seed, press)).collect(),
            Err(reason) => vec![Row {
                seed,
                reason: Some(reason.clone()),
                ..Row::default()
            }],
        };
        rows.iter()
            .try_for_each(|row| self.file.serialize(row))
            .and_then(|()| Ok(self.file.flush()?))
            .map_err(|error| Self::unwritten(&self.path, &error))
    }
}

impl Row {
    fn of(seed: u64, press: &Press) -> Self {
        let truth = press.true_n_per_m;
        let claim = press.outcome.as_ref().ok();
        Self {
            seed,
            world: press.world.name(),
            load: press.load(),
            true_N_per_m: truth.is_finite().then_some(truth),
            estimate_N_per_m: claim.and_then(|claim| claim.estimate_n_per_m),
            lower_N_per_m: claim.map(|claim| claim.lower_n_per_m),
            upper_N_per_m: claim.and_then(|claim| claim.upper_n_per_m),
            load_ratio: claim.map(|claim| claim.load_ratio),
            load_ratio_standard_error: claim.map(|claim| claim.load_ratio_standard_error),
            two_state_N_per_m: claim.and_then(|claim| claim.two_state_n_per_m),
            covered: claim.map(|claim| claim.holds(truth)),
            reason: press.outcome.as_ref().err().cloned(),
        }
    }
}
