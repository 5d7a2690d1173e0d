//! The checks, each with its limit.

use serde::Serialize;

use super::data_fault::DataFault;

/// The checks of a bench's data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// Missing samples, as a part of all.
    Samples,
    /// Samples without a reading of the load cell, as a part of all.
    ForceMissing,
    /// Missing current at the peak, relative.
    Current,
    /// Load cell without contact, over the target force.
    Zero,
    /// Noise of the load cell without contact, over the target force.
    ForceNoise,
    /// Change of inductance where the sensor should be untouched.
    Touched,
    /// Difference of the frequency before the press from that of the sensor without a specimen,
    /// relative.
    RestFrequency,
    /// Required change of inductance of a press, less the actual one.
    Reached,
    /// Backward travel of the stage, over the target travel.
    StageSign,
    /// Factor between the travel of the stage and the target travel, in either direction.
    StageUnit,
    /// Force of the wrong sign, over the target force.
    ForceSign,
    /// Factor between the force and the target force, in either direction.
    ForceUnit,
    /// Deviation of the force from a smooth curve of the inductance, over the greatest force.
    ForceFollows,
    /// Time for which the load cell shows exactly the same value under a press, s.
    ForceFrozen,
    /// Deviation of the stage's scale from a smooth curve of the inductance, over its travel.
    StageFollows,
    /// Deformation after the train less that before it, relative.
    Slip,
    /// Force after the train less that before it, relative.
    ForceSlip,
    /// Scatter of the train's readings about a smooth curve, over their span or 8 µm, whichever is
    /// greater.
    Scatter,
    /// Ratio of depth to target depth of a press, over that ratio of the other presses, or the
    /// reciprocal if that is greater.
    Depth,
    /// Compliance of block and frame, over that of the sensing layer.
    Frame,
    /// Deformation at which the force on the block begins, over the depth of the presses.
    ForceBegins,
    /// Difference of the stage's travel on a spring from that expected from the spring's stiffness,
    /// relative.
    Spring,
}

/// Smallest change of inductance that a press must cause: 20 µm on the reference coil.
const LEAST_CHANGE: f64 = 5e-3;

impl Check {
    /// All checks, in the order of the table.
    pub const ALL: [Self; 22] = [
        Self::Samples,
        Self::ForceMissing,
        Self::Current,
        Self::Zero,
        Self::ForceNoise,
        Self::Touched,
        Self::RestFrequency,
        Self::Reached,
        Self::StageSign,
        Self::StageUnit,
        Self::ForceSign,
        Self::ForceUnit,
        Self::ForceFollows,
        Self::ForceFrozen,
        Self::StageFollows,
        Self::Slip,
        Self::ForceSlip,
        Self::Scatter,
        Self::Depth,
        Self::Frame,
        Self::ForceBegins,
        Self::Spring,
    ];

    /// Value of [`Check::Reached`] for a change of inductance.
    pub(super) fn reached(change: f64) -> f64 {
        LEAST_CHANGE - change
    }

    /// Upper limit for good data. docs/evidence/springs.md lists typical values.
    pub const fn limit(self) -> f64 {
        match self {
            // A link that drops one sample in a hundred drops some of every fall.
            Self::Samples => 0.01,
            // A missing reading makes the press or the falls around it unusable.
            Self::ForceMissing => 0.02,
            // The firmware allows its current an error of 2 %. An open coil gives no current, a
            // half-dead coil half of it.
            Self::Current => 0.1,
            // A zero error of a hundredth of the force shifts the zero of the curve by a hundredth
            // of the depth.
            Self::Zero => 0.05,
            Self::ForceNoise => 0.02,
            // Equals 4 µm of deformation; warming by the train causes half a micrometre.
            Self::Touched => 1e-3,
            // Equals 8 µm of contact, or 10 K: the capacitor has 30 ppm/K, the layers' growth 150.
            Self::RestFrequency => 1e-3,
            Self::Reached => 0.0,
            Self::StageSign => 0.0,
            // Lies between the layers' spread of a fifth and the nearest wrong unit, a factor of 10
            // (cm, bar).
            Self::StageUnit => 3.0,
            Self::ForceSign => 0.0,
            // The nearest wrong unit is the pound-force, 4.4 N.
            Self::ForceUnit => 3.0,
            // Four times the effect of creep in good presses.
            Self::ForceFollows => 0.02,
            // A force that creeps by some millinewtons a second changes its last digit sooner.
            Self::ForceFrozen => 0.5,
            Self::StageFollows => 0.01,
            // Allows creep during the train; good runs have half of this.
            Self::Slip => 0.06,
            Self::ForceSlip => 0.06,
            // Lag and memory of the layers, and stands that shake by half a micrometre, cause 4.0 %
            // at most on 48 simulated sensors. Jumps and shaking of 2 µm exceed the limit.
            Self::Scatter => 0.08,
            Self::Depth => 2.0,
            // The frame's compliance is in series with every load: beyond the limit no load is
            // rigid.
            Self::Frame => 0.2,
            // A shift of the zero by a hundredth of the depth lets a load of c_S appear 3 % softer. 40
            // simulated sensors (`ultrasoft` from seed 1420100, `soft-closed` from 1420200) have
            // 0.14 µm at most; a load cell that is read 1 ms late adds 0.75 µm.
            Self::ForceBegins => 0.01,
            // Allows creep in presses of different length, and the springs' tolerance of 1 %.
            Self::Spring => 0.07,
        }
    }

    /// Returns the fault for a value beyond the limit.
    pub(super) fn fault(self, value: f64, place: &str) -> DataFault {
        let percent = 1e2 * value;
        let (name, cause, action) = match self {
            Self::Samples => (
                "samples_missing",
                format!("{percent:.0} % of the samples did not arrive"),
                "Use a shorter cable and no hub, or end what else keeps the computer busy",
            ),
            Self::ForceMissing => (
                "force_missing",
                format!("the load cell gave no reading for {percent:.0} % of the samples"),
                "Check its plug and its program, and use one that prints ten readings a second or more",
            ),
            Self::Current => (
                "current_missing",
                format!("the coil's current stayed {percent:.0} % below its peak"),
                "Check the coil's plugs and its supply",
            ),
            Self::Zero => (
                "force_not_zero",
                format!(
                    "the load cell shows {percent:.0} % of the force that is aimed at while nothing is \
                     to touch"
                ),
                "Lift the specimen off the sensor, set the load cell to zero, and let its program print newtons",
            ),
            Self::ForceNoise => (
                "force_noisy",
                format!(
                    "the load cell scatters by {percent:.1} % of the force that is aimed at while nothing \
                     touches"
                ),
                "Let its program print newtons; check its cable and shield, keep hands and feet off \
                 the bench, or use a load cell of a smaller range",
            ),
            Self::Touched => (
                "touched",
                format!("the inductance changed by {percent:.2} % where nothing was to touch"),
                "Move the stage clear of the sensor",
            ),
            Self::RestFrequency => (
                "rest_frequency_moved",
                format!(
                    "the frequency before the press differs by {percent:.2} % from the untouched \
                     sensor's"
                ),
                "Lift the specimen off the sensor, wait until the sensor has recovered from the press \
                 before, and check that its coil is firmly connected",
            ),
            Self::Reached => (
                "press_not_reached",
                "the press did not reach the sensor: its inductance hardly changed".to_owned(),
                "Check that the specimen is above the sensor, that the stage moves, and the distance \
                 to the touch",
            ),
            Self::StageSign => (
                "stage_sign",
                "the stage's scale falls while it presses".to_owned(),
                "Let the stage's program print greater numbers the deeper it presses",
            ),
            Self::StageUnit => (
                "stage_unit",
                format!(
                    "the stage's scale moved {value:.3} times more or less than what was aimed at"
                ),
                "Let the stage's program print metres",
            ),
            Self::ForceSign => (
                "force_sign",
                "the load cell shows a pull where the sensor is pressed".to_owned(),
                "Turn the sign of what the gauge's program prints: a press is positive",
            ),
            Self::ForceUnit => (
                "force_unit",
                format!("the force is {value:.3} times more or less than what was aimed at"),
                "Let the gauge's program print newtons, calibrate the load cell with a weight, and \
                 check that its cable is plugged in",
            ),
            Self::ForceFollows => (
                "force_does_not_follow",
                format!(
                    "the force of the press is not a smooth function of the inductance: {percent:.0} % \
                     of it are off"
                ),
                "Check that the load cell is plugged in and within its range, that its readings come \
                 without delay, and that nothing slips",
            ),
            Self::ForceFrozen => (
                "force_frozen",
                format!("the load cell showed the same to the last digit for {value:.1} s"),
                "Check its plug; if that is right, let its program print more digits",
            ),
            Self::StageFollows => (
                "stage_does_not_follow",
                format!(
                    "the stage's scale in the press is not a smooth function of the inductance: \
                     {percent:.0} % of its travel are off"
                ),
                "Check that the stage loses no steps and the specimen does not slip, and press again",
            ),
            Self::Slip => (
                "slipped",
                format!(
                    "the deformation after the train differs by {percent:.0} % more from that before it than \
                     creep explains"
                ),
                "Fasten the specimen, the sensor and the stage, and press again",
            ),
            Self::ForceSlip => (
                "force_jumped",
                format!("the force after the train differs by {percent:.0} % from that before it"),
                "Check the load cell's plug, and that nothing slips",
            ),
            Self::Scatter => (
                "unsteady",
                format!(
                    "the readings of the train are {percent:.0} % of their span off a smooth curve: the specimen \
                     jumps, or the bench shakes"
                ),
                "Fasten specimen, sensor and stage, keep motors and feet off the bench, and press again",
            ),
            Self::Depth => (
                "depth_differs",
                format!(
                    "the press was {value:.1} times deeper or less deep than the others, for its aim"
                ),
                "Begin each press where the specimen touches, and press as deep as asked",
            ),
            Self::Frame => (
                "block_gives_way",
                format!(
                    "block and frame give way by {percent:.0} % of what the sensing layer does under the \
                     same force"
                ),
                "Use a block of metal and a stiffer frame",
            ),
            Self::ForceBegins => (
                "force_begins_late",
                format!(
                    "the force on the block begins only when the layer has given way by {percent:.1} % of its \
                     depth: the block touches with its edge first"
                ),
                "Align stage and sensor until the block lies flat on it, take away what lies between them, and \
                 see that the load cell's readings are not late",
            ),
            Self::Spring => (
                "spring_differs",
                format!(
                    "the stage moved {percent:.1} % more or less on it than its stiffness requires: a \
                     wrong spring, a wrong number, or a press that slipped"
                ),
                "Compare the spring with the stiffness that was entered, in newtons per metre, and \
                 press again",
            ),
        };
        DataFault {
            name,
            cause: format!("{place}: {cause}"),
            action,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;

    #[test]
    fn every_fault_of_the_data_stands_in_the_book() {
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/calibration.md");
        let page = fs::read_to_string(page).unwrap();
        for check in Check::ALL {
            let name = check.fault(1.0, "").name;
            assert!(page.contains(&format!("`{name}`")), "{name}");
        }
    }
}
