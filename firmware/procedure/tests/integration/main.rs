//! Integration tests of `palpate-procedure`: one program, one module per subject.

mod boot;
mod commands;
mod configuration;
mod deadlines;
mod energy;
mod estimates;
mod fault_lists;
mod faults;
mod limits;
mod manual;
mod phases;
mod queue;
mod refusals;
mod relaxation;
mod rest;
mod storage;
mod streams;
mod support;
mod touches;
