//! What the instrument does with what happens: the one place to change for another procedure.
//!
//! [`Procedure::step`] takes an event with its time and hands actions to whoever called it. It
//! knows no clock, no pin and no channel; `tasks::instrument` brings it the events and does what
//! it asks for. Here the procedure is that of an acquisition instrument: samples become records,
//! and a measurement drives the coil through its course without evaluating it.

use ldc161x::{Freshness, Reading};
use palpate_wire::Record;
use palpate_wire::code::{Contact, Mode, Outcome, RefusalReason, State, Stream};
use palpate_wire::command::{Command, Settings};
use palpate_wire::record::{Conversion, Raw, Refusal, Sample, StateChange};

use crate::acquisition::Sampled;
use crate::coil::{Course, GREATEST_CURRENT_A};

/// Words of a raw record.
const RAW_WORDS: usize = 32;

/// What happens.
pub enum Event<'a> {
    /// The converter's next frame.
    Sampled(&'a Sampled),
    /// A valid command that concerns the procedure.
    Command(&'a Command),
    /// A fault stands.
    Faulted,
    /// Time has passed; at least every few milliseconds.
    Tick,
}

/// What is to be done. At most four come of one event.
pub enum Action {
    /// Send a record of a time.
    Emit(u64, Record),
    /// Answer the command.
    Answer(Outcome),
    /// Allow the coil to be driven, or forbid it.
    Arm(bool),
    /// Take another course of the current, or none.
    Follow(Option<Course>),
}

/// What the procedure is told besides events.
pub struct Inputs<'a> {
    /// The settings in force.
    pub settings: &'a Settings,
    /// The coil is calibrated.
    pub has_coil: bool,
    /// A fault stands.
    pub is_faulted: bool,
    /// The coil's current as measured last, A.
    pub current_a: Option<f32>,
}

/// The procedure.
pub struct Procedure {
    state: State,
    mode: Mode,
    armed: bool,
    measurement: u32,
    /// The legs of the course that are still to come: their number, and when the present one ends.
    leg: u16,
    leg_ends_us: u64,
    skipped: u16,
    raw: Option<(u64, Raw)>,
}

impl Procedure {
    /// At rest: disarmed, and the coil is off.
    pub const fn new() -> Self {
        Self {
            state: State::Watching,
            mode: Mode::SensingOnly,
            armed: false,
            measurement: 0,
            leg: 0,
            leg_ends_us: 0,
            skipped: 0,
            raw: None,
        }
    }

    /// Measurements that began.
    pub const fn measurements(&self) -> u32 {
        self.measurement
    }

    /// Whether the coil may be driven.
    pub const fn is_armed(&self) -> bool {
        self.armed
    }

    fn is_measuring(&self) -> bool {
        matches!(self.state, State::Peak | State::Ramps)
    }

    /// Takes an event of a time and hands on what is to be done.
    pub fn step(
        &mut self,
        now_us: u64,
        event: Event<'_>,
        inputs: &Inputs<'_>,
        mut act: impl FnMut(Action),
    ) {
        match event {
            Event::Sampled(sampled) => self.sampled(sampled, inputs, &mut act),
            Event::Command(command) => {
                let outcome = self.command(now_us, command, inputs, &mut act);
                act(Action::Answer(outcome));
            }
            Event::Faulted => self.disarm(now_us, RefusalReason::Faulted, &mut act),
            Event::Tick if self.is_measuring() && now_us >= self.leg_ends_us => {
                self.next_leg(now_us, inputs.settings, &mut act);
            }
            Event::Tick => {}
        }
    }

    fn command(
        &mut self,
        now_us: u64,
        command: &Command,
        inputs: &Inputs<'_>,
        act: &mut impl FnMut(Action),
    ) -> Outcome {
        match command {
            Command::Arm if inputs.is_faulted => Outcome::Faulted,
            Command::Arm if !inputs.has_coil => Outcome::NoCoil,
            Command::Arm => {
                act(Action::Arm(true));
                self.change(now_us, self.state, Mode::Stiffness, true, act);
                Outcome::Accepted
            }
            Command::Disarm => {
                self.disarm(now_us, RefusalReason::Aborted, act);
                Outcome::Accepted
            }
            Command::SensingOnly => {
                self.disarm(now_us, RefusalReason::Aborted, act);
                self.change(now_us, self.state, Mode::SensingOnly, false, act);
                Outcome::Accepted
            }
            Command::Abort => {
                self.abort(now_us, RefusalReason::Aborted, act);
                Outcome::Accepted
            }
            Command::Measure => self.measure(now_us, inputs, act),
            _ => Outcome::UnknownCommand,
        }
    }

    fn measure(
        &mut self,
        now_us: u64,
        inputs: &Inputs<'_>,
        act: &mut impl FnMut(Action),
    ) -> Outcome {
        if self.mode == Mode::SensingOnly {
            return Outcome::SensingOnly;
        }
        if !self.armed {
            return Outcome::NotArmed;
        }
        if self.is_measuring() {
            return Outcome::Busy;
        }
        self.measurement = self.measurement.wrapping_add(1);
        self.leg = 0;
        self.change(now_us, State::Peak, self.mode, true, act);
        self.next_leg(now_us, inputs.settings, act);
        Outcome::Accepted
    }

    /// The legs: the rise, the hold, and for each ramp its fall and, but for the last, the rise
    /// back to the peak.
    fn next_leg(&mut self, now_us: u64, settings: &Settings, act: &mut impl FnMut(Action)) {
        let peak_a = settings.peak_current_a.min(GREATEST_CURRENT_A);
        let end_a = settings.end_current_a;
        let last = 2 * u16::from(settings.ramps);
        let (from_a, to_a, length_s) = match self.leg {
            0 => (0.0, peak_a, settings.rise_s),
            1 => (peak_a, peak_a, settings.hold_s),
            leg if leg > last => return self.finish(now_us, RefusalReason::NotCalibrated, act),
            leg if leg % 2 == 0 => (peak_a, end_a, settings.ramp_s),
            _ => (end_a, peak_a, settings.rise_s),
        };
        if self.leg == 2 {
            self.change(now_us, State::Ramps, self.mode, true, act);
        }
        self.leg += 1;
        self.leg_ends_us = now_us + (length_s * 1e6) as u64;
        act(Action::Follow(Some(Course {
            from_us: now_us,
            to_us: self.leg_ends_us,
            from_a,
            to_a,
        })));
    }

    /// Bridge off first, then the record.
    fn finish(&mut self, now_us: u64, reason: RefusalReason, act: &mut impl FnMut(Action)) {
        act(Action::Follow(None));
        let refusal = Refusal {
            measurement: self.measurement,
            reason,
            value: None,
            limit: None,
        };
        act(Action::Emit(now_us, Record::Refusal(refusal)));
        self.change(now_us, State::Watching, self.mode, self.armed, act);
    }

    fn abort(&mut self, now_us: u64, reason: RefusalReason, act: &mut impl FnMut(Action)) {
        if self.is_measuring() {
            self.finish(now_us, reason, act);
        } else {
            act(Action::Follow(None));
        }
    }

    fn disarm(&mut self, now_us: u64, reason: RefusalReason, act: &mut impl FnMut(Action)) {
        act(Action::Arm(false));
        self.abort(now_us, reason, act);
        if self.armed {
            self.change(now_us, self.state, self.mode, false, act);
        }
    }

    fn change(
        &mut self,
        now_us: u64,
        state: State,
        mode: Mode,
        armed: bool,
        act: &mut impl FnMut(Action),
    ) {
        let previous = core::mem::replace(&mut self.state, state);
        (self.mode, self.armed) = (mode, armed);
        let change = StateChange {
            state,
            previous,
            mode,
            armed,
            measurement: self.measurement,
        };
        act(Action::Emit(now_us, Record::State(change)));
    }

    fn sampled(&mut self, sampled: &Sampled, inputs: &Inputs<'_>, act: &mut impl FnMut(Action)) {
        self.skipped += 1;
        match inputs.settings.stream {
            Stream::Samples if self.skipped >= inputs.settings.decimation => {
                self.skipped = 0;
                let record = Record::Sample(sample(sampled, inputs.current_a));
                act(Action::Emit(sampled.time_us, record));
            }
            Stream::Raw => self.pack(sampled, act),
            _ => {}
        }
    }

    /// Adds a frame's words to the record under way, which ends when it is full or when frames
    /// were lost.
    fn pack(&mut self, sampled: &Sampled, act: &mut impl FnMut(Action)) {
        let readings = sampled.frame.readings();
        let channels = readings
            .iter()
            .fold(0, |bits, reading| bits | 1 << reading.channel as u8);
        let breaks = sampled.missed > 0 || sampled.gap;
        let ends = |raw: &Raw| {
            breaks || raw.channels != channels || raw.words.len() + readings.len() > RAW_WORDS
        };
        if let Some((time_us, raw)) = self.raw.take_if(|(_, raw)| ends(raw)) {
            act(Action::Emit(time_us, Record::Raw(raw)));
        }
        let (_, raw) = self.raw.get_or_insert_with(|| {
            let raw = Raw {
                sensor: 0,
                missed: sampled.missed,
                channels,
                period_us: sampled.period_us,
                words: heapless::Vec::new(),
            };
            (sampled.time_us, raw)
        });
        for reading in readings {
            // There is room: a record that had none was sent.
            let _ = raw.words.push(reading.word.bits());
        }
    }
}

fn sample(sampled: &Sampled, current_a: Option<f32>) -> Sample {
    let mut channels = heapless::Vec::new();
    for (reading, offset_us) in sampled.frame.readings().iter().zip(sampled.offsets_us) {
        // There is room for the four channels of a frame.
        let _ = channels.push(Conversion {
            channel: reading.channel as u8,
            offset_us,
            word: reading.word.bits(),
            frequency_hz: reading.frequency_hz,
            sigma_hz: reading.sigma_hz,
            deformation_m: None,
            deformation_sigma_m: None,
            extrapolated: false,
        });
    }
    let repeated = |reading: &Reading| reading.freshness == Freshness::Repeated;
    Sample {
        sensor: 0,
        missed: sampled.missed,
        gap: sampled.gap || sampled.frame.readings().iter().any(repeated),
        drive_step: sampled.frame.marks.drive_step,
        channels,
        contact: Contact::Settling,
        force_n: None,
        force_sigma_n: None,
        current_a,
    }
}
