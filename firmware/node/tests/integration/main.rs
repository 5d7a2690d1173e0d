//! Integration tests of `palpate-node`: one program, one module per subject.

mod faults_page;
mod grid;
