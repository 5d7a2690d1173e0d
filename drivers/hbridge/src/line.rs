//! Setpoint of the current as straight lines.

/// A straight line from one current to another, in fixed-point numbers of units with 32 fractional
/// bits.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(crate) struct FixedPointLine {
    now: i64,
    slope: i64,
    left: u32,
    change_q4: i32,
    end: i32,
}

/// Setpoint of one period, in sixteenths of a unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Setpoint {
    /// Current at the end of the period.
    pub(crate) at_q4: i32,
    /// Change of the current within the period.
    pub(crate) change_q4: i32,
}

/// The next line with its division already done: the division does not fit into the time that a
/// period leaves.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ahead {
    to: i32,
    periods: u32,
    slope: i64,
}

const POINT: u32 = 32;
const TO_Q4: u32 = POINT - 4;

impl FixedPointLine {
    /// Starts a line from the present current to `to` in `periods` periods; with zero periods, the
    /// current steps to `to`.
    pub(crate) fn go(&mut self, to: i32, periods: u32) {
        self.follow(&Ahead::from(self.now, to, periods));
    }

    /// Prepares the line that starts at this line's end.
    pub(crate) fn ahead(&self, to: i32, periods: u32) -> Ahead {
        Ahead::from(i64::from(self.end) << POINT, to, periods)
    }

    /// Starts a prepared line, whose start must be the present current.
    #[inline]
    pub(crate) fn follow(&mut self, ahead: &Ahead) {
        self.end = ahead.to;
        self.left = ahead.periods;
        self.slope = ahead.slope;
        self.change_q4 = (ahead.slope >> TO_Q4) as i32;
        if ahead.periods == 0 {
            self.now = i64::from(ahead.to) << POINT;
        }
    }

    /// Advances by one period.
    #[inline]
    pub(crate) fn advance(&mut self) {
        if self.left == 0 {
            self.change_q4 = 0;
            return;
        }
        self.left -= 1;
        if self.left == 0 {
            self.now = i64::from(self.end) << POINT;
        } else {
            self.now += self.slope;
        }
    }

    /// The setpoint of the present period.
    #[inline]
    pub(crate) const fn setpoint(&self) -> Setpoint {
        Setpoint {
            at_q4: (self.now >> TO_Q4) as i32,
            change_q4: self.change_q4,
        }
    }

    #[inline]
    pub(crate) const fn is_over(&self) -> bool {
        self.left == 0
    }

    /// Whether the slope ended with the last period.
    #[inline]
    pub(crate) const fn ends(&self) -> bool {
        self.change_q4 != 0
    }

    /// The setpoint at the end of the present period, in whole units.
    #[inline]
    pub(crate) const fn now(&self) -> i32 {
        (self.now >> POINT) as i32
    }
}

impl Ahead {
    fn from(now: i64, to: i32, periods: u32) -> Self {
        let slope = if periods == 0 {
            0
        } else {
            ((i64::from(to) << POINT) - now) / i64::from(periods)
        };
        Self { to, periods, slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_straight_and_ends_exactly() {
        let mut line = FixedPointLine::default();
        line.go(3_000, 0);
        line.advance();
        assert_eq!(line.setpoint().at_q4, 48_000);
        // the longest line: 20 s of 16 us
        line.go(-1_000, 1_250_000);
        let mut worst = 0;
        for step in 1..=1_250_000_i64 {
            line.advance();
            let at = i64::from(line.setpoint().at_q4);
            let ideal = 48_000 - 64_000 * step / 1_250_000;
            worst = worst.max((at - ideal).abs());
        }
        assert!(worst <= 1, "{worst}");
        assert!(line.is_over());
        line.advance();
        assert_eq!(
            line.setpoint(),
            Setpoint {
                at_q4: -16_000,
                change_q4: 0
            }
        );
    }
}
