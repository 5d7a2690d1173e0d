//! A record of a board.

use palpate_wire::{Frame, Message, Record as WireRecord};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::json;

/// A record of a board, with its header.
#[pyclass(frozen, module = "palpate")]
pub(crate) struct Record {
    frame: Frame<WireRecord>,
    /// Whether a recomputed record equals the board's in every byte; `None` for a received one.
    #[pyo3(get)]
    matches: Option<bool>,
}

impl Record {
    pub(crate) const fn received(frame: Frame<WireRecord>) -> Self {
        Self {
            frame,
            matches: None,
        }
    }

    pub(crate) const fn computed(frame: Frame<WireRecord>, matches: bool) -> Self {
        Self {
            frame,
            matches: Some(matches),
        }
    }
}

#[pymethods]
impl Record {
    #[getter]
    fn kind(&self) -> &'static str {
        self.frame.message.name()
    }

    #[getter]
    fn time_s(&self) -> f64 {
        self.frame.header.time_us as f64 * 1e-6
    }

    #[getter]
    fn time_us(&self) -> u64 {
        self.frame.header.time_us
    }

    #[getter]
    fn boot_id(&self) -> u32 {
        self.frame.header.boot_id
    }

    #[getter]
    fn sequence(&self) -> u32 {
        self.frame.header.sequence
    }

    #[getter]
    fn dropped(&self) -> u32 {
        self.frame.header.dropped
    }

    /// The fields by name; a new dictionary at each call.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let message = json::object_of(py, &self.frame.message)?;
        // A record without fields is its name alone.
        match message.cast::<PyDict>() {
            Ok(message) => message.as_any().get_item(self.kind()),
            Err(_) => Ok(PyDict::new(py).into_any()),
        }
    }

    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        self.fields(py)?.get_item(name)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let fields = self.fields(py)?.repr()?;
        Ok(format!(
            "<{} at {} s: {fields}>",
            self.kind(),
            self.time_s()
        ))
    }
}
