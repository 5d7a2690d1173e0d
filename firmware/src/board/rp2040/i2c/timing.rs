//! Timing of the I2C block at 400 kHz, in cycles of the processor's clock (I2C specification, table 10).

use palpate_node::board::cycles;

/// IC_CON: master, fast mode, repeated STARTs, no target.
pub const CONTROL: u32 = 0x65;
/// Filter length: suppresses spikes up to 50 ns.
pub const SPIKE: u32 = cycles(50);
/// SCL low count: with one more clock 1.375 us, so at least 1.3 us for any fall time.
pub const LOW: u32 = cycles(1_375) - 1;
/// SCL high count: with the filter and seven clocks added (datasheet 4.3.14.2), and with low time and
/// rise, the period is 2.5 us, 400 kHz.
pub const HIGH: u32 = cycles(2_500) - (LOW + 1) - RISE - SPIKE - 7;
/// Rise time of SCL: 150 ns with 2.2 kiloohm and 80 pF. A faster rise speeds the bus up by at most 6 %
/// above 400 kHz; a slower rise slows it down.
const RISE: u32 = cycles(150);
/// Hold time: SDA changes 300 ns after SCL falls.
pub const HOLD: u32 = cycles(300);
