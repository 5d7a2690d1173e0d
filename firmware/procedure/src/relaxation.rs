//! Relaxation of the pressed object: what the deformation does while the press is held.
//!
//! The press is held, so the deformations share a displacement that does not change:
//!
//! x_0 = u (1 + kappa + g), with u = F/c_S, kappa = c_S x_L/F and g = c_S/c_D.
//!
//! The reading is x = u (1 + z) with the sensing layer's creep z, and the actuated layer's creep z_D
//! adds u g z_D. So between two times, with differences D,
//!
//! D kappa = -W D ln x + (kappa + g) D z - g D z_D, with W = 1 + kappa + g,
//!
//! and the relaxation is D kappa/kappa. Both layers creep as [`Creep`] says, with independent
//! deviations. The kappa in W contains the compression before the first time, which the kappa of the
//! estimate lacks ([`BEFORE`]).
//!
//! The coil's heat softens both layers alike, which changes the result by as much as the springs: 0.1 %.
//! The stiffening that remains after a train, below 0.7 % of g, and the vibration of a stand, averaged
//! over a block of [`Steadiness`], are less than the creep's uncertainty.

use palpate_model::math::{hypot, ln};
use palpate_model::units::{Metre, Second};
use palpate_wire::command::Creep;
use palpate_wire::record::{Estimate, Relaxation};

use crate::deformation::Deformation;
use crate::steadiness::Steadiness;
use crate::time::{Instant, seconds};

/// Time of a held press after which the relaxation is reported for the last time.
const HELD: Second = Second(3.0);

/// Compression before the first level, in units of that at the train's rate, which relaxes; and its
/// standard uncertainty. It is 0.01 to 0.4 for objects that relax by 0.2 or 0.5 with time constants of
/// 0.2 to 20 s: 423 of 455 significant results are then within 20 %, 420 of 459 with 0.15 (8 sensors
/// from seed 2500101).
const BEFORE: f32 = 0.2;

/// Mean deformation of a block of time without current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Level {
    /// Middle of the block's last conversion.
    pub(crate) at: Instant,
    pub(crate) deformation: Metre,
    /// Mean age of the deformation.
    pub(crate) mean_age: Second,
}

/// Press that is held after an estimate.
#[derive(Clone, Debug)]
pub(crate) struct HeldPress {
    measurement: u32,
    /// kappa with its standard error.
    load_ratio: (f32, f32),
    /// g without current.
    actuated_ratio: f32,
    creep: Creep,
    before: Level,
    /// Blocks after the train; the first one, in which the stiffening fades, is not reported.
    blocks: Steadiness,
    /// Middle of the last conversion.
    last: Option<Instant>,
    /// Time of holding from which the next record is due; infinite after the last one.
    due: Second,
}

impl HeldPress {
    /// Starts after the train; the sensor has g without current, and its creep.
    pub(crate) fn new(
        estimate: &Estimate,
        (actuated_ratio, creep): (f32, Creep),
        before: Level,
    ) -> Self {
        Self {
            measurement: estimate.measurement,
            load_ratio: (estimate.load_ratio, estimate.load_ratio_standard_error),
            actuated_ratio,
            creep,
            before,
            blocks: Steadiness::default(),
            last: None,
            due: Second(0.0),
        }
    }

    /// Takes the deformation of a conversion with its middle, `interval` after the previous one;
    /// `steady_m_per_s` is the greatest rate of a steady press. Returns the relaxation if a record is due.
    pub(crate) fn push(
        &mut self,
        (at, interval): (Instant, Second),
        deformation: &Deformation,
        steady_m_per_s: f32,
    ) -> Option<Relaxation> {
        let last = self.last.replace(at);
        let interval = last.map_or(interval, |last| seconds(last, at));
        let rate = self.blocks.push(interval, deformation.value)?;
        let held = seconds(self.before.at, at);
        if held < self.due || rate.is_nan() || rate.abs() > steady_m_per_s {
            return None;
        }
        self.due = if held < HELD {
            HELD
        } else {
            Second(f32::INFINITY)
        };
        let after = Level {
            at,
            deformation: self.blocks.mean()?,
            mean_age: deformation.mean_age,
        };
        self.relaxation(&after)
    }

    /// Returns the relaxation between the levels; `None` if the protocol cannot represent it.
    fn relaxation(&self, after: &Level) -> Option<Relaxation> {
        let Level {
            at,
            deformation,
            mean_age,
        } = *after;
        let (kappa, error) = self.load_ratio;
        let of_actuated = self.actuated_ratio / kappa;
        let of_sensing = 1.0 + of_actuated;
        let creep = of_sensing * self.creep.sensing - of_actuated * self.creep.actuated;
        // W/kappa.
        let gain = 1.0 + BEFORE + (1.0 + self.actuated_ratio) / kappa;
        let older = ln(mean_age.0 / self.before.mean_age.0);
        // D ln x, referred to the second deformation: the growth of kappa is exact in it.
        let grown = (deformation - self.before.deformation).0 / deformation.0;
        let relaxation = creep * older - gain * grown;
        let of_creep = self.creep.uncertainty * older.abs() * hypot(of_sensing, of_actuated);
        // The part of W that does not grow with kappa.
        let of_ratio = grown * (gain - 1.0 - BEFORE) * error / kappa;
        let of_before = BEFORE * grown;
        let record = Relaxation {
            measurement: self.measurement,
            held_s: seconds(self.before.at, at).0,
            relaxation,
            standard_error: hypot(hypot(of_creep, of_ratio), of_before),
        };
        (kappa > 0.0 && record.validate().is_ok()).then_some(record)
    }
}
