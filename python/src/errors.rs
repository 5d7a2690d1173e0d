//! Failures of the tool as Python exceptions.

use palpate_cli::failure::Failure;
use pyo3::exceptions::PyException;
use pyo3::{PyErr, create_exception};

create_exception!(
    palpate,
    PalpateError,
    PyException,
    "A refusal or a failure. The text is the tool's own: where, why, and what to do."
);

/// The exception of a failure.
pub(crate) fn raised(failure: Failure) -> PyErr {
    PalpateError::new_err(failure.to_string())
}
