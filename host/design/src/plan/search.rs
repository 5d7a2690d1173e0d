//! Search for the best train within the limits of heat, contact time and converter.

use palpate_sim::electrical::reference_limits;
use palpate_simulate::instrument::supply_limit_a;
use palpate_wire::command::Settings;
use rayon::prelude::*;

use super::bench::{PlannedBench, Unplannable};
use super::chip::Conversions;
use super::expected::PlannedPress;
use super::heat::TrainHeat;
use super::sensor::PlannedSensor;

/// The varied figures of a train. Rise and hold are fixed: they give the elastomer the same memory
/// and lag on all ramps, which this model does not contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrainChoice {
    /// Falling ramps.
    pub(crate) ramps: u8,
    /// Duration of a fall, s.
    pub(crate) fall_s: f32,
    /// Conversions a second.
    pub(crate) rate_hz: u16,
    /// Peak of the current, A.
    pub(crate) peak_a: f32,
}

/// Values that the search tries for ramps, duration of a fall, rate and peak current. No fall is
/// shorter than 40 ms: an elastomer with a lag of 10 ms would not settle. No rate is below 1 kHz,
/// although slower conversions have less noise: at 250 Hz the errors of 13 sensors at the bench's
/// temperature were 1.3 to 1.4 times those at 1 kHz, and two more presses were refused, since the
/// current bends within a conversion.
const RAMPS: [u8; 6] = [6, 8, 12, 16, 20, 24];
const FALLS_S: [f32; 3] = [0.04, 0.06, 0.1];
const RATES_HZ: [u16; 2] = [1_000, 2_000];
const PEAKS_A: [f32; 3] = [8.0, 10.0, 12.0];

/// Multiple of the allowed energy beyond which the errors of a train are not computed.
const FAR: f64 = 1.5;

/// Loads, c_L/c_S, at which trains are compared.
pub(crate) const COMPARED: [f64; 3] = [0.2, 1.0, 5.0];

/// The limit that a train exceeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TrainLimit {
    /// More energy into the coil than the settings allow.
    Energy,
    /// Copper hotter than the settings allow.
    Heat,
    /// Longer than the contact time.
    ContactTime,
    /// The converter or its bus.
    Chip,
    /// Supply or bridge cannot drive the peak.
    Current,
    /// Too few conversions for a line, or no signal.
    NoSignal,
}

impl TrainLimit {
    /// Name for text and JSON.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::Heat => "coil_temperature",
            Self::ContactTime => "contact_time",
            Self::Chip => "chip",
            Self::Current => "current",
            Self::NoSignal => "no_signal",
        }
    }
}

/// A train with its heat and errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RatedTrain {
    pub(crate) choice: TrainChoice,
    pub(crate) rcount: u16,
    pub(crate) heat: TrainHeat,
    /// Standard errors of ln(c_L) at [`COMPARED`].
    pub(crate) errors_ln: [f64; COMPARED.len()],
}

impl RatedTrain {
    /// Mean of the logarithms of the errors; less is better.
    pub(crate) fn score(&self) -> f64 {
        let logarithms = self.errors_ln.iter().map(|error| error.ln());
        logarithms.sum::<f64>() / COMPARED.len() as f64
    }
}

/// A row of the comparison: the best allowed train of a kind, and what prevents a better one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ComparedTrain {
    /// The varied figure, `default` or `all`.
    pub(crate) change: &'static str,
    pub(crate) train: RatedTrain,
    /// Limit that a better train of this kind exceeds; `None` where no train is better.
    pub(crate) limit: Option<TrainLimit>,
}

/// Sensor and limits for the comparison of trains.
pub(crate) struct TrainSearch<'s> {
    pub(crate) sensor: &'s PlannedSensor,
    pub(crate) press: PlannedPress,
    /// Time for which the load stays pressed for a train, s.
    pub(crate) contact_s: f64,
}

impl TrainSearch<'_> {
    /// Returns the default train, the best change of each figure alone, and the best of all.
    pub(crate) fn compare(&self) -> Result<Vec<ComparedTrain>, TrainLimit> {
        let settings = &self.sensor.settings;
        let default = TrainChoice {
            ramps: settings.ramps,
            fall_s: settings.ramp_s,
            rate_hz: settings.rate_hz as u16,
            peak_a: settings.peak_current_a,
        };
        let with = |change: &dyn Fn(&mut TrainChoice)| {
            let mut choice = default;
            change(&mut choice);
            choice
        };
        let ramps: Vec<_> = RAMPS.iter().map(|of| with(&|c| c.ramps = *of)).collect();
        let falls: Vec<_> = FALLS_S.iter().map(|of| with(&|c| c.fall_s = *of)).collect();
        let rates: Vec<_> = RATES_HZ
            .iter()
            .map(|of| with(&|c| c.rate_hz = *of))
            .collect();
        let peaks: Vec<_> = PEAKS_A.iter().map(|of| with(&|c| c.peak_a = *of)).collect();
        let start = self.rated(&default)?;
        self.allowed(&start)?;
        let mut compared = vec![ComparedTrain {
            change: "default",
            train: start,
            limit: None,
        }];
        let kinds = [
            ("ramps", ramps),
            ("fall", falls),
            ("rate", rates),
            ("peak", peaks),
            ("all", all()),
        ];
        for (change, choices) in kinds {
            compared.push(self.best(change, &start, &choices));
        }
        Ok(compared)
    }

    /// Returns the best allowed train of `choices` and `start`, and the limit of the next better.
    fn best(
        &self,
        change: &'static str,
        start: &RatedTrain,
        choices: &[TrainChoice],
    ) -> ComparedTrain {
        let rated: Vec<(TrainChoice, Result<RatedTrain, TrainLimit>)> = choices
            .par_iter()
            .map(|choice| (*choice, self.rated(choice)))
            .collect();
        let rated = || rated.iter().filter_map(|(_, train)| train.as_ref().ok());
        let better = |one: &&RatedTrain, other: &&RatedTrain| one.score().total_cmp(&other.score());
        let allowed = rated().filter(|train| self.allowed(train).is_ok());
        let train = allowed.chain([start]).min_by(better).unwrap_or(start);
        let beyond = rated().filter(|of| of.score() < train.score() && self.allowed(of).is_err());
        // Of the better trains that are not allowed, the next one has the smallest energy.
        let next = beyond.min_by(|one, other| one.heat.energy_j.total_cmp(&other.heat.energy_j));
        ComparedTrain {
            change,
            train: *train,
            limit: next.and_then(|next| self.allowed(next).err()),
        }
    }

    pub(super) fn settings(&self, choice: &TrainChoice) -> Settings {
        Settings {
            ramps: choice.ramps,
            ramp_s: choice.fall_s,
            rate_hz: choice.rate_hz.into(),
            peak_current_a: choice.peak_a,
            ..self.sensor.settings.clone()
        }
    }

    /// Rates a train without checking the limits of the instrument.
    fn rated(&self, choice: &TrainChoice) -> Result<RatedTrain, TrainLimit> {
        let settings = self.settings(choice);
        let heat = TrainHeat::of(&settings, &self.sensor.plant.thermal);
        // The errors of trains far beyond the limit are not computed.
        if heat.energy_j > FAR * f64::from(settings.greatest_energy_j) {
            return Err(TrainLimit::Energy);
        }
        if settings.validate().is_err() || heat.lasts_s > reference_limits().on_time_s.into() {
            return Err(TrainLimit::ContactTime);
        }
        let white = self.sensor.plant.ldc.white_noise_relative;
        let conversions =
            Conversions::at(choice.rate_hz.into(), white).map_err(|_| TrainLimit::Chip)?;
        let bench = PlannedBench::new(self.sensor, &settings, conversions);
        let bench = bench.map_err(|_: Unplannable| TrainLimit::NoSignal)?;
        let errors_ln = bench.standard_errors_ln(COMPARED, &self.press);
        Ok(RatedTrain {
            choice: *choice,
            rcount: conversions.rcount,
            heat,
            errors_ln: errors_ln.ok_or(TrainLimit::NoSignal)?,
        })
    }

    /// Checks that a train exceeds no limit of the instrument.
    fn allowed(&self, train: &RatedTrain) -> Result<(), TrainLimit> {
        let settings = &self.sensor.settings;
        let supply_a = supply_limit_a(&self.sensor.plant);
        let within = |is: bool, limit: TrainLimit| if is { Ok(()) } else { Err(limit) };
        let TrainHeat {
            energy_j,
            hottest_c,
            lasts_s,
        } = train.heat;
        within(
            f64::from(train.choice.peak_a) <= supply_a.min(reference_limits().setpoint_a.into()),
            TrainLimit::Current,
        )?;
        within(
            energy_j <= settings.greatest_energy_j.into(),
            TrainLimit::Energy,
        )?;
        within(
            hottest_c <= settings.greatest_temperature_c.into(),
            TrainLimit::Heat,
        )?;
        within(lasts_s <= self.contact_s, TrainLimit::ContactTime)
    }
}

/// All tried trains.
fn all() -> Vec<TrainChoice> {
    let mut choices = Vec::new();
    for ramps in RAMPS {
        for fall_s in FALLS_S {
            for rate_hz in RATES_HZ {
                choices.extend(PEAKS_A.map(|peak_a| TrainChoice {
                    ramps,
                    fall_s,
                    rate_hz,
                    peak_a,
                }));
            }
        }
    }
    choices
}
