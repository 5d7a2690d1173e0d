//! Figures of the reference board: the frequencies and cycle counts that follow from the processor's
//! clock, and the coil's drive (docs/firmware.md).
//!
//! ```
//! use palpate_node::board::{CORE_HZ, Clkin, FULL_LEVEL};
//! assert_eq!(CORE_HZ, 200_000_000);
//! assert_eq!((Clkin::SINGLE.divisor(), Clkin::SINGLE.hz()), (6, 33_333_333));
//! assert_eq!((Clkin::SCAN.divisor(), Clkin::SCAN.hz()), (5, 40_000_000));
//! assert_eq!(FULL_LEVEL, 1_600);
//! ```

use coil_hbridge::{Decay, Hardware};
use ldc161x::Sensor;
use palpate_procedure::Limits;
use palpate_procedure::units::{Ampere, Celsius, Hertz};

/// Clock of the processor, in hertz: the highest for which the RP2040 is certified, at a core voltage of
/// 1.15 V.
pub const CORE_HZ: u32 = 200_000_000;
/// Clock of the processor, in megahertz, a whole number.
pub const CORE_MHZ: u32 = CORE_HZ / 1_000_000;
const _: () = assert!(CORE_MHZ * 1_000_000 == CORE_HZ);

/// Converts nanoseconds to cycles of the processor's clock, rounded to the nearest.
#[must_use]
pub const fn cycles(time_ns: u32) -> u32 {
    (time_ns * CORE_MHZ + 500) / 1_000
}

/// Clock of the converter: the processor's clock divided by a whole number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clkin {
    divisor: u32,
}

impl Clkin {
    /// For one channel: the highest within 35 MHz (LDC1614 datasheet, table 43).
    pub const SINGLE: Self = Self::within(35_000_000);
    /// For several channels: the highest within 40 MHz.
    pub const SCAN: Self = Self::within(40_000_000);

    const fn within(limit_hz: u32) -> Self {
        Self {
            divisor: CORE_HZ.div_ceil(limit_hz),
        }
    }

    /// Returns the divisor of the processor's clock.
    #[must_use]
    pub const fn divisor(self) -> u32 {
        self.divisor
    }

    /// Returns the frequency in whole hertz, which the driver uses for its plan. 200 MHz divided by 6 is
    /// a third of a hertz more: a relative error of 1e-8, against 3e-5 of the crystal.
    #[must_use]
    pub const fn hz(self) -> u32 {
        (CORE_HZ + self.divisor / 2) / self.divisor
    }
}

/// Resonators for which the board is made: 2 to 5 MHz with a quality factor of 50 at most. The parallel
/// resistance gives only the drive current with which the converter starts its search for the right one.
pub const SENSOR: Sensor = Sensor {
    highest_quality_factor: 50,
    lowest_rp_ohm: 3_000,
    highest_rp_ohm: 3_000,
    ..Sensor::new(2_000_000, 5_000_000)
};
/// Planned bus clock: 98 % of the actual 400 kHz. At the highest scan rate that this allows, the image
/// loses no sample in a minute (docs/evidence/image-rates.md). Closer to 400 kHz, one late frame delays
/// the following ones.
pub const BUS_HZ: u32 = 393_000;

/// Period of the bridge's PWM, in microseconds; the ADC makes exactly eight conversions in it.
pub const PERIOD_US: u32 = 16;
/// Number of PWM steps in half a period, and so the level of a full duty cycle: the PWM counts up and
/// down once per period.
pub const FULL_LEVEL: u16 = (CORE_MHZ * PERIOD_US / 2) as u16;
const _: () = assert!(2 * FULL_LEVEL as u32 == CORE_MHZ * PERIOD_US);

/// Time by which the ADC's samples come after the PWM's edges, in nanoseconds: the delay from the
/// bridge's inputs through its outputs to the output of the current amplifier, mean of rising and falling
/// edges. Samples then stand where the ripple passes through its mean.
///
/// 1.02 us is the longest for which there is room: levels are written 4 us after the second sample's
/// conversion, and have to be there before the PWM's next period, whatever preempts the control interrupt.
/// At 1.82 us one level in ten thousand came too late at a USB host. A delay that is d off shifts readings
/// by d (V - 2 I R)/(2 L). The carrier's bridge and amplifier have 1.77 us at 1.8 A and 1.97 us from 6 A
/// on, so readings through them are 71 mA too low at 6 A, 12 V and 40 uH, and were 148 mA without a delay
/// (`sim-host/emulator/tests/integration/current.rs`). A bridge without delay needs 0. The board starts its
/// ADC in steps of 0.2 us.
pub const BRIDGE_DELAY_NS: u32 = 1_020;
const _: () = assert!(BRIDGE_DELAY_NS <= 1_020);

/// Hard limits of the coil's drive. `current_a` is the greatest setpoint of the coil's current, and a
/// measured current beyond `trip_a` switches the bridge off; the driver's
/// `Supervisor::new` refuses a `trip_a` that the current amplifier of [`HARDWARE`] cannot measure.
///
/// 12 A: the bridges are made for 15 A; the rest is a margin. 12.7 A is the largest current that the ADC
/// can represent, less the tolerance of the measurement's zero. Duty 0.98: bridges need 2 % of each
/// period to keep their upper switches supplied. 60 J would heat copper of 0.8 J/K by 75 K if it kept
/// all of it; from 25 degrees Celsius that ends at the 100 allowed. 3.5 W is the continuous rating of
/// the paper's coils, 3 A; 60 J in 20 s are 3 W, within it. Resistance and inductance are those of
/// sensible coils, with a margin.
pub const DRIVE_LIMITS: coil_hbridge::Limits = coil_hbridge::Limits {
    setpoint_a: 12.0,
    trip_a: 12.7,
    duty: 0.98,
    on_time_s: 20.0,
    energy_j: 60.0,
    continuous_w: 3.5,
    supply_v: [4.5, 14.0],
    resistance_ohm: [0.15, 3.0],
    inductance_h: [10e-6, 400e-6],
};

/// Limits that no setting, command or calibration exceeds: those of the [drive](DRIVE_LIMITS), the coil's
/// maximum temperature, and the protocol's highest rate.
pub const LIMITS: Limits = Limits {
    current: Ampere(DRIVE_LIMITS.setpoint_a),
    energy_j: DRIVE_LIMITS.energy_j,
    on_time_s: DRIVE_LIMITS.on_time_s,
    temperature: Celsius(100.0),
    rate: Hertz(5_000.0),
};

/// Bridge, PWM and current amplifier of the board. `firmware/src/board/rp2040/control` defines the order
/// in which the ADC's inputs are read.
pub const HARDWARE: Hardware = Hardware {
    period_s: PERIOD_US as f32 * 1e-6,
    full_level: FULL_LEVEL,
    // Current amplifier: 0.125 V/A about 1.65 V, read with 12 bits of 3.3 V.
    ampere_per_count: 3.3 / 4096.0 / 0.125,
    zero_count: 2048,
    zero_tolerance: 64,
    greatest_count: 4095,
    diode_v: 0.8,
    decay: Decay::Fast,
    // Wake-up time of the bridge: twice the 1 ms that drivers of external transistors take (DRV8704,
    // SLVSD29, t_SLEEP; DRV8714-Q1, t_WAKE).
    wake_s: 2e-3,
    reduced_limit_a: Some(2.0),
};
