//! The converters on the bus, with their pins SD and CLKIN.

use ldc161x_sim::{Ack, Chip, ExternalClock, Time};

use super::options::SecondSensors;

/// A second converter.
pub(crate) type SecondChip = Chip<SecondSensors>;

/// The converters on the bus: one or two.
#[derive(Clone, Debug)]
pub(crate) struct Converters<P> {
    pub(crate) first: Chip<P>,
    pub(crate) second: Option<SecondChip>,
    /// Levels of the converters' SD pins.
    shut_down: [bool; 2],
    /// Frequency at the converters' CLKIN pins, Hz; `None` without a clock.
    clkin_hz: Option<f64>,
}

impl<P: ldc161x_sim::Sensors> Converters<P> {
    /// Converters without a clock.
    pub(crate) fn new(mut first: Chip<P>, second: Option<SecondChip>) -> Self {
        first.set_external_clock(None);
        Self {
            first,
            second,
            shut_down: [false; 2],
            clkin_hz: None,
        }
    }

    pub(crate) const fn clkin_hz(&self) -> Option<f64> {
        self.clkin_hz
    }

    /// Time of the next event of either converter.
    pub(crate) fn next_event(&self) -> Option<u64> {
        let second = self.second.as_ref().and_then(Chip::next_event);
        let events = [self.first.next_event(), second];
        events.iter().flatten().min().map(|due| due.as_ps())
    }

    /// Levels of the converters' INTB pins; high for an absent converter.
    pub(crate) fn intb(&self) -> [bool; 2] {
        let second = self.second.as_ref();
        [
            !self.first.intb_is_low(),
            second.is_none_or(|chip| !chip.intb_is_low()),
        ]
    }

    /// Sets the frequency at CLKIN.
    pub(crate) fn set_clock(&mut self, now: Time, hz: Option<f64>) {
        if hz == self.clkin_hz {
            return;
        }
        self.clkin_hz = hz;
        let clock = hz.map(ExternalClock::exact);
        self.first.advance_to(now);
        self.first.set_external_clock(clock);
        if let Some(second) = &mut self.second {
            second.advance_to(now);
            second.set_external_clock(clock);
        }
    }

    /// Sets the levels of SD; returns which of them have changed.
    pub(crate) fn set_shutdown(&mut self, now: Time, levels: [bool; 2]) -> [bool; 2] {
        let before = std::mem::replace(&mut self.shut_down, levels);
        let changed = [levels[0] != before[0], levels[1] != before[1]];
        if changed[0] {
            self.first.advance_to(now);
            self.first.set_shutdown(levels[0]);
        }
        if let Some(second) = &mut self.second
            && changed[1]
        {
            second.advance_to(now);
            second.set_shutdown(levels[1]);
        }
        changed
    }

    /// Cuts and restores the converters' power.
    pub(crate) fn cycle_power(&mut self, now: Time) {
        self.first.advance_to(now);
        self.first.brown_out();
        if let Some(second) = &mut self.second {
            second.advance_to(now);
            second.brown_out();
        }
    }

    /// Whether a converter holds SDA low.
    pub(crate) fn sda_is_low(&mut self, now: Time) -> bool {
        let second = &mut self.second;
        self.first.sda_held_low(now) || second.as_mut().is_some_and(|chip| chip.sda_held_low(now))
    }

    /// Time until which a converter holds SCL low.
    pub(crate) fn scl_low_until(&mut self, now: Time) -> Option<Time> {
        let first = self.first.scl_held_until(now);
        let second = self.second.as_mut();
        first.max(second.and_then(|chip| chip.scl_held_until(now)))
    }

    /// Sends START with an address byte; returns whether a converter acknowledges it.
    pub(crate) fn start(&mut self, now: Time, byte: u8) -> bool {
        let second = self.second.as_mut().map(|chip| chip.start(now, byte));
        self.first.start(now, byte).is_ack() | second.is_some_and(Ack::is_ack)
    }

    /// Sends a byte of the master; returns whether a converter acknowledges it.
    pub(crate) fn write(&mut self, now: Time, byte: u8) -> bool {
        let second = self.second.as_mut().map(|chip| chip.write(now, byte));
        self.first.write(now, byte).is_ack() | second.is_some_and(Ack::is_ack)
    }

    /// Reads a byte for the master.
    pub(crate) fn read(&mut self, now: Time, ack: Ack) -> u8 {
        // Wired AND: an unaddressed converter leaves the wire high.
        let second = self.second.as_mut().map(|chip| chip.read(now, ack));
        self.first.read(now, ack) & second.unwrap_or(0xFF)
    }

    pub(crate) fn stop(&mut self, now: Time) {
        self.first.stop(now);
        if let Some(second) = &mut self.second {
            second.stop(now);
        }
    }

    /// Sends a pulse of SCL outside of a transfer.
    pub(crate) fn clock_pulse(&mut self, now: Time) {
        self.first.clock_pulses(now, 1);
        if let Some(second) = &mut self.second {
            second.clock_pulses(now, 1);
        }
    }
}
