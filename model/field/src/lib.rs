#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod design;
pub mod element;
pub mod figures;
pub mod force;
pub mod geometry;
pub mod heat;
pub mod layer;
pub mod material;
pub mod mesh;
pub mod plates;
pub mod solve;
