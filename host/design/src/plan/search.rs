//! The best train within what heat, contact time and converter allow.

use palpate_sim::electrical::reference_limits;
use palpate_wire::command::Settings;
use rayon::prelude::*;

use super::bench::{PlannedBench, Unplannable};
use super::chip::Conversions;
use super::expected::PlannedPress;
use super::heat::TrainHeat;
use super::sensor::PlannedSensor;

/// What of a train is chosen. Rise and hold stay: memory and lag of the elastomer are the same on all ramps by them, which these
/// figures do not contain.
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

/// What is tried of each. Falls shorter than 40 ms are not: an elastomer that follows 10 ms late would still be on its way. Slower
/// conversions are not either: their noise is less, but at 250 Hz the errors of 13 sensors at the bench's temperature were 1.3 to 1.4
/// times those at 1 kHz, and two more presses were refused, since the current bends within a conversion.
const RAMPS: [u8; 6] = [6, 8, 12, 16, 20, 24];
const FALLS_S: [f32; 3] = [0.04, 0.06, 0.1];
const RATES_HZ: [u16; 2] = [1_000, 2_000];
const PEAKS_A: [f32; 3] = [8.0, 10.0, 12.0];

/// Share of what the supply can push through the warm coil that the peak may take, and the warm coil as a multiple of its
/// resistance at rest, as on the bench (host/simulate/src/instrument.rs).
const OF_SUPPLY: f64 = 0.95;
const WARM: f64 = 1.2;

/// How many times the energy that is allowed a train may take to be named as what a limit stands in the way of.
const FAR: f64 = 1.5;

/// Loads, c_L/c_S, at which trains are compared.
pub(crate) const COMPARED: [f64; 3] = [0.2, 1.0, 5.0];

/// What stands in the way of a train.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TrainLimit {
    /// More energy into the coil than the settings allow.
    Energy,
    /// Copper hotter than the settings allow.
    Heat,
    /// Longer than the contact.
    ContactTime,
    /// The converter or its bus.
    Chip,
    /// Supply or bridge cannot drive the peak.
    Current,
    /// Too few conversions for a line, or no signal.
    NoSignal,
}

impl TrainLimit {
    /// In words, and in JSON.
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

/// A train with what it comes to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RatedTrain {
    pub(crate) choice: TrainChoice,
    pub(crate) rcount: u16,
    pub(crate) heat: TrainHeat,
    /// Standard errors of ln(c_L) at [`COMPARED`].
    pub(crate) errors_ln: [f64; COMPARED.len()],
}

impl RatedTrain {
    /// Mean of the logarithms of the errors: less is better.
    pub(crate) fn score(&self) -> f64 {
        let logarithms = self.errors_ln.iter().map(|error| error.ln());
        logarithms.sum::<f64>() / COMPARED.len() as f64
    }
}

/// A line of the comparison: a train, with what stands in the way of the next better one of its kind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ComparedTrain {
    /// What is changed.
    pub(crate) change: &'static str,
    pub(crate) train: RatedTrain,
    /// The limit that a better train of the same kind breaks; nothing where none is better.
    pub(crate) limit: Option<TrainLimit>,
}

/// What a train is judged by.
pub(crate) struct TrainSearch<'s> {
    pub(crate) sensor: &'s PlannedSensor,
    pub(crate) press: PlannedPress,
    /// How long the load stays pressed for a train, s.
    pub(crate) contact_s: f64,
}

impl TrainSearch<'_> {
    /// The default train, the best change of each of its figures alone, and the best of all.
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

    /// The best allowed of these trains, `start` among them, and what stands in the way of the best of all.
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
        // The one that breaks the limit by the least comes next.
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

    /// What a train comes to, whether it is allowed or not.
    fn rated(&self, choice: &TrainChoice) -> Result<RatedTrain, TrainLimit> {
        let settings = self.settings(choice);
        let heat = TrainHeat::of(&settings, &self.sensor.plant.thermal);
        // What is far beyond the limits need not be computed.
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

    /// Whether the instrument drives a train.
    fn allowed(&self, train: &RatedTrain) -> Result<(), TrainLimit> {
        let settings = &self.sensor.settings;
        let current = &self.sensor.plant.current;
        let resistance_ohm = WARM * self.sensor.plant.thermal.resistance_ohm;
        let supply_a = OF_SUPPLY * current.limit_a(resistance_ohm);
        let within = |is: bool, limit: TrainLimit| if is { Ok(()) } else { Err(limit) };
        let TrainHeat {
            energy_j,
            hottest_c,
            lasts_s,
        } = train.heat;
        within(
            f64::from(train.choice.peak_a) <= supply_a.min(reference_limits().current_a.into()),
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

/// Every train that is tried.
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
