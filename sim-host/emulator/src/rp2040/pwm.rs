//! PWM: pulse widths, and a counter of edges (RP2040 datasheet 4.5). It runs independently of the
//! processor.

use ldc161x_sim::Time;

use crate::time::periods_ps;

const SLICES: usize = 8;

/// Times of writes to the compare values of a phase-correct slice, relative to the wraps at which
/// they take effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelTimes {
    /// Number of writes while the slice ran.
    pub written: u64,
    /// Number of writes in the first half of a cycle: code that writes after mid-cycle samples has
    /// missed its wrap.
    pub late: u64,
    /// Shortest time from a write in the second half of a cycle to the wrap.
    pub least_left: Time,
    /// Longest interval between two writes; above one and a half cycles, a write was left out.
    pub longest_gap: Time,
    last: Option<Time>,
}

impl Default for LevelTimes {
    fn default() -> Self {
        Self {
            written: 0,
            late: 0,
            least_left: Time::MAX,
            longest_gap: Time::ZERO,
            last: None,
        }
    }
}

/// The eight slices.
#[derive(Clone, Debug)]
pub(crate) struct Pwm {
    slices: [Slice; SLICES],
    /// System clock that the slices count, Hz.
    sys_hz: f64,
    /// Write times of the first slice.
    level_times: LevelTimes,
    /// Wrap flags, one bit per slice: up to date for slices whose wraps are used, up to `marked_ps`
    /// for others.
    raw: u32,
    enabled: u32,
    serviced_ps: u64,
    marked_ps: u64,
}

#[derive(Clone, Debug)]
struct Slice {
    control: u32,
    /// Clock divider, in sixteenths.
    divider: u32,
    /// Counter at `since_ps`.
    count: u32,
    since_ps: u64,
    top: u32,
    compare: u32,
    /// Written value of TOP, active from the next wrap on.
    next_top: u32,
    next_compare: u32,
}

impl Default for Slice {
    fn default() -> Self {
        Self {
            control: 0,
            divider: 16,
            count: 0,
            since_ps: 0,
            top: 0xFFFF,
            compare: 0,
            next_top: 0xFFFF,
            next_compare: 0,
        }
    }
}

/// Mode in CSR: free-running.
const FREE: u32 = 0;
/// Bit of CSR: phase-correct counting.
const PHASE_CORRECT: u32 = 1 << 1;
/// Mode in CSR: counts falling edges of input B.
const FALLING: u32 = 3;

impl Slice {
    fn enabled(&self) -> bool {
        self.control & 1 == 1
    }

    fn mode(&self) -> u32 {
        self.control >> 4 & 0b11
    }

    fn runs(&self) -> bool {
        self.enabled() && self.mode() == FREE
    }

    fn step_ps(&self, sys_hz: f64) -> f64 {
        f64::from(self.divider) / 16.0 * 1e12 / sys_hz
    }

    /// Counter steps from one wrap to the next: up, or up and down.
    fn cycle(&self) -> u64 {
        let up = u64::from(self.top) + 1;
        if self.control & PHASE_CORRECT == 0 {
            up
        } else {
            2 * up
        }
    }

    /// Counter steps since the last wrap.
    fn position_at(&self, now_ps: u64, sys_hz: f64) -> u64 {
        if !self.runs() {
            return u64::from(self.count);
        }
        let steps = (now_ps.saturating_sub(self.since_ps) as f64 / self.step_ps(sys_hz)) as u64;
        (u64::from(self.count) + steps) % self.cycle()
    }

    fn count_at(&self, now_ps: u64, sys_hz: f64) -> u32 {
        let position = self.position_at(now_ps, sys_hz);
        let up = u64::from(self.top) + 1;
        // The counter fits in 16 bits in both cases.
        (if self.runs() && position >= up {
            2 * up - 1 - position
        } else {
            position
        }) as u32
    }

    /// Time of the first wrap after a time.
    fn wrap_ps(&self, now_ps: u64, sys_hz: f64) -> u64 {
        let cycle = self.cycle();
        let passed = now_ps.saturating_sub(self.since_ps) as f64 / self.step_ps(sys_hz);
        let first = cycle - u64::from(self.count) % cycle;
        let hz = sys_hz * 16.0 / f64::from(self.divider);
        let mut steps = first;
        if passed >= first as f64 {
            steps += ((passed - first as f64) / cycle as f64) as u64 * cycle;
        }
        let mut at_ps = self.since_ps + periods_ps(steps, hz);
        while at_ps <= now_ps {
            steps += cycle;
            at_ps = self.since_ps + periods_ps(steps, hz);
        }
        at_ps
    }

    fn waits(&self) -> bool {
        self.top != self.next_top || self.compare != self.next_compare
    }

    fn latch(&mut self) {
        self.top = self.next_top;
        self.compare = self.next_compare;
    }

    /// Counter steps left until the wrap, and counter steps in half a cycle.
    fn left_at(&self, now_ps: u64, sys_hz: f64) -> (u64, u64) {
        let cycle = self.cycle();
        (cycle - self.position_at(now_ps, sys_hz), cycle / 2)
    }

    fn advance(&mut self, now_ps: u64, sys_hz: f64) {
        // Fits in 32 bits: the largest cycle has 2^17 steps.
        self.count = self.position_at(now_ps, sys_hz) as u32;
        self.since_ps = now_ps;
    }

    fn wave(&self, sys_hz: f64) -> Wave {
        let up = f64::from(self.top) + 1.0;
        let levels = [self.compare & 0xFFFF, self.compare >> 16];
        Wave {
            since_ps: self.since_ps,
            position: f64::from(self.count),
            step_ps: if self.runs() {
                self.step_ps(sys_hz)
            } else {
                0.0
            },
            cycle: self.cycle() as f64,
            up,
            levels: levels.map(|level| f64::from(level).min(up)),
            centred: self.control & PHASE_CORRECT != 0,
        }
    }
}

/// Both outputs of a slice as functions of time, valid until a compare value is written or takes
/// effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wave {
    since_ps: u64,
    position: f64,
    /// Length of a counter step, ps; 0 while the slice is stopped.
    step_ps: f64,
    cycle: f64,
    up: f64,
    levels: [f64; 2],
    centred: bool,
}

impl Wave {
    fn position_at(&self, now_ps: u64) -> f64 {
        if self.step_ps == 0.0 {
            return self.position;
        }
        let steps = now_ps.saturating_sub(self.since_ps) as f64 / self.step_ps;
        (self.position + steps) % self.cycle
    }

    /// Positions within a cycle at which an output falls and rises again.
    fn edges(&self, output: usize) -> [f64; 2] {
        let level = self.levels.get(output).copied().unwrap_or(0.0);
        let rises = if self.centred {
            self.cycle - level
        } else {
            self.cycle
        };
        [level, rises]
    }

    pub(crate) fn is_high(&self, output: usize, now_ps: u64) -> bool {
        let [falls, rises] = self.edges(output);
        // A thousandth of a step is added, so that an edge at this very time counts as past.
        let position = self.position_at(now_ps) + 1e-3;
        falls > 0.0 && (position < falls || position >= rises) || falls >= self.up
    }

    pub(crate) fn next_edge(&self, output: usize, now_ps: u64) -> Option<u64> {
        let [falls, rises] = self.edges(output);
        if self.step_ps == 0.0 || falls <= 0.0 || falls >= self.up {
            return None;
        }
        let position = self.position_at(now_ps) + 1e-3;
        let next = [falls, rises, self.cycle + falls]
            .into_iter()
            .find(|&edge| edge > position)?;
        let at_ps = (next - position + 1e-3) * self.step_ps;
        Some(now_ps + (at_ps.round() as u64).max(1))
    }
}

impl Pwm {
    pub(crate) fn new(sys_hz: f64) -> Self {
        Self {
            slices: Default::default(),
            sys_hz,
            level_times: LevelTimes::default(),
            raw: 0,
            enabled: 0,
            serviced_ps: 0,
            marked_ps: 0,
        }
    }

    pub(crate) fn reset(&mut self) {
        *self = Self::new(self.sys_hz);
    }

    /// Changes the system clock; counts continue from their present values.
    pub(crate) fn set_clock(&mut self, now_ps: u64, sys_hz: f64) {
        for slice in &mut self.slices {
            slice.advance(now_ps, self.sys_hz);
        }
        self.sys_hz = sys_hz;
    }

    /// Outputs of a slice from now on.
    pub(crate) fn wave(&self, slice: usize) -> Wave {
        match self.slices.get(slice) {
            Some(slice) => slice.wave(self.sys_hz),
            None => Slice::default().wave(self.sys_hz),
        }
    }

    /// Time at which a value written to this slice takes effect, if that is not later than
    /// `now_ps`.
    pub(crate) fn latches_by(&self, slice: usize, now_ps: u64) -> Option<u64> {
        let slice = self.slices.get(slice)?;
        if !slice.runs() || !slice.waits() {
            return None;
        }
        let wrap_ps = slice.wrap_ps(slice.since_ps, self.sys_hz);
        let wrap_ps = if wrap_ps < self.serviced_ps {
            slice.wrap_ps(self.serviced_ps, self.sys_hz)
        } else {
            wrap_ps
        };
        (wrap_ps <= now_ps).then_some(wrap_ps)
    }

    /// Level of the interrupt line.
    pub(crate) const fn line(&self) -> bool {
        self.raw & self.enabled != 0
    }

    /// Whether any slice has its interrupt enabled.
    pub(crate) const fn interrupts(&self) -> bool {
        self.enabled != 0
    }

    fn wraps_count(&self, index: usize) -> bool {
        let slice = self.slices.get(index);
        slice.is_some_and(|slice| slice.runs() && (slice.waits() || self.enabled >> index & 1 == 1))
    }

    /// Level of an output at a time, and its changes up to another time; neither may precede the
    /// last write or the last value that took effect.
    pub(crate) fn edges(
        &self,
        slice: usize,
        channel_b: bool,
        (from_ps, to_ps): (u64, u64),
    ) -> Vec<(u64, bool)> {
        let (wave, output) = (self.wave(slice), usize::from(channel_b));
        let mut edges = vec![(from_ps, wave.is_high(output, from_ps))];
        let mut at_ps = from_ps;
        while let Some(next_ps) = wave.next_edge(output, at_ps).filter(|&next| next <= to_ps) {
            at_ps = next_ps;
            edges.push((at_ps, wave.is_high(output, at_ps)));
        }
        edges
    }

    /// Counts a falling edge at a slice's input B.
    pub(crate) fn falling_edge(&mut self, slice: usize) {
        if let Some(slice) = self.slices.get_mut(slice)
            && slice.enabled()
            && slice.mode() == FALLING
        {
            slice.count = (slice.count + 1) % (slice.top + 1);
        }
    }

    /// Time at which a written value next takes effect, or a wrap interrupts.
    pub(crate) fn next_event(&self, now_ps: u64) -> Option<u64> {
        let slices = self.slices.iter().enumerate();
        slices
            .filter(|(index, _)| self.wraps_count(*index))
            .map(|(_, slice)| slice.wrap_ps(now_ps.max(slice.since_ps), self.sys_hz))
            .min()
    }

    /// Time of the next event as in [`Self::next_event`], or of one that is pending since the last
    /// service.
    pub(crate) fn due_ps(&self) -> Option<u64> {
        self.next_event(self.serviced_ps)
    }

    /// Applies values whose wrap has passed since the last call, and raises the wrap flags.
    pub(crate) fn service(&mut self, now_ps: u64) {
        for index in 0..SLICES {
            if !self.wraps_count(index) {
                continue;
            }
            let Some(slice) = self.slices.get_mut(index) else {
                continue;
            };
            let since_ps = self.serviced_ps.max(slice.since_ps);
            let wrap_ps = slice.wrap_ps(since_ps, self.sys_hz);
            if wrap_ps <= now_ps {
                slice.count = 0;
                slice.since_ps = wrap_ps;
                slice.latch();
                self.raw |= 1 << index;
            }
        }
        self.serviced_ps = now_ps;
    }

    /// Catches up on the wrap flags that `service` leaves out. The hardware sets a slice's flag at
    /// every wrap, even with its interrupt disabled (4.5.2.7); `service` follows only slices whose
    /// interrupt is enabled or that have a written value waiting.
    fn mark_wraps(&mut self, now_ps: u64) {
        for index in 0..SLICES {
            if let Some(slice) = self.slices.get(index).filter(|slice| slice.runs())
                && !self.wraps_count(index)
                && slice.wrap_ps(self.marked_ps.max(slice.since_ps), self.sys_hz) <= now_ps
            {
                self.raw |= 1 << index;
            }
        }
        self.marked_ps = now_ps;
    }

    pub(crate) fn read(&mut self, offset: u32, now_ps: u64) -> Option<u32> {
        if offset == 0xA4 {
            self.mark_wraps(now_ps);
        }
        if offset == 0xA0 {
            let enabled = |(bits, slice): (u32, &Slice)| u32::from(slice.enabled()) << bits;
            return Some((0..).zip(&self.slices).map(enabled).sum());
        }
        match offset {
            0xA4 => return Some(self.raw),
            0xA8 => return Some(self.enabled),
            0xB0 => return Some(self.raw & self.enabled),
            _ => {}
        }
        let slice = self.slices.get(offset as usize / 0x14)?;
        Some(match offset % 0x14 {
            0x00 => slice.control,
            0x04 => slice.divider,
            0x08 => slice.count_at(now_ps, self.sys_hz),
            0x0C => slice.next_compare,
            _ => slice.next_top,
        })
    }

    /// Write times of the first slice's levels since the last call.
    pub(crate) fn take_level_times(&mut self) -> LevelTimes {
        std::mem::take(&mut self.level_times)
    }

    fn count_level(&mut self, now_ps: u64) {
        let [slice, ..] = &self.slices;
        if !slice.runs() {
            return;
        }
        let (left, half) = slice.left_at(now_ps, self.sys_hz);
        let times = &mut self.level_times;
        times.written += 1;
        let now = Time::from_ps(now_ps);
        if let Some(last) = times.last.replace(now) {
            times.longest_gap = times.longest_gap.max(now - last);
        }
        if left > half {
            times.late += 1;
        } else {
            let left = Time::from_ps((left as f64 * slice.step_ps(self.sys_hz)) as u64);
            times.least_left = times.least_left.min(left);
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        self.mark_wraps(now_ps);
        if offset == 0xA0 {
            for (bit, slice) in self.slices.iter_mut().enumerate() {
                slice.advance(now_ps, self.sys_hz);
                slice.control = slice.control & !1 | value >> bit & 1;
            }
            return Some(());
        }
        match offset {
            0xA4 => self.raw &= !value,
            0xA8 => {
                self.enabled = value & 0xFF;
                // Earlier wraps are already marked.
                self.serviced_ps = self.serviced_ps.max(now_ps);
            }
            _ => {}
        }
        if matches!(offset, 0xA4 | 0xA8) {
            return Some(());
        }
        if offset == 0x0C {
            self.count_level(now_ps);
        }
        let slice = self.slices.get_mut(offset as usize / 0x14)?;
        if !matches!(offset % 0x14, 0x0C | 0x10) {
            slice.advance(now_ps, self.sys_hz);
        }
        match offset % 0x14 {
            // Level gating, rising edges, single steps and inverted outputs are not modelled.
            0x00 if value & 0b1100_1100 == 0 && matches!(value >> 4 & 0b11, FREE | FALLING) => {
                slice.control = value;
            }
            0x04 if value >= 16 => slice.divider = value & 0xFFF,
            0x08 => slice.count = value & 0xFFFF,
            0x0C => slice.next_compare = value,
            0x10 => slice.next_top = value & 0xFFFF,
            _ => return None,
        }
        if !slice.enabled() {
            // The shadow register is transparent while the slice is stopped.
            slice.latch();
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HZ: f64 = 200e6;

    fn running() -> Pwm {
        let mut pwm = Pwm::new(HZ);
        pwm.write(0x10, 9_999, 0).unwrap();
        pwm.write(0x0C, 5_000, 0).unwrap();
        pwm.write(0x00, 1, 0).unwrap();
        pwm
    }

    #[test]
    fn levels_before_the_wrap_are_distinguished_from_those_behind_it() {
        let mut pwm = Pwm::new(HZ);
        pwm.write(0x10, 1_599, 0).unwrap();
        pwm.write(0x0C, 400, 0).unwrap();
        pwm.write(0x00, 0b11, 0).unwrap();
        assert_eq!(pwm.take_level_times(), LevelTimes::default());
        for at_us in [12, 15, 17] {
            pwm.write(0x0C, 400, at_us * 1_000_000).unwrap();
        }
        let times = pwm.take_level_times();
        assert_eq!((times.written, times.late), (3, 1));
        assert_eq!(times.longest_gap, Time::from_us(3));
        // The time left is a whole number of counter steps.
        let left = times.least_left;
        assert!(
            left >= Time::from_us(1) && left < Time::from_ns(1_010),
            "{left}"
        );
    }

    #[test]
    fn a_wrap_from_before_the_interrupt_was_enabled_waits_in_its_flag() {
        let mut pwm = running();
        assert_eq!(pwm.read(0xA4, 49_000_000), Some(0));
        pwm.write(0xA8, 1, 51_000_000).unwrap();
        assert!(pwm.line(), "of the wrap at 50 us");
        pwm.write(0xA4, 1, 52_000_000).unwrap();
        pwm.service(60_000_000);
        assert!(!pwm.line());
        pwm.service(pwm.next_event(60_000_000).unwrap());
        assert!(pwm.line(), "of the wrap at 100 us");
    }
}
