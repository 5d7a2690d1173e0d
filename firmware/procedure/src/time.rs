//! Time as an argument: microseconds since the device's start.

use palpate_model::units::Second;

/// A moment, in microseconds since the start of the device.
pub type Instant = fugit::MonotonicInstant<u64, 1, 1_000_000>;

/// A span of time in microseconds.
pub type Duration = fugit::Duration<u64, 1, 1_000_000>;

/// Returns the time from `earlier` to `later`; zero if they are in the reverse order.
pub(crate) fn between(earlier: Instant, later: Instant) -> Duration {
    Duration::from_ticks(later.as_ticks().saturating_sub(earlier.as_ticks()))
}

/// Returns the time from `earlier` to `later` in seconds.
pub(crate) fn seconds(earlier: Instant, later: Instant) -> Second {
    in_seconds(between(earlier, later))
}

/// Converts a span to seconds, with a relative error below 6e-8.
pub(crate) fn in_seconds(span: Duration) -> Second {
    Second(span.as_ticks() as f32 * 1e-6)
}

/// Returns the nearest span to a number of seconds; zero for a negative number or NaN.
pub(crate) fn span(seconds_s: f32) -> Duration {
    // The cast of a float saturates, and turns NaN into zero. The difference to whole seconds below is
    // exact.
    let whole_s = seconds_s as u32;
    let rest_s = (seconds_s - whole_s as f32).clamp(0.0, 1.0);
    Duration::from_ticks(u64::from(whole_s) * 1_000_000 + u64::from((rest_s * 1e6 + 0.5) as u32))
}

/// Adds two spans without overflow: the sum of `fugit` panics.
pub(crate) fn together(one: Duration, other: Duration) -> Duration {
    Duration::from_ticks(one.as_ticks().saturating_add(other.as_ticks()))
}

/// Adds a span to an instant without overflow.
pub(crate) fn after(instant: Instant, span: Duration) -> Instant {
    Instant::from_ticks(instant.as_ticks().saturating_add(span.as_ticks()))
}
