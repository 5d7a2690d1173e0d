//! Values of the tool as Python objects, with the digits of its JSON output.

use palpate_cli::failure::Failure;
use pyo3::prelude::*;
use serde::Serialize;

use crate::errors::raised;

/// The text of a value.
pub(crate) fn text(value: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string(value)?)
}

/// The Python object of a text: dictionaries, lists, numbers, strings.
pub(crate) fn object<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (text,))
}

/// The Python object of a value.
pub(crate) fn object_of<'py>(
    py: Python<'py>,
    value: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    object(py, &text(value).map_err(raised)?)
}
