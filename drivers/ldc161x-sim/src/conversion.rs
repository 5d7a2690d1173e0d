//! One conversion: from a varying frequency to a word.

use crate::counter::{Counts, DividedSignal, Ratio, exact_ratio};
use crate::drive::{AMPLITUDE_HIGH_V, AMPLITUDE_LOW_V};
use crate::errors::Errors;
use crate::random::Random;
use crate::sensor::{Sensors, Window};
use crate::settings::Settings;
use crate::switches::Deglitch33;
use crate::time::{Moment, Time};

/// Largest word, 0xFFF_FFFF: it means over-range.
pub(crate) const OVER_RANGE_WORD: u32 = (1 << 28) - 1;

/// Ground truth of one finished conversion, for a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueConversion {
    /// Channel, 0 to 3.
    pub channel: u8,
    /// Number of earlier conversions of this channel since the chip was created.
    pub number: u64,
    /// Time at which the counter's gate opens.
    pub start: Time,
    /// Time at which the counter's gate closes: the result is available, and INTB falls.
    pub end: Time,
    /// Mean of [`Sensors::frequency_hz`] from `start` to `end`, Hz.
    pub sensor_hz: f64,
    /// Mean frequency at the comparator, Hz: the sensor's frequency with the shifts by drive, clamp
    /// and settling, with noise and with external pulling. The word encodes this frequency.
    pub oscillation_hz: f64,
    /// True reference frequency after FREF_DIVIDERx, Hz.
    pub reference_hz: f64,
    /// Peak amplitude at the start of the conversion, V.
    pub amplitude_v: f64,
    /// Drive-current code in use, 0 to 31.
    pub drive_code: u8,
    /// The counts M and N; both zero if quantisation is off or no edge was counted.
    pub counts: Counts,
    /// The 28-bit word in DATAx, after subtraction of OFFSETx.
    pub word: u32,
    /// Errors of the conversion, whether or not ERROR_CONFIG reports them.
    pub errors: Errors,
    /// Whether the count is wrong although the chip reports no error: a register was written during
    /// the conversion, or the deglitch filter is slower than the sensor.
    pub spoilt: bool,
}

/// Frequency of a sensor over a time window, Hz: at its start, in the mean, and at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sweep {
    pub(crate) first: f64,
    pub(crate) mean: f64,
    pub(crate) last: f64,
}

impl Sweep {
    /// Integrates the frequency by composite five-point Gauss–Lobatto quadrature: exact for
    /// polynomials of degree 7 in each panel. Its nodes include both ends of the window, where the
    /// frequency gives the times of the first and the last edge.
    pub(crate) fn over(
        sensors: &impl Sensors,
        channel: u8,
        start_s: f64,
        length_s: f64,
        panels: u8,
    ) -> Self {
        let at = |time_s| oscillating(sensors.frequency_hz(usize::from(channel), time_s));
        let panels = u32::from(panels.max(1));
        let half_s = 0.5 * length_s / f64::from(panels);
        let first = at(start_s);
        let (mut left, mut sum) = (first, 0.0);
        for panel in 0..panels {
            let centre_s = start_s + half_s * f64::from(2 * panel + 1);
            let right = at(centre_s + half_s);
            let inner = at(centre_s - INNER_NODE * half_s) + at(centre_s + INNER_NODE * half_s);
            sum +=
                END_WEIGHT * (left + right) + INNER_WEIGHT * inner + CENTRE_WEIGHT * at(centre_s);
            left = right;
        }
        Self {
            first,
            mean: sum / (2.0 * f64::from(panels)),
            last: left,
        }
    }

    fn scaled(self, factor: f64) -> Self {
        Self {
            first: self.first * factor,
            mean: self.mean * factor,
            last: self.last * factor,
        }
    }

    /// Adds the cycles by which external pulling advances the oscillation to the mean frequency.
    /// The frequency at both ends is not changed: it is off by about 10⁻⁵ at most, which affects
    /// only the times of the first and the last edge.
    fn pulled(self, sensors: &impl Sensors, channel: u8, start_s: f64, length_s: f64) -> Self {
        let window = Window {
            start_s,
            length_s,
            free_hz: self.mean,
        };
        if self.mean <= 0.0 {
            return self;
        }
        let cycles = sensors.pulled_cycles(usize::from(channel), &window);
        if cycles.is_finite() {
            Self {
                mean: self.mean + cycles / length_s,
                ..self
            }
        } else {
            self
        }
    }

    fn silenced(self, silent: bool) -> Self {
        self.scaled(if silent { 0.0 } else { 1.0 })
    }
}

/// Position √(3/7) of the inner nodes of five-point Gauss–Lobatto quadrature.
const INNER_NODE: f64 = 0.654_653_670_707_977_2;
// Weights of the nodes of the quadrature.
const END_WEIGHT: f64 = 0.1;
const INNER_WEIGHT: f64 = 49.0 / 90.0;
const CENTRE_WEIGHT: f64 = 32.0 / 45.0;

/// The frequency, or zero if it is not positive or not finite.
fn oscillating(frequency_hz: f64) -> f64 {
    if frequency_hz > 0.0 && frequency_hz.is_finite() {
        frequency_hz
    } else {
        0.0
    }
}

/// Registers and clocks at the start of a conversion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gate {
    pub(crate) channel: u8,
    pub(crate) start: Moment,
    pub(crate) end: Moment,
    pub(crate) rcount: u16,
    pub(crate) offset: u16,
    pub(crate) sensor_divider: u16,
    pub(crate) deglitch: u8,
    pub(crate) reference_hz: f64,
    pub(crate) drive_code: u8,
    /// Peak amplitude at the start of the conversion, V.
    pub(crate) amplitude_v: f64,
    /// Peak amplitude that the drive current sustains after settling, V.
    pub(crate) settled_v: f64,
    /// Whether a register was written during the conversion.
    pub(crate) disturbed: bool,
}

impl Gate {
    /// Length of the gate in reference periods: 16 RCOUNT, but at least 16, so that every
    /// conversion takes time.
    pub(crate) fn clocks(&self) -> f64 {
        16.0 * f64::from(self.rcount.max(1))
    }

    /// Computes the result of the conversion. `phase` is the phase of the divided sensor signal at
    /// the start, in cycles; it is advanced to the end of the conversion.
    pub(crate) fn measure(
        &self,
        settings: &Settings,
        sensors: &impl Sensors,
        phase: &mut f64,
        random: &mut Random,
    ) -> TrueConversion {
        let length_s = self.clocks() / self.reference_hz;
        let sensor = Sweep::over(
            sensors,
            self.channel,
            self.start.seconds(),
            length_s,
            settings.conversions.panels,
        );
        let stopped = self.amplitude_v < settings.drive.least_amplitude_v;
        let shift = self.shift(settings) + self.noise(settings, length_s, random);
        let free = sensor.scaled(1.0 + shift).silenced(stopped);
        let oscillation = free.pulled(sensors, self.channel, self.start.seconds(), length_s);
        let bandwidth_hz = deglitch_hz(self.deglitch, settings.switches.deglitch_33);
        let slow_filter = oscillation.mean >= bandwidth_hz;
        let spoilt = slow_filter || self.disturbed;

        let seen = oscillation.scaled(self.share_seen(oscillation.mean, bandwidth_hz, random));
        let signal = self.signal(seen, *phase, length_s);
        *phase = fraction(signal.phase + signal.cycles);
        let (counts, ratio) = self.count(settings, signal);
        let (word, errors) = offset_word(ratio, self.offset);
        TrueConversion {
            channel: self.channel,
            number: 0,
            start: self.start.time(),
            end: self.end.time(),
            sensor_hz: sensor.mean,
            oscillation_hz: oscillation.mean,
            reference_hz: self.reference_hz,
            amplitude_v: if sensor.first > 0.0 && !stopped {
                self.amplitude_v
            } else {
                0.0
            },
            drive_code: self.drive_code,
            counts,
            word,
            errors,
            spoilt,
        }
    }

    /// Relative shift of the frequency by drive, input clamp and settling.
    fn shift(&self, settings: &Settings) -> f64 {
        let drive = &settings.drive;
        let above_v = (self.amplitude_v - AMPLITUDE_HIGH_V).max(0.0);
        let missing = (1.0 - self.amplitude_v / self.settled_v.max(1e-9)).max(0.0);
        drive.shift_per_code * f64::from(self.drive_code)
            + drive.clamp_shift_per_volt * above_v
            + drive.settling_shift * missing
    }

    /// Relative noise of the mean frequency: white, so it is inversely proportional to the square
    /// root of the conversion time.
    fn noise(&self, settings: &Settings, length_s: f64, random: &mut Random) -> f64 {
        if settings.conversions.noise_at_1ms <= 0.0 {
            return 0.0;
        }
        let faint = (AMPLITUDE_LOW_V / self.amplitude_v.max(0.1)).max(1.0);
        settings.conversions.noise_at_1ms * faint * libm::sqrt(1e-3 / length_s) * random.normal()
    }

    /// Fraction of the edges that reach the counter. A deglitch filter slower than the sensor
    /// swallows some of them (datasheet 8.1.7 only requires that it is faster; how many are lost is
    /// a guess). In the model, a register write during the conversion also loses edges.
    fn share_seen(&self, oscillation_hz: f64, bandwidth_hz: f64, random: &mut Random) -> f64 {
        let mut share = 1.0;
        if oscillation_hz >= bandwidth_hz {
            share *= bandwidth_hz / oscillation_hz * (0.8 + 0.2 * random.uniform());
        }
        if self.disturbed {
            share *= 0.5 + 0.5 * random.uniform();
        }
        share
    }

    /// The sensor's signal after FIN_DIVIDERx; a divider of zero passes no edges.
    fn signal(&self, seen: Sweep, phase: f64, length_s: f64) -> DividedSignal {
        let divided = match self.sensor_divider {
            0 => seen.scaled(0.0),
            divider => seen.scaled(1.0 / f64::from(divider)),
        };
        DividedSignal {
            phase,
            cycles: divided.mean * length_s,
            first_rate: divided.first / self.reference_hz,
            last_rate: divided.last / self.reference_hz,
        }
    }

    fn count(&self, settings: &Settings, signal: DividedSignal) -> (Counts, Ratio) {
        if self.rcount < settings.switches.rcount_minimum.value() {
            return (Counts::default(), Ratio::Zero);
        }
        if !settings.conversions.quantised {
            let ratio = exact_ratio(signal.cycles / self.clocks());
            return (Counts::default(), ratio);
        }
        let core = settings.conversions.core(&settings.switches);
        let counts = signal.count(core, self.clocks());
        (counts, counts.ratio())
    }
}

/// The word after subtraction of OFFSETx, whose unit is 2⁻¹⁶ of the reference frequency (datasheet
/// equation 6).
fn offset_word(ratio: Ratio, offset: u16) -> (u32, Errors) {
    let offset = u32::from(offset) << 12;
    match ratio {
        Ratio::Zero if offset > 0 => (0, Errors::ZERO_COUNT | Errors::UNDER_RANGE),
        Ratio::Zero => (0, Errors::ZERO_COUNT),
        Ratio::FullScale => (OVER_RANGE_WORD, Errors::OVER_RANGE),
        Ratio::Word(word) => match word.checked_sub(offset) {
            Some(word) => (word.min(OVER_RANGE_WORD), Errors::NONE),
            None => (0, Errors::UNDER_RANGE),
        },
    }
}

/// Bandwidth of the deglitch filter, Hz (datasheet tables 28 and 45). A reserved code selects the
/// narrowest filter (guess).
fn deglitch_hz(code: u8, widest: Deglitch33) -> f64 {
    match (code, widest) {
        (0b111, Deglitch33::Code111) | (0b011, Deglitch33::Code011) => 33e6,
        (0b101, _) => 10e6,
        (0b100, _) => 3.3e6,
        _ => 1e6,
    }
}

/// Fractional part of a phase in cycles.
pub(crate) fn fraction(cycles: f64) -> f64 {
    let fraction = cycles - libm::floor(cycles);
    if fraction.is_finite() { fraction } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(frequency: impl Fn(f64) -> f64, panels: u8) -> Sweep {
        Sweep::over(&|_: usize, time: f64| frequency(time), 0, 0.0, 1e-3, panels)
    }

    #[test]
    fn the_mean_of_a_ramp_and_of_a_septic_is_exact() {
        let ramp = sweep(|t| 3e6 + 1e8 * t, 1);
        assert!((ramp.mean - 3.05e6).abs() < 1e-6);
        assert_eq!((ramp.first, ramp.last), (3e6, 3.1e6));
        let septic = sweep(|t| 1e6 + 8e6 * libm::pow(t / 1e-3, 7.0), 1);
        assert!((septic.mean - 2e6).abs() < 1e-5, "{}", septic.mean);
    }

    #[test]
    fn one_cycle_per_panel_averages_out() {
        let swing = 1e4;
        for panels in [1, 2, 4] {
            let cycles = f64::from(panels);
            let wave = |t: f64| 3e6 + swing * libm::cos(core::f64::consts::TAU * cycles * t / 1e-3);
            let error = sweep(wave, panels).mean - 3e6;
            assert!(error.abs() < 1.4e-3 * swing, "{panels} panels: {error} Hz");
        }
    }

    #[test]
    fn what_is_no_frequency_counts_as_silence() {
        for bad in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
            assert_eq!(sweep(|_| bad, 2).mean, 0.0);
        }
    }

    #[test]
    fn the_offset_is_subtracted_in_sixteenths_of_a_bit() {
        let word = |offset| offset_word(Ratio::Word(0x123_4567), offset);
        assert_eq!(word(0x0000), (0x123_4567, Errors::NONE));
        assert_eq!(word(0x1000), (0x023_4567, Errors::NONE));
        assert_eq!(word(0x1235), (0, Errors::UNDER_RANGE));
        assert_eq!(offset_word(Ratio::FullScale, 9).0, 0xFFF_FFFF);
        let both = Errors::ZERO_COUNT | Errors::UNDER_RANGE;
        assert_eq!(offset_word(Ratio::Zero, 9), (0, both));
    }

    #[test]
    fn the_two_tables_of_the_deglitch_filter_differ_at_33_mhz() {
        for (code, table_28, table_45) in [
            (0b001, 1e6, 1e6),
            (0b100, 3.3e6, 3.3e6),
            (0b101, 10e6, 10e6),
            (0b111, 33e6, 1e6),
            (0b011, 1e6, 33e6),
            (0b000, 1e6, 1e6),
        ] {
            assert_eq!(deglitch_hz(code, Deglitch33::Code111), table_28);
            assert_eq!(deglitch_hz(code, Deglitch33::Code011), table_45);
        }
    }
}
