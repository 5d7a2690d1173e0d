//! Tests of `palpate-wire` from outside: one program, whose modules are its parts.

mod checksum;
mod commands;
mod fixture;
mod loss;
mod reading;
mod robustness;
mod round_trip;
mod schema;
mod support;
mod validation;
