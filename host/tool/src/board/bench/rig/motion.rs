//! Movements of the stage: to the touch, into the press, away, and block on block.

use palpate_calibration::session::Pressed;
use palpate_cli::failure::Failure;

use super::program::GaugeLine;
use super::{MEAN_S, RigBench};

/// Distance of the specimen from the sensor before a press, and its distance between two presses,
/// m.
const CLEAR_M: f64 = 0.2e-3;
const LIFT_M: f64 = 1e-3;
/// Step and range of the search for the touch, m. A person places the specimen within millimetres.
const SEARCH_STEP_M: f64 = 20e-6;
const SEARCH_M: f64 = 5e-3;
/// Speed of the search, m/s.
const SEARCH_M_PER_S: f64 = 2e-3;
/// Relative change of frequency above which the specimen touches: that of 2 µm of deformation.
const TOUCH: f64 = 0.25e-3;
/// Longest travel of the stage when block presses on block, m: 20 N compress the softest frame by
/// 40 µm, and the blocks almost touch at the start.
const BARE_M: f64 = 1e-3;
/// Step of the stage when block presses on block, m: a stiff frame gives way by a fifth of a
/// micrometre under a newton.
const BARE_STEP_M: f64 = 1e-6;
/// Time over which the gauges are averaged when block presses on block, s.
const BARE_MEAN_S: f64 = 0.5;

impl RigBench<'_> {
    /// Moves the stage to a position, m, at a speed in m/s, and waits for the end of the movement.
    pub(super) fn move_to(&mut self, place_m: f64, speed_m_per_s: f64) -> Result<(), Failure> {
        let lasts_s = (place_m - self.place_m()).abs() / speed_m_per_s;
        let command = format!("move {place_m:.7} {speed_m_per_s}");
        match self.command(&command, lasts_s)? {
            GaugeLine::Done => Ok(()),
            _ => Err(Failure::Refused(
                "the program of --stage answers `by hand` to move: leave --stage out, and move it by hand"
                    .to_owned(),
            )),
        }
    }

    /// Last reading of the stage's position, m; before the first reading, that of the last touch.
    pub(super) fn place_m(&self) -> f64 {
        self.stage_track
            .last()
            .map_or(self.touch_m, |(_, place_m)| place_m)
    }

    /// Brings the specimen close above the sensor and determines the touch.
    pub(super) fn approach(&mut self) -> Result<(), Failure> {
        if self.stage.is_some() {
            self.find_touch()
        } else {
            self.approach_by_hand()
        }
    }

    /// Lowers the stage until the frequency shows a touch.
    fn find_touch(&mut self) -> Result<(), Failure> {
        let rest_hz = self.mean_hz()?;
        let start_m = self.place_m();
        let steps = (SEARCH_M / SEARCH_STEP_M) as u32;
        for step in 1..=steps {
            let place_m = start_m + SEARCH_STEP_M * f64::from(step);
            self.move_to(place_m, SEARCH_M_PER_S)?;
            if 1.0 - self.mean_hz()? / rest_hz > TOUCH {
                self.touch_m = place_m;
                return self.move_to(place_m - CLEAR_M, SEARCH_M_PER_S);
            }
        }
        Err(Failure::Refused(format!(
            "the stage has moved {:.0} mm, and nothing touches the sensor: bring the specimen within that \
             above the sensor; the stage has to press with rising numbers",
            1e3 * SEARCH_M
        )))
    }

    /// Travel of the stage beyond the touch for a depth of the sensing layer, by the nominal
    /// stiffness, m.
    pub(super) fn travel_m(&self, depth_m: f64) -> f64 {
        let sensing = self.plan.sensing_n_per_m;
        let load = sensing * self.pressed.compliance_m_per_n().unwrap_or_default();
        depth_m * (1.0 + sensing / self.plan.actuated_n_per_m + load)
    }

    /// Lifts the specimen off the sensor.
    pub(super) fn lift(&mut self) -> Result<(), Failure> {
        if self.stage.is_some() {
            return self.move_to(self.touch_m - LIFT_M, SEARCH_M_PER_S);
        }
        self.hand.position_m = None;
        self.request("Lift the stage by a millimetre, then press Enter.")
            .map(drop)
    }

    /// Presses block on block in place of the sensor to a force, N. Returns force in N and position
    /// in m.
    pub(super) fn bare(&mut self, force_n: f64) -> Result<(f64, f64), Failure> {
        if self.pressed != Pressed::Nothing {
            self.mount(
                "bare",
                "Take the sensor away, put a block of metal in its place and one on the stage, and \
                 lower the stage until they almost touch",
            )?;
            self.pressed = Pressed::Nothing;
            self.begin()?;
        }
        let start_m = self.place_m();
        let steps = (BARE_M / BARE_STEP_M) as u32;
        for step in 0..=steps {
            let place_m = start_m + BARE_STEP_M * f64::from(step);
            self.move_to(place_m, SEARCH_M_PER_S)?;
            self.pass(MEAN_S)?;
            let force = self.force_track.last();
            if force.is_some_and(|(_, reading_n)| reading_n >= force_n) {
                return self.mean_of_gauges();
            }
        }
        Err(Failure::Refused(format!(
            "block on block, the stage has moved {:.1} mm without {force_n:.0} N: check that they touch",
            1e3 * BARE_M
        )))
    }

    /// Mean force in N and position in m over half a second.
    fn mean_of_gauges(&mut self) -> Result<(f64, f64), Failure> {
        let from_s = self.now_s();
        self.pass(BARE_MEAN_S)?;
        let means = (
            self.force_track.mean_since(from_s),
            self.stage_track.mean_since(from_s),
        );
        match means {
            (Some(force_n), Some(stage_m)) => Ok((force_n, stage_m)),
            _ => Err(Failure::Refused(
                "block on block, a gauge prints nothing: check its program".to_owned(),
            )),
        }
    }
}
