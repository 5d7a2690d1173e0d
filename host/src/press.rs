//! One press of an object upon a simulated, calibrated instrument.

use palpate_sim::Time;
use palpate_sim::board::{BoardError, Hardware, TimedRecord, VirtualBoard};
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::parameters::ParameterError;
use palpate_sim::world::{Holder, Setup, World};
use palpate_wire::{Command, Record};

use crate::instrument::Instrument;

/// How an object is pressed.
#[derive(Clone, Debug)]
pub(crate) struct Press {
    /// The object.
    pub(crate) load: Load,
    /// Who presses.
    pub(crate) holder: Holder,
    /// How deep the sensing layer is meant to be pressed, m.
    pub(crate) depth_m: f64,
    /// How fast, m/s.
    pub(crate) speed_m_per_s: f64,
}

/// Where the object waits above the sensor, m.
const CLEARANCE_M: f64 = 0.2e-3;
/// Self-test and baseline.
const BASELINE: Time = Time::from_ms(800);
/// A result comes within this time after the press.
const PATIENCE: Time = Time::from_ms(30_000);
/// Time for the points of the load's curve.
const AFTERWARDS: Time = Time::from_ms(100);

/// What came of it.
#[derive(Clone, Debug)]
pub(crate) struct Pressed {
    /// Everything the instrument told.
    pub(crate) records: Vec<TimedRecord>,
    /// What was pressed.
    pub(crate) load: Load,
    /// Compliance of what the load stands on, m/N.
    pub(crate) frame_m_per_n: f64,
    /// True tangent stiffness of the load with what it stands on at the end of the train, N/m.
    pub(crate) true_n_per_m: f64,
    /// True force then, N.
    pub(crate) true_force_n: f64,
    /// Simulated time, s.
    pub(crate) simulated_s: f64,
}

impl Pressed {
    /// How far load and frame give way to a force, m.
    pub(crate) fn displacement_m(&self, force_n: f64) -> f64 {
        self.load.displacement_m(force_n) + self.frame_m_per_n * force_n
    }
}

/// Why a simulation could not run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Broken {
    Plant(ParameterError),
    Board(BoardError),
}

impl std::fmt::Display for Broken {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Plant(error) => error.fmt(f),
            Self::Board(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for Broken {}

impl From<ParameterError> for Broken {
    fn from(error: ParameterError) -> Self {
        Self::Plant(error)
    }
}

impl From<BoardError> for Broken {
    fn from(error: BoardError) -> Self {
        Self::Board(error)
    }
}

/// Presses an object upon the instrument and waits for its estimate or refusal.
pub(crate) fn press(instrument: &Instrument, how: &Press) -> Result<Pressed, Broken> {
    let (plant, switches) = (&instrument.plant, instrument.switches);
    let setup = Setup {
        load: how.load,
        holder: how.holder,
        profile: Profile::at(-CLEARANCE_M),
        ..Setup::default()
    };
    let world = World::new(plant, switches, setup)?;
    let travel_m = world.press_for_depth_m(how.depth_m);
    let frame_m_per_n = plant.effective(&switches).press.frame_m_per_n;
    let hardware = Hardware::new(world);
    let mut board = VirtualBoard::new(&hardware);
    for command in &instrument.calibration.commands {
        board.send(automatic(command))?;
    }
    board.send(Command::Arm)?;
    board.run_until(BASELINE)?;
    let mut world = hardware.world().borrow_mut();
    world.move_press(travel_m, how.speed_m_per_s);
    drop(world);
    let moving_s = (travel_m + CLEARANCE_M) / how.speed_m_per_s;
    let limit = board.now() + Time::from_secs_f64(moving_s) + PATIENCE;
    board.run_to(limit, |record| {
        matches!(record, Record::Estimate(_) | Record::Refusal(_))
    })?;
    let truth = hardware.world().borrow().truth();
    let end = board.now() + AFTERWARDS;
    board.run_until(end)?;
    Ok(Pressed {
        records: board.take_records(),
        load: how.load,
        frame_m_per_n,
        true_n_per_m: truth.load_spring_n_per_m,
        true_force_n: truth.force_n,
        simulated_s: board.now().as_secs_f64(),
    })
}

/// Measures at every contact, as nobody is there to ask.
fn automatic(command: &Command) -> Command {
    match command {
        Command::SetSettings(settings) => Command::SetSettings(palpate_wire::command::Settings {
            automatic: true,
            ..settings.clone()
        }),
        other => other.clone(),
    }
}
