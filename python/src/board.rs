//! A connected board.

use palpate_cli::failure::Failure;
use pyo3::exceptions::PyStopIteration;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::errors::PalpateError;
use crate::json;
use crate::record::Record;
use crate::worker::Worker;

/// Longest time of one receive call.
const POLL: Duration = Duration::from_millis(10);

/// A board over any of the tool's links, made by `palpate.connect`.
#[pyclass(frozen, subclass, module = "palpate")]
pub(crate) struct Board {
    name: String,
    is_recording: bool,
    hello: Option<String>,
    worker: Mutex<Option<Arc<Worker>>>,
}

impl Board {
    fn worker(&self) -> PyResult<Arc<Worker>> {
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner);
        let closed = || PalpateError::new_err("the board is closed: connect again");
        worker.clone().ok_or_else(closed)
    }
}

#[pymethods]
impl Board {
    /// Connects, by the arguments of `palpate measure`.
    #[new]
    fn open(py: Python<'_>, arguments: Vec<String>) -> PyResult<Self> {
        let worker = Worker::start(py, arguments)?;
        let (name, is_recording, hello) = worker.run(py, |board| {
            let hello = board.hello().map(json::text).transpose()?;
            Ok((board.name().to_owned(), board.is_recording(), hello))
        })?;
        Ok(Self {
            name,
            is_recording,
            hello,
            worker: Mutex::new(Some(Arc::new(worker))),
        })
    }

    /// Location of the board.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Identity of the board at the connection.
    #[getter]
    fn hello<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::object(py, self.hello.as_deref().unwrap_or("{}"))
    }

    /// Measures at the next contact: a line of `palpate measure --json`.
    fn measure<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let measured = self
            .worker()?
            .run(py, |board| json::text(&board.measure()?))?;
        json::object(py, &measured)
    }

    /// Settings in force by name.
    fn read_settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let settings = self
            .worker()?
            .run(py, |board| json::text(&board.settings()?))?;
        json::object(py, &settings)
    }

    /// Changes settings, each as `NAME=VALUE`.
    fn change_settings(&self, py: Python<'_>, assignments: Vec<String>) -> PyResult<()> {
        let change = move |board: &mut palpate::library::Board| board.set(&assignments).map(drop);
        self.worker()?.run(py, change)
    }

    /// Stores settings and calibration in force; returns the state of the storage.
    fn store<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let storage = self
            .worker()?
            .run(py, |board| json::text(&board.store()?))?;
        json::object(py, &storage)
    }

    /// Sends a command as JSON; it must be accepted.
    fn send_json(&self, py: Python<'_>, command: String) -> PyResult<()> {
        self.worker()?.run(py, move |board| board.send(&command))
    }

    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    /// The next record; waits for it. A recording ends, a board does not.
    fn __next__(&self, py: Python<'_>) -> PyResult<Record> {
        let worker = self.worker()?;
        loop {
            if let Some(frame) = worker.next() {
                return Ok(Record::received(frame));
            }
            let is_recording = self.is_recording;
            let received = worker.run(py, move |board| match board.receive(POLL) {
                Err(Failure::Lost(_)) if is_recording => Ok(None),
                other => other.map(Some),
            })?;
            match received {
                Some(frames) => worker.keep(frames),
                None => return Err(PyStopIteration::new_err(())),
            }
        }
    }

    /// Closes the link; a board that this program armed is disarmed.
    fn close(&self, py: Python<'_>) {
        let worker = self
            .worker
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        // A call in another thread closes it at its end.
        if let Some(worker) = worker.and_then(Arc::into_inner) {
            worker.close(py);
        }
    }
}
