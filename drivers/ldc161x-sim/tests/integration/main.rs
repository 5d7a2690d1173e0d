//! Integration tests of `ldc161x-sim`: one program, one module per subject.

mod bus;
mod common;
mod counting;
mod drive;
mod faults;
mod registers;
mod reporting;
mod schedule;
