//! Enumeration requests of a PC to a device, in order (USB 2.0 9.1.2, 9.4).

use std::fmt;

use super::control::{ControlOutcome, ControlTransfer};
use crate::usb::description::{UsbDescription, kind};

/// wLength of the first request for the device descriptor, as Linux and Windows ask.
const FIRST_LENGTH: u16 = 64;
/// Address that the device is assigned.
const ADDRESS: u8 = 5;
/// Least bcdUSB of a device with a BOS descriptor (USB 3.2 9.6.2).
const WITH_BOS: u16 = 0x0201;
/// wLength of a string request: the longest descriptor.
const STRING_LENGTH: u16 = 255;
/// Line coding that the host sets: 115 200 bit/s, one stop bit, no parity, eight bits (PSTN 1.2
/// table 17).
const LINE_CODING: [u8; 7] = [0x00, 0xC2, 0x01, 0x00, 0, 0, 8];

/// Failure of an enumeration: the request and its outcome.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EnumerationFailure {
    /// Request of the host.
    pub request: &'static str,
    /// Outcome of the request.
    pub outcome: ControlOutcome,
}

impl fmt::Display for EnumerationFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.request, self.outcome)
    }
}

impl std::error::Error for EnumerationFailure {}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    FirstDevice,
    Reset,
    Address,
    Device,
    Qualifier,
    BosHeader,
    Bos(u16),
    ConfigurationHeader,
    Configuration(u16),
    Languages,
    String(u8),
    Configure,
    LineCoding,
    LineState,
    Done,
}

/// Next action of the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Request {
    Transfer(ControlTransfer),
    Reset,
    Done,
}

/// An enumeration in progress.
#[derive(Clone, Debug)]
pub(super) struct Enumeration {
    step: Step,
    pub(super) found: UsbDescription,
}

impl Enumeration {
    pub(super) fn new() -> Self {
        Self {
            step: Step::FirstDevice,
            found: UsbDescription::default(),
        }
    }

    /// Next action of the host.
    pub(super) fn request(&self) -> Request {
        let get = |kind, index, length| Request::Transfer(get_descriptor(kind, index, 0, length));
        let set = |setup| Request::Transfer(ControlTransfer::new(setup));
        match self.step {
            Step::FirstDevice => get(kind::DEVICE, 0, FIRST_LENGTH),
            Step::Reset => Request::Reset,
            Step::Address => set([0, 5, ADDRESS, 0, 0, 0, 0, 0]),
            Step::Device => get(kind::DEVICE, 0, 18),
            Step::Qualifier => get(kind::QUALIFIER, 0, 10),
            Step::BosHeader => get(kind::BOS, 0, 5),
            Step::Bos(length) => get(kind::BOS, 0, length),
            Step::ConfigurationHeader => get(kind::CONFIGURATION, 0, 9),
            Step::Configuration(length) => get(kind::CONFIGURATION, 0, length),
            Step::Languages => get(kind::STRING, 0, STRING_LENGTH),
            Step::String(index) => {
                let transfer = get_descriptor(kind::STRING, index, self.language(), STRING_LENGTH);
                Request::Transfer(transfer)
            }
            Step::Configure => {
                let value = self.found.configuration.get(5).copied().unwrap_or(0);
                set([0, 9, value, 0, 0, 0, 0, 0])
            }
            Step::LineCoding => Request::Transfer(line_coding(self.control_interface())),
            Step::LineState => Request::Transfer(line_state(self.control_interface(), true)),
            Step::Done => Request::Done,
        }
    }

    fn language(&self) -> u16 {
        match self.found.languages.get(2..4) {
            Some(&[low, high]) => u16::from_le_bytes([low, high]),
            _ => 0,
        }
    }

    fn control_interface(&self) -> u8 {
        self.found.cdc().map_or(0, |cdc| cdc.control_interface)
    }

    /// Handles a second reset of the port.
    pub(super) fn was_reset(&mut self) {
        if self.step == Step::Reset {
            self.step = Step::Address;
        }
    }

    /// Handles the outcome of the present request.
    pub(super) fn answer(&mut self, outcome: ControlOutcome) -> Result<(), EnumerationFailure> {
        if self.step == Step::Qualifier {
            self.found.refused_qualifier = outcome == ControlOutcome::Stalled;
            self.step = self.after_qualifier();
            return Ok(());
        }
        if let (Step::String(index), ControlOutcome::Stalled) = (self.step, &outcome) {
            self.found.strings.insert(index, Vec::new());
            self.step = self.after_string(index);
            return Ok(());
        }
        let data = match outcome {
            ControlOutcome::Done(data) => data,
            _ => return Err(self.failure(outcome)),
        };
        let short = ControlOutcome::Broken("a descriptor shorter than its header");
        self.step = self.after(data).ok_or_else(|| self.failure(short))?;
        Ok(())
    }

    /// Failure of the present request with this outcome.
    pub(super) fn failure(&self, outcome: ControlOutcome) -> EnumerationFailure {
        EnumerationFailure {
            request: self.name(),
            outcome,
        }
    }

    /// Step after the one that received `data`; `None` if the data are too short.
    fn after(&mut self, data: Vec<u8>) -> Option<Step> {
        Some(match self.step {
            Step::FirstDevice if data.len() >= 8 => Step::Reset,
            Step::FirstDevice | Step::Reset | Step::Qualifier | Step::Done => return None,
            Step::Address => Step::Device,
            Step::Device => {
                self.found.device = data;
                self.word_of_device(2)?;
                Step::Qualifier
            }
            Step::BosHeader => Step::Bos(word(&data, 2)?),
            Step::Bos(_) => {
                self.found.bos = Some(data);
                Step::ConfigurationHeader
            }
            Step::ConfigurationHeader => Step::Configuration(word(&data, 2)?),
            Step::Configuration(_) => {
                self.found.configuration = data;
                match self.found.string_indices().first() {
                    Some(_) => Step::Languages,
                    None => Step::Configure,
                }
            }
            Step::Languages => {
                self.found.languages = data;
                self.after_string(0)
            }
            Step::String(index) => {
                self.found.strings.insert(index, data);
                self.after_string(index)
            }
            Step::Configure if self.found.cdc().is_some() => Step::LineCoding,
            Step::LineCoding => Step::LineState,
            Step::Configure | Step::LineState => Step::Done,
        })
    }

    fn word_of_device(&self, at: usize) -> Option<u16> {
        word(&self.found.device, at)
    }

    fn after_qualifier(&self) -> Step {
        match self.word_of_device(2) {
            Some(version) if version >= WITH_BOS => Step::BosHeader,
            _ => Step::ConfigurationHeader,
        }
    }

    fn after_string(&self, index: u8) -> Step {
        let indices = self.found.string_indices();
        let next = indices.into_iter().find(|&next| next > index);
        next.map_or(Step::Configure, Step::String)
    }

    const fn name(&self) -> &'static str {
        match self.step {
            Step::FirstDevice => "GET_DESCRIPTOR of the device, at address 0",
            Step::Reset => "reset",
            Step::Address => "SET_ADDRESS",
            Step::Device => "GET_DESCRIPTOR of the device",
            Step::Qualifier => "GET_DESCRIPTOR of the device qualifier",
            Step::BosHeader | Step::Bos(_) => "GET_DESCRIPTOR of the capabilities (BOS)",
            Step::ConfigurationHeader => "GET_DESCRIPTOR of the configuration, 9 bytes",
            Step::Configuration(_) => "GET_DESCRIPTOR of the configuration",
            Step::Languages => "GET_DESCRIPTOR of the languages",
            Step::String(_) => "GET_DESCRIPTOR of a string",
            Step::Configure => "SET_CONFIGURATION",
            Step::LineCoding => "SET_LINE_CODING",
            Step::LineState => "SET_CONTROL_LINE_STATE",
            Step::Done => "nothing",
        }
    }
}

/// GET_DESCRIPTOR (USB 2.0 9.4.3).
fn get_descriptor(kind: u8, index: u8, language: u16, length: u16) -> ControlTransfer {
    let [language_low, language_high] = language.to_le_bytes();
    let [length_low, length_high] = length.to_le_bytes();
    ControlTransfer::new([
        0x80,
        6,
        index,
        kind,
        language_low,
        language_high,
        length_low,
        length_high,
    ])
}

/// SET_LINE_CODING (PSTN 1.2 6.3.10).
fn line_coding(interface: u8) -> ControlTransfer {
    ControlTransfer::with_data([0x21, 0x20, 0, 0, interface, 0, 7, 0], &LINE_CODING)
}

/// SET_CONTROL_LINE_STATE (PSTN 1.2 6.3.12): RTS and DTR together, as a PC sets them when a
/// program opens the port.
pub(super) fn line_state(interface: u8, is_open: bool) -> ControlTransfer {
    let state = if is_open { 0b11 } else { 0 };
    ControlTransfer::new([0x21, 0x22, state, 0, interface, 0, 0, 0])
}

fn word(bytes: &[u8], at: usize) -> Option<u16> {
    let bytes = bytes.get(at..at + 2)?;
    bytes.try_into().ok().map(u16::from_le_bytes)
}
