//! Tests of `palpate-field` from outside: one program, whose modules are its parts.

mod arcs;
mod designs;
mod dodd_deeds;
mod drawings;
mod eddy;
mod exact;
mod forces;
mod magnets;
mod properties;
mod sheets;
mod tables;
