//! Pins, bus and current over time, as a value change dump (IEEE 1364-2005, clause 18).

use std::io::{self, Write};

use vcd::{IdCode, SimulationCommand, TimescaleUnit, VarType, Writer};

use crate::board::pins::{COIL_SLICE, pin};
use crate::rp2040::gpio::{Gpio, function};
use crate::rp2040::pwm::Pwm;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    Sda,
    Scl,
    Intb,
    Shutdown,
    In1,
    In2,
    Sleep,
    Fault,
    Led,
    /// Last byte on the bus, valid from the end of its acknowledge.
    Byte,
    Current,
}

impl Signal {
    const ALL: [Self; 11] = [
        Self::Sda,
        Self::Scl,
        Self::Intb,
        Self::Shutdown,
        Self::In1,
        Self::In2,
        Self::Sleep,
        Self::Fault,
        Self::Led,
        Self::Byte,
        Self::Current,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Sda => "sda",
            Self::Scl => "scl",
            Self::Intb => "intb",
            Self::Shutdown => "sd",
            Self::In1 => "in1",
            Self::In2 => "in2",
            Self::Sleep => "nsleep",
            Self::Fault => "nfault",
            Self::Led => "led",
            Self::Byte => "i2c_byte",
            Self::Current => "coil_current_a",
        }
    }

    /// Kind and width of the signal's variable.
    const fn kind(self) -> (VarType, u32) {
        match self {
            Self::Byte => (VarType::Reg, 8),
            Self::Current => (VarType::Real, 64),
            _ => (VarType::Wire, 1),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SignalValue {
    Level(bool),
    Byte(u8),
    Real(f64),
}

/// Value of a signal from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Change {
    pub(crate) at_ps: u64,
    pub(crate) signal: Signal,
    pub(crate) value: SignalValue,
}

/// A trace of the board's pins, its bus and the coil's current. It has SDA and SCL bit by bit, and
/// IN1 and IN2 pulse by pulse.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Changes of the signals, not sorted by time: bits of the bus are known only at their end.
    changes: Vec<Change>,
    last: [Option<SignalValue>; Signal::ALL.len()],
    /// Time up to which the PWM pulses have been traced.
    pulses_ps: u64,
}

impl Trace {
    pub(crate) fn push(&mut self, change: Change) {
        self.changes.push(change);
    }

    /// Samples the pins other than the bridge's inputs, and the bus where its master does not trace
    /// it.
    pub(crate) fn sample_pins(&mut self, now_ps: u64, gpio: &Gpio, bus_is_idle: bool) {
        for (signal, pin) in [(Signal::Sda, pin::SDA), (Signal::Scl, pin::SCL)] {
            if bus_is_idle {
                self.is(now_ps, signal, SignalValue::Level(gpio.level(pin)));
            } else {
                self.leave(signal);
            }
        }
        for (signal, pin) in [
            (Signal::Intb, pin::INTB),
            (Signal::Shutdown, pin::SD),
            (Signal::Sleep, pin::SLEEP),
            (Signal::Fault, pin::FAULT),
            (Signal::Led, pin::LED),
        ] {
            self.is(now_ps, signal, SignalValue::Level(gpio.level(pin)));
        }
    }

    /// Samples the bridge's inputs up to a time. Must be called before they change, and afterwards.
    pub(crate) fn sample_pulses(&mut self, until_ps: u64, gpio: &Gpio, pwm: &Pwm) {
        for (signal, pin, channel_b) in [
            (Signal::In1, pin::IN1, false),
            (Signal::In2, pin::IN2, true),
        ] {
            let edges = match gpio.function(pin) {
                function::PWM => pwm.edges(COIL_SLICE, channel_b, (self.pulses_ps, until_ps)),
                _ => vec![(until_ps, gpio.level(pin))],
            };
            for (at_ps, high) in edges {
                self.is(at_ps, signal, SignalValue::Level(high));
            }
        }
        self.pulses_ps = until_ps;
    }

    /// Sets the value of a signal; a repeated value is not stored.
    pub(crate) fn is(&mut self, at_ps: u64, signal: Signal, value: SignalValue) {
        let last = self.last.get_mut(signal as usize);
        if last.is_some_and(|last| last.replace(value) != Some(value)) {
            self.push(Change {
                at_ps,
                signal,
                value,
            });
        }
    }

    /// Ends sampling of a signal that another source traces from now on.
    fn leave(&mut self, signal: Signal) {
        if let Some(last) = self.last.get_mut(signal as usize) {
            *last = None;
        }
    }

    /// Writes the trace, in nanoseconds; the file name should end with `.vcd`.
    ///
    /// # Errors
    /// Errors of the writer.
    pub fn write(mut self, to: impl Write) -> io::Result<()> {
        self.changes.sort_by_key(|change| change.at_ps);
        let mut to = Writer::new(to);
        to.comment("simulated: palpate's image on an emulated Raspberry Pi Pico")?;
        to.timescale(1, TimescaleUnit::NS)?;
        to.add_module("board")?;
        let mut codes = Vec::new();
        for signal in Signal::ALL {
            let (kind, width) = signal.kind();
            codes.push(to.add_var(kind, width, signal.name(), None)?);
        }
        to.upscope()?;
        to.enddefinitions()?;
        to.begin(SimulationCommand::Dumpvars)?;
        for (&code, signal) in codes.iter().zip(Signal::ALL) {
            match signal {
                Signal::Byte => to.change_vector(code, [vcd::Value::X; 8])?,
                Signal::Current => to.change_real(code, 0.0)?,
                _ => to.change_scalar(code, vcd::Value::X)?,
            }
        }
        to.end()?;
        write_changes(&mut to, &codes, &self.changes)?;
        to.flush()
    }
}

fn write_changes(
    to: &mut Writer<impl Write>,
    codes: &[IdCode],
    changes: &[Change],
) -> io::Result<()> {
    let mut last = [None; Signal::ALL.len()];
    let mut time_ns = None;
    for change in changes {
        let index = change.signal as usize;
        let (Some(&code), Some(last)) = (codes.get(index), last.get_mut(index)) else {
            continue;
        };
        // A repeated byte is a new event, a repeated level is not.
        let is_byte = change.signal == Signal::Byte;
        if last.replace(change.value) == Some(change.value) && !is_byte {
            continue;
        }
        let now_ns = change.at_ps / 1_000;
        if time_ns.replace(now_ns) != Some(now_ns) {
            to.timestamp(now_ns)?;
        }
        match change.value {
            SignalValue::Level(high) => to.change_scalar(code, high)?,
            SignalValue::Byte(byte) => {
                let bits = (0..8).rev().map(|bit| (byte >> bit & 1 == 1).into());
                to.change_vector(code, bits)?;
            }
            SignalValue::Real(value) => to.change_real(code, value)?,
        }
    }
    Ok(())
}
