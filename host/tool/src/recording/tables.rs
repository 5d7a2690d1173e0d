//! Records as rows of tables, for every file format and for other programs.

pub use super::parquet_file::{Head, Kind};
pub use crate::commands::export::columns::{Column, Used, of};
pub use crate::commands::export::modulus;
pub use crate::commands::export::parquet::{FIRST, kind_of};
