//! Period of the control interrupt.

use palpate_node::board::FULL_LEVEL;

/// PWM slice that triggers the interrupt.
pub const CONTROL_SLICE: usize = 1;
/// Cycles per period.
pub const CYCLES: u32 = 2 * FULL_LEVEL as u32;
