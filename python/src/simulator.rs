//! Simulated sensors: calibrated on their own bench, pressed, with the truth beside every record.

use std::sync::Arc;

use arrow_array::Float64Array;
use arrow_schema::DataType;
use palpate::recording::Recorded;
use palpate_cli::failure::Failure;
use palpate_sim::Time;
use palpate_sim::device::Device;
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::scenario::Scenario;
use palpate_sim::stack::{Disturbances, LoadError};
use palpate_sim::world::{Truth, World};
use palpate_simulate::engine::{Engine, press};
use palpate_simulate::instrument::{CalibratedInstrument, default_settings};
use palpate_simulate::press::{Press as PressProfile, PressOutcome, press_on};
use palpate_simulate::results::{Measured, calibrated, title};
use palpate_simulate::scenario::profile;
use palpate_wire::{Command, Frame, Record as WireRecord};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::raised;
use crate::json;
use crate::reading::GrowingTables;
use crate::record::Record;
use crate::table::{Table, as_dict, field, refused};

/// Interval of the truth's rows.
const TRUTH_EVERY: Time = Time::from_ms(1);
/// Simulated time for the answer to a question about the configuration: a curve has four records, one
/// step of the procedure apart.
const ANSWER: Time = Time::from_ms(10);

/// A simulated sensor, calibrated on its own bench.
#[pyclass(frozen, subclass, module = "palpate")]
pub(crate) struct Simulator {
    scenario: Scenario,
    seed: u64,
    instrument: CalibratedInstrument,
}

/// A press on a simulated sensor.
#[pyclass(frozen, module = "palpate")]
pub(crate) struct Press {
    /// The line of `palpate simulate --json`.
    result: String,
    frames: Vec<Frame<WireRecord>>,
    answers: Vec<Frame<WireRecord>>,
    truths: Vec<Truth>,
}

#[pymethods]
impl Simulator {
    /// Draws and calibrates a sensor. `scenario` is the head of a scenario file.
    #[new]
    fn calibrated(py: Python<'_>, scenario: String, seed: u64) -> PyResult<Self> {
        let made = py.detach(|| {
            let scenario = Scenario::parse("simulator", &scenario)?;
            let instrument = CalibratedInstrument::calibrated(
                &scenario.stack,
                &Disturbances::builtin().map_err(LoadError::from)?,
                seed,
                scenario.switches,
                &default_settings(),
            )?;
            Ok(Self {
                scenario,
                seed,
                instrument,
            })
        });
        made.map_err(raised)
    }

    /// Presses an object. `scenario` is a scenario file with one press.
    fn press_as(&self, py: Python<'_>, scenario: String) -> PyResult<Vec<Press>> {
        let pressed = py.detach(|| {
            let scenario = Scenario::parse("simulator", &scenario)?;
            let presses = scenario.presses.iter();
            let pressed =
                presses.map(|what| Press::of(&self.instrument, &profile(&self.instrument, what)));
            pressed.collect::<Result<Vec<_>, Failure>>()
        });
        pressed.map_err(raised)
    }

    /// Sensor and calibration in words, as `palpate simulate` prints them.
    #[getter]
    fn description(&self) -> String {
        let stack = &self.scenario.stack.name;
        let title = title(&self.instrument, stack, self.seed);
        format!("{title}\n{}", calibrated(&self.instrument))
    }

    /// Working depth: deformation of the sensing layer at rest, m.
    #[getter]
    fn depth_m(&self) -> f64 {
        self.instrument.depth_m
    }

    /// True stiffness of the sensing layer, N/m.
    #[getter]
    fn sensing_n_per_m(&self) -> f64 {
        self.instrument.plant.sensing.spring_n_per_m
    }
}

impl Press {
    fn of(instrument: &CalibratedInstrument, how: &PressProfile) -> Result<Self, Failure> {
        let engine = Watching::default();
        let outcome = press(instrument, how, &engine)?;
        let (truths, answers) = engine.watched.take();
        let measured = Measured::new(how.name.clone(), outcome);
        Ok(Self {
            result: json::text(&measured.line())?,
            frames: measured.pressed.frames,
            answers,
            truths,
        })
    }
}

#[pymethods]
impl Press {
    /// Result and truth: a line of `palpate simulate --json`.
    #[getter]
    fn result<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::object(py, &self.result)
    }

    /// Every record of the instrument, in order.
    #[getter]
    fn records(&self) -> Vec<Record> {
        let frames = self.frames.iter().cloned();
        frames.map(Record::received).collect()
    }

    /// The records as tables, by kind.
    #[getter]
    fn tables<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let tables = py.detach(|| {
            let mut tables = GrowingTables::default();
            for frame in &self.frames {
                let host_ns = frame.header.time_us.saturating_mul(1000);
                let recorded = Recorded {
                    host_ns,
                    device_ns: host_ns,
                    frame: frame.clone(),
                };
                tables.add(&recorded).map_err(raised)?;
            }
            tables.finish()
        })?;
        as_dict(py, tables)
    }

    /// True state of sensor and object, a row about every millisecond.
    #[getter]
    fn truth(&self) -> PyResult<Table> {
        let columns = TRUTH.map(|(name, unit, of)| {
            let values = Float64Array::from_iter_values(self.truths.iter().map(of));
            let array: arrow_array::ArrayRef = Arc::new(values);
            (field(name, DataType::Float64, unit, false), array)
        });
        Table::new(columns.into()).map_err(refused)
    }

    /// Writes the records as a recording, which every verb of the tool reads.
    fn save(&self, py: Python<'_>, file: std::path::PathBuf) -> PyResult<()> {
        let saved =
            py.detach(|| palpate::library::write_recording(&file, &self.answers, &self.frames));
        saved.map_err(raised)
    }
}

/// A column of the truth: name, unit, value.
type TrueColumn = (&'static str, &'static str, fn(&Truth) -> f64);

/// Columns of the truth; `palpate_sim::world::Truth` describes each.
const TRUTH: [TrueColumn; 19] = [
    ("time_s", "s", |of| of.time.as_secs_f64()),
    ("force_n", "N", |of| of.force_n),
    ("sensing_m", "m", |of| of.sensing_m),
    ("apparent_m", "m", |of| of.apparent_m),
    ("actuated_m", "m", |of| of.actuated_m),
    ("load_m", "m", |of| of.load_m),
    ("frame_m", "m", |of| of.frame_m),
    ("press_m", "m", |of| of.press_m),
    ("opening_m", "m", |of| of.opening_m),
    ("growth_m", "m", |of| of.growth_m),
    ("sensing_creep_m", "m", |of| of.sensing_creep_m),
    ("actuated_creep_m", "m", |of| of.actuated_creep_m),
    ("load_creep_m", "m", |of| of.load_creep_m),
    ("attraction_n", "N", |of| of.attraction_n),
    ("actuated_spring_n_per_m", "N/m", |of| {
        of.actuated_spring_n_per_m
    }),
    ("load_spring_n_per_m", "N/m", |of| of.load_spring_n_per_m),
    ("current_a", "A", |of| of.current_a),
    ("copper_c", "degC", |of| of.copper_c),
    ("pad_c", "degC", |of| of.pad_c),
];

/// True states of a press, and the answers about the configuration.
type Watched = (Vec<Truth>, Vec<Frame<WireRecord>>);

/// The tool's native engine, which also keeps the true states.
#[derive(Default)]
struct Watching {
    watched: std::cell::RefCell<Watched>,
}

impl Engine for Watching {
    fn press(
        &self,
        world: World,
        instrument: &CalibratedInstrument,
        how: &PressProfile,
    ) -> Result<PressOutcome, Failure> {
        let hardware = Wiring::new(world);
        let mut device = WatchedDevice {
            board: NativeBoard::new(&hardware),
            truths: Vec::new(),
        };
        let outcome = press_on(&mut device, instrument, how).map_err(Failure::refused)?;
        let WatchedDevice { mut board, truths } = device;
        for question in palpate::library::questions() {
            board.send(question).map_err(Failure::refused)?;
            let end = board.now() + ANSWER;
            board.run_until(end).map_err(Failure::refused)?;
        }
        self.watched.replace((truths, board.take_frames()));
        Ok(outcome)
    }
}

/// A device whose true states are kept.
struct WatchedDevice<'w> {
    board: NativeBoard<'w>,
    truths: Vec<Truth>,
}

impl<'w> Device for WatchedDevice<'w> {
    type Error = <NativeBoard<'w> as Device>::Error;

    fn now(&self) -> Time {
        self.board.now()
    }

    fn send(&mut self, command: Command) -> Result<(), Self::Error> {
        self.board.send(command)
    }

    fn advance(&mut self, end: Time) -> Result<(), Self::Error> {
        self.board.advance(end)?;
        let is_due = |last: &Truth| self.board.now() >= last.time + TRUTH_EVERY;
        if self.truths.last().is_none_or(is_due) {
            let truth = self.board.with_world(|world| world.truth());
            self.truths.push(truth);
        }
        Ok(())
    }

    fn frames(&mut self) -> &mut Vec<Frame<WireRecord>> {
        self.board.frames()
    }

    fn with_world<T>(&mut self, apply: impl FnOnce(&mut World) -> T) -> T {
        self.board.with_world(apply)
    }
}
