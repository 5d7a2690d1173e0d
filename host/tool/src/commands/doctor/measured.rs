//! What a board measures of its coil, its sensor and its supply.

use palpate_cli::failure::Failure;
use palpate_simulate::instrument;
use palpate_wire::code::{FaultCode, Outcome, Part};
use palpate_wire::command::{ClearFault, DriveCoil, Settings};
use palpate_wire::record::{CoilTest, Sample, Status};
use palpate_wire::{Command, Record};

use super::examination::is_set;
use crate::board::link::{KEEP_ALIVE_S, Link, Reported};
use crate::commands::acceptance::Promise;

/// Number of readings of the supply at rest, and the time between two, s.
const READINGS: usize = 40;
const BETWEEN_S: f64 = 0.02;
/// Longest wait for the self-test, s; it takes at most a fifth of a second.
const TEST_S: f64 = 2.0;
/// Held current, A, unless the settings' peak is less, and the times until it has settled and for which it is
/// measured, s.
const HELD_A: f32 = 3.0;
const SETTLES_S: f64 = 0.05;
const HOLD_S: f64 = 0.2;
/// Part of a drift measurement at either end over which frequencies are averaged.
const ENDS: f64 = 0.1;

/// Readings of a board.
#[derive(Clone, Debug, Default)]
pub(super) struct Measured {
    pub(super) supply_v: Vec<f64>,
    pub(super) temperature_c: Option<f64>,
    /// Frequency and its standard uncertainty by the data sheet, Hz, at rest.
    pub(super) frequencies_hz: Vec<(f64, f64)>,
    /// Conversions with an error flag.
    pub(super) flagged: usize,
    pub(super) lost: u32,
    /// Current without drive, A.
    pub(super) resting_a: Vec<f64>,
    /// Result of the self-test, or why there is none.
    pub(super) coil: Option<Result<CoilTest, String>>,
    pub(super) held: Option<Held>,
    pub(super) drift: Option<Drift>,
}

/// A held current.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Held {
    pub(super) to_a: f64,
    pub(super) currents_a: Vec<f64>,
    /// Ripple as the board computes it, A rms.
    pub(super) ripple_a: Option<f64>,
}

/// Frequencies at the beginning and the end of a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drift {
    pub(super) time_s: f64,
    pub(super) from_hz: f64,
    pub(super) to_hz: f64,
}

impl Measured {
    /// Measures a disarmed board: at rest, with its coil's test, with a held current, and over `drift_s`.
    ///
    /// The board gets the coil's data of the design if it has none, and stores nothing.
    pub(super) fn of(
        link: &mut Link,
        promise: &Promise,
        settings: &Settings,
        drift_s: f64,
    ) -> Result<Self, Failure> {
        let mut measured = Self::default();
        measured.rest(link)?;
        measured.drive(link, promise, settings)?;
        link.send_accepted(&Command::Disarm)?;
        link.take();
        link.collect(drift_s)?;
        measured.drift = drift(&link.take_records(), drift_s);
        Ok(measured)
    }

    fn rest(&mut self, link: &mut Link) -> Result<(), Failure> {
        link.take();
        for _ in 0..READINGS {
            link.send_accepted(&Command::Identify)?;
            link.collect(BETWEEN_S)?;
        }
        let mut before = None;
        for (_, record) in link.take_records() {
            match record {
                Record::Status(status) => {
                    self.lost =
                        status.conversions_lost - *before.get_or_insert(status.conversions_lost);
                    self.enter_status(&status);
                }
                Record::Sample(sample) if sample.sensor == 0 => self.enter_sample(&sample),
                _ => {}
            }
        }
        Ok(())
    }

    fn enter_status(&mut self, status: &Status) {
        self.supply_v.extend(status.supply_v.map(f64::from));
        self.temperature_c = status.temperature_c.map(f64::from);
    }

    fn enter_sample(&mut self, sample: &Sample) {
        self.resting_a.extend(sample.current_a.map(f64::from));
        let Some(conversion) = sample.channels.first() else {
            return;
        };
        self.frequencies_hz
            .push((conversion.frequency_hz, conversion.sigma_hz.into()));
        self.flagged += usize::from(conversion.word >> 28 != 0);
    }

    /// Arms the board, which tests the coil, and holds a current.
    fn drive(
        &mut self,
        link: &mut Link,
        promise: &Promise,
        settings: &Settings,
    ) -> Result<(), Failure> {
        if !is_set(link, Part::Coil)? {
            let coil = instrument::coil(&promise.plant);
            link.send_accepted(&Command::SetCoil(coil))?;
        }
        link.take();
        let (_, outcome) = link.ask(&Command::Arm)?;
        if outcome != Outcome::Accepted {
            self.coil = Some(Err(format!(
                "arming was refused: {outcome}. {}",
                outcome.meaning().trim()
            )));
            return Ok(());
        }
        let tested = self_test(link)?;
        let is_sound = tested.is_ok();
        self.coil = Some(tested);
        if is_sound {
            let to_a = HELD_A.min(settings.peak_current_a);
            self.held = hold(link, to_a)?;
        }
        Ok(())
    }
}

/// Waits for the result of the coil's test. A fault that the test finds is cleared, since nothing else is to be
/// left behind on the board.
fn self_test(link: &mut Link) -> Result<Result<CoilTest, String>, Failure> {
    let mut left_s = TEST_S;
    while left_s > 0.0 {
        link.collect(KEEP_ALIVE_S)?;
        left_s -= KEEP_ALIVE_S;
        for (_, record) in link.take_records() {
            match record {
                Record::CoilTest(test) => return Ok(Ok(test)),
                Record::Fault(fault) if fault.active => {
                    link.send_accepted(&Command::Disarm)?;
                    link.ask(&Command::ClearFault(ClearFault { code: fault.code }))?;
                    return Ok(Err(fault_text(fault.code)));
                }
                _ => {}
            }
        }
    }
    Ok(Err("the board sent no result of its self-test".to_owned()))
}

fn fault_text(code: FaultCode) -> String {
    format!("the self-test ended with {code}: {}", code.meaning().trim())
}

fn hold(link: &mut Link, to_a: f32) -> Result<Option<Held>, Failure> {
    let drive = DriveCoil {
        to_a,
        over_s: 1e-3,
        trace_interval_s: 0.0,
    };
    let (_, outcome) = link.ask(&Command::DriveCoil(drive))?;
    if outcome != Outcome::Accepted {
        return Ok(None);
    }
    link.drive_on(SETTLES_S)?;
    link.take();
    link.drive_on(HOLD_S)?;
    let samples: Vec<Sample> = link.take_records().into_iter().filter_map(sample).collect();
    link.send_accepted(&Command::Abort)?;
    let currents_a: Vec<f64> = samples
        .iter()
        .filter_map(|of| of.current_a.map(f64::from))
        .collect();
    let ripple_a = samples.last().and_then(|of| of.ripple_a.map(f64::from));
    Ok((!currents_a.is_empty()).then_some(Held {
        to_a: to_a.into(),
        currents_a,
        ripple_a,
    }))
}

fn sample((_, record): Reported) -> Option<Sample> {
    match record {
        Record::Sample(sample) if sample.sensor == 0 => Some(sample),
        _ => None,
    }
}

/// Means of the frequency over the first and the last tenth of the records.
fn drift(records: &[Reported], time_s: f64) -> Option<Drift> {
    let frequencies: Vec<f64> = records
        .iter()
        .filter_map(|(_, record)| match record {
            Record::Sample(sample) if sample.sensor == 0 => {
                Some(sample.channels.first()?.frequency_hz)
            }
            _ => None,
        })
        .collect();
    let count = (ENDS * frequencies.len() as f64).ceil() as usize;
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    (count > 0).then(|| Drift {
        time_s,
        from_hz: mean(&frequencies[..count]),
        to_hz: mean(&frequencies[frequencies.len() - count..]),
    })
}
