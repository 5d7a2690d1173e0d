//! Integration tests of `ldc161x`: one program, one module per subject.

mod asynchronous;
mod common;
mod plan;
mod rational;
mod registers;
mod sharing;
