//! Tests of `palpate-model` from outside: one program, whose modules are its parts.

mod bits;
mod calibration_curve;
mod common;
mod contact;
mod contact_sequences;
mod load_curve;
mod math;
mod misfit;
mod physics;
mod ramp_efficiency;
mod ramp_fit;
mod ramp_precision;
mod ramp_refusals;
mod readme;
mod thermal;
mod uncertainty;
