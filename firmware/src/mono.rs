//! The monotonic clock: the microsecond timer.

use rtic_monotonics::rp2040_timer_monotonic;

rp2040_timer_monotonic!(Mono);
