//! Integration tests of `palpate-field`: one program, one module per subject.

mod arcs;
mod designs;
mod dodd_deeds;
mod drawings;
mod drawn;
mod eddy;
mod exact;
mod forces;
mod magnets;
mod properties;
mod sheets;
mod tables;
