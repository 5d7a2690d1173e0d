//! Supervision: the watchdog is fed only when every task has checked in.

use palpate_node::supervision::CheckIns;

/// Time from the last feeding to the reset, in microseconds. With the boot ROM's time the bridge is off
/// within 60 ms of a hang; its inputs go low with the reset.
pub const WATCHDOG_US: u32 = 40_000;
/// Period of the supervisor's check, in milliseconds. Every task must check in between two checks.
pub const PERIOD_MS: u64 = 10;

/// Check-ins of all tasks. It is a static because each task checks in during its waits.
pub static CHECK_INS: CheckIns = CheckIns::new();
