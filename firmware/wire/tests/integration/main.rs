//! Integration tests of `palpate-wire`: one program, one module per subject.

mod checksum;
mod commands;
mod fixture;
mod loss;
mod payloads;
mod robustness;
mod round_trip;
mod schema;
mod support;
mod validation;
