//! Error of a load from errors of a train's readings.
//!
//! With kappa = c_S/c_L, g = c_S/c_D0 and W = 1 + kappa + g, the reading x on the falls follows 1/x = (W + s(I)) (1 + d
//! phi(t) + e t)/X. The signal s is the stiffening h with the attraction, X the total travel, d phi a logarithmic drift
//! and e t a straight one. A line through 1/x against s, with both drifts, gives kappa. Let s' be the part of s that is
//! orthogonal to a constant and to both drifts; then P(e) = sum(s' e)/sum(s'^2) projects an error e of each sample onto
//! s'. To first order,
//!
//! | error | error of kappa |
//! |---|---|
//! | relative error e of the readings | W^2 P(e) |
//! | error e of the signal | W P(e) |
//! | relative error u of c_S/c_D0, with the same h | -g u |

use palpate_wire::command::Settings;

use super::chip::Conversions;
use super::sensor::PlannedSensor;

/// Time from the touch to the train in use, s. A press is found steady after two to four tenths of
/// a second, then the coil is tested (docs/decisions/0008-misfit.md).
const SINCE_TOUCH_S: f64 = 0.7;
/// Points per fall in the sums over signals and errors. With four times as many the error from
/// vibration changes by 0.7 %, all others by 0.1 %.
const POINTS: u32 = 24;
/// Smallest number of conversions in a fall: three for the level, the slope and the drift of a
/// single ramp, and one more.
const LEAST_CONVERSIONS: u32 = 4;
/// Step of the frequency in the sum over the vibration, Hz: the resolution of a train of a second.
const VIBRATION_STEP_HZ: f64 = 1.0;

/// A sample of a fall: time since the middle of the first rise, s, and current, A.
type FallPoint = (f64, f64);

/// The line of a train at one deformation.
#[derive(Clone, Debug)]
pub(crate) struct TrainLine {
    points: Vec<FallPoint>,
    /// Weights s'/sum(s'^2) of the samples.
    weights: Vec<f64>,
    /// Deformation of the sensing layer, m.
    pub(crate) deformation_m: f64,
    /// Projections of all quantities except c_D0. The derivatives of kappa are W times these, for
    /// cross-talk and its growth W^2 times.
    pub(crate) of: Projections,
    /// Variance of P for white relative noise of the readings.
    pub(crate) conversions: f64,
    /// W^2 times the variance of P for a vibrating stand: the sensing layer moves by 1/W of the
    /// stand's amplitude.
    pub(crate) vibration: f64,
}

/// Projections P of the effects of a calibration's quantities on the falls.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projections {
    /// Projection of h.
    pub(crate) stiffening: f64,
    /// Projection of an attraction that would deform the sensing layer by the working depth at the
    /// peak.
    pub(crate) attraction: f64,
    /// Projection of a cross-talk of the working depth at the peak, relative to the deformation.
    pub(crate) crosstalk: f64,
    /// Projection of a cross-talk proportional to the deformation, and equal to it at the peak.
    pub(crate) growth: f64,
}

impl TrainLine {
    /// Computes the line of a train with these settings at a deformation, m; `None` where its falls
    /// have too few conversions.
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

    /// Projection P of an error that depends on the current, A.
    fn project(&self, error: impl Fn(f64) -> f64) -> f64 {
        let samples = self.points.iter().zip(&self.weights);
        samples
            .map(|((_, current_a), weight)| weight * error(*current_a))
            .sum()
    }

    /// Mean square of P over frequencies and phases of the stand's vibration, from the spectrum of
    /// the weights at each frequency.
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

/// Points of each fall, evenly spaced in time and current. They stand for its conversions: sums
/// over points and sums over conversions are proportional.
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

/// Number of complete conversions within a fall.
fn conversions_of_fall(settings: &Settings) -> u32 {
    // A fall starts with a conversion. The added 1e-3 gives 60 for 60 ms at 1 kHz despite rounding.
    (settings.ramp_s * settings.rate_hz + 1e-3).floor() as u32
}

/// Weights s'/sum(s'^2): the signal, orthogonalised to a constant and both drifts.
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
