//! A real bench: a board on a link, programs for gauges and stage, and a person.
//!
//! This code cannot tell whether the bench is simulated: `palpate serve-emulated --rig` and its
//! gauge programs use the same lines of text as a real bench.

mod delay;
mod hand;
mod hand_state;
mod motion;
mod openscale;
mod person;
mod program;
mod track;

use std::time::Duration;

use hand_state::Hand;
use palpate_calibration::bench::{Bench, Instrument, Work};
use palpate_calibration::checks::DataFault;
use palpate_calibration::session::{BenchSample, Pressed, Run};
use palpate_cli::describe::stiffness;
use palpate_cli::failure::Failure;
use palpate_wire::code::Outcome;
use palpate_wire::command::Settings;
use palpate_wire::{Command, Record};
use person::Person;
use program::{GaugeLine, Program, Source};
use track::Track;

use super::bare::noted;
use crate::board::link::{Arrival, Link};
use crate::interrupt::Interrupt;

/// Longest time of one receive call, and time without a sample after which the board counts as
/// silent.
const POLL: Duration = Duration::from_millis(2);
const SILENT: Duration = Duration::from_secs(30);
/// Time without a reading of the load cell after which the calibration fails, s: a slow amplifier
/// sends ten readings a second.
const GAUGE_SILENT_S: f64 = 2.0;
/// Longest wait for the first reading of the load cell: an amplifier restarts when its port is
/// opened.
const GAUGE_START: Duration = Duration::from_secs(60);
/// Relative difference from the frequency of the untouched sensor below which the sensor has
/// recovered from a press: a fifth of the limit in the check of each run.
const RECOVERED: f64 = 0.2e-3;
/// Longest wait for the sensor's recovery, s.
const RECOVERY_S: f64 = 300.0;
/// Longest delay of a stage's answer beyond the duration of its movement, s.
const STAGE_S: f64 = 30.0;
/// Longest wait for delayed readings of the gauges at the end of a run, s.
const GAUGE_SETTLES_S: f64 = 0.6;
/// Time over which the frequency is averaged, s.
const MEAN_S: f64 = 0.02;

/// Configuration of a bench.
pub(crate) struct RigPlan {
    /// Program of the load cell.
    pub(crate) force: Option<String>,
    /// Program of the stage; `None` if the user drives it by hand.
    pub(crate) stage: Option<String>,
    /// Settings of the board for its samples.
    pub(crate) settings: Settings,
    /// Nominal stiffness of both layers, N/m.
    pub(crate) sensing_n_per_m: f64,
    pub(crate) actuated_n_per_m: f64,
    /// Temperature of the coil, degrees Celsius.
    pub(crate) temperature_c: f64,
}

/// A bench with its gauges.
pub(crate) struct RigBench<'l> {
    link: &'l mut Link,
    plan: RigPlan,
    force: Option<Box<dyn Source>>,
    stage: Option<Box<dyn Source>>,
    force_track: Track,
    stage_track: Track,
    person: Person,
    hand: Hand,
    interrupt: Interrupt,
    /// Specimen on the stage.
    pressed: Pressed,
    /// Unprocessed answers of the stage.
    answers: Vec<GaugeLine>,
    arrivals: Vec<Arrival>,
    /// Board time of the last sample, s, and arrival of that sample by the link's clock.
    latest_s: Option<f64>,
    came: Duration,
    /// Frequency of the last sample, Hz.
    frequency_hz: f64,
    /// Frequency of the sensor before the first contact, Hz.
    rest_hz: Option<f64>,
    /// Position at the last touch, m, of a stage that a program moves.
    touch_m: f64,
}

impl<'l> RigBench<'l> {
    /// Starts the programs.
    ///
    /// # Errors
    /// If a program does not start.
    pub(crate) fn new(
        link: &'l mut Link,
        plan: RigPlan,
        interrupt: Interrupt,
    ) -> Result<Self, Failure> {
        let force = plan.force.as_deref().map(gauge).transpose()?;
        let stage = plan.stage.as_deref();
        let stage = stage.map(|command| Program::start("--stage", command));
        let came = link.now();
        Ok(Self {
            link,
            plan,
            force,
            stage: stage
                .transpose()?
                .map(|program| Box::new(program) as Box<dyn Source>),
            force_track: Track::default(),
            stage_track: Track::default(),
            person: Person::default(),
            hand: Hand::default(),
            interrupt,
            pressed: Pressed::Nothing,
            answers: Vec::new(),
            arrivals: Vec::new(),
            latest_s: None,
            came,
            frequency_hz: 0.0,
            rest_hz: None,
            touch_m: 0.0,
        })
    }

    /// Receives from board and gauges for a short time.
    fn pump(&mut self) -> Result<(), Failure> {
        self.interrupt.go_on()?;
        self.link.listen(POLL)?;
        for arrival in self.link.take() {
            if let Record::Sample(sample) = &arrival.frame.message {
                self.latest_s = Some(arrival.frame.header.time_us as f64 * 1e-6);
                self.came = arrival.at;
                let conversion = sample.channels.first();
                self.frequency_hz = conversion.map_or(0.0, |of| of.frequency_hz);
            }
            self.arrivals.push(arrival);
        }
        self.take_force()?;
        self.take_stage()
    }

    fn take_force(&mut self) -> Result<(), Failure> {
        let Some(force) = &mut self.force else {
            return Ok(());
        };
        for line in force.lines()? {
            if let (GaugeLine::Reading { time_s, value }, Some(now_s)) = (line, self.latest_s) {
                self.force_track.enter(now_s, time_s, value);
            }
        }
        let (Some(now_s), Some((last_s, _))) = (self.latest_s, self.force_track.last()) else {
            return Ok(());
        };
        if now_s - last_s > GAUGE_SILENT_S {
            return Err(Failure::Refused(format!(
                "the program of --force has printed nothing for {GAUGE_SILENT_S:.0} s: check the load \
                 cell's plug and port"
            )));
        }
        Ok(())
    }

    fn take_stage(&mut self) -> Result<(), Failure> {
        if let (Some(position_m), Some(now_s)) = (self.hand.position_m, self.latest_s) {
            self.stage_track.enter(now_s, None, position_m);
        }
        let Some(stage) = &mut self.stage else {
            return Ok(());
        };
        for line in stage.lines()? {
            match (line, self.latest_s) {
                (GaugeLine::Reading { time_s, value }, Some(now_s)) => {
                    self.stage_track.enter(now_s, time_s, value);
                }
                (GaugeLine::Reading { .. }, None) => {}
                (answer, _) => self.answers.push(answer),
            }
        }
        Ok(())
    }

    /// Receives until a span of board time, s, has passed.
    fn pass(&mut self, time_s: f64) -> Result<(), Failure> {
        let end_s = self.now_s() + time_s;
        while self.now_s() < end_s {
            self.pump()?;
            self.is_sending()?;
        }
        Ok(())
    }

    fn is_sending(&self) -> Result<(), Failure> {
        if self.link.now().saturating_sub(self.came) > SILENT {
            return Err(Failure::Lost(format!(
                "{}: the board sends no samples: check its LED and its sensor",
                self.link.name()
            )));
        }
        Ok(())
    }

    /// Present time by the board's clock, s: that of the last sample, if there is one.
    fn now_s(&self) -> f64 {
        let by_clock = || self.link.clock().device_s(self.link.now());
        self.latest_s.or_else(by_clock).unwrap_or_default()
    }

    /// Sends a command to the stage and waits for the answer.
    fn command(&mut self, command: &str, wait_s: f64) -> Result<GaugeLine, Failure> {
        self.answers.clear();
        match &mut self.stage {
            Some(stage) => stage.send(command)?,
            None => return Ok(GaugeLine::ByHand),
        }
        let end = self.link.now() + Duration::from_secs_f64(wait_s + STAGE_S);
        while self.link.now() < end {
            self.pump()?;
            match self.answers.pop() {
                Some(GaugeLine::Refused(reason)) => {
                    return Err(Failure::Refused(format!(
                        "the program of --stage failed at {command}: {reason}"
                    )));
                }
                Some(answer) => return Ok(answer),
                None => {}
            }
        }
        Err(Failure::Refused(format!(
            "the program of --stage does not answer {command}: it has to print `ok` when that is done"
        )))
    }

    /// Puts a specimen on the stage, or asks the user to.
    fn mount(&mut self, specimen: &str, request: &str) -> Result<(), Failure> {
        if self.command(&format!("mount {specimen}"), 0.0)? == GaugeLine::ByHand {
            self.request(&format!("{request}, then press Enter."))?;
        }
        Ok(())
    }

    /// Asks the user for something. Receives until the user answers, and returns the answer.
    fn request(&mut self, request: &str) -> Result<String, Failure> {
        self.person.ask(request)?;
        loop {
            self.pump()?;
            if let Some(answer) = self.person.answer()? {
                return Ok(answer);
            }
        }
    }

    /// Starts the samples again after a change of the specimen, since the board may have restarted.
    fn begin(&mut self) -> Result<(), Failure> {
        self.link.greet()?;
        // Without a restart the board is still armed from the previous run.
        self.link.send_accepted(&Command::Disarm)?;
        self.link
            .send_accepted(&Command::SetSettings(self.plan.settings.clone()))?;
        self.link.take();
        self.arrivals.clear();
        self.force_track.clear();
        self.stage_track.clear();
        self.hand.position_m = None;
        self.latest_s = None;
        // Drops the readings that the gauges sent before, since these have no board time.
        self.take_force()?;
        self.take_stage()?;
        self.came = self.link.now();
        let end = self.link.now() + GAUGE_START;
        while self.latest_s.is_none() || self.force.is_some() && self.force_track.last().is_none() {
            self.pump()?;
            self.is_sending()?;
            if self.link.now() > end {
                return Err(Failure::Refused(
                    "the load cell of --force has sent no reading: check its plug, its port and its \
                     program"
                        .into(),
                ));
            }
        }
        Ok(())
    }

    /// Waits until the frequency has returned to that before the first press.
    fn recover(&mut self) -> Result<(), Failure> {
        let Some(rest_hz) = self.rest_hz else {
            return Ok(());
        };
        let end_s = self.now_s() + RECOVERY_S;
        while (self.mean_hz()? / rest_hz - 1.0).abs() > RECOVERED && self.now_s() < end_s {}
        Ok(())
    }

    /// Mean frequency over a short time, Hz.
    fn mean_hz(&mut self) -> Result<f64, Failure> {
        let (mut sum_hz, mut count) = (0.0, 0.0);
        let end_s = self.now_s() + MEAN_S;
        while self.now_s() < end_s || count < 1.0 {
            let before_s = self.latest_s;
            self.pump()?;
            self.is_sending()?;
            if self.latest_s != before_s {
                sum_hz += self.frequency_hz;
                count += 1.0;
            }
        }
        Ok(sum_hz / count)
    }

    /// Adds the gauges' readings to a run: each sample gets the readings at its own time.
    fn fill(&self, run: &mut Run) {
        let late_s = delay::of(run, &self.force_track).unwrap_or_default();
        for line in &mut run.lines {
            let time_s = line.time_s + run.zero_s;
            line.gauges_time_s = line.time_s;
            line.force_n = self.force_track.at(time_s + late_s);
            line.stage_m = self.stage_track.at(time_s);
        }
    }
}

/// Opens the load cell: an amplifier that this tool supports itself, or a program.
fn gauge(name: &str) -> Result<Box<dyn Source>, Failure> {
    match name.strip_prefix("openscale:") {
        Some(port) => Ok(Box::new(openscale::OpenScale::open(port)?)),
        None => Ok(Box::new(Program::start("--force", name)?)),
    }
}

impl Bench for RigBench<'_> {
    type Error = Failure;

    fn with_specimen(
        &mut self,
        pressed: Pressed,
        work: &mut Work<'_, Failure>,
    ) -> Result<Run, Failure> {
        if self.pressed != pressed || self.rest_hz.is_none() {
            let (name, request) = specimen(pressed);
            self.mount(&name, &request)?;
            self.pressed = pressed;
        }
        self.begin()?;
        self.recover()?;
        if pressed != Pressed::Nothing {
            self.approach()?;
            self.recover()?;
        }
        self.arrivals.clear();
        let mut run = work(self)?;
        self.pass(GAUGE_SETTLES_S)?;
        self.fill(&mut run);
        if self.rest_hz.is_none() {
            self.rest_hz = Some(self.mean_hz()?);
        }
        if pressed != Pressed::Nothing {
            self.lift()?;
        }
        Ok(run)
    }

    fn press_bare(&mut self, force_n: f64) -> Result<Option<(f64, f64)>, Failure> {
        if self.force.is_none() || self.stage.is_none() {
            return Ok(None);
        }
        self.bare(force_n).map(Some)
    }

    fn temperature_c(&self) -> f64 {
        self.plan.temperature_c
    }

    fn repeats(&mut self, fault: &DataFault) -> Result<bool, Failure> {
        if !person::is_there() {
            return Ok(false);
        }
        let answer = self.request(&format!("{fault}. Press again? [Y/n]"))?;
        Ok(matches!(answer.as_str(), "" | "y" | "Y" | "yes"))
    }
}

impl Instrument for RigBench<'_> {
    type Error = Failure;

    fn now(&self) -> Duration {
        Duration::from_secs_f64(self.now_s())
    }

    fn ask(&mut self, command: Command) -> Result<Outcome, Failure> {
        self.link.ask(&command).map(|(_, outcome)| outcome)
    }

    fn post(&mut self, command: Command) -> Result<(), Failure> {
        self.link.send(&command).map(drop)
    }

    fn advance(
        &mut self,
        _: Duration,
        lines: &mut Vec<BenchSample>,
    ) -> Result<Vec<Record>, Failure> {
        self.pump()?;
        self.is_sending()?;
        // The gauges' readings are added at the end of the run, since some arrive late.
        Ok(noted(std::mem::take(&mut self.arrivals), lines))
    }

    fn press(&mut self, depth_m: f64, speed_m_per_s: f64) -> Result<Duration, Failure> {
        if self.stage.is_none() {
            self.press_by_hand(depth_m)?;
            return Ok(Duration::ZERO);
        }
        self.move_to(self.touch_m + self.travel_m(depth_m), speed_m_per_s)?;
        Ok(Duration::ZERO)
    }
}

/// Returns a specimen's name in the stage's protocol, and the request to a person.
fn specimen(pressed: Pressed) -> (String, String) {
    match pressed {
        Pressed::Nothing => (
            "nothing".to_owned(),
            "Take everything off the sensor".to_owned(),
        ),
        Pressed::Block => (
            "block".to_owned(),
            "Put the block on the stage, a millimetre above the sensor".to_owned(),
        ),
        Pressed::Spring { n_per_m } => (
            format!("spring {n_per_m}"),
            format!(
                "Put the spring of {} ({n_per_m:.0} N/m) on the stage, a millimetre above the sensor",
                stiffness(n_per_m)
            ),
        ),
        Pressed::BlockBeside {
            distance_m,
            direction_rad,
        } => (
            format!("block-beside {distance_m:.6} {direction_rad:.4}"),
            format!(
                "Put the block on the stage, flat, {:.2} mm beside the centre of the coil towards {:.0} deg, \
                 a millimetre above the sensor",
                1e3 * distance_m,
                direction_rad.to_degrees()
            ),
        ),
        Pressed::BlockTilted {
            angle_rad,
            direction_rad,
        } => (
            format!("block-tilted {angle_rad:.6} {direction_rad:.4}"),
            format!(
                "Put the block on the stage, in the centre, tilted by {:.2} deg ({:.0} µm on 10 mm) so that its \
                 edge at {:.0} deg touches first, a millimetre above the sensor",
                angle_rad.to_degrees(),
                1e4 * angle_rad.tan(),
                direction_rad.to_degrees()
            ),
        ),
    }
}
