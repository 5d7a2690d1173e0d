//! Options of an emulated board.

use std::fmt;
use std::sync::Arc;

use ldc161x_sim::Sensors;

use crate::board::coil::BridgeCircuit;
use crate::board::flash::FlashTimes;
use crate::time::Time;

/// Sensors of the second converter.
#[derive(Clone)]
pub struct SecondSensors(Arc<dyn Sensors + Send + Sync>);

impl SecondSensors {
    /// Sensors that are constant, or depend on time.
    #[must_use]
    pub fn new(sensors: impl Sensors + Send + Sync + 'static) -> Self {
        Self(Arc::new(sensors))
    }
}

impl fmt::Debug for SecondSensors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SecondSensors").finish_non_exhaustive()
    }
}

impl Sensors for SecondSensors {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        self.0.frequency_hz(channel, time_s)
    }
}

/// Differences between emulated boards.
#[derive(Clone, Debug)]
pub struct Options {
    /// True frequency of the crystal, Hz, the source of all clocks; 0 for a crystal that does not
    /// start.
    pub crystal_hz: f64,
    /// Seed of the ring oscillator's random bit, of the flash's identifier, and of the effects of
    /// power cuts on the flash.
    pub seed: u64,
    /// Duration of erasing and programming the flash.
    pub flash_times: FlashTimes,
    /// Cycles to fetch an uncached line of flash. The first word takes 50 cycles: 400 ns, measured
    /// at 125 MHz (oberon-rtk.org, "Flash Memory"). The second word follows in the same transfer:
    /// eight nibbles at half the processor's clock.
    pub miss_cycles: u32,
    /// Rise time of SCL, from the pull-ups and the load of the wire.
    pub scl_rise: Time,
    /// Bridge and current measurement.
    pub drive: BridgeCircuit,
    /// Sensors of a second converter, at address 0x2B with INTB at GP9 and SD at
    /// GP10; `None` without a second converter.
    pub second_converter: Option<SecondSensors>,
    /// Whether bus traffic is recorded.
    pub record: bool,
    /// Whether pins and current are traced.
    pub trace: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            crystal_hz: 12e6,
            seed: 1,
            flash_times: FlashTimes::default(),
            miss_cycles: 66,
            scl_rise: Time::from_ns(150),
            drive: BridgeCircuit::default(),
            second_converter: None,
            record: false,
            trace: false,
        }
    }
}
