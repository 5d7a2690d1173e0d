//! A stage that the user drives by hand.

use palpate_cli::failure::Failure;

use super::RigBench;

/// Number of positions at which a press by hand stops if the stage has a scale. The scale's
/// readings there give points of the curve of travel against inductance.
const STEPS: u32 = 4;
/// Rest at each position, s: enough samples for a mean whose noise is well below a nanometre.
const REST_S: f64 = 0.3;

impl RigBench<'_> {
    /// Asks the user to press the sensing layer to a depth, m.
    pub(super) fn press_by_hand(&mut self, depth_m: f64) -> Result<(), Failure> {
        let travel_m = self.travel_m(depth_m);
        match self.hand.touch_m {
            Some(touch_m) => {
                for step in 1..=STEPS {
                    let place_m = touch_m + travel_m * f64::from(step) / f64::from(STEPS);
                    self.hand.position_m = None;
                    self.request(&format!(
                        "Set the stage's scale to {:.3} mm, take your hand off it, then press Enter.",
                        1e3 * place_m
                    ))?;
                    self.hand.position_m = Some(place_m);
                    self.pass(REST_S)?;
                }
                Ok(())
            }
            None if self.force.is_some() => {
                let force_n = depth_m * self.plan.sensing_n_per_m;
                self.request(&format!(
                    "Press with about {force_n:.2} N, take your hand off the stage, then press Enter."
                ))?;
                Ok(())
            }
            None => Err(Failure::Refused(
                "without a load cell and without a scale on the stage the force is unknown: name the \
                 gauge's program with --force, or use a stage with a scale, such as a micrometer"
                    .to_owned(),
            )),
        }
    }

    /// Asks the user to find the touch and to lift the stage again.
    pub(super) fn approach_by_hand(&mut self) -> Result<(), Failure> {
        self.hand.touch_m = self.touch_by_hand()?;
        self.request(
            "Lift it by a fifth of a millimetre, take your hand off it for two seconds, then press Enter.",
        )
        .map(drop)
    }

    /// Asks for the reading of the stage's scale at the touch. Returns it, m; `None` without a
    /// scale.
    fn touch_by_hand(&mut self) -> Result<Option<f64>, Failure> {
        if self.hand.has_scale == Some(false) {
            return Ok(None);
        }
        loop {
            let answer = self.request(
                "Lower the stage until it just touches. What does its scale show, in mm? (only Enter: it \
                 has none)",
            )?;
            if answer.is_empty() {
                self.hand.has_scale = Some(false);
                return Ok(None);
            }
            if let Ok(millimetres) = answer.replace(',', ".").parse::<f64>()
                && millimetres.is_finite()
            {
                self.hand.has_scale = Some(true);
                return Ok(Some(1e-3 * millimetres));
            }
        }
    }
}
