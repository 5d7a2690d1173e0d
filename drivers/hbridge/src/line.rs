//! What the current is to do: straight lines.

/// A straight line from one current to another, in units with 32 bits behind the point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Line {
    now: i64,
    slope: i64,
    end: i64,
    left: u32,
}

/// A moment of a line, in sixteenths of a unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// The current at the end of the period.
    pub(crate) at_q4: i32,
    /// Its change within it.
    pub(crate) change_q4: i32,
}

const POINT: u32 = 32;
const TO_Q4: u32 = POINT - 4;

impl Line {
    /// Goes from here to `to` in so many periods; at once in none.
    pub(crate) fn go(&mut self, to: i32, periods: u32) {
        self.end = i64::from(to) << POINT;
        self.left = periods;
        if periods == 0 {
            self.now = self.end;
            self.slope = 0;
        } else {
            self.slope = (self.end - self.now) / i64::from(periods);
        }
    }

    /// The next period.
    #[inline]
    pub(crate) fn advance(&mut self) -> Wanted {
        if self.left > 0 {
            self.left -= 1;
            if self.left == 0 {
                self.now = self.end;
            } else {
                self.now += self.slope;
            }
        } else {
            self.slope = 0;
        }
        Wanted {
            at_q4: (self.now >> TO_Q4) as i32,
            change_q4: (self.slope >> TO_Q4) as i32,
        }
    }

    pub(crate) const fn is_over(&self) -> bool {
        self.left == 0
    }

    pub(crate) const fn now(&self) -> i32 {
        (self.now >> POINT) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_straight_and_ends_exactly() {
        let mut line = Line::default();
        line.go(3_000, 0);
        assert_eq!(line.advance().at_q4, 48_000);
        // the longest line: 20 s of 16 us
        line.go(-1_000, 1_250_000);
        let mut worst = 0;
        for step in 1..=1_250_000_i64 {
            let at = i64::from(line.advance().at_q4);
            let ideal = 48_000 - 64_000 * step / 1_250_000;
            worst = worst.max((at - ideal).abs());
        }
        assert!(worst <= 1, "{worst}");
        assert!(line.is_over());
        assert_eq!(
            line.advance(),
            Wanted {
                at_q4: -16_000,
                change_q4: 0
            }
        );
    }
}
