//! What errors of a train's readings make of the load that its line gives.
//!
//! With W = 1 + kappa + g, kappa = c_S/c_L and g = c_S/c_D0, the reading x on the falls follows
//! 1/x = (W + s(I)) (1 + d phi(t) + e t)/X, where the signal s is the stiffening h with the attraction. A line through 1/x
//! against s, beside a logarithmic and a straight drift, gives kappa. s' is the part of s that is orthogonal to a constant
//! and to both drifts, and P(e) = sum(s' e)/sum(s'^2) the projection of an error e of each sample onto it. To first order,
//!
//! | error | of kappa |
//! |---|---|
//! | e of the readings, by parts | W^2 P(e) |
//! | e of the signal | W P(e) |
//! | u of c_S/c_D0 by parts, h as it is | -g u |

use palpate_wire::command::Settings;

use super::chip::Conversions;
use super::sensor::PlannedSensor;

/// From the touch to the train in use, s: a press is found steady after two to four tenths of a second, and the coil is tested
/// (docs/decisions/0008-misfit.md).
const SINCE_TOUCH_S: f64 = 0.7;
/// Points of each fall over which signals and errors are summed: four times as many change an error by vibration by 0.7 %, all others
/// by 0.1 %.
const POINTS: u32 = 24;
/// Conversions of a fall that a single ramp needs, for a level, a slope and a drift with one left over.
const LEAST_CONVERSIONS: u32 = 4;
/// Step over the frequencies of vibration, Hz: a train of a second resolves as much.
const VIBRATION_STEP_HZ: f64 = 1.0;

/// A sample of a fall: time since the middle of the first rise, s, and current, A.
type FallPoint = (f64, f64);

/// The line of a train at one deformation.
#[derive(Clone, Debug)]
pub(crate) struct TrainLine {
    points: Vec<FallPoint>,
    /// s'/sum(s'^2) at each sample.
    weights: Vec<f64>,
    /// Deformation of the sensing layer, m.
    pub(crate) deformation_m: f64,
    /// What kappa changes by, over W, for each quantity but c_D0.
    pub(crate) of: Projections,
    /// Variance of P of white noise of the readings, by parts.
    pub(crate) conversions: f64,
    /// The same of a stand that vibrates, times W^2: what it moves the sensing layer by is a W-th of its amplitude.
    pub(crate) vibration: f64,
}

/// Projections P of what the quantities of a calibration do to the falls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projections {
    /// Of h.
    pub(crate) stiffening: f64,
    /// Of an attraction that would press the sensing layer by the working depth at the peak.
    pub(crate) attraction: f64,
    /// Of a cross-talk of the working depth at the peak, by parts of the deformation.
    pub(crate) crosstalk: f64,
    /// Of a cross-talk that grows with the deformation, as large as that itself at the peak.
    pub(crate) growth: f64,
}

impl TrainLine {
    /// The line of a train with these settings at a deformation, m; nothing where its falls have too few conversions.
    pub(crate) fn new(
        sensor: &PlannedSensor,
        settings: &Settings,
        conversions: &Conversions,
        deformation_m: f64,
    ) -> Option<Self> {
        if conversions_of_fall(settings) < LEAST_CONVERSIONS {
            return None;
        }
        let points = fall_points(settings);
        let signal = points.iter().map(|(_, current_a)| {
            sensor.stiffening(*current_a) + sensor.attraction(*current_a, deformation_m)
        });
        let weights = weights(&points, signal.collect())?;
        let mut line = Self {
            points,
            weights,
            deformation_m,
            of: Projections {
                stiffening: 0.0,
                attraction: 0.0,
                crosstalk: 0.0,
                growth: 0.0,
            },
            conversions: 0.0,
            vibration: 0.0,
        };
        let peak_a = f64::from(settings.peak_current_a);
        let square = |current_a: f64| (current_a / peak_a).powi(2);
        let deep = sensor.depth_m / deformation_m;
        line.of = Projections {
            stiffening: line.project(|current_a| sensor.stiffening(current_a)),
            attraction: line.project(|current_a| {
                square(current_a) * deep * (sensor.ratio + sensor.stiffening(current_a))
            }),
            crosstalk: deep * line.project(square),
            growth: line.project(square),
        };
        let squares: f64 = line.weights.iter().map(|weight| weight * weight).sum();
        let each = f64::from(conversions_of_fall(settings)) / f64::from(POINTS);
        let noise_m =
            conversions.relative_sigma * sensor.metres_per_relative_frequency(deformation_m);
        line.conversions = squares / each * (noise_m / deformation_m).powi(2);
        line.vibration = line.of_vibration(sensor);
        Some(line)
    }

    /// P of an error that follows the current, A.
    fn project(&self, error: impl Fn(f64) -> f64) -> f64 {
        let samples = self.points.iter().zip(&self.weights);
        samples
            .map(|((_, current_a), weight)| weight * error(*current_a))
            .sum()
    }

    /// Mean over the frequencies of a stand, and over the phases: P of a sine is as large as the weights' spectrum there.
    fn of_vibration(&self, sensor: &PlannedSensor) -> f64 {
        let (low_hz, high_hz) = sensor.vibration_hz;
        let steps = ((high_hz - low_hz) / VIBRATION_STEP_HZ).ceil().max(1.0) as u32;
        let at =
            |step: u32| low_hz + (high_hz - low_hz) * (f64::from(step) + 0.5) / f64::from(steps);
        let spectrum: f64 = (0..steps).map(|step| self.spectrum(at(step))).sum();
        let amplitude = sensor.vibration_m / self.deformation_m;
        0.5 * amplitude * amplitude * spectrum / f64::from(steps)
    }

    /// Square of the weights' Fourier transform at a frequency, Hz.
    fn spectrum(&self, hertz: f64) -> f64 {
        let omega = core::f64::consts::TAU * hertz;
        let samples = self.points.iter().zip(&self.weights);
        let (cosine, sine) = samples.fold((0.0, 0.0), |(cosine, sine), ((time_s, _), weight)| {
            let (s, c) = (omega * time_s).sin_cos();
            (cosine + weight * c, sine + weight * s)
        });
        cosine * cosine + sine * sine
    }
}

/// Points of each fall, evenly spaced in time and current: sums over the conversions are so many times those over the points.
fn fall_points(settings: &Settings) -> Vec<FallPoint> {
    let [rise_s, hold_s, fall_s] =
        [settings.rise_s, settings.hold_s, settings.ramp_s].map(f64::from);
    let (peak_a, end_a) = (
        f64::from(settings.peak_current_a),
        f64::from(settings.end_current_a),
    );
    let fall = move |ramp: u8| {
        let begins_s = f64::from(ramp) * (rise_s + hold_s + fall_s) + 0.5 * rise_s + hold_s;
        (0..POINTS).map(move |index| {
            let part = (f64::from(index) + 0.5) / f64::from(POINTS);
            (begins_s + part * fall_s, peak_a + (end_a - peak_a) * part)
        })
    };
    (0..settings.ramps).flat_map(fall).collect()
}

/// Conversions that lie within a fall as a whole.
fn conversions_of_fall(settings: &Settings) -> u32 {
    // A fall begins with a conversion; that of 60 ms at 1 kHz has 60, for all that rounding leaves.
    (settings.ramp_s * settings.rate_hz + 1e-3).floor() as u32
}

/// s'/sum(s'^2): the signal without what a constant and both drifts can be of it.
fn weights(points: &[FallPoint], mut signal: Vec<f64>) -> Option<Vec<f64>> {
    let drifts: [fn(f64) -> f64; 3] = [
        |_| 1.0,
        |time_s| (time_s / SINCE_TOUCH_S).ln_1p(),
        |time_s| time_s,
    ];
    let mut orthogonal: Vec<Vec<f64>> = Vec::new();
    for drift in drifts {
        let mut column: Vec<f64> = points.iter().map(|(time_s, _)| drift(*time_s)).collect();
        for other in &orthogonal {
            take_out(&mut column, other);
        }
        orthogonal.push(column);
    }
    for column in &orthogonal {
        take_out(&mut signal, column);
    }
    let square: f64 = signal.iter().map(|value| value * value).sum();
    (square > 0.0).then(|| signal.into_iter().map(|value| value / square).collect())
}

fn take_out(column: &mut [f64], other: &[f64]) {
    let dot = |one: &[f64]| {
        one.iter()
            .zip(other)
            .map(|(one, other)| one * other)
            .sum::<f64>()
    };
    let share = dot(column) / dot(other);
    for (entry, other) in column.iter_mut().zip(other) {
        *entry -= share * other;
    }
}
