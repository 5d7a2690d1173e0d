//! The USB controller as a device (RP2040 datasheet 4.1): registers, and its side of a transaction.

use ldc161x_sim::Time;

use super::memory::{PacketMemory, SIZE, buffer};
use super::wire::{FRAME_PS, LARGEST_PACKET, Reply, Transaction, TransactionKind};

/// Idle time after which the bus is suspended (USB 2.0 7.1.7.6).
const SUSPENDS_PS: u64 = 3_000_000_000;
/// Time from the end of a bus reset to CONNECTED, with an idle bus (RP2040 datasheet, erratum E5).
const CONNECTS_PS: u64 = 800_000_000;

/// Times after the start of a frame at which a newly available bulk IN packet may collide with the
/// frame's end (RP2040 datasheet, erratum E15; its workaround leaves out the last fifth of a frame,
/// up to the point EOF2 of USB 2.0 11.2.5).
const ENDS_FRAME_PS: core::ops::RangeInclusive<u64> = 800_000_000..=998_000_000;

/// MAIN_CTRL: the controller is enabled.
const ENABLED: u32 = 1;
/// USB_MUXING: TO_PHY alone, and with SOFTCON, which is set together with it.
const TO_PHY: u32 = 1;
const MUXING: u32 = 0b1001;
/// USB_PWR: VBUS_DETECT with its override.
const VBUS_OVERRIDE: u32 = 0b1100;
const PHY_TRIM: u32 = 0x1F1F;
const NAK_POLL: u32 = 0x0010_0010;

/// Bits of SIE_CTRL.
mod control {
    const PULL_DOWN: u32 = 1 << 15;
    pub(super) const PULL_UP: u32 = 1 << 16;
    const PULL_UP_STRENGTH: u32 = 1 << 17;
    pub(super) const ON_NAK_0: u32 = 1 << 27;
    pub(super) const PER_BUFFER_0: u32 = 1 << 29;
    /// Bits of SIE_CTRL that are modelled.
    pub(super) const KNOWN: u32 = PULL_DOWN | PULL_UP | PULL_UP_STRENGTH | ON_NAK_0 | PER_BUFFER_0;
}

/// Bits of SIE_STATUS.
mod status {
    pub(super) const VBUS: u32 = 1 << 0;
    pub(super) const LINE_SHIFT: u32 = 2;
    pub(super) const SUSPENDED: u32 = 1 << 4;
    pub(super) const RESUME: u32 = 1 << 11;
    pub(super) const CONNECTED: u32 = 1 << 16;
    pub(super) const SETUP: u32 = 1 << 17;
    pub(super) const COMPLETE: u32 = 1 << 18;
    pub(super) const RESET: u32 = 1 << 19;
    pub(super) const ACKNOWLEDGED: u32 = 1 << 30;
    pub(super) const SEQUENCE: u32 = 1 << 31;
}

/// Interrupts, by bit.
mod raised {
    pub(super) const COMPLETE: u32 = 1 << 3;
    pub(super) const BUFFERS: u32 = 1 << 4;
    pub(super) const SEQUENCE: u32 = 1 << 5;
    pub(super) const VBUS: u32 = 1 << 11;
    pub(super) const RESET: u32 = 1 << 12;
    pub(super) const CONNECTION: u32 = 1 << 13;
    pub(super) const SUSPEND: u32 = 1 << 14;
    pub(super) const RESUME: u32 = 1 << 15;
    pub(super) const SETUP: u32 = 1 << 16;
    pub(super) const FRAME: u32 = 1 << 17;
    pub(super) const REFUSED: u32 = 1 << 19;
    pub(super) const ALL: u32 = 0xF_FFFF;
}

/// Bits of an endpoint's control word that are not modelled: two buffers, an interrupt for a pair of
/// them, an interrupt at a stall.
const UNMODELLED_ENDPOINT: u32 = 1 << 30 | 1 << 28 | 1 << 17;

/// State of the bus lines in SIE_STATUS (USB 2.0 7.1.7.1, full speed).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LineState {
    /// Both lines low.
    Reset = 0,
    /// Idle.
    J = 1,
    /// Resume.
    K = 2,
}

/// Settings of an endpoint.
#[derive(Clone, Copy, Debug)]
struct Endpoint {
    enabled: bool,
    per_buffer: bool,
    bulk: bool,
    on_nak: bool,
    buffer: usize,
}

/// A transaction with a buffer in progress.
#[derive(Clone, Copy, Debug)]
struct Busy {
    index: usize,
    buffer: usize,
    in_sequence: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct UsbController {
    pub(crate) memory: PacketMemory,
    address: u32,
    main: u32,
    control: u32,
    status: u32,
    muxing: u32,
    power: u32,
    nak_poll: u32,
    trim: u32,
    stall_armed: u32,
    refused: u32,
    latched: u32,
    enabled: u32,
    frame: u32,
    line: LineState,
    suspended: bool,
    connected: bool,
    /// Time from which on the bus has been idle.
    idle_ps: u64,
    /// End of the last bus reset, until CONNECTED is set.
    connecting_ps: Option<u64>,
    /// BUFF_STATUS.
    done: u32,
    busy: Option<Busy>,
    /// Time of the last start of frame.
    frame_ps: Option<u64>,
    /// Whether the controller hangs until the block is reset (erratum E15).
    hangs: bool,
    /// Whether erratum E15 is emulated; programs without its workaround disable it.
    pub(crate) can_hang: bool,
    /// Latest time within a frame at which a bulk IN packet became available, up to EOF2.
    latest_bulk_ps: u64,
    /// Number of setup packets that arrived while a packet of endpoint 0 was available.
    answered_before: u32,
    problem: Option<&'static str>,
}

impl UsbController {
    /// State after a reset of the block.
    pub(crate) fn new() -> Self {
        Self {
            memory: PacketMemory::new(),
            address: 0,
            main: 0,
            control: 0,
            status: 0,
            muxing: 0,
            power: 0,
            nak_poll: NAK_POLL,
            trim: PHY_TRIM,
            stall_armed: 0,
            refused: 0,
            latched: 0,
            enabled: 0,
            frame: 0,
            line: LineState::J,
            suspended: false,
            connected: false,
            idle_ps: 0,
            connecting_ps: None,
            done: 0,
            busy: None,
            frame_ps: None,
            hangs: false,
            can_hang: true,
            latest_bulk_ps: 0,
            answered_before: 0,
            problem: None,
        }
    }

    /// Whether the controller's pull-up signals a full-speed device. Without VBUS, which no pin
    /// provides on a Raspberry Pi Pico, it does not; that is a guess.
    pub(crate) const fn is_attached(&self) -> bool {
        self.main & ENABLED != 0
            && self.muxing & TO_PHY != 0
            && self.control & control::PULL_UP != 0
            && self.has_vbus()
    }

    const fn has_vbus(&self) -> bool {
        self.power & VBUS_OVERRIDE == VBUS_OVERRIDE
    }

    /// Takes the last request that the emulator does not model.
    pub(crate) fn take_problem(&mut self) -> Option<&'static str> {
        self.problem.take()
    }

    // ---- the bus ----

    /// Time at which the controller's view of the bus next changes without an access.
    pub(crate) fn next_event(&self) -> Option<u64> {
        let suspends_ps = (self.is_attached() && !self.suspended && self.line == LineState::J)
            .then_some(self.idle_ps + SUSPENDS_PS);
        let connects_ps = self.connecting_ps.map(|end_ps| end_ps + CONNECTS_PS);
        [suspends_ps, connects_ps].iter().flatten().min().copied()
    }

    /// Processes events that are due.
    pub(crate) fn service(&mut self, now_ps: u64) {
        if self
            .connecting_ps
            .is_some_and(|end_ps| end_ps + CONNECTS_PS <= now_ps)
        {
            self.connecting_ps = None;
            self.set_connected(self.is_attached());
        }
        let is_idle = self.line == LineState::J && self.idle_ps + SUSPENDS_PS <= now_ps;
        if self.is_attached() && is_idle {
            self.set_suspended(true);
        }
    }

    fn set_suspended(&mut self, suspended: bool) {
        if suspended != self.suspended {
            self.suspended = suspended;
            self.latched |= raised::SUSPEND;
        }
    }

    fn set_connected(&mut self, connected: bool) {
        if connected != self.connected {
            self.connected = connected;
            self.latched |= raised::CONNECTION;
        }
    }

    /// The host pulls both lines low for longer than a device may ignore (USB 2.0 7.1.7.5). The
    /// address stays: the firmware clears it.
    pub(crate) fn begin_reset(&mut self) {
        self.line = LineState::Reset;
        self.connecting_ps = None;
        self.busy = None;
        self.set_suspended(false);
        if self.is_attached() {
            self.status |= status::RESET;
        }
    }

    /// The lines are idle again after a reset.
    pub(crate) fn end_reset(&mut self, now_ps: u64) {
        self.line = LineState::J;
        self.idle_ps = now_ps;
        self.connecting_ps = (!self.connected).then_some(now_ps);
    }

    /// The host starts to resume a suspended bus.
    pub(crate) fn begin_resume(&mut self) {
        self.line = LineState::K;
        if self.suspended {
            self.status |= status::RESUME;
        }
        self.set_suspended(false);
    }

    /// The host ends its resume signal.
    pub(crate) fn end_resume(&mut self, now_ps: u64) {
        self.line = LineState::J;
        self.idle_ps = now_ps;
    }

    /// Unplugs the cable: the pull-up keeps the lines idle.
    pub(crate) fn unplug(&mut self, now_ps: u64) {
        self.line = LineState::J;
        self.busy = None;
        self.idle_ps = now_ps;
    }

    /// A start of frame with its number.
    pub(crate) fn start_of_frame(&mut self, frame: u16, now_ps: u64) {
        self.idle_ps = now_ps;
        self.frame_ps = Some(now_ps);
        if self.is_attached() && !self.hangs {
            self.frame = u32::from(frame);
            self.latched |= raised::FRAME;
        }
    }

    // ---- transactions ----

    /// Handles a token. The returned decision applies until the transaction ends.
    pub(crate) fn begin(&mut self, transaction: &Transaction, now_ps: u64) -> Reply {
        self.idle_ps = now_ps;
        self.busy = None;
        let is_meant = u32::from(transaction.address) == self.address;
        if !self.is_attached() || self.hangs || !is_meant {
            return Reply::Silence;
        }
        match &transaction.kind {
            TransactionKind::Setup(_) if transaction.endpoint == 0 => Reply::Ack,
            TransactionKind::Setup(_) => Reply::Silence,
            TransactionKind::Out { data1, .. } => {
                self.begin_buffer(2 * usize::from(transaction.endpoint) + 1, Some(*data1))
            }
            TransactionKind::In => {
                let index = 2 * usize::from(transaction.endpoint);
                let reply = self.begin_buffer(index, None);
                if matches!(reply, Reply::Data { .. }) {
                    self.follow_bulk(index);
                }
                self.hangs = matches!(reply, Reply::Data { .. }) && self.ends_frame(index, now_ps);
                if self.hangs { Reply::Silence } else { reply }
            }
        }
    }

    /// Latest time within a frame at which a bulk IN packet read by the host became available.
    pub(crate) const fn latest_bulk(&self) -> Time {
        Time::from_ps(self.latest_bulk_ps)
    }

    /// Number of setup packets that arrived while a packet of endpoint 0 was available.
    pub(crate) const fn answered_before(&self) -> u32 {
        self.answered_before
    }

    fn follow_bulk(&mut self, index: usize) {
        let is_bulk = self.endpoint(index).is_some_and(|it| it.bulk);
        let armed_ps = self.memory.armed_ps(index);
        let Some((armed_ps, frame_ps)) = armed_ps.zip(self.frame_ps).filter(|_| is_bulk) else {
            return;
        };
        // The packet became available in this frame, or in an earlier one.
        let within_ps = (armed_ps + FRAME_PS - frame_ps % FRAME_PS) % FRAME_PS;
        if within_ps <= *ENDS_FRAME_PS.end() {
            self.latest_bulk_ps = self.latest_bulk_ps.max(within_ps);
        }
    }

    /// Whether a bulk packet requested now became available at the end of this frame: if the start
    /// of the next frame replaces the host's answer, the controller waits for that answer for ever.
    /// Here the start always replaces it, the worst case of the erratum.
    fn ends_frame(&self, index: usize, now_ps: u64) -> bool {
        let is_bulk = self.endpoint(index).is_some_and(|it| it.bulk);
        let armed_ps = self.memory.armed_ps(index);
        let late = |(armed_ps, frame_ps): (u64, u64)| {
            let is_late = |at_ps: u64| at_ps >= frame_ps + ENDS_FRAME_PS.start();
            ENDS_FRAME_PS.contains(&armed_ps.saturating_sub(frame_ps)) && is_late(now_ps)
        };
        self.can_hang && is_bulk && armed_ps.zip(self.frame_ps).is_some_and(late)
    }

    /// Starts a transaction with a buffer. `data1` is the PID of the host's data, if any.
    fn begin_buffer(&mut self, index: usize, data1: Option<bool>) -> Reply {
        let Some(endpoint) = self.endpoint(index).filter(|it| it.enabled) else {
            return Reply::Silence;
        };
        let control = self.memory.endpoint_control(index).unwrap_or(0);
        if control & UNMODELLED_ENDPOINT != 0 {
            self.problem = Some("two buffers of a USB endpoint, or an interrupt at its stall");
            return Reply::Silence;
        }
        let half = self.memory.half(index);
        if self.stalls(index) {
            return Reply::Stall;
        }
        let is_in = data1.is_none();
        // 4.1.2.8: an IN needs a full buffer, an OUT an empty one.
        let is_full = half & buffer::FULL != 0;
        let is_ready = half & buffer::AVAILABLE != 0 && is_full == is_in;
        if !is_ready {
            self.refused |= u32::from(endpoint.on_nak) << index;
            return Reply::Nak;
        }
        let has_data1 = half & buffer::DATA1 != 0;
        let busy = Busy {
            index,
            buffer: endpoint.buffer,
            in_sequence: data1.is_none_or(|data1| data1 == has_data1),
        };
        if busy.buffer + LARGEST_PACKET > SIZE {
            self.problem = Some("a USB buffer beyond the memory");
            return Reply::Silence;
        }
        self.busy = Some(busy);
        if is_in {
            self.data(busy, half)
        } else {
            Reply::Ack
        }
    }

    /// Whether the endpoint stalls; on endpoint 0 the stall must also be armed (EP_STALL_ARM).
    fn stalls(&self, index: usize) -> bool {
        let is_armed = index > 1 || self.stall_armed >> index & 1 == 1;
        is_armed && self.memory.half(index) & buffer::STALL != 0
    }

    fn data(&mut self, busy: Busy, half: u16) -> Reply {
        let length = usize::from(half & buffer::LENGTH);
        match self.memory.load(busy.buffer, length) {
            Some(data) if length <= LARGEST_PACKET => Reply::Data {
                data1: half & buffer::DATA1 != 0,
                data,
            },
            _ => {
                self.problem = Some("a USB packet of more than 64 bytes");
                Reply::Silence
            }
        }
    }

    /// Ends an acknowledged transaction; for an IN the host acknowledged it. A packet out of
    /// sequence is acknowledged and dropped (USB 2.0 8.6.4). LENGTH does not limit the received
    /// data; that is a guess.
    pub(crate) fn end(&mut self, transaction: &Transaction, now_ps: u64) {
        self.idle_ps = now_ps;
        match &transaction.kind {
            TransactionKind::Setup(packet) => {
                let is_answered = self.memory.half(0) & buffer::AVAILABLE != 0;
                self.answered_before += u32::from(is_answered);
                self.memory.store_setup(packet);
                self.status |= status::SETUP;
                self.stall_armed = 0;
            }
            TransactionKind::Out { data, .. } => {
                if let Some(busy) = self.busy {
                    self.receive(busy, data);
                }
            }
            TransactionKind::In => {
                self.status |= status::ACKNOWLEDGED;
                if let Some(busy) = self.busy {
                    let half = self.memory.half(busy.index);
                    self.write_back(busy.index, half & !buffer::FULL);
                }
            }
        }
        self.busy = None;
    }

    fn receive(&mut self, busy: Busy, data: &[u8]) {
        if !busy.in_sequence {
            self.status |= status::SEQUENCE;
            return;
        }
        self.memory.store(busy.buffer, data);
        let half = self.memory.half(busy.index) & !buffer::LENGTH;
        self.write_back(busy.index, half | buffer::FULL | data.len() as u16);
    }

    /// Returns a buffer to the processor.
    fn write_back(&mut self, index: usize, half: u16) {
        self.memory.set_half(index, half & !buffer::AVAILABLE);
        if half & buffer::LAST != 0 {
            self.status |= status::COMPLETE;
        }
        let per_buffer = self.endpoint(index).is_some_and(|it| it.per_buffer);
        self.done |= u32::from(per_buffer) << index;
    }

    fn endpoint(&self, index: usize) -> Option<Endpoint> {
        let Some(word) = self.memory.endpoint_control(index) else {
            let has = |bit| self.control & bit != 0;
            return Some(Endpoint {
                enabled: true,
                per_buffer: has(control::PER_BUFFER_0),
                bulk: false,
                on_nak: has(control::ON_NAK_0),
                buffer: 0x100,
            });
        };
        let has = |bit: u32| word >> bit & 1 == 1;
        // 4.1.2.5.2. Isochronous endpoints, type 1, are not modelled: they have no handshakes.
        (word >> 26 & 0b11 != 1).then_some(Endpoint {
            enabled: has(31),
            per_buffer: has(29),
            bulk: word >> 26 & 0b11 == 2,
            on_nak: has(16),
            buffer: (word & 0xFFC0) as usize,
        })
    }

    // ---- registers ----

    pub(crate) fn line(&self) -> bool {
        self.interrupts() != 0
    }

    fn interrupts(&self) -> u32 {
        self.raw() & self.enabled
    }

    fn raw(&self) -> u32 {
        let of_status = [
            (status::COMPLETE, raised::COMPLETE),
            (status::SEQUENCE, raised::SEQUENCE),
            (status::VBUS, raised::VBUS),
            (status::RESET, raised::RESET),
            (status::RESUME, raised::RESUME),
            (status::SETUP, raised::SETUP),
        ];
        let shown = self.status();
        let of_status = of_status
            .iter()
            .filter(|(bit, _)| shown & bit != 0)
            .fold(0, |raw, (_, interrupt)| raw | interrupt);
        let set = |is_set: bool, interrupt| if is_set { interrupt } else { 0 };
        self.latched
            | of_status
            | set(self.done != 0, raised::BUFFERS)
            | set(self.refused != 0, raised::REFUSED)
    }

    fn status(&self) -> u32 {
        let line = match self.line {
            line if self.is_attached() => line,
            _ => LineState::Reset,
        };
        let set = |is_set: bool, bit| if is_set { bit } else { 0 };
        self.status
            | (line as u32) << status::LINE_SHIFT
            | set(self.has_vbus(), status::VBUS)
            | set(self.suspended, status::SUSPENDED)
            | set(self.connected, status::CONNECTED)
    }

    pub(crate) fn read(&mut self, offset: u32) -> Option<u32> {
        if offset == 0x48 {
            self.latched &= !raised::FRAME;
        }
        self.peek(offset)
    }

    fn peek(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.address,
            0x40 => self.main,
            0x48 => self.frame,
            0x4C => self.control,
            0x50 => self.status(),
            0x58 => self.done,
            0x68 => self.stall_armed,
            0x6C => self.nak_poll,
            0x70 => self.refused,
            0x74 => self.muxing,
            0x78 => self.power,
            0x84 => self.trim,
            0x8C => self.raw(),
            0x90 => self.enabled,
            0x98 => self.interrupts(),
            _ if is_unused(offset) => 0,
            _ => return None,
        })
    }

    /// Writes a register through one of its four views: plain, xor, set, clear. A
    /// write-one-to-clear bit is cleared through the plain and the clear view; the SDK relies on
    /// that.
    pub(crate) fn write(&mut self, view: u32, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        if let 0x50 | 0x58 | 0x70 = offset {
            return matches!(view, 0 | 3).then(|| self.clear(offset, value));
        }
        let value = match view {
            0 => value,
            1 => self.peek(offset)? ^ value,
            2 => self.peek(offset)? | value,
            _ => self.peek(offset)? & !value,
        };
        let was_attached = self.is_attached();
        self.set(offset, value)?;
        if self.is_attached() != was_attached {
            self.idle_ps = now_ps;
            self.connecting_ps = None;
            self.set_suspended(false);
            self.set_connected(false);
        }
        Some(())
    }

    fn clear(&mut self, offset: u32, value: u32) {
        match offset {
            0x50 => self.clear_status(value),
            0x58 => self.done &= !value,
            _ => self.refused &= !value,
        }
    }

    /// SUSPENDED and CONNECTED show the present state, which a write does not change: it clears only the
    /// interrupt that their last change has latched.
    fn clear_status(&mut self, value: u32) {
        self.status &= !value;
        let latches = [
            (status::SUSPENDED, raised::SUSPEND),
            (status::CONNECTED, raised::CONNECTION),
        ];
        for (_, interrupt) in latches.iter().filter(|(bit, _)| value & bit != 0) {
            self.latched &= !interrupt;
        }
    }

    fn set(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            // The endpoint in the same register is for host mode, which is not modelled.
            0x00 if value <= 0x7F => self.address = value,
            // Neither host mode nor shortened times are modelled.
            0x40 if value & !ENABLED == 0 => self.main = value,
            0x4C if value & !control::KNOWN == 0 => self.control = value,
            0x68 => self.stall_armed = value & 0b11,
            0x6C => self.nak_poll = value,
            0x74 if value & !MUXING == 0 => self.muxing = value,
            0x78 => self.power = value & 0x3F,
            0x84 => self.trim = value,
            0x90 => self.enabled = value & raised::ALL,
            // These registers are read-only.
            0x48 | 0x8C | 0x98 => {}
            _ if is_unused(offset) && value == 0 => {}
            _ => return None,
        }
        Some(())
    }
}

/// Registers of host mode, of direct PHY control, of second buffers, aborts and forced interrupts,
/// and unused ones: they read zero, and accept only zero.
const fn is_unused(offset: u32) -> bool {
    matches!(offset, 0x04..=0x3C | 0x44 | 0x54 | 0x5C..=0x64 | 0x7C | 0x80 | 0x88 | 0x94)
}
