//! One train in the plant's response: the reading at each conversion, and its derivative in each
//! unknown.

use palpate_sim::Time;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::parameters::{ParameterError, Parameters};
use palpate_sim::rig::CLEARANCE_M;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_simulate::instrument::SPEED_M_PER_S;
use palpate_wire::command::Settings;

/// Time from the end of the press to the train, s, on the bench as in use
/// (host/simulate/src/instrument.rs).
pub(super) const REST_S: f64 = 0.3;

/// A conversion of a train.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    /// Time since the start of the train, s.
    pub(super) time_s: f64,
    /// Deformation as the coil measures it, m.
    pub(super) deformation_m: f64,
    /// Force on the sensor, N.
    pub(super) force_n: f64,
    /// Whether the whole conversion is within a fall.
    pub(super) in_fall: bool,
}

/// A fall: start and end, s since the start of the train.
type Fall = (f64, f64);

/// A press with its train.
#[derive(Clone, Debug)]
pub(super) struct TrainTask<'s> {
    pub(super) settings: &'s Settings,
    /// Load; `None` for the untouched sensor.
    pub(super) load: Option<Load>,
    /// Position of the press, m.
    pub(super) travel_m: f64,
}

impl TrainTask<'_> {
    /// Readings of a train without noise and vibration.
    pub(super) fn readings(&self, plant: &Parameters) -> Result<Vec<Reading>, ParameterError> {
        let mut plant = plant.clone();
        plant.press.vibration.amplitude_m = 0.0;
        let setup = Setup {
            load: self.load.unwrap_or(Load::Rigid),
            profile: Profile::at(-CLEARANCE_M),
            ..Setup::default()
        };
        let mut world = World::new(&plant, Switches::all(), setup)?;
        if self.load.is_some() {
            world.move_press(self.travel_m, SPEED_M_PER_S);
            world.advance(Time::from_secs_f64(
                (self.travel_m + CLEARANCE_M) / SPEED_M_PER_S + REST_S,
            ));
        }
        let (points, falls) = self.profile();
        let begins = world.now();
        world.follow_current(&points);
        let interval_s = 1.0 / f64::from(self.settings.rate_hz);
        let lasts_s = points.last().map_or(0.0, |(time, _)| time.as_secs_f64());
        let count = (lasts_s / interval_s).floor() as u32;
        let readings = (0..count).map(|index| {
            let time_s = (f64::from(index) + 0.5) * interval_s;
            world.advance_to(begins + Time::from_secs_f64(time_s));
            let truth = world.truth();
            let within = |(from_s, to_s): &Fall| {
                // A conversion that starts with a fall counts as within it, despite rounding.
                let half_s = 0.5 * interval_s - 1e-9;
                time_s - half_s >= *from_s && time_s + half_s <= *to_s
            };
            Reading {
                time_s,
                deformation_m: truth.apparent_m,
                force_n: truth.force_n,
                in_fall: falls.iter().any(within),
            }
        });
        Ok(readings.collect())
    }

    /// Corners of the current, and the falls, each with start and end, s.
    fn profile(&self) -> (Vec<(Time, f64)>, Vec<Fall>) {
        let settings = self.settings;
        let [rise_s, hold_s, fall_s] =
            [settings.rise_s, settings.hold_s, settings.ramp_s].map(f64::from);
        let (peak_a, end_a) = (
            f64::from(settings.peak_current_a),
            f64::from(settings.end_current_a),
        );
        let (mut points, mut falls, mut now_s) = (Vec::new(), Vec::new(), 0.0);
        for _ in 0..settings.ramps {
            for (lasts_s, to_a) in [(rise_s, peak_a), (hold_s, peak_a), (fall_s, end_a)] {
                now_s += lasts_s;
                points.push((Time::from_secs_f64(now_s), to_a));
            }
            falls.push((now_s - fall_s, now_s));
        }
        points.push((Time::from_secs_f64(now_s + rise_s), 0.0));
        (points, falls)
    }
}

/// Derivative of the readings in an unknown that changes them from `less` to `more` over `units` of
/// its units.
pub(super) fn derivative(less: &[Reading], more: &[Reading], units: f64) -> Vec<(f64, f64)> {
    let pairs = less.iter().zip(more);
    pairs
        .map(|(less, more)| {
            (
                (more.deformation_m - less.deformation_m) / units,
                (more.force_n - less.force_n) / units,
            )
        })
        .collect()
}
