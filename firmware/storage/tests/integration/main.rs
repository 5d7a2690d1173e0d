//! Integration tests of `palpate-storage`: one program, one module per subject.

mod costs;
mod damage;
mod library;
mod model;
mod power_cuts;
mod reading;
mod saving;
mod support;
mod versions;
