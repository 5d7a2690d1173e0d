//! Integration tests of `palpate-float`: one program, one module per subject.

mod bits;
