//! The bench on which an instrument is calibrated, with the readings of its user.
//!
//! A stage presses a specimen on the sensor: a reference spring, or a rigid block. A load cell
//! measures the force, the stage's scale the overall displacement. Both have errors, and the frame
//! is compliant (the disturbances' `[calibration_rig]`). The bench is at the temperature of
//! calibration, and it vibrates as any stand does.
//!
//! [`Rig`] contains the sensor. [`BareRig`] has a rigid block in the sensor's place, which shows
//! the frame's own compliance.

use core::f64::consts::TAU;

use crate::mechanics::contact::Contact;
use crate::mechanics::load::Load;
use crate::mechanics::press::Profile;
use crate::parameters::{ParameterError, Parameters, RigParameters, STAGE_PITCH_M};
use crate::random::Stream;
use crate::switches::Switches;
use crate::world::{Setup, World};

/// Initial distance of the specimen above the sensor, m.
pub const CLEARANCE_M: f64 = 0.2e-3;

/// Object that the stage presses on the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Specimen {
    /// A reference spring.
    Spring {
        /// Nominal stiffness, as marked on the spring, N/m.
        nominal_n_per_m: f64,
    },
    /// A rigid block.
    Block,
}

/// One reading of the bench.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigReading {
    /// Force that the load cell measures, N.
    pub force_n: f64,
    /// Displacement that the stage's scale measures, m.
    pub stage_m: f64,
}

/// Load cell and scale alone, for a bench whose world belongs to a board.
#[derive(Clone, Debug)]
pub struct Gauges {
    parameters: RigParameters,
    noise: Stream,
}

impl Gauges {
    /// Reads load cell and scale of a bench's world at its current time. Each call has its own
    /// noise.
    pub fn read(&mut self, world: &World) -> RigReading {
        self.reading(world.truth().force_n, world.planned_press_m())
    }

    fn reading(&mut self, force_n: f64, stage_m: f64) -> RigReading {
        let rig = &self.parameters;
        let noise_n = if rig.load_cell_noise_n > 0.0 {
            rig.load_cell_noise_n * self.noise.normal()
        } else {
            0.0
        };
        let turns = stage_m / STAGE_PITCH_M;
        RigReading {
            force_n: force_n * (1.0 + rig.load_cell_gain_error) + noise_n,
            stage_m: stage_m + rig.stage_error_m * libm::sin(TAU * turns + rig.stage_phase),
        }
    }
}

/// The bench with the sensor in it.
///
/// ```
/// use ldc161x_sim::Time;
/// use palpate_sim::parameters::draw;
/// use palpate_sim::rig::{Rig, Specimen};
/// use palpate_sim::stack::{Disturbances, Stack};
/// use palpate_sim::switches::Switches;
///
/// let plant = draw(&Stack::builtin("ultrasoft")?, &Disturbances::builtin()?, 3);
/// let specimen = Specimen::Spring { nominal_n_per_m: 5e3 };
/// let mut rig = Rig::new(&plant, Switches::all(), specimen)?;
/// rig.move_stage(0.5e-3, 1e-3);
/// rig.world_mut().advance(Time::from_ms(2_000));
/// let reading = rig.read();
/// assert!((reading.stage_m - 0.5e-3).abs() <= 1e-6);
/// assert!((reading.force_n - rig.world().truth().force_n).abs() < 10e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Rig {
    world: World,
    gauges: Gauges,
}

impl Rig {
    /// A bench with this plant's sensor in it and a specimen [`CLEARANCE_M`] above.
    ///
    /// # Errors
    /// [`ParameterError`] as [`World::new`], and for an invalid specimen spring.
    pub fn new(
        parameters: &Parameters,
        switches: Switches,
        specimen: Specimen,
    ) -> Result<Self, ParameterError> {
        Self::warmer(parameters, switches, specimen, 0.0)
    }

    /// Creates the bench with the specimens and gauges of [`Rig::new`] at `warmer_k` kelvin above the
    /// temperature of calibration, with other noise.
    ///
    /// # Errors
    /// As [`Rig::new`].
    pub fn warmer(
        parameters: &Parameters,
        switches: Switches,
        specimen: Specimen,
        warmer_k: f64,
    ) -> Result<Self, ParameterError> {
        let centred = (Contact::default(), 0.0);
        Self::placed(parameters, switches, (specimen, warmer_k), centred)
    }

    /// The bench as [`Rig::warmer`] with a specimen beside the centre or tilted, in a direction,
    /// rad, on which only the noise depends.
    ///
    /// # Errors
    /// As [`Rig::new`].
    pub fn placed(
        parameters: &Parameters,
        switches: Switches,
        (specimen, warmer_k): (Specimen, f64),
        (contact, direction_rad): (Contact, f64),
    ) -> Result<Self, ParameterError> {
        let mut parameters = parameters.effective(&switches);
        parameters.thermal.ambient_change_k = warmer_k;
        parameters.press.frame_m_per_n = parameters.rig.frame_m_per_n;
        let (load, name) = match specimen {
            Specimen::Spring { nominal_n_per_m } => {
                let name = format!("rig_spring.{nominal_n_per_m}");
                let part = Stream::named(parameters.seed, &name).between(-1.0, 1.0);
                let n_per_m = nominal_n_per_m * (1.0 + parameters.rig.spring_tolerance * part);
                (Load::Spring { n_per_m }, name)
            }
            Specimen::Block => (Load::Rigid, "rig_block".to_owned()),
        };
        // The seed changes only the noise: the specimens are already drawn.
        parameters.seed ^= warmer_k.to_bits();
        if contact != Contact::default() {
            parameters.seed ^= (1.0 + direction_rad).to_bits();
        }
        let gauges = Gauges {
            parameters: parameters.rig,
            noise: Stream::named(parameters.seed, &format!("{name}.load_cell")),
        };
        let setup = Setup {
            load,
            contact: Contact {
                tilt_rad: contact.tilt_rad + parameters.rig.tilt_rad,
                ..contact
            },
            profile: Profile::at(-CLEARANCE_M),
            ..Setup::default()
        };
        Ok(Self {
            world: World::of(parameters, setup)?,
            gauges,
        })
    }

    /// World of the bench.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// World of the bench, to advance time and to set the current.
    pub fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    /// Moves the stage to a true displacement at a speed.
    pub fn move_stage(&mut self, position_m: f64, speed_m_per_s: f64) {
        self.world.move_press(position_m, speed_m_per_s);
    }

    /// Reads load cell and scale at the current time. Each call has its own noise.
    pub fn read(&mut self) -> RigReading {
        self.gauges.read(&self.world)
    }

    /// Splits the bench into world and gauges.
    #[must_use]
    pub fn into_parts(self) -> (World, Gauges) {
        (self.world, self.gauges)
    }
}

/// The bench with a rigid block in the sensor's place.
#[derive(Clone, Debug)]
pub struct BareRig {
    gauges: Gauges,
}

impl BareRig {
    /// Bench of a plant.
    #[must_use]
    pub fn new(parameters: &Parameters, switches: Switches) -> Self {
        let parameters = parameters.effective(&switches);
        Self {
            gauges: Gauges {
                parameters: parameters.rig,
                noise: Stream::named(parameters.seed, "rig_bare.load_cell"),
            },
        }
    }

    /// Presses block on block until the true force is `force_n`, and returns the reading. The scale
    /// is zero at first contact.
    pub fn press(&mut self, force_n: f64) -> RigReading {
        let stage_m = force_n * self.gauges.parameters.frame_m_per_n;
        self.gauges.reading(force_n, stage_m)
    }
}
