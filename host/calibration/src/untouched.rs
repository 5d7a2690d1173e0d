//! Check of the cross-talk in use, by a train without a press.
//!
//! The coil's field on the sensing layer adds X I^2 to a reading. If X has changed by a relative
//! amount e since the calibration, either the field acts on the layer differently, or the true
//! current differs from the measured one. In the second case the stiffening, also proportional to
//! the square of the current, has changed by e as well. A train without a press cannot separate the
//! two cases: X is corrected, and e becomes a standard uncertainty of the rise. A press onto a
//! known spring (`check`) then determines the case.
//!
//! The comparison is with the bench's own train, not with the X of the calibration, since the
//! calibration adjusts X to the presses too, and differs from the untouched sensor by up to 5 %.

use palpate_wire::Command;
use palpate_wire::command::{Crosstalk, Settings, StiffeningCurve};

use super::least_squares::System;
use super::samples::{Fallen, SampleRun};
use super::session::Run;
use super::unchecked::{MOST_CHANGE, MOST_DEVIATION, Unchecked};

/// A calibration corrected by a train without a press.
#[derive(Clone, Debug, PartialEq)]
pub struct Untouched {
    /// Commands that set it.
    pub commands: Vec<Command>,
    /// Relative change of the cross-talk.
    pub change: f64,
    /// Standard error of `change`.
    pub standard_error: f64,
    /// Whether the change is significant, so that the calibration was corrected.
    pub corrected: bool,
}

/// Relative standard uncertainty of the cross-talk, in quadrature with the scatter of the falls:
/// the untouched reading drifts with warming, and a train's fit takes the drift as linear.
/// Determined with 24 trains on 12 unchanged simulated sensors of the design `ultrasoft` from seed
/// 710001, half of them 30 K warmer: the changes found are at most 2.1 standard errors, without
/// this constant 3.3.
const OF_WARMING: f64 = 1e-3;
/// Greatest drift of the untouched reading over a train, relative to the cross-talk at the peak: in
/// the 24 trains of [`OF_WARMING`] it is 0.006 at most. A change of contact exceeds the limit.
const MOST_DRIFT: f64 = 0.2;
/// A train must contain at least this part of the falls that the settings request.
const LEAST_FALLS: f64 = 0.5;

/// The bench's own train without a press, for comparison.
#[derive(Clone, Copy, Debug)]
pub struct OnTheBench<'r> {
    /// Data of the train, recorded on the bench.
    pub run: &'r Run,
    /// Commands of the calibration from the bench, before any check.
    pub commands: &'r [Command],
}

/// Checks a calibration, given as the commands that set it, by the recorded run of a train without
/// a press.
///
/// # Errors
/// If a part of the calibration or a train is missing, the bench belongs to another calibration,
/// something touched the sensor, or the cross-talk has changed by more than [`MOST_CHANGE`].
pub fn check_untouched(
    commands: &[Command],
    bench: OnTheBench<'_>,
    run: &Run,
) -> Result<Untouched, Unchecked> {
    let (calibrated, in_force) = (Calibrated::of(bench.commands)?, Calibrated::of(commands)?);
    // Exact equality: no other sensor has the same frequency to the last digit.
    if calibrated.rest_hz != in_force.rest_hz {
        return Err(Unchecked::OtherSession);
    }
    let before = Added::by(bench.run, in_force.settings)?;
    let now = Added::by(run, in_force.settings)?;
    // Correction of the cross-talk by earlier checks.
    let corrected_before = in_force.apparent_m_per_a2 / calibrated.apparent_m_per_a2;
    let change = now.per_a2 / before.per_a2 / corrected_before - 1.0;
    let scatter = now.standard_error.hypot(before.standard_error) / before.per_a2;
    let standard_error = scatter.hypot(OF_WARMING);
    if !change.is_finite() || !standard_error.is_finite() {
        return Err(Unchecked::NotATrain);
    }
    if change.abs() > MOST_CHANGE {
        return Err(Unchecked::OtherField { change });
    }
    let corrected = change.abs() > MOST_DEVIATION * standard_error;
    Ok(Untouched {
        commands: if corrected {
            corrected_by(commands, change)
        } else {
            commands.to_vec()
        },
        change,
        standard_error,
        corrected,
    })
}

/// The needed parts of a calibration.
struct Calibrated<'c> {
    settings: &'c Settings,
    /// Frequency of the untouched sensor on the bench, Hz.
    rest_hz: f64,
    apparent_m_per_a2: f64,
}

impl<'c> Calibrated<'c> {
    fn of(commands: &'c [Command]) -> Result<Self, Unchecked> {
        let (mut settings, mut rest_hz, mut apparent_m_per_a2) = (None, None, None);
        for command in commands {
            match command {
                Command::SetSettings(of) => settings = Some(of),
                Command::SetTank(of) if is_first(of.sensor, of.channel) => {
                    rest_hz = Some(of.rest_frequency_hz);
                }
                Command::SetCrosstalk(of) if is_first(of.sensor, of.channel) => {
                    apparent_m_per_a2 = Some(of.apparent_m_per_a2.into());
                }
                _ => {}
            }
        }
        Ok(Self {
            settings: settings.ok_or(Unchecked::Missing("settings"))?,
            rest_hz: rest_hz.ok_or(Unchecked::Missing("tank"))?,
            apparent_m_per_a2: apparent_m_per_a2.ok_or(Unchecked::Missing("cross-talk"))?,
        })
    }
}

/// Whether a channel is the one that gives the stiffness: the first channel of the first converter.
const fn is_first(sensor: u8, channel: u8) -> bool {
    sensor == 0 && channel == 0
}

/// Splits samples into falls: the current rises between two falls.
fn falls(samples: &[Fallen]) -> Vec<&[Fallen]> {
    samples
        .chunk_by(|before, after| after.current_a < before.current_a)
        .collect()
}

/// Effect of the current on the relative change of inductance.
struct Added {
    /// Relative change of inductance per square of the current, 1/A^2.
    per_a2: f64,
    /// Standard error of `per_a2`, by leaving out one fall after the other (Efron, Ann. Statist. 7,
    /// 1979, p. 1: the jackknife).
    standard_error: f64,
    /// Relative change of inductance over the train that does not depend on the current.
    drift: f64,
}

impl Added {
    /// Evaluates a train without a press.
    fn by(run: &Run, settings: &Settings) -> Result<Self, Unchecked> {
        let train = SampleRun::new(run, settings).map_err(|_| Unchecked::NotATrain)?;
        let falls = falls(&train.falls);
        let least = LEAST_FALLS * f64::from(settings.ramps);
        if falls.len() < 2 || (falls.len() as f64) < least {
            return Err(Unchecked::NotATrain);
        }
        let added = Self::of(&falls).ok_or(Unchecked::NotATrain)?;
        let at_peak = added.per_a2 * f64::from(settings.peak_current_a).powi(2);
        if added.drift.abs() > MOST_DRIFT * at_peak.abs() {
            return Err(Unchecked::Touched);
        }
        Ok(added)
    }

    fn of(falls: &[&[Fallen]]) -> Option<Self> {
        let all = fit(falls.iter().copied().flatten())?;
        let without = |left_out: usize| {
            let others = falls.iter().enumerate();
            let others = others.filter(move |(index, _)| *index != left_out);
            fit(others.flat_map(|(_, fall)| fall.iter())).map(|(_, per_a2)| per_a2)
        };
        let count = falls.len() as f64;
        let each: Vec<f64> = (0..falls.len()).map(without).collect::<Option<_>>()?;
        let mean = each.iter().sum::<f64>() / count;
        let squares: f64 = each.iter().map(|of| (of - mean).powi(2)).sum();
        let (first, last) = (falls.first()?.first()?, falls.last()?.last()?);
        Some(Self {
            per_a2: all.1,
            standard_error: (squares * (count - 1.0) / count).sqrt(),
            drift: all.0 * (last.time_s - first.time_s),
        })
    }
}

/// Fits the relative change of inductance: its drift, 1/s, and its slope over the square of the
/// current, 1/A^2.
fn fit<'f>(samples: impl Iterator<Item = &'f Fallen>) -> Option<(f64, f64)> {
    let mut system = System::new(3);
    for sample in samples {
        let row = [1.0, sample.time_s, sample.current_a.powi(2)];
        system.add(row, sample.change, 1.0);
    }
    match system.solve("the cross-talk").ok()?.unknowns.as_slice() {
        [_, drift, per_a2] => Some((*drift, *per_a2)),
        _ => None,
    }
}

/// Commands with another cross-talk, and its change as an uncertainty of the rise.
fn corrected_by(commands: &[Command], change: f64) -> Vec<Command> {
    let corrected = |command: &Command| match command {
        Command::SetCrosstalk(of) if is_first(of.sensor, of.channel) => {
            Command::SetCrosstalk(Crosstalk {
                apparent_m_per_a2: of.apparent_m_per_a2 * (1.0 + change) as f32,
                ..of.clone()
            })
        }
        Command::SetStiffeningCurve(chunk) => Command::SetStiffeningCurve(StiffeningCurve {
            rise_uncertainty: chunk.rise_uncertainty.hypot(change as f32),
            ..chunk.clone()
        }),
        other => other.clone(),
    };
    commands.iter().map(corrected).collect()
}

#[cfg(test)]
mod tests {
    use palpate_sim::random::Stream;
    use palpate_wire::command::{StiffeningKnot, Tank};

    use super::super::session::{BenchSample, Pressed};
    use super::*;

    const REST_HZ: f64 = 3.06e6;
    const PEAK_A: f64 = 10.0;
    /// Effect of the current on the relative change of inductance, 1/A^2: a tenth of a per cent at
    /// the peak.
    const PER_A2: f64 = 1e-5;
    /// Relative noise of a conversion's inductance.
    const NOISE: f64 = 2e-6;
    const APPARENT_M_PER_A2: f64 = 8e-8;
    const RISE_UNCERTAINTY: f32 = 0.01;

    fn settings() -> Settings {
        Settings {
            peak_current_a: PEAK_A as f32,
            ..palpate_sim::native::default_settings()
        }
    }

    fn calibration() -> Vec<Command> {
        vec![
            Command::SetSettings(settings()),
            Command::SetTank(Tank {
                sensor: 0,
                channel: 0,
                capacitance_f: 330e-12,
                rest_frequency_hz: REST_HZ,
            }),
            Command::SetCrosstalk(Crosstalk {
                sensor: 0,
                channel: 0,
                apparent_m_per_a2: APPARENT_M_PER_A2 as f32,
                growth_per_m: 100.0,
                uncertainty: 0.0,
            }),
            Command::SetStiffeningCurve(StiffeningCurve {
                total: 1,
                first: 0,
                rise_uncertainty: RISE_UNCERTAINTY,
                knots: [StiffeningKnot {
                    current_a: 0.0,
                    rise: 0.0,
                }]
                .into_iter()
                .collect(),
            }),
        ]
    }

    /// A train of the default settings on a sensor with the given cross-talk, noise, and drift per
    /// second.
    fn train(per_a2: f64, drift_per_s: f64, noise: &mut dyn FnMut() -> f64) -> Run {
        let settings = settings();
        let (rise_s, hold_s) = (f64::from(settings.rise_s), f64::from(settings.hold_s));
        let fall_s = f64::from(settings.ramp_s);
        let period_s = rise_s + hold_s + fall_s;
        let mut run = Run::new(Pressed::Nothing, 0.0);
        run.began_s = 0.8;
        run.ramps_s = 0.86;
        let end_s = run.ramps_s + period_s * f64::from(settings.ramps);
        for index in 0..(end_s / 1e-3) as u32 {
            let time_s = f64::from(index) * 1e-3;
            let in_train_s = time_s - run.ramps_s;
            let in_ramp_s = in_train_s.rem_euclid(period_s);
            let current_a = if in_train_s < 0.0 {
                0.0
            } else if in_ramp_s < rise_s {
                PEAK_A * in_ramp_s / rise_s
            } else {
                let fallen_s = (in_ramp_s - rise_s - hold_s).max(0.0);
                PEAK_A * (1.0 - fallen_s / fall_s)
            };
            let change =
                per_a2 * current_a * current_a + drift_per_s * in_train_s.max(0.0) + noise();
            run.lines.push(BenchSample {
                time_s,
                frequency_hz: REST_HZ / (1.0 + change).sqrt(),
                current_a,
                gauges_time_s: time_s,
                force_n: None,
                stage_m: None,
            });
        }
        run
    }

    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut stream = Stream::named(seed, "untouched");
        move || NOISE * stream.normal()
    }

    /// Checks a train whose cross-talk is `times` that of the bench.
    fn checked(commands: &[Command], times: f64, seed: u64) -> Result<Untouched, Unchecked> {
        let bench = train(PER_A2, 0.0, &mut noise(2 * seed));
        let now = train(times * PER_A2, 1e-5, &mut noise(2 * seed + 1));
        let calibration = calibration();
        let bench = OnTheBench {
            run: &bench,
            commands: &calibration,
        };
        check_untouched(commands, bench, &now)
    }

    /// Cross-talk, m/A^2, and uncertainty of the rise.
    fn set(commands: &[Command]) -> (f64, f64) {
        let apparent_m_per_a2 = Calibrated::of(commands).unwrap().apparent_m_per_a2;
        let uncertainty = commands.iter().find_map(|command| match command {
            Command::SetStiffeningCurve(of) => Some(of.rise_uncertainty),
            _ => None,
        });
        (apparent_m_per_a2, uncertainty.unwrap().into())
    }

    #[test]
    fn what_has_not_changed_is_left_as_it_is() {
        let checked = checked(&calibration(), 1.0, 1).unwrap();
        assert!(!checked.corrected, "{checked:?}");
        assert_eq!(checked.commands, calibration());
    }

    #[test]
    fn a_change_is_taken_over_and_is_an_uncertainty_of_the_rise() {
        for times in [0.8, 0.96, 1.04, 1.25] {
            let checked = checked(&calibration(), times, 2).unwrap();
            assert!(checked.corrected);
            assert!((checked.change + 1.0 - times).abs() < 5e-3, "{checked:?}");
            let (apparent_m_per_a2, uncertainty) = set(&checked.commands);
            let expected = APPARENT_M_PER_A2 * (1.0 + checked.change);
            assert!((apparent_m_per_a2 / expected - 1.0).abs() < 1e-6);
            let expected = f64::from(RISE_UNCERTAINTY).hypot(checked.change);
            assert!((uncertainty / expected - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_same_change_is_corrected_once() {
        let first = checked(&calibration(), 1.1, 3).unwrap();
        let second = checked(&first.commands, 1.1, 4).unwrap();
        assert!(!second.corrected, "{second:?}");
        assert_eq!(second.commands, first.commands);
        // A second check corrects only the additional change.
        let third = checked(&first.commands, 1.1 * 1.05, 5).unwrap();
        assert!((third.change - 0.05).abs() < 5e-3, "{third:?}");
    }

    /// 300 trains that differ by noise alone.
    #[test]
    fn the_standard_error_is_what_trains_scatter_by() {
        const TRAINS: u64 = 300;
        let mut squares = 0.0;
        for seed in 0..TRAINS {
            let checked = checked(&calibration(), 1.0, 100 + seed).unwrap();
            let scatter = (checked.standard_error.powi(2) - OF_WARMING.powi(2)).sqrt();
            squares += (checked.change / scatter).powi(2);
        }
        let ratio = (squares / TRAINS as f64).sqrt();
        // A jackknife of twelve falls has t-like tails.
        assert!((0.85..1.25).contains(&ratio), "{ratio}");
    }

    #[test]
    fn what_is_no_such_train_is_refused() {
        let refused = |times| checked(&calibration(), times, 6).unwrap_err();
        assert!(matches!(refused(1.5), Unchecked::OtherField { change } if change > 0.4));
        assert!(refused(0.5).to_string().contains("iron"));

        let calibration = calibration();
        let bench = train(PER_A2, 0.0, &mut noise(1));
        let held_against = |commands, now: &Run| {
            let bench = OnTheBench {
                run: &bench,
                commands: &calibration,
            };
            check_untouched(commands, bench, now).unwrap_err()
        };
        // Contact and a growing press, ten times the effect of the current.
        let touched = train(PER_A2, 100.0 * PER_A2 * PEAK_A, &mut noise(2));
        assert_eq!(held_against(&calibration, &touched), Unchecked::Touched);
        // The current stays off, or half of the samples are missing.
        let mut still = bench.clone();
        still.lines.iter_mut().for_each(|line| line.current_a = 0.0);
        assert_eq!(held_against(&calibration, &still), Unchecked::NotATrain);
        let mut half = bench.clone();
        half.lines.truncate(bench.lines.len() / 2);
        assert_eq!(held_against(&calibration, &half), Unchecked::NotATrain);

        let mut other = calibration.clone();
        for command in &mut other {
            if let Command::SetTank(of) = command {
                of.rest_frequency_hz += 1.0;
            }
        }
        assert_eq!(held_against(&other, &bench), Unchecked::OtherSession);
        let missing = held_against(&calibration[..1], &bench);
        assert_eq!(missing, Unchecked::Missing("tank"));
    }
}
