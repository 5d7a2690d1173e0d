#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![doc = include_str!("../README.md")]

mod board;
mod image;
mod instrument;
mod rp2040;
mod stop;
mod time;
mod trace;
pub mod usb;

pub use board::bridge::BridgeInputs;
pub use board::coil::BridgeCircuit;
pub use board::flash::{Flash, FlashOperation, FlashOperationKind, FlashTimes};
pub use board::plant::{Plant, PlantConditions, PressedWorld, Still};
pub use board::wire::{LineFault, WireLog};
pub use board::{EmulatedBoard, Options, ResetCount, SecondSensors, Uf2Error};
pub use image::firmware;
pub use image::profile::{Cost, Handler, Profile};
pub use image::sources::{Function, Sources, SourcesError};
pub use image::{Image, ImageError};
pub use instrument::{COMMANDS, ImageFailure, Instrument, LOGS, RECORDS};
pub use rp2040::pwm::LevelTimes;
pub use stop::Stop;
pub use time::Time;
pub use trace::Trace;
