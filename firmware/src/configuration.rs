//! Settings and calibration: held while the power lasts, set by commands, told on request.

use heapless::Vec;
use palpate_wire::code::{Drift, Outcome, Part, Stream};
use palpate_wire::command::{
    Coil, Command, Crosstalk, DeformationCurve, DeformationKnot, GetCalibration, KNOTS_PER_CHUNK,
    Settings, Springs, Stiffening, StiffeningCurve, StiffeningKnot, Tank,
};
use palpate_wire::{Record, configuration_crc};

/// Channels of a converter. There is one converter.
const CHANNELS: usize = 4;
/// Knots of the longest curve.
const KNOTS: usize = 32;
/// Commands that set the largest configuration.
const LARGEST: usize = 1 + CHANNELS + 4 * CHANNELS + CHANNELS + 1 + 4 + 1;

/// What the instrument does until it is told otherwise: one channel, a thousand samples a second,
/// the coil's course of the paper's measurements.
pub const DEFAULT: Settings = Settings {
    channels: 1,
    rate_hz: 1_000.0,
    stream: Stream::Samples,
    decimation: 1,
    status_period_s: 1.0,
    contact_noise_m: 1e-6,
    release_m: 1e-5,
    least_press_m: 5e-5,
    steady_m_per_s: 1e-4,
    settling_s: 2.0,
    automatic: false,
    peak_current_a: 10.0,
    end_current_a: 0.0,
    rise_s: 0.02,
    hold_s: 0.01,
    ramps: 8,
    ramp_s: 0.05,
    drift: Drift::Linear,
    drift_time_s: 1.0,
    greatest_error: 0.2,
    load_points: 0,
    greatest_temperature_c: 60.0,
    greatest_energy_j: 100.0,
};

/// A curve, as it grows chunk by chunk.
struct Curve<K> {
    knots: Vec<K, KNOTS>,
    total: u8,
}

impl<K: Clone> Curve<K> {
    const EMPTY: Self = Self {
        knots: Vec::new(),
        total: 0,
    };

    /// Takes the next chunk; whether it was the next.
    fn append(&mut self, total: u8, first: u8, knots: &[K]) -> bool {
        if first == 0 {
            self.knots.clear();
            self.total = total;
        }
        let follows = usize::from(first) == self.knots.len() && total == self.total;
        let taken = follows && self.knots.extend_from_slice(knots).is_ok();
        if !taken {
            self.knots.clear();
            self.total = 0;
        }
        taken
    }

    fn is_whole(&self) -> bool {
        self.total > 0 && self.knots.len() == usize::from(self.total)
    }
}

/// Everything that commands set.
pub struct Configuration {
    /// How the instrument is used.
    pub settings: Settings,
    was_set: bool,
    tanks: [Option<Tank>; CHANNELS],
    curves: [Curve<DeformationKnot>; CHANNELS],
    growing: Curve<DeformationKnot>,
    crosstalks: [Option<Crosstalk>; CHANNELS],
    springs: Option<Springs>,
    stiffening: Option<Stiffening>,
    stiffening_curve: Curve<StiffeningKnot>,
    growing_stiffening: Curve<StiffeningKnot>,
    rise_uncertainty: f32,
    /// The coil.
    pub coil: Option<Coil>,
}

impl Configuration {
    /// Nothing set.
    pub const fn new() -> Self {
        Self {
            settings: DEFAULT,
            was_set: false,
            tanks: [const { None }; CHANNELS],
            curves: [const { Curve::EMPTY }; CHANNELS],
            growing: Curve::EMPTY,
            crosstalks: [const { None }; CHANNELS],
            springs: None,
            stiffening: None,
            stiffening_curve: Curve::EMPTY,
            growing_stiffening: Curve::EMPTY,
            rise_uncertainty: 0.0,
            coil: None,
        }
    }

    /// Takes a command that sets something; nothing for one that does not.
    pub fn set(&mut self, command: &Command) -> Option<Outcome> {
        let place = |sensor: u8, channel: u8| (sensor == 0).then_some(usize::from(channel));
        Some(match command {
            Command::SetSettings(settings) => {
                self.settings = settings.clone();
                self.was_set = true;
                Outcome::Accepted
            }
            Command::SetTank(tank) => put(&mut self.tanks, place(tank.sensor, tank.channel), tank),
            Command::SetCrosstalk(crosstalk) => put(
                &mut self.crosstalks,
                place(crosstalk.sensor, crosstalk.channel),
                crosstalk,
            ),
            Command::SetDeformationCurve(curve) => self.set_curve(curve),
            Command::SetSprings(springs) => {
                self.springs = Some(springs.clone());
                Outcome::Accepted
            }
            Command::SetStiffening(stiffening) => {
                self.stiffening = Some(stiffening.clone());
                self.stiffening_curve = Curve::EMPTY;
                Outcome::Accepted
            }
            Command::SetStiffeningCurve(curve) => self.set_stiffening_curve(curve),
            Command::SetCoil(coil) => {
                self.coil = Some(coil.clone());
                Outcome::Accepted
            }
            _ => return None,
        })
    }

    fn set_curve(&mut self, chunk: &DeformationCurve) -> Outcome {
        let channel = usize::from(chunk.channel);
        let Some(curve) = self.curves.get_mut(channel).filter(|_| chunk.sensor == 0) else {
            return Outcome::NoSuchChannel;
        };
        if !self.growing.append(chunk.total, chunk.first, &chunk.knots) {
            return Outcome::OutOfSequence;
        }
        if self.growing.is_whole() {
            *curve = core::mem::replace(&mut self.growing, Curve::EMPTY);
        }
        Outcome::Accepted
    }

    fn set_stiffening_curve(&mut self, chunk: &StiffeningCurve) -> Outcome {
        let growing = &mut self.growing_stiffening;
        if !growing.append(chunk.total, chunk.first, &chunk.knots) {
            return Outcome::OutOfSequence;
        }
        if growing.is_whole() {
            self.stiffening_curve = core::mem::replace(growing, Curve::EMPTY);
            self.rise_uncertainty = chunk.rise_uncertainty;
            self.stiffening = None;
        }
        Outcome::Accepted
    }

    /// Tells a part of the calibration, record by record.
    pub fn tell(&self, wanted: &GetCalibration, mut emit: impl FnMut(Record)) -> Outcome {
        let channel = usize::from(wanted.channel);
        let is_of_channel = matches!(
            wanted.part,
            Part::Tank | Part::DeformationCurve | Part::Crosstalk
        );
        if is_of_channel && (wanted.sensor != 0 || channel >= CHANNELS) {
            return Outcome::NoSuchChannel;
        }
        let mut told = false;
        for (of, command) in self.commands() {
            if sets(&command, wanted.part)
                && (!is_of_channel || of == channel)
                && let Some(record) = as_record(command)
            {
                emit(record);
                told = true;
            }
        }
        if told {
            Outcome::Accepted
        } else {
            Outcome::NotSet
        }
    }

    /// CRC-32 over what is in force.
    pub fn crc(&self) -> u32 {
        let mut commands = Vec::<Command, LARGEST>::new();
        for (_, command) in self.commands() {
            // There is room for the largest configuration.
            let _ = commands.push(command);
        }
        configuration_crc(&commands)
    }

    /// The commands that would set what is in force, in their order, each with its channel.
    fn commands(&self) -> impl Iterator<Item = (usize, Command)> + '_ {
        let settings = self
            .was_set
            .then(|| (0, Command::SetSettings(self.settings.clone())));
        let tanks = self.tanks.iter().enumerate();
        let crosstalks = self.crosstalks.iter().enumerate();
        let curves = self.curves.iter().enumerate();
        settings
            .into_iter()
            .chain(tanks.filter_map(|(of, tank)| Some((of, Command::SetTank(tank.clone()?)))))
            .chain(curves.flat_map(|(of, curve)| {
                chunks(curve).map(move |(first, knots)| (of, curve_chunk(of, curve, first, knots)))
            }))
            .chain(crosstalks.filter_map(|(of, crosstalk)| {
                Some((of, Command::SetCrosstalk(crosstalk.clone()?)))
            }))
            .chain(self.springs.clone().map(|it| (0, Command::SetSprings(it))))
            .chain(
                self.stiffening
                    .clone()
                    .map(|it| (0, Command::SetStiffening(it))),
            )
            .chain(chunks(&self.stiffening_curve).map(|(first, knots)| {
                let chunk = StiffeningCurve {
                    total: self.stiffening_curve.total,
                    first,
                    rise_uncertainty: self.rise_uncertainty,
                    knots: Vec::from_slice(knots).unwrap_or_default(),
                };
                (0, Command::SetStiffeningCurve(chunk))
            }))
            .chain(self.coil.clone().map(|it| (0, Command::SetCoil(it))))
    }
}

fn curve_chunk(
    of: usize,
    curve: &Curve<DeformationKnot>,
    first: u8,
    knots: &[DeformationKnot],
) -> Command {
    Command::SetDeformationCurve(DeformationCurve {
        sensor: 0,
        channel: of as u8,
        total: curve.total,
        first,
        knots: Vec::from_slice(knots).unwrap_or_default(),
    })
}

/// Full chunks of a curve, but for the last, with the place of their first knot.
fn chunks<K>(curve: &Curve<K>) -> impl Iterator<Item = (u8, &[K])> {
    let firsts = (0..u8::MAX).step_by(KNOTS_PER_CHUNK);
    firsts.zip(curve.knots.chunks(KNOTS_PER_CHUNK))
}

fn put<T: Clone>(places: &mut [Option<T>], place: Option<usize>, value: &T) -> Outcome {
    match place.and_then(|place| places.get_mut(place)) {
        Some(place) => {
            *place = Some(value.clone());
            Outcome::Accepted
        }
        None => Outcome::NoSuchChannel,
    }
}

/// Whether a command sets a part of the calibration.
fn sets(command: &Command, part: Part) -> bool {
    match part {
        Part::Tank => matches!(command, Command::SetTank(_)),
        Part::DeformationCurve => matches!(command, Command::SetDeformationCurve(_)),
        Part::Crosstalk => matches!(command, Command::SetCrosstalk(_)),
        Part::Springs => matches!(command, Command::SetSprings(_)),
        Part::Stiffening => matches!(command, Command::SetStiffening(_)),
        Part::StiffeningCurve => matches!(command, Command::SetStiffeningCurve(_)),
        Part::Coil => matches!(command, Command::SetCoil(_)),
        _ => false,
    }
}

fn as_record(command: Command) -> Option<Record> {
    Some(match command {
        Command::SetSettings(it) => Record::Settings(it),
        Command::SetTank(it) => Record::Tank(it),
        Command::SetDeformationCurve(it) => Record::DeformationCurve(it),
        Command::SetCrosstalk(it) => Record::Crosstalk(it),
        Command::SetSprings(it) => Record::Springs(it),
        Command::SetStiffening(it) => Record::Stiffening(it),
        Command::SetStiffeningCurve(it) => Record::StiffeningCurve(it),
        Command::SetCoil(it) => Record::Coil(it),
        _ => return None,
    })
}
