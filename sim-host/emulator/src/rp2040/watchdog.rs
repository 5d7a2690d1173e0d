//! WATCHDOG: the reset timer, its scratch registers, and the tick (datasheet 4.7).

/// The watchdog block. A watchdog reset keeps everything here except the count.
#[derive(Clone, Debug, Default)]
pub(crate) struct Watchdog {
    enabled: bool,
    pauses: u32,
    /// Time at which the watchdog expires.
    due_ps: Option<u64>,
    /// Time of the last feeding; `longest_unfed_ps` is the longest interval between two feedings.
    fed_ps: Option<u64>,
    longest_unfed_ps: u64,
    left: u32,
    reason: u32,
    /// Whether the next reset is a requested one, not a timeout.
    is_forced: bool,
    scratch: [u32; 8],
    tick: u32,
    /// Whether the watchdog has expired and the chip must be reset.
    pub(crate) has_fired: bool,
}

/// Decrement of the count per tick: two, by erratum RP2040-E1.
const PER_TICK: u64 = 2;
const TICK_ENABLE: u32 = 1 << 9;
const TIMER_EXPIRED: u32 = 1;
const FORCED: u32 = 2;

impl Watchdog {
    /// Length of the microsecond tick; `None` if clk_ref is stopped or ticks are disabled.
    pub(crate) fn tick_ps(&self, ref_hz: f64) -> Option<f64> {
        let is_on = self.tick & TICK_ENABLE != 0 && ref_hz > 0.0;
        is_on.then(|| f64::from((self.tick & 0x1FF).max(1)) * 1e12 / ref_hz)
    }

    pub(crate) fn next_event(&self) -> Option<u64> {
        self.due_ps.filter(|_| self.enabled)
    }

    /// Whether the watchdog resets the chip now.
    pub(crate) fn expires(&mut self, now_ps: u64) -> bool {
        let is_due = self.next_event().is_some_and(|due| due <= now_ps);
        if is_due {
            self.reason = if std::mem::take(&mut self.is_forced) {
                FORCED
            } else {
                TIMER_EXPIRED
            };
        }
        is_due
    }

    /// State after a watchdog reset.
    pub(crate) fn after_reset(&mut self) {
        self.enabled = false;
        self.is_forced = false;
        self.due_ps = None;
        self.fed_ps = None;
        self.tick = 0;
        self.has_fired = false;
    }

    /// Longest interval between two feedings since the last call.
    pub(crate) const fn take_longest_unfed_ps(&mut self) -> u64 {
        std::mem::replace(&mut self.longest_unfed_ps, 0)
    }

    fn feed(&mut self, now_ps: u64, ref_hz: f64) {
        if let Some(fed_ps) = self.fed_ps.replace(now_ps) {
            self.longest_unfed_ps = self.longest_unfed_ps.max(now_ps - fed_ps);
        }
        self.load(now_ps, ref_hz);
    }

    fn load(&mut self, now_ps: u64, ref_hz: f64) {
        self.due_ps = self
            .tick_ps(ref_hz)
            .map(|tick| now_ps + (u64::from(self.left).div_ceil(PER_TICK) as f64 * tick) as u64);
    }

    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => self.pauses | u32::from(self.enabled) << 30,
            0x08 => self.reason,
            0x0C..=0x28 => *self.scratch.get((offset as usize - 0x0C) / 4)?,
            0x2C => self.tick | u32::from(self.tick & TICK_ENABLE != 0) << 10,
            _ => return None,
        })
    }

    /// Writes a register. `ref_hz` is the present frequency of clk_ref.
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now_ps: u64,
        ref_hz: f64,
    ) -> Option<()> {
        match offset {
            0x00 => {
                let was_enabled = self.enabled;
                self.pauses = value & 0x0700_0000;
                self.enabled = value >> 30 & 1 == 1;
                if self.enabled && !was_enabled {
                    self.load(now_ps, ref_hz);
                }
                if value >> 31 == 1 {
                    self.enabled = true;
                    self.is_forced = true;
                    self.due_ps = Some(0);
                }
            }
            0x04 => {
                self.left = value & 0xFF_FFFF;
                self.feed(now_ps, ref_hz);
            }
            0x0C..=0x28 => *self.scratch.get_mut((offset as usize - 0x0C) / 4)? = value,
            0x2C => self.tick = value & 0x3FF,
            _ => return None,
        }
        Some(())
    }
}
