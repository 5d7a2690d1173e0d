//! TIMER: microseconds and four alarms (RP2040 datasheet 4.6).

/// The 64-bit microsecond timer. It counts the ticks that the watchdog block derives from clk_ref.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timer {
    /// Time at which the count was `base_us`.
    base_ps: u64,
    base_us: u64,
    /// Length of a tick, ps; 0 without ticks.
    tick_ps: f64,
    latched_high: u32,
    alarms: [u32; 4],
    armed: u32,
    raised: u32,
    enabled: u32,
    forced: u32,
    serviced_ps: u64,
}

impl Timer {
    /// Sets another tick length; `None` stops the ticks.
    pub(crate) fn set_tick(&mut self, now_ps: u64, tick_ps: Option<f64>) {
        let tick_ps = tick_ps.unwrap_or(0.0);
        if tick_ps != self.tick_ps {
            self.base_us = self.count(now_ps);
            self.base_ps = now_ps;
            self.tick_ps = tick_ps;
        }
    }

    pub(crate) fn reset(&mut self, now_ps: u64) {
        *self = Self {
            base_ps: now_ps,
            tick_ps: self.tick_ps,
            ..Self::default()
        };
    }

    /// Present count.
    pub(crate) fn count(&self, now_ps: u64) -> u64 {
        if self.tick_ps == 0.0 {
            return self.base_us;
        }
        self.base_us + ((now_ps - self.base_ps) as f64 / self.tick_ps) as u64
    }

    /// Time at which an alarm next fires.
    pub(crate) fn next_event(&self, now_ps: u64) -> Option<u64> {
        if self.armed == 0 || self.tick_ps == 0.0 {
            return None;
        }
        let now_us = self.count(now_ps);
        (0..4)
            .filter(|alarm| self.armed >> alarm & 1 == 1)
            .map(|alarm| {
                let left = self.alarms[alarm].wrapping_sub(now_us as u32);
                let due_us = now_us + u64::from(left) - self.base_us;
                // Slightly after the tick, so that rounding cannot put it before.
                self.base_ps + ((due_us as f64 + 0.001) * self.tick_ps) as u64
            })
            .min()
    }

    /// Fires the alarms that are due: those that equal the lower half of the count.
    pub(crate) fn service(&mut self, now_ps: u64) {
        let since_ps = std::mem::replace(&mut self.serviced_ps, now_ps);
        if self.armed == 0 {
            return;
        }
        let now_us = self.count(now_ps);
        let since_us = self.count(since_ps.max(self.base_ps));
        for alarm in 0..4 {
            let passed = (now_us as u32).wrapping_sub(self.alarms[alarm]);
            let window = now_us - since_us.min(now_us);
            if self.armed >> alarm & 1 == 1 && u64::from(passed) <= window {
                self.armed &= !(1 << alarm);
                self.raised |= 1 << alarm;
            }
        }
    }

    pub(crate) fn lines(&self) -> u32 {
        self.raised & self.enabled | self.forced
    }

    pub(crate) fn read(&mut self, offset: u32, now_ps: u64) -> Option<u32> {
        let count = self.count(now_ps);
        Some(match offset {
            0x08 => self.latched_high,
            0x0C => {
                self.latched_high = (count >> 32) as u32;
                count as u32
            }
            0x10..=0x1C => *self.alarms.get((offset as usize - 0x10) / 4)?,
            0x20 => self.armed,
            0x24 => (count >> 32) as u32,
            0x28 => count as u32,
            0x34 => self.raised,
            0x38 => self.enabled,
            0x3C => self.forced,
            0x40 => self.lines(),
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x10..=0x1C => {
                let alarm = (offset as usize - 0x10) / 4;
                *self.alarms.get_mut(alarm)? = value;
                self.armed |= 1 << alarm;
            }
            0x20 => self.armed &= !value,
            0x34 => self.raised &= !value,
            0x38 => self.enabled = value & 0xF,
            0x3C => self.forced = value & 0xF,
            // Selects whether a debugger stops the timer; there is no debugger.
            0x2C => {}
            _ => return None,
        }
        Some(())
    }
}
