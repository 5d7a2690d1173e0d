//! Tests of `palpate-node` from outside: one program, whose modules are its parts.

mod faults_page;
mod grid;
