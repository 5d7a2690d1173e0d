//! Fault in the data of a bench.

use std::fmt;

/// A fault of a bench's data, with its likely cause and a remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DataFault {
    /// Name, stable across versions.
    pub name: &'static str,
    /// Description of the fault.
    pub cause: String,
    /// Remedy.
    pub action: &'static str,
}

impl fmt::Display for DataFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}. {}", self.cause, self.action)
    }
}
