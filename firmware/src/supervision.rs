//! Supervision: the watchdog is fed only when every task has checked in.

use palpate_node::supervision::CheckIns;

/// From the last feeding to the reset. With the boot ROM's time the bridge is off within 60 ms of
/// a hang; the outputs themselves fall with the reset.
pub const WATCHDOG_US: u32 = 40_000;
/// How often the supervisor polls. Every task has to check in between two polls.
pub const PERIOD_MS: u64 = 10;

/// The check-ins of all tasks. A static, since each task checks in from within its waits.
pub static CHECK_INS: CheckIns = CheckIns::new();
