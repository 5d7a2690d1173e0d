//! The simulated bench with the native board.

use std::time::Duration;

use palpate_calibration::bench::{Bench, Instrument, Work};
use palpate_calibration::session::{BenchSample, Pressed, Run};
use palpate_cli::failure::Failure;
use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::parameters::{ParameterError, Parameters};
use palpate_sim::rig::{BareRig, CLEARANCE_M, Gauges, Rig, Specimen};
use palpate_sim::switches::Switches;
use palpate_sim::thermal::CALIBRATION_C;
use palpate_sim::world::World;
use palpate_wire::code::Outcome;
use palpate_wire::{Command, Message, Record};

use super::gauges::bench_sample;

/// The simulated bench of a plant.
pub struct NativeBench<'p> {
    plant: &'p Parameters,
    switches: Switches,
    /// Temperature above that of the calibration, K.
    warmer_k: f64,
    bare: BareRig,
}

impl<'p> NativeBench<'p> {
    /// Creates the bench of this plant, at `warmer_k` kelvin above the temperature of the
    /// calibration.
    pub fn new(plant: &'p Parameters, switches: Switches, warmer_k: f64) -> Self {
        Self {
            plant,
            switches,
            warmer_k,
            bare: BareRig::new(plant, switches),
        }
    }
}

impl Bench for NativeBench<'_> {
    type Error = Failure;

    fn with_specimen(
        &mut self,
        pressed: Pressed,
        work: &mut Work<'_, Failure>,
    ) -> Result<Run, Failure> {
        let rig = on_rig(self.plant, self.switches, pressed, self.warmer_k)?;
        let (world, gauges) = rig.into_parts();
        let wiring = Wiring::new(world);
        work(&mut NativeInstrument {
            board: NativeBoard::new(&wiring),
            wiring: &wiring,
            gauges,
        })
    }

    fn press_bare(&mut self, force_n: f64) -> Result<Option<(f64, f64)>, Failure> {
        Ok(Some(mean_bare(&mut self.bare, force_n)))
    }

    fn temperature_c(&self) -> f64 {
        CALIBRATION_C + self.warmer_k
    }
}

/// Number of readings that are averaged for each force, block on block.
const BARE_READINGS: u32 = 100;

/// Presses block on block to a force. Returns force in N and position in m, each the mean of many
/// readings.
pub fn mean_bare(bare: &mut BareRig, force_n: f64) -> (f64, f64) {
    let mut sum = (0.0, 0.0);
    for _ in 0..BARE_READINGS {
        let reading = bare.press(force_n);
        sum = (sum.0 + reading.force_n, sum.1 + reading.stage_m);
    }
    let count = f64::from(BARE_READINGS);
    (sum.0 / count, sum.1 / count)
}

/// Simulated bench with a specimen on its stage, `warmer_k` kelvin above the temperature of the
/// calibration; without contact a block that stays above the sensor.
pub fn on_rig(
    plant: &Parameters,
    switches: Switches,
    pressed: Pressed,
    warmer_k: f64,
) -> Result<Rig, ParameterError> {
    let specimen = match pressed {
        Pressed::Spring { n_per_m } => Specimen::Spring {
            nominal_n_per_m: n_per_m,
        },
        _ => Specimen::Block,
    };
    let contact = match pressed {
        Pressed::BlockBeside {
            distance_m,
            direction_rad,
        } => (
            Contact {
                place_m: distance_m,
                tilt_rad: 0.0,
            },
            direction_rad,
        ),
        Pressed::BlockTilted {
            angle_rad,
            direction_rad,
        } => (
            Contact {
                place_m: 0.0,
                tilt_rad: angle_rad,
            },
            direction_rad,
        ),
        _ => Default::default(),
    };
    Rig::placed(plant, switches, (specimen, warmer_k), contact)
}

/// Starts to move the stage to this depth of the sensing layer. Returns the time that this takes.
pub fn press(world: &mut World, depth_m: f64, speed_m_per_s: f64) -> Duration {
    let travel_m = world.press_for_depth_m(depth_m);
    world.move_press(travel_m, speed_m_per_s);
    Duration::from_secs_f64((travel_m + CLEARANCE_M) / speed_m_per_s)
}

/// The native board during a run.
struct NativeInstrument<'w> {
    board: NativeBoard<'w>,
    wiring: &'w Wiring,
    gauges: Gauges,
}

impl Instrument for NativeInstrument<'_> {
    type Error = Failure;

    fn now(&self) -> Duration {
        Duration::from_nanos(self.board.now().as_ns())
    }

    fn ask(&mut self, command: Command) -> Result<Outcome, Failure> {
        let name = command.name();
        self.board.send(command)?;
        let records = self.board.take_records();
        let mut answers = records.iter().filter_map(|(_, record)| match record {
            Record::Acknowledgement(answer) => Some(answer.outcome),
            _ => None,
        });
        let last = answers.next_back();
        last.ok_or_else(|| Failure::Refused(format!("the instrument does not answer {name}")))
    }

    fn post(&mut self, command: Command) -> Result<(), Failure> {
        self.board.post(command);
        Ok(())
    }

    fn advance(
        &mut self,
        end: Duration,
        lines: &mut Vec<BenchSample>,
    ) -> Result<Vec<Record>, Failure> {
        self.board.advance(Time::from_ns(end.as_nanos() as u64))?;
        let world = self.wiring.world().borrow();
        let mut others = Vec::new();
        for (at, record) in self.board.take_records() {
            match record {
                Record::Sample(sample) => {
                    let gauges = self.gauges.read(&world).into();
                    let line = bench_sample(
                        at.as_ticks() as f64 * 1e-6,
                        &sample,
                        world.now().as_secs_f64(),
                        gauges,
                    );
                    lines.extend(line);
                }
                other => others.push(other),
            }
        }
        Ok(others)
    }

    fn press(&mut self, depth_m: f64, speed_m_per_s: f64) -> Result<Duration, Failure> {
        let mut world = self.wiring.world().borrow_mut();
        Ok(press(&mut world, depth_m, speed_m_per_s))
    }
}
