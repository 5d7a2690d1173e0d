//! Period of the control interrupt.

use palpate_node::board::FULL_LEVEL;

/// PWM slice that triggers the interrupt.
pub const CONTROL_SLICE: usize = 1;
/// Processor cycles per period of the control interrupt.
pub const CYCLES: u32 = 2 * FULL_LEVEL as u32;
