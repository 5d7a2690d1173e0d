//! Parameters of one simulated chip and its surroundings.

use crate::counter::{Core, StartUp};
use crate::switches::{Overhead, Switches};
use crate::time::Time;

/// Chip type. The identity registers of both types are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PartNumber {
    /// Two channels. Its registers are those of the LDC1614; sequences stop at channel 1, and only
    /// the low bit of ACTIVE_CHAN counts (guess: the same die with two channels bonded).
    Ldc1612,
    /// Four channels.
    #[default]
    Ldc1614,
}

/// The clock at the CLKIN pin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExternalClock {
    /// Nominal frequency, Hz; 2 MHz to 40 MHz (datasheet 6.5).
    pub frequency_hz: f64,
    /// Relative error of the frequency (1e-6 is one part per million).
    pub relative_error: f64,
}

impl ExternalClock {
    /// An exact clock.
    #[must_use]
    pub const fn exact(frequency_hz: f64) -> Self {
        Self {
            frequency_hz,
            relative_error: 0.0,
        }
    }

    pub(crate) fn true_hz(&self) -> f64 {
        self.frequency_hz * (1.0 + self.relative_error)
    }
}

/// The internal oscillator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InternalClock {
    /// True frequency at 25 °C, Hz: 35 MHz to 55 MHz, typically 43.4 MHz (datasheet 6.5).
    pub frequency_hz: f64,
    /// Temperature coefficient of the frequency, relative per kelvin: −13·10⁻⁶ in the mean
    /// (datasheet 6.5).
    pub relative_per_kelvin: f64,
}

impl InternalClock {
    pub(crate) fn at(&self, temperature_c: f64) -> f64 {
        self.frequency_hz * (1.0 + self.relative_per_kelvin * (temperature_c - 25.0))
    }
}

impl Default for InternalClock {
    fn default() -> Self {
        Self {
            frequency_hz: 43.4e6,
            relative_per_kelvin: -13e-6,
        }
    }
}

/// Counting and noise of conversions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conversions {
    /// Whether words are computed from whole counts M/N, as in silicon, or from the exact ratio.
    pub quantised: bool,
    /// Delay of the falling edge after the rising one, as a fraction of the sensor's period between
    /// 0 and 1, for [`crate::Counter::TwoGates`]. Recorded words fit 0.15 to 0.4 equally well and
    /// an even duty, 0.5, less well; the default is 0.2.
    pub falling_edge: f64,
    /// White noise of the sensor's frequency: relative standard deviation in a conversion of 1 ms
    /// at an amplitude of 1.2 V or more. It is proportional to 1/√tC for a conversion time tC, and
    /// below 1.2 V it is inversely proportional to the amplitude. Default 10⁻⁶ (guess; quantisation
    /// at 40 MHz and 1 ms is 7·10⁻⁶).
    pub noise_at_1ms: f64,
    /// Number of panels of five-point Gauss–Lobatto quadrature over a conversion, 1 to 255: one
    /// panel reduces a disturbance whose period is the panel's length to 1.4·10⁻³ of its amplitude.
    /// Default 2.
    pub panels: u8,
    /// Time from the end of a conversion to the activation of the next channel in autoscan
    /// (datasheet equation 8). For a single channel see [`Switches::overhead`].
    pub switch_delay: Overhead,
}

impl Default for Conversions {
    fn default() -> Self {
        Self {
            quantised: true,
            falling_edge: 0.2,
            noise_at_1ms: 1e-6,
            panels: 2,
            switch_delay: Overhead::EQUATION_8,
        }
    }
}

impl Conversions {
    pub(crate) fn core(&self, switches: &Switches) -> Core {
        Core {
            counter: switches.counter,
            start_up: StartUp::of(switches.counter),
            falling_edge: self.falling_edge,
        }
    }
}

/// Effects of the drive current and of the amplitude on the sensor's frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorDrive {
    /// Relative shift of the frequency for each step of the drive code, counted from code 0. The
    /// datasheet mentions "an output code offset when the current drive is changed" (8.1.5); its
    /// size, 2·10⁻⁶, is a guess.
    pub shift_per_code: f64,
    /// Relative shift of the frequency per volt of amplitude above 1.8 V, where the input clamps
    /// (datasheet 8.1.5; the size, −10⁻³, is a guess).
    pub clamp_shift_per_volt: f64,
    /// Relative shift of the frequency at zero amplitude. While the oscillation builds up, the
    /// shift is proportional to the missing fraction of the settled amplitude (guess, −10⁻³).
    pub settling_shift: f64,
    /// Peak amplitude below which the oscillation stops, V: 0.6 V (datasheet 8.1.5) or 0.5 V
    /// (SNOA950).
    pub least_amplitude_v: f64,
    /// Current of the high-current drive of channel 0, ampere: above 3.5 mA (datasheet 8.1.5.5), or
    /// 3 mA (SNOA950).
    pub high_current_a: f64,
}

impl Default for SensorDrive {
    fn default() -> Self {
        Self {
            shift_per_code: 2e-6,
            clamp_shift_per_volt: -1e-3,
            settling_shift: -1e-3,
            least_amplitude_v: 0.6,
            high_current_a: 3.5e-3,
        }
    }
}

/// All parameters of one simulated chip.
///
/// ```
/// use ldc161x_sim::{ExternalClock, Settings};
///
/// let settings = Settings {
///     seed: 7,
///     external_clock: Some(ExternalClock { relative_error: 20e-6, ..ExternalClock::exact(40e6) }),
///     ..Settings::default()
/// };
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Chip type.
    pub part: PartNumber,
    /// Level of the ADDR pin: low selects address 0x2A, high 0x2B.
    pub address_pin_high: bool,
    /// Seed of the random numbers: equal seeds and equal calls give equal bytes.
    pub seed: u64,
    /// Temperature of the chip, °C; it affects the internal oscillator.
    pub temperature_c: f64,
    /// Internal oscillator; it always is the clock of the start-up and of the watchdog.
    pub internal_clock: InternalClock,
    /// The clock at CLKIN; `None` if the pin is tied to ground.
    pub external_clock: Option<ExternalClock>,
    /// Time from SD low, or from the return of the supply, to an answer on the bus: 2 ms at most
    /// (datasheet 6.5).
    pub wake_up: Time,
    /// Time after which the watchdog acts on a silent sensor or reference in single-channel mode:
    /// 5.2 ms (datasheet 6.5, SNOA959 3.3) with an internal oscillator of 43.4 MHz; inversely
    /// proportional to the oscillator's true frequency.
    pub watchdog_s: f64,
    /// Parameters of the counter and its noise.
    pub conversions: Conversions,
    /// Effects of drive current and amplitude.
    pub drive: SensorDrive,
    /// Unsettled properties of the silicon: the selected position of each switch.
    pub switches: Switches,
}

impl Default for Settings {
    /// An LDC1614 at 0x2A with an exact 40 MHz clock at CLKIN and all switches at their defaults.
    fn default() -> Self {
        Self {
            part: PartNumber::default(),
            address_pin_high: false,
            seed: 0x1614,
            temperature_c: 25.0,
            internal_clock: InternalClock::default(),
            external_clock: Some(ExternalClock::exact(40e6)),
            wake_up: Time::from_ms(2),
            watchdog_s: 5.2e-3,
            conversions: Conversions::default(),
            drive: SensorDrive::default(),
            switches: Switches::default(),
        }
    }
}

impl Settings {
    /// Settings without noise, without quantisation and without shift by the drive: words are the
    /// exact ratio, so that a test can compute them by hand. All other settings have their
    /// defaults.
    #[must_use]
    pub fn ideal() -> Self {
        Self {
            conversions: Conversions {
                quantised: false,
                noise_at_1ms: 0.0,
                ..Conversions::default()
            },
            drive: SensorDrive {
                shift_per_code: 0.0,
                clamp_shift_per_volt: 0.0,
                settling_shift: 0.0,
                ..SensorDrive::default()
            },
            ..Self::default()
        }
    }

    pub(crate) fn internal_hz(&self) -> f64 {
        self.internal_clock.at(self.temperature_c)
    }

    /// Time after which the watchdog acts, s.
    pub(crate) fn watchdog(&self) -> f64 {
        self.watchdog_s * 43.4e6 / self.internal_hz()
    }

    /// Length of the start-up after sleep, s: 16 384 periods of the internal oscillator (7.4.2).
    pub(crate) fn start_up(&self) -> f64 {
        16_384.0 / self.internal_hz()
    }
}
