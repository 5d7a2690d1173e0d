//! Timing of the I2C block at 400 kHz, in cycles of the processor's clock (I2C specification, table 10).

use palpate_node::board::cycles;

/// Register IC_CON: master, fast mode, repeated STARTs, not a target itself.
pub const CONTROL: u32 = 0x65;
/// Length of the spike filter: suppresses spikes up to 50 ns.
pub const SPIKE: u32 = cycles(50);
/// Count of SCL's low time: with one clock that the block adds it is 1.375 us, so at least 1.3 us for
/// any fall time.
pub const LOW: u32 = cycles(1_375) - 1;
/// Count of SCL's high time: the block adds the filter and seven clocks (datasheet 4.3.14.2). With low
/// time and rise time, the period is 2.5 us, 400 kHz.
pub const HIGH: u32 = cycles(2_500) - (LOW + 1) - RISE - SPIKE - 7;
/// Assumed rise time of SCL: 150 ns with 2.2 kiloohm and 80 pF. A faster rise makes the bus at most 6 %
/// faster than 400 kHz; a slower rise makes it slower.
const RISE: u32 = cycles(150);
/// Hold time: SDA changes 300 ns after SCL falls.
pub const HOLD: u32 = cycles(300);
