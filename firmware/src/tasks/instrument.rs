//! The instrument's task: samples, commands and time go to the procedure, and what it wants done
//! is done.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::Mutex;
use heapless::spsc::Consumer;
use palpate_wire::code::{Board, Chip, FaultCode, Outcome, Place, ResetCause};
use palpate_wire::command::{Command, Settings};
use palpate_wire::record::{Acknowledgement, Fault, Hello, Status};
use palpate_wire::{FrameError, Header, MINOR_VERSION, Message, Record, SCHEMA_HASH};
use rtic_monotonics::rp2040::prelude::*;
use rtic_sync::signal::SignalReader;

use crate::acquisition::{Sampled, Scheme};
use crate::configuration::{Configuration, DEFAULT};
use crate::crash::Beginning;
use crate::link::{Inbox, Outbox, Received, log};
use crate::procedure::{Action, Event, Inputs, Procedure};
use crate::supervision::{Task, check_in};
use crate::{Mono, app, board, coil, report};

/// How long the task waits for a sample before it looks at everything else.
const TICK_MS: u64 = 1;
/// Samples that are taken before it looks at everything else.
const AT_ONCE: usize = 4;
/// Bytes of commands that are looked at in a tick: two of the longest frames.
const COMMAND_BYTES: usize = 212;

/// The settings that the sensing task is to follow, and a number that changes with them.
static WANTED: Mutex<RefCell<Settings>> = Mutex::new(RefCell::new(DEFAULT));
static WANTED_NUMBER: AtomicU32 = AtomicU32::new(0);

/// The settings in force with their number.
pub fn wanted() -> (Settings, u32) {
    let number = wanted_number();
    let settings = critical_section::with(|section| match WANTED.borrow(section).try_borrow() {
        Ok(settings) => settings.clone(),
        Err(_) => DEFAULT,
    });
    (settings, number)
}

/// The number of the settings in force.
pub fn wanted_number() -> u32 {
    WANTED_NUMBER.load(Ordering::Relaxed)
}

fn want(settings: &Settings) {
    critical_section::with(|section| {
        if let Ok(mut wanted) = WANTED.borrow(section).try_borrow_mut() {
            *wanted = settings.clone();
        }
    });
    WANTED_NUMBER.store(wanted_number().wrapping_add(1), Ordering::Relaxed);
}

/// What the task owns.
pub struct Instrument {
    /// To the PC.
    pub outbox: Outbox,
    /// From the PC.
    pub inbox: Inbox,
    /// From the sensing task.
    pub samples: Consumer<'static, Sampled>,
    /// Why this run began.
    pub beginning: Beginning,
    /// The number of this run.
    pub boot_id: u32,
    /// The clocks run as planned.
    pub clocks_run: bool,
    /// What was set.
    pub configuration: Configuration,
    /// What is done with it.
    pub procedure: Procedure,
    /// Commands that were refused.
    pub refused: u32,
    /// The fault that was reported and stands.
    pub standing: Option<Fault>,
    /// When the next status is due, and what the last one said of sleep.
    pub status_due_us: u64,
    /// Time of the last status, and the sleep up to then.
    pub last_status: (u64, u32),
}

/// Takes what comes, for ever.
pub async fn instrument(cx: app::instrument::Context<'_>) {
    let instrument = cx.local.instrument;
    let arrived = cx.local.arrived;
    instrument.greet();
    loop {
        check_in(Task::Instrument);
        instrument.work();
        #[cfg(planted_defect = "panic")]
        crate::planted::panic_if_asked(Task::Instrument);
        wait(arrived).await;
    }
}

async fn wait(arrived: &mut SignalReader<'static, ()>) {
    let _ = Mono::timeout_after(TICK_MS.millis(), arrived.wait()).await;
}

impl Instrument {
    /// What a run begins with.
    fn greet(&mut self) {
        self.hello();
        if let Some(crash) = self.beginning.crash.clone() {
            self.emit(Record::Crash(crash));
        }
        if !self.clocks_run {
            self.fault(FaultCode::Clock, Place::Clock);
        }
        if self.beginning.is_crash() {
            let code = match self.beginning.cause {
                ResetCause::Watchdog => FaultCode::Watchdog,
                ResetCause::Panic => FaultCode::Panic,
                _ => FaultCode::HardFault,
            };
            self.fault(code, Place::Processor);
        }
    }

    fn fault(&mut self, code: FaultCode, place: Place) {
        self.emit(Record::Fault(Fault {
            code,
            place,
            active: true,
            value: None,
            limit: None,
        }));
    }

    fn work(&mut self) {
        for _ in 0..AT_ONCE {
            let Some(sampled) = self.samples.dequeue() else {
                break;
            };
            self.step(Event::Sampled(&sampled), None);
        }
        if let Some(received) = self.inbox.receive(COMMAND_BYTES) {
            self.receive(&received);
        }
        self.follow_faults();
        self.step(Event::Tick, None);
        let now_us = Mono::now().as_ticks();
        if now_us >= self.status_due_us {
            let period_us = self.configuration.settings.status_period_s * 1e6;
            self.status_due_us = now_us + period_us as u64;
            self.status(now_us);
        }
    }

    /// Lets the procedure take an event, and does what it wants.
    fn step(&mut self, event: Event<'_>, command: Option<(&Header, u8)>) {
        let now_us = Mono::now().as_ticks();
        let inputs = Inputs {
            settings: &self.configuration.settings,
            has_coil: self.configuration.coil.is_some(),
            is_faulted: self.standing.is_some(),
            current_a: coil::measured().current_a,
        };
        let (outbox, refused) = (&mut self.outbox, &mut self.refused);
        self.procedure
            .step(now_us, event, &inputs, |action| match action {
                Action::Emit(time_us, record) => outbox.send(time_us, &record),
                Action::Arm(armed) => coil::arm(armed),
                Action::Follow(course) => coil::follow(course),
                Action::Answer(outcome) => {
                    if let Some((header, kind)) = command {
                        *refused += u32::from(outcome != Outcome::Accepted);
                        let answer = Acknowledgement::new(header, kind, outcome);
                        outbox.send(now_us, &Record::Acknowledgement(answer));
                    }
                }
            });
    }

    fn emit(&mut self, record: Record) {
        self.outbox.send(Mono::now().as_ticks(), &record);
    }

    // ---- commands ----

    fn receive(&mut self, received: &Received) {
        match received {
            Ok(frame) => self.command(&frame.header, &frame.message),
            Err(FrameError::Version { .. }) => self.hello(),
            Err(error) => {
                if let Some(answer) = Acknowledgement::not_understood(error) {
                    self.refused += 1;
                    self.emit(Record::Acknowledgement(answer));
                }
            }
        }
    }

    fn command(&mut self, header: &Header, command: &Command) {
        if !command.is_for(self.boot_id, header.boot_id) {
            self.answer(header, command, Outcome::OtherBoot);
            return;
        }
        if let Err(invalid) = command.validate() {
            self.refused += 1;
            let answer = Acknowledgement::invalid(header, command.kind(), &invalid);
            self.emit(Record::Acknowledgement(answer));
            return;
        }
        match command {
            Command::Identify => {
                self.answer(header, command, Outcome::Accepted);
                self.hello();
                self.status(Mono::now().as_ticks());
            }
            Command::GetSettings => {
                self.answer(header, command, Outcome::Accepted);
                let settings = self.configuration.settings.clone();
                self.emit(Record::Settings(settings));
            }
            Command::GetCalibration(wanted) => {
                // The answer comes first, and says whether there is anything to tell.
                let outcome = self.configuration.tell(wanted, |_| ());
                self.answer(header, command, outcome);
                let outbox = &mut self.outbox;
                let now_us = Mono::now().as_ticks();
                self.configuration
                    .tell(wanted, |record| outbox.send(now_us, &record));
            }
            Command::ClearFault(_) => {
                let outcome = match &self.standing {
                    Some(_) => Outcome::FaultPersists,
                    None => Outcome::OtherFault,
                };
                self.answer(header, command, outcome);
            }
            Command::SetSettings(settings) => self.set_settings(header, command, settings),
            _ if self.sets(command) => self.set(header, command),
            _ => self.step(Event::Command(command), Some((header, command.kind()))),
        }
    }

    fn sets(&self, command: &Command) -> bool {
        matches!(
            command,
            Command::SetTank(_)
                | Command::SetDeformationCurve(_)
                | Command::SetCrosstalk(_)
                | Command::SetSprings(_)
                | Command::SetStiffening(_)
                | Command::SetStiffeningCurve(_)
                | Command::SetCoil(_)
        )
    }

    fn answer(&mut self, header: &Header, command: &Command, outcome: Outcome) {
        self.refused += u32::from(outcome != Outcome::Accepted);
        let answer = Acknowledgement::new(header, command.kind(), outcome);
        self.emit(Record::Acknowledgement(answer));
    }

    fn set(&mut self, header: &Header, command: &Command) {
        let outcome = if self.procedure.is_armed() {
            Outcome::Armed
        } else {
            let set = self.configuration.set(command);
            set.unwrap_or(Outcome::UnknownCommand)
        };
        self.answer(header, command, outcome);
    }

    /// Settings that the converter cannot follow are refused as a whole.
    fn set_settings(&mut self, header: &Header, command: &Command, settings: &Settings) {
        if Scheme::new(settings).is_err() {
            self.answer(header, command, Outcome::OutOfRange);
            return;
        }
        self.set(header, command);
        if self.configuration.settings == *settings && !self.procedure.is_armed() {
            want(settings);
        }
    }

    // ---- records ----

    /// Reports a fault of the converter when it begins and when it ends.
    fn follow_faults(&mut self) {
        let fault = report::fault().or_else(|| {
            coil::bridge_faults().then_some(Fault {
                code: FaultCode::Bridge,
                place: Place::Bridge,
                active: true,
                value: None,
                limit: None,
            })
        });
        let code = |fault: &Option<Fault>| fault.as_ref().map(|fault| fault.code);
        if code(&fault) == code(&self.standing) {
            return;
        }
        if let Some(ended) = self.standing.take() {
            self.emit(Record::Fault(Fault {
                active: false,
                ..ended
            }));
        }
        if let Some(began) = fault {
            self.emit(Record::Fault(began.clone()));
            self.standing = Some(began);
            self.step(Event::Faulted, None);
        }
    }

    fn hello(&mut self) {
        let chip = match self.standing.as_ref().map(|fault| fault.code) {
            Some(FaultCode::SensorIdentity) => Chip::Foreign,
            Some(FaultCode::SensorAbsent) => Chip::Absent,
            _ => Chip::Ldc161x,
        };
        let hello = Hello {
            minor_version: MINOR_VERSION,
            schema_hash: SCHEMA_HASH,
            firmware_major: number(env!("CARGO_PKG_VERSION_MAJOR")) as u16,
            firmware_minor: number(env!("CARGO_PKG_VERSION_MINOR")) as u16,
            firmware_patch: number(env!("CARGO_PKG_VERSION_PATCH")) as u16,
            commit: number(env!("PALPATE_COMMIT")),
            dirty: number(env!("PALPATE_DIRTY")) != 0,
            simulated: false,
            board: Board::Pico,
            unit: 0,
            reset_cause: self.beginning.cause,
            chip,
            second_chip: Chip::Absent,
            configuration_crc: self.configuration.crc(),
        };
        self.emit(Record::Hello(hello));
    }

    fn status(&mut self, now_us: u64) {
        let measured = coil::measured();
        let asleep_us = report::ASLEEP_US.get();
        let (then_us, slept_us) = core::mem::replace(&mut self.last_status, (now_us, asleep_us));
        let passed_us = now_us.saturating_sub(then_us) as f32;
        let idle = asleep_us.wrapping_sub(slept_us) as f32 / passed_us;
        self.emit(Record::Status(Status {
            conversions: report::FRAMES.get(),
            conversions_lost: report::LOST.get(),
            conversions_flagged: report::FLAGGED.get(),
            second_conversions: 0,
            second_conversions_lost: 0,
            second_conversions_flagged: 0,
            bus_errors: report::BUS_ERRORS.get(),
            recoveries: report::RECOVERIES.get(),
            logs_dropped: log::dropped(),
            commands_damaged: self.inbox.damaged(),
            commands_refused: self.refused,
            measurements: self.procedure.measurements(),
            refusals: self.procedure.measurements(),
            temperature_c: None,
            supply_v: measured.supply_v,
            processor_load: (passed_us > 0.0).then_some((1.0 - idle).clamp(0.0, 1.0)),
            stack_bytes: board::stack_used(),
        }));
    }
}

/// A hexadecimal or decimal number from the build; 0 if it is none.
const fn number(text: &str) -> u32 {
    match u32::from_str_radix(text, 16) {
        Ok(number) => number,
        Err(_) => 0,
    }
}
