//! Tests of `ldc161x-sim` from outside: one program, whose modules are its parts.

mod bus;
mod common;
mod counting;
mod drive;
mod faults;
mod registers;
mod reporting;
mod robust;
mod schedule;
mod wire_faults;
