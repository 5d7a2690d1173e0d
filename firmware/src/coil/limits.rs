//! The coil's hardware on this board, and what nothing exceeds. Compiled in, and nowhere else.

use coil_hbridge::{Decay, Hardware, Limits};

/// Steps of the PWM from its middle to its end: 960 up and 960 down at 120 MHz are 16 us, in which
/// the ADC makes eight conversions exactly.
pub const FULL_LEVEL: u16 = 960;
/// A period of the PWM.
pub const PERIOD_US: u32 = 16;

/// Bridge, PWM and current measurement (docs/firmware.md).
pub const HARDWARE: Hardware = Hardware {
    period_s: PERIOD_US as f32 * 1e-6,
    full_level: FULL_LEVEL,
    // 12 bits of 3.3 V behind 0.125 V/A about 1.65 V.
    ampere_per_count: 3.3 / 4096.0 / 0.125,
    zero_count: 2048,
    zero_tolerance: 64,
    greatest_count: 4095,
    diode_v: 0.8,
    decay: Decay::Fast,
    reduced_limit_a: Some(2.0),
};

/// What nothing exceeds, with its reasons: the procedure forecasts by the same.
pub const LIMITS: Limits = palpate_procedure::board::DRIVE;
