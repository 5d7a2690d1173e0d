//! PWM: pulse widths, and a counter of edges (RP2040 datasheet 4.5). It runs on whatever the
//! processor does.

use crate::time::periods_ps;

const SLICES: usize = 8;

/// The eight slices.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pwm {
    slices: [Slice; SLICES],
}

#[derive(Clone, Debug)]
struct Slice {
    control: u32,
    /// Divider in sixteenths.
    divider: u32,
    /// The count at `since_ps`.
    count: u32,
    since_ps: u64,
    top: u32,
    compare: u32,
    /// Written, in force from the next wrap on.
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

/// Modes of counting: free, or falling edges of input B.
const FREE: u32 = 0;
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

    fn count_at(&self, now_ps: u64, sys_hz: f64) -> u32 {
        if !self.runs() {
            return self.count;
        }
        let steps = ((now_ps - self.since_ps) as f64 / self.step_ps(sys_hz)) as u64;
        ((u64::from(self.count) + steps) % (u64::from(self.top) + 1)) as u32
    }

    /// When the count next wraps.
    fn wrap_ps(&self, now_ps: u64, sys_hz: f64) -> u64 {
        let left = u64::from(self.top) + 1 - u64::from(self.count_at(now_ps, sys_hz));
        now_ps + periods_ps(left, sys_hz * 16.0 / f64::from(self.divider))
    }

    fn waits(&self) -> bool {
        self.top != self.next_top || self.compare != self.next_compare
    }

    fn latch(&mut self) {
        self.top = self.next_top;
        self.compare = self.next_compare;
    }

    fn advance(&mut self, now_ps: u64, sys_hz: f64) {
        self.count = self.count_at(now_ps, sys_hz);
        self.since_ps = now_ps;
    }

    fn level(&self, channel_b: bool) -> u32 {
        if channel_b {
            self.compare >> 16
        } else {
            self.compare & 0xFFFF
        }
    }

    fn inverted(&self, channel_b: bool) -> bool {
        self.control >> (2 + u32::from(channel_b)) & 1 == 1
    }

    /// The output at a time, and its changes from there to another, while nothing is written and
    /// no written value comes into force.
    fn edges(&self, channel_b: bool, from_ps: u64, to_ps: u64, sys_hz: f64) -> Vec<(u64, bool)> {
        let (level, inverted) = (self.level(channel_b), self.inverted(channel_b));
        if !self.runs() || level == 0 || level > self.top {
            return vec![(from_ps, (self.count < level) != inverted)];
        }
        let step_ps = self.step_ps(sys_hz);
        let period_ps = (f64::from(self.top) + 1.0) * step_ps;
        let first_ps = self.since_ps as f64 - f64::from(self.count) * step_ps;
        let passed = ((from_ps as f64 - first_ps) / period_ps).floor();
        let mut edges = vec![(from_ps, inverted)];
        let mut rise_ps = first_ps + (passed - 1.0) * period_ps;
        while rise_ps <= to_ps as f64 {
            let fall_ps = rise_ps + f64::from(level) * step_ps;
            for (at_ps, high) in [(rise_ps as u64, !inverted), (fall_ps as u64, inverted)] {
                if at_ps <= from_ps {
                    edges = vec![(from_ps, high)];
                } else if at_ps <= to_ps {
                    edges.push((at_ps, high));
                }
            }
            rise_ps += period_ps;
        }
        edges
    }

    fn duty(&self, channel_b: bool) -> f64 {
        let level = self.level(channel_b);
        let inverted = self.inverted(channel_b);
        let duty = if self.runs() {
            (f64::from(level) / (f64::from(self.top) + 1.0)).min(1.0)
        } else {
            // Stopped: the output stays where the count left it.
            f64::from(u8::from(self.count < level))
        };
        if inverted { 1.0 - duty } else { duty }
    }
}

impl Pwm {
    /// The part of the time in which an output is high.
    pub(crate) fn duty(&self, slice: usize, channel_b: bool) -> f64 {
        self.slices
            .get(slice)
            .map_or(0.0, |slice| slice.duty(channel_b))
    }

    /// The level of an output at a time, and its changes from there to another; neither may lie
    /// before the last write or the last value that came into force.
    pub(crate) fn edges(
        &self,
        slice: usize,
        channel_b: bool,
        (from_ps, to_ps): (u64, u64),
        sys_hz: f64,
    ) -> Vec<(u64, bool)> {
        self.slices.get(slice).map_or_else(Vec::new, |slice| {
            slice.edges(channel_b, from_ps, to_ps, sys_hz)
        })
    }

    /// A falling edge at a slice's input B.
    pub(crate) fn falling_edge(&mut self, slice: usize) {
        if let Some(slice) = self.slices.get_mut(slice)
            && slice.enabled()
            && slice.mode() == FALLING
        {
            slice.count = (slice.count + 1) % (slice.top + 1);
        }
    }

    /// When a written value next comes into force.
    pub(crate) fn next_event(&self, now_ps: u64, sys_hz: f64) -> Option<u64> {
        self.slices
            .iter()
            .filter(|slice| slice.runs() && slice.waits())
            .map(|slice| slice.wrap_ps(now_ps.max(slice.since_ps), sys_hz))
            .min()
    }

    /// Brings values into force whose wrap lies between two times.
    pub(crate) fn service(&mut self, since_ps: u64, now_ps: u64, sys_hz: f64) {
        for slice in &mut self.slices {
            if slice.runs() && slice.waits() {
                let wrap_ps = slice.wrap_ps(since_ps.max(slice.since_ps), sys_hz);
                if wrap_ps <= now_ps {
                    slice.count = 0;
                    slice.since_ps = wrap_ps;
                    slice.latch();
                }
            }
        }
    }

    /// The system clock changes: counts go on from where they are.
    pub(crate) fn advance(&mut self, now_ps: u64, sys_hz: f64) {
        for slice in &mut self.slices {
            slice.advance(now_ps, sys_hz);
        }
    }

    pub(crate) fn read(&self, offset: u32, now_ps: u64, sys_hz: f64) -> Option<u32> {
        if offset == 0xA0 {
            let enabled = |(bits, slice): (u32, &Slice)| u32::from(slice.enabled()) << bits;
            return Some((0..).zip(&self.slices).map(enabled).sum());
        }
        let slice = self.slices.get(offset as usize / 0x14)?;
        Some(match offset % 0x14 {
            0x00 => slice.control,
            0x04 => slice.divider,
            0x08 => slice.count_at(now_ps, sys_hz),
            0x0C => slice.next_compare,
            _ => slice.next_top,
        })
    }

    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now_ps: u64,
        sys_hz: f64,
    ) -> Option<()> {
        if offset == 0xA0 {
            for (bit, slice) in self.slices.iter_mut().enumerate() {
                slice.advance(now_ps, sys_hz);
                slice.control = slice.control & !1 | value >> bit & 1;
            }
            return Some(());
        }
        let slice = self.slices.get_mut(offset as usize / 0x14)?;
        slice.advance(now_ps, sys_hz);
        match offset % 0x14 {
            // Phase-correct counting, gating by level, rising edges and steps are not modelled.
            0x00 if value & 0b1100_0010 == 0 && matches!(value >> 4 & 0b11, FREE | FALLING) => {
                slice.control = value;
            }
            0x04 if value >= 16 => slice.divider = value & 0xFFF,
            0x08 => slice.count = value & 0xFFFF,
            0x0C => slice.next_compare = value,
            0x10 => slice.next_top = value & 0xFFFF,
            _ => return None,
        }
        if !slice.enabled() {
            // The shadow is transparent while the slice stands.
            slice.latch();
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HZ: f64 = 120e6;

    fn running() -> Pwm {
        let mut pwm = Pwm::default();
        pwm.write(0x10, 5_999, 0, HZ).unwrap();
        pwm.write(0x0C, 3_000, 0, HZ).unwrap();
        pwm.write(0x00, 1, 0, HZ).unwrap();
        pwm
    }

    #[test]
    fn a_new_level_comes_at_the_wrap() {
        let mut pwm = running();
        assert_eq!(pwm.duty(0, false), 0.5);
        pwm.write(0x0C, 0, 10_000_000, HZ).unwrap();
        assert_eq!(pwm.duty(0, false), 0.5);
        let due = pwm.next_event(10_000_000, HZ).unwrap();
        assert!(due.abs_diff(50_000_000) < 10_000, "{due}");
        pwm.service(10_000_000, due, HZ);
        assert_eq!(pwm.duty(0, false), 0.0);
        assert_eq!(pwm.next_event(due, HZ), None);
    }

    #[test]
    fn edges_come_at_every_wrap_and_every_level() {
        let pwm = running();
        let us = 1_000_000;
        assert_eq!(
            pwm.edges(0, false, (10 * us, 110 * us), HZ),
            [
                (10 * us, true),
                (25 * us, false),
                (50 * us, true),
                (75 * us, false),
                (100 * us, true),
            ]
        );
        assert_eq!(pwm.edges(0, true, (0, 110 * us), HZ), [(0, false)]);
    }

    #[test]
    fn a_stopped_slice_holds_its_output() {
        let mut pwm = running();
        pwm.write(0x00, 0, 10_000_000, HZ).unwrap();
        assert_eq!(pwm.duty(0, false), 1.0, "stopped within the pulse");
    }

    #[test]
    fn falling_edges_are_counted() {
        let mut pwm = Pwm::default();
        pwm.write(3 * 0x14, 1 | FALLING << 4, 0, HZ).unwrap();
        for _ in 0..3 {
            pwm.falling_edge(3);
        }
        assert_eq!(pwm.read(3 * 0x14 + 8, 0, HZ), Some(3));
    }
}
