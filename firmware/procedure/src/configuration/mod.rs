//! Active settings and calibration.
//!
//! Commands set them. Each command is checked as a whole before any part of it is applied. Curves come
//! in chunks and take effect with their last knot. Values are stored in the form that the model computes
//! with. Readback records are made from these values, so there is no second copy that could differ.

mod array;
mod assembly;
mod checksum;
mod parts;
mod readback;
mod stiffening;

use palpate_model::calibration_curve::{CurveError, MonotoneCurve};
use palpate_model::magnetorheological::{Changed, Factors, Saturating, Tabulated};
use palpate_model::units::{Ampere, Celsius, Metre, NewtonPerMetre, Tesla};
use palpate_wire::Command;
use palpate_wire::code::{Drift, Outcome, Part, Stream};
use palpate_wire::command::{
    Attraction, CalibrationIdentity, Coil, ContactTolerance, Creep, Crosstalk, CurrentCorrection,
    MAX_KNOTS, Settings, Springs, Stiffening, StiffeningCurve, Tank, TemperatureCoefficients,
    TemperatureEffect, Tip, TouchArray,
};

use crate::answer::{Answer, field};
use crate::{BoardInfo, Limits, touch};
pub(crate) use array::ActiveArray;
use assembly::{Assembly, Target};
#[cfg(test)]
pub(crate) use checksum::tests;
pub(crate) use parts::ITEMS;
use parts::touches_the_identity;
pub(crate) use readback::Cursor;
pub use stiffening::Law;

/// A calibration curve.
pub type Curve = MonotoneCurve<{ MAX_KNOTS as usize }>;

/// Active settings and calibration.
#[derive(Clone, Debug)]
pub struct Configuration {
    pub(crate) settings: Settings,
    /// The settings were set by a command.
    settings_are_set: bool,
    channels: [[ChannelCalibration; 4]; 2],
    springs: Option<Springs>,
    stiffening: Option<SetStiffening>,
    coil: Option<Coil>,
    attraction: Option<Attraction>,
    temperature_effect: Option<TemperatureEffect>,
    current_correction: Option<CurrentCorrection>,
    temperature_coefficients: Option<TemperatureCoefficients>,
    /// Stored and reported for hosts.
    tip: Option<Tip>,
    contact: Option<ContactTolerance>,
    creep: Option<Creep>,
    array: Option<ActiveArray>,
    identity: Option<CalibrationIdentity>,
    assembly: Option<Assembly>,
    /// Checksums of all items.
    sums: parts::Sums,
}

/// Calibration of one channel of one converter.
#[derive(Clone, Debug)]
pub(crate) struct ChannelCalibration {
    pub(crate) tank: Option<Tank>,
    /// Deformation as a function of the relative change of inductance.
    pub(crate) curve: Option<Curve>,
    pub(crate) crosstalk: Option<Crosstalk>,
}

/// Calibration of the magnetorheological effect.
#[derive(Clone, Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one of it, and no heap to put the curve on"
)]
enum SetStiffening {
    Law(Stiffening),
    Curve { rise: Curve, uncertainty: f32 },
}

/// Complete calibration of a stiffness measurement.
#[derive(Clone, Debug)]
pub(crate) struct Calibrated {
    /// Largest deformation on the calibrated curve of the measuring channel.
    pub(crate) deepest: Metre,
    /// Springs at the measurement's temperature.
    pub(crate) springs: Springs,
    /// Stiffening at the measurement's temperature.
    pub(crate) law: Changed<Law>,
    /// Relative standard uncertainty of the rise.
    pub(crate) rise_uncertainty: f32,
    pub(crate) coil: Coil,
    pub(crate) attraction: Attraction,
    pub(crate) crosstalk: Crosstalk,
    pub(crate) temperature_effect: Option<TemperatureEffect>,
    /// Coefficients that correct springs and rise for the measured temperature. `temperature_effect`
    /// gives the uncertainty of this correction or, without coefficients, of the change itself.
    pub(crate) temperature_coefficients: Option<TemperatureCoefficients>,
    /// Contacts for which the interval holds; `None` for the calibrated contact alone.
    pub(crate) contact: Option<ContactTolerance>,
    /// Temperature of the measurement, if there is a thermometer.
    pub(crate) temperature: Option<Celsius>,
}

/// Settings of a new device, reduced to its board's limits: one channel at 1 kHz, sensing, and a train
/// of twelve ramps of 60 ms.
///
/// The model's precision figures hold for this train. Its falling ramps are short to limit the effect of
/// creep. Hold and ramp are several times the lag of the softest elastomers (10 ms). The other figures
/// are for the sensor design `ultrasoft`: its readings of 1 ms scatter by 0.06 um at rest.
pub const DEFAULT_SETTINGS: Settings = Settings {
    channels: 0b0001,
    rate_hz: 1_000.0,
    stream: Stream::Samples,
    decimation: 1,
    status_period_s: 1.0,
    contact_noise_m: 2e-7,
    release_m: 5e-6,
    least_press_m: 50e-6,
    steady_m_per_s: 50e-6,
    settling_s: 3.0,
    automatic: false,
    peak_current_a: 10.0,
    end_current_a: 0.0,
    rise_s: 0.01,
    hold_s: 0.03,
    ramps: 12,
    ramp_s: 0.06,
    drift: Drift::Logarithmic,
    drift_time_s: 0.5,
    greatest_error: 0.5,
    load_points: 8,
    greatest_temperature_c: 80.0,
    greatest_energy_j: 40.0,
};

impl ChannelCalibration {
    /// No calibration.
    #[inline(always)]
    pub(crate) const fn none() -> Self {
        Self {
            tank: None,
            curve: None,
            crosstalk: None,
        }
    }
}

impl Default for Configuration {
    // Inlined: the compiler then writes the fields to their place. As a value of its own, a configuration
    // takes five kilobytes of stack.
    #[inline(always)]
    fn default() -> Self {
        let none = ChannelCalibration::none;
        let four = || [none(), none(), none(), none()];
        Self {
            settings: DEFAULT_SETTINGS,
            settings_are_set: false,
            channels: [four(), four()],
            springs: None,
            stiffening: None,
            coil: None,
            attraction: None,
            temperature_effect: None,
            current_correction: None,
            temperature_coefficients: None,
            tip: None,
            contact: None,
            creep: None,
            array: None,
            identity: None,
            assembly: None,
            sums: [0; ITEMS],
        }
    }
}

impl Configuration {
    /// Creates the default settings, within the board's limits, without a calibration.
    #[cfg(test)]
    pub(crate) fn new(board: &BoardInfo) -> Self {
        let mut configuration = Self::default();
        configuration.limit_to(board);
        configuration
    }

    /// Returns to the default settings, within the board's limits, without a calibration.
    pub(crate) fn reset(&mut self, board: &BoardInfo) {
        *self = Self::default();
        self.limit_to(board);
    }

    /// Limits the default settings to those of the board.
    pub(crate) fn limit_to(&mut self, board: &BoardInfo) {
        let limits = &board.limits;
        let [first, _] = board.channels;
        let settings = &mut self.settings;
        if let Some(lowest) = 1u8.checked_shl(first.trailing_zeros()) {
            settings.channels = lowest;
        }
        settings.rate_hz = settings.rate_hz.min(limits.rate.0);
        settings.peak_current_a = settings.peak_current_a.min(limits.current.0);
        let greatest_c = limits.temperature.0;
        settings.greatest_temperature_c = settings.greatest_temperature_c.min(greatest_c);
        settings.greatest_energy_j = settings.greatest_energy_j.min(limits.energy_j);
        self.seal_all();
    }

    /// Returns the settings.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns the calibration of a channel.
    pub(crate) fn channel(&self, sensor: u8, channel: u8) -> Option<&ChannelCalibration> {
        self.channels
            .get(usize::from(sensor))?
            .get(usize::from(channel))
    }

    /// Returns the calibration of the two springs, c_S and c_D0.
    pub(crate) const fn springs(&self) -> Option<&Springs> {
        self.springs.as_ref()
    }

    /// Returns the coil's calibration.
    pub(crate) const fn coil(&self) -> Option<&Coil> {
        self.coil.as_ref()
    }

    /// Returns the array of coils.
    pub(crate) const fn array(&self) -> Option<&ActiveArray> {
        self.array.as_ref()
    }

    /// Returns the creep of the layers: that of this sensor or, where it was not calibrated, of any.
    pub(crate) fn creep(&self) -> Creep {
        self.creep.clone().unwrap_or(Creep::TYPICAL)
    }

    /// Returns the stated tolerance of the contact's place, m; `None` if there is none.
    pub(crate) fn contact_within_m(&self) -> Option<f32> {
        let within_m = self.contact.as_ref()?.within_m;
        (within_m > 0.0).then_some(within_m)
    }

    /// Returns the correction of the current measurement.
    pub(crate) const fn current_correction(&self) -> Option<&CurrentCorrection> {
        self.current_correction.as_ref()
    }

    /// Gives tests write access to the coil.
    #[cfg(test)]
    pub(crate) const fn coil_mut(&mut self) -> Option<&mut Coil> {
        self.coil.as_mut()
    }

    /// Returns the channel of the first converter that determines touch and stiffness: the lowest active
    /// one.
    pub(crate) const fn principal(&self) -> u8 {
        self.settings.channels.trailing_zeros() as u8
    }

    /// Returns the largest deformation on the principal channel's calibrated curve.
    pub(crate) fn deepest(&self) -> Option<Metre> {
        let curve = self.channel(0, self.principal())?.curve.as_ref()?;
        let deformations_m = curve.points().map(|(_, deformation_m)| deformation_m);
        deformations_m.reduce(f32::max).map(Metre)
    }

    /// Applies a command as a whole or not at all. Returns `None` for a command that sets no part.
    pub(crate) fn set(&mut self, command: &Command, board: &BoardInfo) -> Option<Answer> {
        let answer = match command {
            Command::SetSettings(settings) => self.set_settings(settings, board),
            Command::SetTouchArray(chunk) => self.set_touch_array(chunk, board),
            _ => self.take(command, board)?.into(),
        };
        // While a curve is incomplete, the configuration has not changed.
        if answer == Outcome::Accepted.into() && self.assembly.is_none() {
            self.keep_identity_with(command);
            self.seal(command);
        }
        Some(answer)
    }

    /// Removes the identity if a command sets another part, which changes the calibration.
    fn keep_identity_with(&mut self, command: &Command) {
        if touches_the_identity(command) && !matches!(command, Command::SetCalibrationIdentity(_)) {
            self.identity = None;
        }
    }

    fn take(&mut self, command: &Command, board: &BoardInfo) -> Option<Outcome> {
        Some(match command {
            Command::SetTank(tank) => {
                let tank = tank.clone();
                self.on_channel(tank.sensor, tank.channel, board, |to| to.tank = Some(tank))
            }
            Command::SetCrosstalk(crosstalk) => {
                let crosstalk = crosstalk.clone();
                let (sensor, channel) = (crosstalk.sensor, crosstalk.channel);
                self.on_channel(sensor, channel, board, |to| to.crosstalk = Some(crosstalk))
            }
            Command::SetDeformationCurve(chunk) => {
                let (sensor, channel) = (chunk.sensor, chunk.channel);
                if !has(board, sensor, channel) {
                    return Some(Outcome::NoSuchChannel);
                }
                let knots = chunk.knots.iter();
                let knots = knots.map(|knot| (knot.inductance_change, knot.deformation_m));
                let target = Target::Deformation { sensor, channel };
                self.assemble(target, chunk.total, chunk.first, knots)
            }
            Command::SetSprings(springs) => {
                self.springs = Some(springs.clone());
                Outcome::Accepted
            }
            Command::SetStiffening(stiffening) => match law(stiffening) {
                Some(_) => {
                    self.stiffening = Some(SetStiffening::Law(stiffening.clone()));
                    Outcome::Accepted
                }
                None => Outcome::OutOfRange,
            },
            Command::SetStiffeningCurve(chunk) => self.set_stiffening_curve(chunk),
            Command::SetCoil(coil) => {
                self.coil = Some(coil.clone());
                Outcome::Accepted
            }
            Command::SetAttraction(attraction) => {
                self.attraction = Some(attraction.clone());
                Outcome::Accepted
            }
            Command::SetTemperatureEffect(effect) => {
                self.temperature_effect = Some(effect.clone());
                Outcome::Accepted
            }
            Command::SetCurrentCorrection(correction) => {
                self.current_correction = Some(correction.clone());
                Outcome::Accepted
            }
            Command::SetTemperatureCoefficients(coefficients) => {
                self.temperature_coefficients = Some(coefficients.clone());
                Outcome::Accepted
            }
            Command::SetTip(tip) => {
                self.tip = Some(tip.clone());
                Outcome::Accepted
            }
            Command::SetContact(tolerance) => {
                self.contact = Some(tolerance.clone());
                Outcome::Accepted
            }
            Command::SetCreep(creep) => {
                self.creep = Some(creep.clone());
                Outcome::Accepted
            }
            Command::SetCalibrationIdentity(identity) => {
                if identity.hash != self.calibration_crc() {
                    return Some(Outcome::OtherCalibration);
                }
                self.identity = Some(identity.clone());
                Outcome::Accepted
            }
            _ => return None,
        })
    }

    fn set_settings(&mut self, settings: &Settings, board: &BoardInfo) -> Answer {
        let [first, second] = board.channels;
        if settings.channels & !(first | second) != 0 || settings.channels & first == 0 {
            return Outcome::NoSuchChannel.into();
        }
        // Settings that an earlier version accepted and stored may have channels that fail this check.
        if settings.check_channels().is_err() {
            return Outcome::Inconsistent.into();
        }
        if let Err(answer) = within(settings, &board.limits) {
            return answer;
        }
        self.settings = settings.clone();
        self.settings_are_set = true;
        Outcome::Accepted.into()
    }

    fn set_stiffening_curve(&mut self, chunk: &StiffeningCurve) -> Outcome {
        let knots = chunk.knots.iter().map(|knot| (knot.current_a, knot.rise));
        let target = Target::Stiffening {
            uncertainty: chunk.rise_uncertainty,
        };
        self.assemble(target, chunk.total, chunk.first, knots)
    }

    fn set_touch_array(&mut self, chunk: &TouchArray, board: &BoardInfo) -> Answer {
        let (pairs, _) = chunk.numbers.as_chunks::<2>();
        let pairs = pairs.iter().map(|[one, other]| (*one, *other));
        match self.collect(Target::Array, chunk.total / 2, chunk.first / 2, pairs) {
            Err(outcome) => outcome.into(),
            Ok(None) => Outcome::Accepted.into(),
            Ok(Some(whole)) => match touch::read(whole.points(), board) {
                Ok(array) => {
                    self.array = Some(array);
                    Outcome::Accepted.into()
                }
                Err(answer) => answer,
            },
        }
    }

    fn on_channel(
        &mut self,
        sensor: u8,
        channel: u8,
        board: &BoardInfo,
        set: impl FnOnce(&mut ChannelCalibration),
    ) -> Outcome {
        let index = self.channels.get_mut(usize::from(sensor));
        match index.and_then(|of| of.get_mut(usize::from(channel))) {
            Some(to) if has(board, sensor, channel) => {
                set(to);
                Outcome::Accepted
            }
            _ => Outcome::NoSuchChannel,
        }
    }

    /// Adds a chunk to the curve being received, and applies the curve when it is complete.
    fn assemble(
        &mut self,
        target: Target,
        total: u8,
        first: u8,
        knots: impl Iterator<Item = (f32, f32)>,
    ) -> Outcome {
        let assembly = match self.collect(target, total, first, knots) {
            Ok(Some(assembly)) => assembly,
            Ok(None) => return Outcome::Accepted,
            Err(outcome) => return outcome,
        };
        match Curve::new(assembly.points()) {
            Ok(curve) => self.take_curve(target, curve),
            Err(CurveError::NotMonotone { .. }) => Outcome::NotMonotone,
            Err(CurveError::NotIncreasing { .. }) => Outcome::NotIncreasing,
            Err(CurveError::NotFinite { .. }) => Outcome::NotFinite,
            Err(CurveError::TooFew { .. } | CurveError::TooMany { .. }) => Outcome::OutOfSequence,
        }
    }

    /// Adds a chunk to what is being received, and returns it when it is complete.
    fn collect(
        &mut self,
        target: Target,
        total: u8,
        first: u8,
        points: impl Iterator<Item = (f32, f32)>,
    ) -> Result<Option<Assembly>, Outcome> {
        let begun = match self.assembly.take() {
            _ if first == 0 => Assembly::new(target, total),
            Some(begun) if begun.continues(target, total, first) => begun,
            _ => return Err(Outcome::OutOfSequence),
        };
        let assembly = begun.with(points).ok_or(Outcome::OutOfSequence)?;
        if assembly.is_complete() {
            return Ok(Some(assembly));
        }
        self.assembly = Some(assembly);
        Ok(None)
    }

    fn take_curve(&mut self, target: Target, curve: Curve) -> Outcome {
        match target {
            Target::Deformation { sensor, channel } => {
                let index = self.channels.get_mut(usize::from(sensor));
                let Some(to) = index.and_then(|of| of.get_mut(usize::from(channel))) else {
                    return Outcome::NoSuchChannel;
                };
                to.curve = Some(curve);
            }
            Target::Stiffening { uncertainty } => {
                self.stiffening = Some(SetStiffening::Curve {
                    rise: curve,
                    uncertainty,
                });
            }
            Target::Array => return Outcome::OutOfSequence,
        }
        Outcome::Accepted
    }

    /// Returns the calibration of a stiffness measurement, or the kind of the first missing record.
    pub(crate) fn calibrated(&self, temperature: Option<Celsius>) -> Result<Calibrated, u8> {
        let principal = self.principal();
        let channel = self.channel(0, principal);
        let kind = Part::number;
        let missing_curve = kind(Part::DeformationCurve);
        let channel = channel.ok_or(missing_curve)?;
        let deepest = self.deepest().ok_or(missing_curve)?;
        let mut springs = self.springs.clone().ok_or(kind(Part::Springs))?;
        let at_rest = NewtonPerMetre(springs.actuated_n_per_m);
        let set = self.stiffening.as_ref().ok_or(kind(Part::Stiffening))?;
        let (law, rise_uncertainty) = match set {
            SetStiffening::Law(set) => (
                law_of(set, at_rest).ok_or(kind(Part::Stiffening))?,
                set.rise_uncertainty,
            ),
            SetStiffening::Curve { rise, uncertainty } => (
                Tabulated::new(at_rest, *rise)
                    .map(Law::Tabulated)
                    .map_err(|_| kind(Part::Springs))?,
                *uncertainty,
            ),
        };
        let by = self.factors(temperature);
        springs.sensing_n_per_m *= by.springs;
        Ok(Calibrated {
            deepest,
            springs,
            law: Changed { law, by },
            rise_uncertainty,
            coil: self.coil.clone().ok_or(kind(Part::Coil))?,
            attraction: self.attraction.clone().ok_or(kind(Part::Attraction))?,
            crosstalk: channel.crosstalk.clone().ok_or(kind(Part::Crosstalk))?,
            temperature_effect: self.temperature_effect.clone(),
            temperature_coefficients: self.temperature_coefficients.clone(),
            contact: self.contact.clone(),
            temperature,
        })
    }

    /// Returns the largest possible difference between the sensor's temperature and that of its
    /// calibration, K. If either is unknown, returns the largest difference in a room around 25 degrees
    /// Celsius.
    pub(crate) fn away_k(&self, temperature: Option<Celsius>) -> f32 {
        const ROOM_K: f32 = 15.0;
        let known = self.temperature_effect.as_ref().zip(temperature);
        known.map_or(ROOM_K, |(effect, Celsius(now_c))| {
            (now_c - effect.calibrated_at_c).abs()
        })
    }

    /// Returns the factors of springs and rise at a temperature relative to the calibration.
    fn factors(&self, temperature: Option<Celsius>) -> Factors {
        let known = self.temperature_effect.as_ref();
        let known = known.zip(self.temperature_coefficients.as_ref());
        let Some(((effect, of), now)) = known.zip(temperature) else {
            return Factors::NONE;
        };
        Factors::at(
            now.0 - effect.calibrated_at_c,
            of.springs_per_k,
            of.rise_per_k,
        )
    }
}

/// Checks settings against the board's limits; every range that a board limits starts at zero.
fn within(settings: &Settings, limits: &Limits) -> Result<(), Answer> {
    for (field, value, limit) in [
        (field!(Settings, rate_hz), settings.rate_hz, limits.rate.0),
        (
            field!(Settings, peak_current_a),
            settings.peak_current_a,
            limits.current.0,
        ),
        (
            field!(Settings, greatest_energy_j),
            settings.greatest_energy_j,
            limits.energy_j,
        ),
        (
            field!(Settings, greatest_temperature_c),
            settings.greatest_temperature_c,
            limits.temperature.0,
        ),
    ] {
        if value > limit {
            return Err(Answer::out_of_range(field, value, [0.0, limit]));
        }
    }
    Ok(())
}

/// Returns whether the board has a channel.
fn has(board: &BoardInfo, sensor: u8, channel: u8) -> bool {
    let channels = board.channels.get(usize::from(sensor)).copied();
    channels.is_some_and(|channels| channels.checked_shr(channel.into()).unwrap_or(0) & 1 == 1)
}

/// Returns the stiffening law with a spring of 1 N/m: enough to check the law's own numbers.
fn law(set: &Stiffening) -> Option<Law> {
    law_of(set, NewtonPerMetre(1.0))
}

fn law_of(set: &Stiffening, at_rest: NewtonPerMetre) -> Option<Law> {
    let peak = Ampere(set.peak_current_a);
    Saturating::new(at_rest, set.rise_at_peak, peak)
        .and_then(|law| law.saturating(Tesla(set.field_at_peak_t), Tesla(set.field_half_t)))
        .map(Law::Saturating)
        .ok()
}
