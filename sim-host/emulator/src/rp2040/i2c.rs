//! The I2C master: a DesignWare block (RP2040 datasheet 4.3), bit by bit.
//!
//! Clock stretching, arbitration and aborts follow the datasheet. The simulated chip takes whole
//! bytes: it does not receive a byte that is cut short, only the next START.

use std::collections::VecDeque;

use crate::board::plant::Plant;
use crate::board::wire::Wire;
use crate::time::periods_ps;
use crate::trace::{Signal, SignalValue};

/// Depth of either FIFO (4.3.2).
const DEPTH: usize = 16;
/// Delay from a command in an empty FIFO to the START, in clocks of the block. The datasheet does
/// not give it; guess.
const START_LATENCY: u64 = 12;
/// Interval at which a master that waits for a free bus polls the bus, ps.
const POLL_PS: u64 = 1_000_000;

/// Bits of a command.
const READ: u32 = 1 << 8;
const STOP: u32 = 1 << 9;
const RESTART: u32 = 1 << 10;

/// Interrupts, by bit.
mod raised {
    pub(super) const RX_UNDER: u32 = 1 << 0;
    pub(super) const RX_OVER: u32 = 1 << 1;
    pub(super) const RX_FULL: u32 = 1 << 2;
    pub(super) const TX_OVER: u32 = 1 << 3;
    pub(super) const TX_EMPTY: u32 = 1 << 4;
    pub(super) const TX_ABRT: u32 = 1 << 6;
    pub(super) const ACTIVITY: u32 = 1 << 8;
    pub(super) const STOP_DET: u32 = 1 << 9;
    pub(super) const START_DET: u32 = 1 << 10;
}

/// Causes of an abort, by bit.
mod cause {
    pub(super) const ADDRESS: u32 = 1 << 0;
    pub(super) const DATA: u32 = 1 << 3;
    pub(super) const ARBITRATION: u32 = 1 << 12;
    pub(super) const USER: u32 = 1 << 16;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MasterState {
    /// Idle.
    Idle,
    /// About to send a START.
    Waiting,
    /// START sent; the address follows.
    Started,
    /// A byte is in transfer; bit 8 is its acknowledge.
    Byte { kind: ByteKind, value: u8, bit: u8 },
    /// Between two bytes, with SCL low, until the next command arrives.
    Holding,
    /// Sending STOP.
    Stopping,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ByteKind {
    Address,
    Write,
    Read { acknowledged: bool },
}

#[derive(Clone, Debug)]
pub(crate) struct I2c {
    control: u32,
    target: u32,
    high_count: u32,
    low_count: u32,
    spike: u32,
    hold: u32,
    enabled: bool,
    abort_requested: bool,
    disable_requested: bool,
    mask: u32,
    sticky: u32,
    source: u32,
    receive_level: u32,
    transmit_level: u32,
    transmit: VecDeque<u32>,
    receive: VecDeque<u8>,
    state: MasterState,
    /// Command of the byte in transfer.
    command: u32,
    /// Whether the present transfer is a read.
    reading: bool,
    /// Whether the address has been sent, and no byte after it.
    addressed: bool,
    due_ps: Option<u64>,
    /// Start of the present bit, at the fall of SCL.
    bit_began_ps: u64,
    free_ps: u64,
    clock_hz: f64,
    rise_ps: u64,
}

impl I2c {
    pub(crate) fn new(rise_ps: u64) -> Self {
        Self {
            control: 0x65,
            target: 0x055,
            high_count: 0x28,
            low_count: 0x2F,
            spike: 7,
            hold: 1,
            enabled: false,
            abort_requested: false,
            disable_requested: false,
            mask: 0x8FF,
            sticky: 0,
            source: 0,
            receive_level: 0,
            transmit_level: 0,
            transmit: VecDeque::new(),
            receive: VecDeque::new(),
            state: MasterState::Idle,
            command: 0,
            reading: false,
            addressed: false,
            due_ps: None,
            bit_began_ps: 0,
            free_ps: 0,
            clock_hz: 0.0,
            rise_ps,
        }
    }

    /// Resets the block: it releases the wires in any state.
    pub(crate) fn reset<P: Plant>(&mut self, wire: &mut Wire<P>) {
        if self.state != MasterState::Idle {
            wire.abandon();
        }
        *self = Self {
            clock_hz: self.clock_hz,
            ..Self::new(self.rise_ps)
        };
    }

    pub(crate) fn set_clock(&mut self, hz: f64) {
        self.clock_hz = hz;
    }

    fn clocks_ps(&self, clocks: u32) -> u64 {
        periods_ps(u64::from(clocks), self.clock_hz)
    }

    /// High time of SCL (4.3.14.2).
    fn high_ps(&self) -> u64 {
        self.clocks_ps(self.high_count + self.spike + 7)
    }

    /// Low time of SCL, including its rise time.
    fn low_ps(&self) -> u64 {
        self.clocks_ps(self.low_count + 1) + self.rise_ps
    }

    fn bit_ps(&self) -> u64 {
        self.low_ps() + self.high_ps()
    }

    pub(crate) fn next_event(&self) -> Option<u64> {
        self.due_ps
    }

    /// Whether the master drives neither wire; while it drives a wire, it traces the levels of both
    /// itself.
    pub(crate) fn is_off_the_wires(&self) -> bool {
        matches!(self.state, MasterState::Idle | MasterState::Waiting)
    }

    /// SCL falls.
    fn fall<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        self.bit_began_ps = now_ps;
        wire.trace(now_ps, Signal::Scl, SignalValue::Level(false));
    }

    /// Traces the level of SDA in the present bit, and the rise of SCL.
    fn trace_bit<P: Plant>(&self, rise_ps: u64, wire: &mut Wire<P>, high: bool) {
        let set_ps = self.bit_began_ps + self.clocks_ps(self.hold);
        wire.trace(set_ps, Signal::Sda, SignalValue::Level(high));
        wire.trace(rise_ps, Signal::Scl, SignalValue::Level(true));
    }

    /// Processes events that are due.
    pub(crate) fn service<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        while let Some(due_ps) = self.due_ps.filter(|&due| due <= now_ps) {
            self.step(due_ps, wire);
        }
    }

    fn step<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        self.due_ps = None;
        match self.state {
            MasterState::Idle | MasterState::Holding => {}
            MasterState::Waiting => self.try_start(now_ps, wire),
            MasterState::Started => self.begin_address(now_ps, wire),
            MasterState::Byte { kind, value, bit } => self.end_bit(now_ps, wire, kind, value, bit),
            MasterState::Stopping => self.end_stop(now_ps, wire),
        }
    }

    fn try_start<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        if self.abort_requested || self.disable_requested {
            self.rest(now_ps);
            return;
        }
        if wire.sda_is_low(now_ps) || wire.scl_low_until(now_ps).is_some() {
            self.due_ps = Some(now_ps + POLL_PS);
            return;
        }
        let Some(&command) = self.transmit.front() else {
            self.state = MasterState::Idle;
            return;
        };
        self.reading = command & READ != 0;
        self.send_start(now_ps, wire);
    }

    /// Sends START, after which SCL stays high for the hold time.
    fn send_start<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        wire.start(now_ps);
        wire.trace(now_ps, Signal::Sda, SignalValue::Level(false));
        self.sticky |= raised::START_DET | raised::ACTIVITY;
        self.state = MasterState::Started;
        self.due_ps = Some(now_ps + self.clocks_ps(self.high_count));
    }

    fn begin_address<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        let value = (self.target as u8) << 1 | u8::from(self.reading);
        self.command = 0;
        self.addressed = true;
        self.begin_byte(now_ps, wire, ByteKind::Address, value);
    }

    fn begin_byte<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>, kind: ByteKind, value: u8) {
        self.fall(now_ps, wire);
        self.state = MasterState::Byte {
            kind,
            value,
            bit: 0,
        };
        self.due_ps = Some(now_ps + self.bit_ps());
    }

    fn end_bit<P: Plant>(
        &mut self,
        now_ps: u64,
        wire: &mut Wire<P>,
        kind: ByteKind,
        value: u8,
        bit: u8,
    ) {
        if let Some(until_ps) = wire.scl_low_until(now_ps) {
            // The bit ends a high time after SCL is released.
            let free_ps = until_ps.saturating_add(self.high_ps());
            self.due_ps = Some(free_ps.min(now_ps + POLL_PS).max(now_ps + 1));
            return;
        }
        wire.count_bit(now_ps);
        let low = wire.sda_is_low(now_ps);
        let sent = value << bit.min(7) & 0x80 != 0;
        let rise_ps = now_ps - self.high_ps();
        if bit <= 7 {
            self.trace_bit(rise_ps, wire, sent && !low);
        } else if let ByteKind::Read { acknowledged } = kind {
            self.trace_bit(rise_ps, wire, !acknowledged && !low);
        }
        match (kind, bit) {
            (ByteKind::Address | ByteKind::Write, 0..=7) if sent && low => {
                self.lose_arbitration(now_ps, wire);
            }
            (ByteKind::Read { acknowledged }, 0..=7) => {
                let value = if low { value & !(0x80 >> bit) } else { value };
                self.next_bit(now_ps, wire, ByteKind::Read { acknowledged }, value, bit);
            }
            (_, 0..=7) => self.next_bit(now_ps, wire, kind, value, bit),
            (ByteKind::Read { .. }, _) => {
                wire.trace(now_ps, Signal::Byte, SignalValue::Byte(value));
                self.take(value);
                self.after_byte(now_ps, wire);
            }
            (ByteKind::Address, _) => {
                let taken = wire.address(now_ps, value) || low;
                self.trace_bit(rise_ps, wire, !taken);
                wire.trace(now_ps, Signal::Byte, SignalValue::Byte(value));
                self.after_acknowledge(now_ps, wire, taken, cause::ADDRESS);
            }
            (ByteKind::Write, _) => {
                let taken = wire.write(now_ps, value) || low;
                self.trace_bit(rise_ps, wire, !taken);
                wire.trace(now_ps, Signal::Byte, SignalValue::Byte(value));
                self.after_acknowledge(now_ps, wire, taken, cause::DATA);
            }
        }
    }

    fn next_bit<P: Plant>(
        &mut self,
        now_ps: u64,
        wire: &mut Wire<P>,
        kind: ByteKind,
        value: u8,
        bit: u8,
    ) {
        let bit = bit + 1;
        self.fall(now_ps, wire);
        self.state = MasterState::Byte { kind, value, bit };
        self.due_ps = Some(now_ps + self.bit_ps());
    }

    fn take(&mut self, byte: u8) {
        if self.receive.len() < DEPTH {
            self.receive.push_back(byte);
        } else {
            self.sticky |= raised::RX_OVER;
        }
    }

    fn after_acknowledge<P: Plant>(
        &mut self,
        now_ps: u64,
        wire: &mut Wire<P>,
        taken: bool,
        cause: u32,
    ) {
        if !taken {
            self.abort(cause);
            self.begin_stop(now_ps, wire);
        } else if cause == cause::ADDRESS {
            // The first command of the new direction is the one that requested the START.
            self.next_command(now_ps, wire);
        } else {
            self.after_byte(now_ps, wire);
        }
    }

    fn after_byte<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        if self.command & STOP != 0 {
            self.begin_stop(now_ps, wire);
        } else {
            self.next_command(now_ps, wire);
        }
    }

    /// Continues with the next command, or waits for it with SCL low.
    fn next_command<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        if self.abort_requested || self.disable_requested {
            self.begin_stop(now_ps, wire);
            return;
        }
        self.state = MasterState::Holding;
        self.fall(now_ps, wire);
        let Some(&command) = self.transmit.front() else {
            return;
        };
        let reads = command & READ != 0;
        if !self.addressed && (reads != self.reading || command & RESTART != 0) {
            self.reading = reads;
            // SCL is low, then high for the set-up time, then SDA falls.
            let fall_ps = now_ps + self.low_ps() + self.clocks_ps(self.high_count);
            if wire.sda_is_low(now_ps) || wire.scl_low_until(now_ps).is_some() {
                self.lose_arbitration(now_ps, wire);
            } else {
                self.trace_bit(now_ps + self.low_ps(), wire, true);
                self.send_start(fall_ps, wire);
            }
        } else if !reads {
            self.pop(command);
            self.begin_byte(now_ps, wire, ByteKind::Write, command as u8);
        } else if let Some(acknowledged) = self.acknowledges(command) {
            self.pop(command);
            let value = wire.read(now_ps, acknowledged);
            self.begin_byte(now_ps, wire, ByteKind::Read { acknowledged }, value);
        }
    }

    fn pop(&mut self, command: u32) {
        self.command = command;
        self.addressed = false;
        self.transmit.pop_front();
    }

    /// Whether the byte of a read command is acknowledged: only if another read follows. `None`
    /// while the next command is not known; until then the block holds SCL low, here before the
    /// byte, in silicon before the byte's ninth clock.
    fn acknowledges(&self, command: u32) -> Option<bool> {
        if command & STOP != 0 {
            return Some(false);
        }
        let next = self.transmit.get(1)?;
        Some(next & READ != 0 && next & RESTART == 0)
    }

    fn begin_stop<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        self.state = MasterState::Stopping;
        self.fall(now_ps, wire);
        self.trace_bit(now_ps + self.low_ps(), wire, false);
        self.due_ps = Some(now_ps + self.low_ps() + self.clocks_ps(self.high_count));
    }

    fn end_stop<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        // A STOP needs both wires high: it waits while another part holds SDA or SCL low.
        if wire.sda_is_low(now_ps) || wire.scl_low_until(now_ps).is_some() {
            self.due_ps = Some(now_ps + POLL_PS);
            return;
        }
        wire.count_bit(now_ps);
        wire.trace(now_ps, Signal::Sda, SignalValue::Level(true));
        wire.stop(now_ps);
        self.sticky |= raised::STOP_DET;
        self.rest(now_ps);
    }

    fn lose_arbitration<P: Plant>(&mut self, now_ps: u64, wire: &mut Wire<P>) {
        self.abort(cause::ARBITRATION);
        wire.abandon();
        self.rest(now_ps);
    }

    /// Returns to idle; the next START waits for the bus-free time.
    fn rest(&mut self, now_ps: u64) {
        if self.abort_requested {
            self.abort(cause::USER);
            self.abort_requested = false;
        }
        if self.disable_requested {
            self.disable_requested = false;
            self.disable();
        }
        self.state = MasterState::Idle;
        self.command = 0;
        self.free_ps = now_ps + self.clocks_ps(self.low_count);
        self.due_ps = None;
        self.begin(now_ps);
    }

    /// Requests a START if there is a command and the master is idle.
    fn begin(&mut self, now_ps: u64) {
        if self.enabled && self.state == MasterState::Idle && !self.transmit.is_empty() {
            self.state = MasterState::Waiting;
            let latency_ps = self.clocks_ps(START_LATENCY as u32);
            self.due_ps = Some(self.free_ps.max(now_ps + latency_ps));
        }
    }

    /// Aborts: both FIFOs are flushed, and stay empty until CLR_TX_ABRT is read (4.3.17,
    /// IC_RAW_INTR_STAT).
    fn abort(&mut self, cause: u32) {
        self.source |= cause | (self.transmit.len() as u32) << 23;
        self.sticky |= raised::TX_ABRT;
        self.transmit.clear();
        self.receive.clear();
    }

    fn disable(&mut self) {
        self.enabled = false;
        self.transmit.clear();
        self.receive.clear();
        self.sticky &= !raised::ACTIVITY;
    }

    fn raw(&self) -> u32 {
        let mut raw = self.sticky;
        if self.receive.len() as u32 > self.receive_level {
            raw |= raised::RX_FULL;
        }
        if self.enabled && self.transmit.len() as u32 <= self.transmit_level {
            raw |= raised::TX_EMPTY;
        }
        raw
    }

    pub(crate) fn line(&self) -> bool {
        self.raw() & self.mask != 0
    }

    fn clear(&mut self, what: u32) -> u32 {
        self.sticky &= !what;
        0
    }

    pub(crate) fn read(&mut self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.control,
            0x04 => self.target,
            0x10 => self.receive.pop_front().map_or_else(
                || {
                    self.sticky |= raised::RX_UNDER;
                    0
                },
                u32::from,
            ),
            0x1C => self.high_count,
            0x20 => self.low_count,
            0x2C => self.raw() & self.mask,
            0x30 => self.mask,
            0x34 => self.raw(),
            0x38 => self.receive_level,
            0x3C => self.transmit_level,
            0x40 => {
                self.source = 0;
                self.clear(u32::MAX)
            }
            0x44 => self.clear(raised::RX_UNDER),
            0x48 => self.clear(raised::RX_OVER),
            0x4C => self.clear(raised::TX_OVER),
            0x54 => {
                self.source = 0;
                self.clear(raised::TX_ABRT)
            }
            0x5C => self.clear(raised::ACTIVITY),
            0x60 => self.clear(raised::STOP_DET),
            0x64 => self.clear(raised::START_DET),
            0x6C => u32::from(self.enabled) | u32::from(self.abort_requested) << 1,
            0x70 => self.status(),
            0x74 => self.transmit.len() as u32,
            0x78 => self.receive.len() as u32,
            0x7C => self.hold,
            0x80 => self.source,
            0x9C => u32::from(self.enabled || self.state != MasterState::Idle),
            0xA0 => self.spike,
            _ => return None,
        })
    }

    fn status(&self) -> u32 {
        let active = u32::from(self.state != MasterState::Idle);
        active
            | active << 5
            | u32::from(self.transmit.len() < DEPTH) << 1
            | u32::from(self.transmit.is_empty()) << 2
            | u32::from(!self.receive.is_empty()) << 3
            | u32::from(self.receive.len() == DEPTH) << 4
    }

    pub(crate) fn write<P: Plant>(
        &mut self,
        offset: u32,
        value: u32,
        now_ps: u64,
        wire: &mut Wire<P>,
    ) -> Option<()> {
        let fixed = !self.enabled;
        match offset {
            // Only a master in fast mode with seven-bit addresses and repeated STARTs is modelled,
            // and no target.
            0x00 if fixed && value & 0x7F == 0x65 => self.control = value,
            0x04 if fixed && value <= 0x7F => self.target = value,
            0x10 => self.command(value, now_ps, wire),
            0x1C if fixed && value > self.spike + 5 => self.high_count = value,
            0x20 if fixed && value > self.spike + 7 => self.low_count = value,
            0x30 => self.mask = value & 0x1FFF,
            0x38 => self.receive_level = value & 0xF,
            0x3C => self.transmit_level = value & 0xF,
            0x6C => self.enable(value, now_ps, wire),
            0x7C if fixed => self.hold = value,
            0xA0 if fixed && value >= 1 => self.spike = value & 0xFF,
            // DMA is not modelled: both requests must stay off.
            0x88 if value == 0 => {}
            _ => return None,
        }
        Some(())
    }

    fn command<P: Plant>(&mut self, value: u32, now_ps: u64, wire: &mut Wire<P>) {
        // The FIFO is flushed until the abort is cleared; a disabled block accepts nothing.
        if !self.enabled || self.sticky & raised::TX_ABRT != 0 {
            return;
        }
        if self.transmit.len() == DEPTH {
            self.sticky |= raised::TX_OVER;
            return;
        }
        self.transmit.push_back(value & 0x7FF);
        match self.state {
            MasterState::Holding => self.next_command(now_ps, wire),
            MasterState::Idle => self.begin(now_ps),
            _ => {}
        }
    }

    fn enable<P: Plant>(&mut self, value: u32, now_ps: u64, wire: &mut Wire<P>) {
        let on = value & 1 == 1;
        if on && !self.enabled {
            self.enabled = true;
            self.source = 0;
            self.sticky = 0;
        }
        self.abort_requested |= value & 0b10 != 0 && self.state != MasterState::Idle;
        if !on && self.enabled {
            if self.state == MasterState::Idle {
                self.disable();
            } else {
                self.disable_requested = true;
            }
        }
        if self.state == MasterState::Holding && (self.abort_requested || self.disable_requested) {
            self.begin_stop(now_ps, wire);
        }
    }
}
