//! One press of a campaign.

use palpate_calibration::bench::{self, Bench};
use palpate_calibration::session::Pressed;
use palpate_calibration::{KnownPress, OnTheBench, Unchecked, check, check_untouched};
use palpate_cli::failure::Failure;
use palpate_sim::mechanics::load::Load;
use palpate_sim::random::Stream;
use palpate_wire::Command;
use palpate_wire::record::Estimate;
use serde::{Deserialize, Serialize};

use super::world::World;
use crate::bench::NativeBench;
use crate::engine::{self, Native};
use crate::instrument::{CalibratedInstrument, SPEED_M_PER_S, coil};
use crate::press;
use crate::shard::number;
use crate::verdict::Verdict;

/// All presses of one sensor, or the reason why it could not be calibrated.
pub(super) type PlantResult = Result<Vec<Press>, String>;

/// A press and its outcome.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Press {
    /// The world in which it was pressed.
    pub world: World,
    /// c_L/c_S; infinite for a block.
    #[serde(with = "number")]
    pub ratio: f64,
    /// Stiffness of the load in series with its support over c_S; infinite for a rigid load.
    #[serde(with = "number")]
    pub true_ratio: f64,
    /// Stiffness of the load in series with its support, N/m.
    #[serde(with = "number")]
    pub true_n_per_m: f64,
    /// The instrument's claim, or its reason for a refusal.
    pub outcome: Result<Claim, String>,
}

/// The instrument's claim about a load.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Claim {
    /// The estimate, N/m; `None` where there is only a lower bound.
    #[serde(with = "number::optional")]
    pub estimate_n_per_m: Option<f64>,
    /// Lower end of the 95 % interval, N/m.
    #[serde(with = "number")]
    pub lower_n_per_m: f64,
    /// Upper end of the interval, N/m; `None` where it has none.
    #[serde(with = "number::optional")]
    pub upper_n_per_m: Option<f64>,
    /// Load as c_S/c_L.
    #[serde(with = "number")]
    pub load_ratio: f64,
    /// Standard error of `load_ratio`.
    #[serde(with = "number")]
    pub load_ratio_standard_error: f64,
    /// Chi-square of the fit over its degrees of freedom.
    #[serde(with = "number::optional")]
    pub reduced_chi_square: Option<f64>,
    /// Estimate by the two-state formula, N/m.
    #[serde(with = "number::optional")]
    pub two_state_n_per_m: Option<f64>,
}

/// Tolerance of the known spring of a check, as on the bench (sim-host/stacks/disturbances.toml).
const TOLERANCE: f64 = 0.01;
/// Spring of a check, in units of c_S.
const CHECKED_BY: f64 = 1.0;

/// Checks the calibration by a train without a press in a world. Returns the corrected instrument,
/// or the reason why the check fails.
fn checked_untouched(
    calibrated: &CalibratedInstrument,
    world: World,
) -> Result<Result<CalibratedInstrument, String>, Failure> {
    let plant = world.plant(&calibrated.plant);
    let warmer_k = plant
        .effective(&calibrated.switches)
        .thermal
        .ambient_change_k;
    let coil = coil(&plant.effective(&calibrated.switches));
    let mut stand = NativeBench::new(&plant, calibrated.switches, warmer_k);
    let run = stand.with_specimen(Pressed::Nothing, &mut |instrument| {
        bench::untouched(instrument, (&calibrated.settings, &coil))
    })?;
    let bench = OnTheBench {
        run: &calibrated.untouched,
        commands: &calibrated.calibrated,
    };
    let checked = check_untouched(&calibrated.calibration.commands, bench, &run);
    Ok(corrected(
        calibrated,
        checked.map(|checked| checked.commands),
    ))
}

/// Returns the instrument with the commands of a check, or the reason why the check failed.
fn corrected(
    calibrated: &CalibratedInstrument,
    commands: Result<Vec<Command>, Unchecked>,
) -> Result<CalibratedInstrument, String> {
    let mut instrument = calibrated.clone();
    instrument.calibration.commands = commands.map_err(|cause| format!("the check: {cause}"))?;
    Ok(instrument)
}

/// Checks the calibration by a known spring in a world. Returns the corrected instrument, or the
/// reason why the check fails.
fn checked(
    calibrated: &CalibratedInstrument,
    world: World,
    depth: f64,
) -> Result<Result<CalibratedInstrument, String>, Failure> {
    let pressed = pressed(calibrated, world, ("check", CHECKED_BY), depth)?;
    let verdict = Verdict::of(&pressed);
    let Some(estimate) = verdict.estimate() else {
        return Ok(Err(format!(
            "the check: {}",
            verdict.reason().unwrap_or_default()
        )));
    };
    let off = Stream::named(calibrated.plant.seed, "campaign.check").between(-1.0, 1.0);
    let known = KnownPress {
        spring_n_per_m: pressed.true_n_per_m * (1.0 + TOLERANCE * off),
        tolerance: TOLERANCE,
        load_ratio: estimate.load_ratio.into(),
        standard_error: estimate.load_ratio_standard_error.into(),
        force_n: estimate.force_n.into(),
        temperature_c: estimate.temperature_c.map(f64::from),
    };
    let checked = check(&calibrated.calibration.commands, &known);
    Ok(corrected(
        calibrated,
        checked.map(|checked| checked.commands),
    ))
}

/// Presses a load in a world, to `depth` times the working depth; the contact depends on the press's
/// name.
fn pressed(
    calibrated: &CalibratedInstrument,
    world: World,
    (name, ratio): (&str, f64),
    depth: f64,
) -> Result<press::PressOutcome, Failure> {
    let n_per_m = ratio * calibrated.plant.sensing.spring_n_per_m;
    let instrument = CalibratedInstrument {
        plant: world.plant(&calibrated.plant),
        ..calibrated.clone()
    };
    let how = press::Press {
        name: format!("{ratio} c_S"),
        load: if ratio.is_finite() {
            Load::Spring { n_per_m }
        } else {
            Load::Rigid
        },
        contact: world.contact(
            calibrated.calibration.contact.as_ref(),
            calibrated.plant.seed,
            name,
        ),
        holder: world.holder(),
        clearance_m: world.clearance_m(),
        depth_m: depth * instrument.depth_m,
        speed_m_per_s: SPEED_M_PER_S,
    };
    engine::press(&instrument, &how, &Native)
}

/// Presses all loads in one world, after the requested checks.
pub fn in_world(
    calibrated: &CalibratedInstrument,
    world: World,
    loads: &[f64],
    depth: f64,
    (check_untouched, check_spring): (bool, bool),
) -> Result<Vec<Press>, Failure> {
    let mut after = Ok(calibrated.clone());
    if check_untouched {
        after = checked_untouched(calibrated, world)?;
    }
    if check_spring && let Ok(instrument) = &after {
        after = checked(instrument, world, depth)?;
    }
    match after {
        Ok(instrument) => loads
            .iter()
            .map(|load| Press::of(&instrument, world, *load, depth))
            .collect(),
        Err(reason) => Ok(loads
            .iter()
            .map(|load| Press::left_out(world, *load, reason.clone()))
            .collect()),
    }
}

impl Press {
    /// Presses a load in a world, to `depth` times the working depth.
    fn of(
        calibrated: &CalibratedInstrument,
        world: World,
        ratio: f64,
        depth: f64,
    ) -> Result<Self, Failure> {
        let pressed = pressed(calibrated, world, (&load_name(ratio), ratio), depth)?;
        let verdict = Verdict::of(&pressed);
        Ok(Self {
            world,
            ratio,
            true_ratio: pressed.true_n_per_m / calibrated.plant.sensing.spring_n_per_m,
            true_n_per_m: pressed.true_n_per_m,
            outcome: verdict
                .estimate()
                .map(Claim::from)
                .ok_or_else(|| verdict.reason().unwrap_or_default()),
        })
    }

    /// Creates a press that was not made because the check of the calibration failed.
    const fn left_out(world: World, ratio: f64, reason: String) -> Self {
        Self {
            world,
            ratio,
            true_ratio: f64::NAN,
            true_n_per_m: f64::NAN,
            outcome: Err(reason),
        }
    }

    /// Returns ln(estimate/truth); `None` for a block.
    pub fn error_ln(&self, estimate_n_per_m: f64) -> Option<f64> {
        let error = (estimate_n_per_m / self.true_n_per_m).ln();
        error.is_finite().then_some(error)
    }

    /// Name of the load.
    pub fn load(&self) -> String {
        load_name(self.ratio)
    }
}

/// Name of a load, c_L/c_S.
pub fn load_name(ratio: f64) -> String {
    if ratio.is_finite() {
        format!("{ratio} c_S")
    } else {
        "block".to_owned()
    }
}

impl From<&Estimate> for Claim {
    fn from(estimate: &Estimate) -> Self {
        Self {
            estimate_n_per_m: estimate.stiffness_n_per_m.map(f64::from),
            lower_n_per_m: estimate.lower_n_per_m.into(),
            upper_n_per_m: estimate.upper_n_per_m.map(f64::from),
            load_ratio: estimate.load_ratio.into(),
            load_ratio_standard_error: estimate.load_ratio_standard_error.into(),
            reduced_chi_square: estimate.reduced_chi_square.map(f64::from),
            two_state_n_per_m: estimate.two_state_n_per_m.map(f64::from),
        }
    }
}

impl Claim {
    /// Whether the interval contains the truth.
    pub fn holds(&self, true_n_per_m: f64) -> bool {
        let upper = self.upper_n_per_m.unwrap_or(f64::INFINITY);
        (self.lower_n_per_m..=upper).contains(&true_n_per_m)
    }

    /// Half of the interval's width, in ln; `None` for an interval without an upper end.
    pub fn half_width_ln(&self) -> Option<f64> {
        Some(0.5 * (self.upper_n_per_m? / self.lower_n_per_m).ln())
    }

    /// Interval score, in ln; `None` for an interval without an upper end.
    pub fn score_ln(&self, true_n_per_m: f64) -> Option<f64> {
        /// The factor 2/alpha of the interval score: alpha is 0.05 for an interval of 95 %.
        const OUTSIDE: f64 = 40.0;
        let (below, above) = (
            (self.lower_n_per_m / true_n_per_m).ln(),
            (true_n_per_m / self.upper_n_per_m?).ln(),
        );
        let score = 2.0 * self.half_width_ln()? + OUTSIDE * below.max(above).max(0.0);
        score.is_finite().then_some(score)
    }
}
