//! Extension module of the Python package `palpate`: the tool's libraries for Python.
//!
//! `package/palpate` holds the Python side, with the documentation of the functions.

mod board;
mod errors;
mod field;
mod json;
mod reading;
mod record;
mod simulator;
mod table;
mod worker;

#[pyo3::pymodule]
mod _palpate {
    #[pymodule_export]
    use crate::board::Board;
    #[pymodule_export]
    use crate::errors::PalpateError;
    #[pymodule_export]
    use crate::field::{Field, designs};
    #[pymodule_export]
    use crate::reading::{estimate, read};
    #[pymodule_export]
    use crate::record::Record;
    #[pymodule_export]
    use crate::simulator::{Press, Simulator};
    #[pymodule_export]
    use crate::table::Table;
}
