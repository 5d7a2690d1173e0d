//! Tests of `ldc161x` from outside: one program, whose modules are its parts.

mod asynchronous;
mod common;
mod plan;
mod rational;
mod registers;
mod sharing;
