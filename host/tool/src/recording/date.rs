//! Times as dates, UTC.

use std::time::{SystemTime, UNIX_EPOCH};

/// Nanoseconds in a second.
pub const NS_PER_S: u64 = 1_000_000_000;
const S_PER_DAY: u64 = 86_400;

/// Present time, ns since 1970-01-01 UTC; 0 if the clock is before that.
pub fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| {
        u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
    })
}

/// Formats a time as `2026-11-23 06:25:07 UTC`.
pub fn text(ns: u64) -> String {
    let [year, month, day, hour, minute, second] = parts(ns);
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} UTC")
}

/// Formats a time for a file name, `20261123-062507`.
pub fn name(ns: u64) -> String {
    let [year, month, day, hour, minute, second] = parts(ns);
    format!("{year}{month:02}{day:02}-{hour:02}{minute:02}{second:02}")
}

fn parts(ns: u64) -> [u64; 6] {
    let time_s = ns / NS_PER_S;
    let [year, month, day] = civil(time_s / S_PER_DAY);
    let of_day_s = time_s % S_PER_DAY;
    [
        year,
        month,
        day,
        of_day_s / 3600,
        of_day_s / 60 % 60,
        of_day_s % 60,
    ]
}

/// Year, month and day from the number of days since 1970-01-01, in the Gregorian calendar.
fn civil(mut days: u64) -> [u64; 3] {
    let mut year = 1970;
    while days >= 365 + u64::from(is_leap(year)) {
        days -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    [year, month, days + 1]
}

const fn is_leap(year: u64) -> bool {
    year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dates from `date -u -d @SECONDS`.
    #[test]
    fn moments_have_their_dates() {
        for (time_s, date) in [
            (0, "1970-01-01 00:00:00 UTC"),
            (951_782_399, "2000-02-28 23:59:59 UTC"),
            (951_782_400, "2000-02-29 00:00:00 UTC"),
            (1_735_689_599, "2024-12-31 23:59:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00:00 UTC"),
        ] {
            assert_eq!(text(time_s * NS_PER_S), date);
        }
        assert_eq!(name(951_782_400 * NS_PER_S), "20000229-000000");
    }
}
