//! Integration tests of `palpate-model`: one program, one module per subject.

mod bits;
mod calibration_curve;
mod common;
mod contact;
mod contact_sequences;
mod hardness;
mod indentation;
mod load_curve;
mod math;
mod misfit;
mod physics;
mod ramp_fit;
mod ramp_precision;
mod ramp_refusals;
mod ramp_statistics;
mod thermal;
mod touch;
mod uncertainty;
