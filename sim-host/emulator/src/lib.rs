#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![doc = include_str!("../README.md")]

mod adc;
mod board;
mod bridge;
mod bus;
mod clocks;
mod coil;
mod converters;
mod dma;
pub mod firmware;
mod flash;
mod gpio;
mod i2c;
mod image;
mod instrument;
mod interrupts;
mod memory;
mod pins;
mod plant;
mod power;
mod private;
mod profile;
mod pwm;
mod rom;
mod rom_calls;
mod rtt;
mod sio;
mod sources;
mod ssi;
mod stop;
mod time;
mod timer;
mod trace;
mod uf2;
pub mod usb;
mod watchdog;
mod wire;
mod xip;

pub use board::{BootLoader, EmulatedBoard, Options, ResetCount, Uf2Error};
pub use bridge::BridgeInputs;
pub use coil::BridgeCircuit;
pub use flash::{Flash, FlashOperation, FlashOperationKind, FlashTimes};
pub use image::{Image, ImageError};
pub use instrument::{COMMANDS, ImageFailure, Instrument, LOGS, RECORDS};
pub use plant::{Plant, PlantConditions, PressedWorld, Still};
pub use profile::{Cost, Handler, Profile};
pub use pwm::LevelTimes;
pub use sources::{Function, Sources, SourcesError};
pub use stop::Stop;
pub use time::Time;
pub use trace::Trace;
pub use wire::{LineFault, WireLog};
