//! Tests of `palpate-float` from outside: one program, whose modules are its parts.

mod bits;
