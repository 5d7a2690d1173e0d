//! The I2C block at 400 kHz, in cycles of the processor's clock (I2C specification, table 10).

use palpate_node::board::cycles;

/// IC_CON: master, fast mode, repeated STARTs, no target.
pub const CONTROL: u32 = 0x65;
/// Spikes up to 50 ns are filtered.
pub const SPIKE: u32 = cycles(50);
/// SCL low: the count plus one clock is 1.375 us, at least 1.3 us whatever its fall takes.
pub const LOW: u32 = cycles(1_375) - 1;
/// SCL high: the count plus the filter and seven clocks (datasheet 4.3.14.2). With the low time and
/// the rise the period is 2.5 us, 400 kHz.
pub const HIGH: u32 = cycles(2_500) - (LOW + 1) - RISE - SPIKE - 7;
/// Rise of SCL: 150 ns, with 2.2 kiloohm and 80 pF. A faster one makes the bus faster than 400 kHz
/// by up to 6 %; a slower one makes it slower.
const RISE: u32 = cycles(150);
/// SDA changes 300 ns after SCL falls.
pub const HOLD: u32 = cycles(300);
