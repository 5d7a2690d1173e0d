//! The instrument's task: samples, commands and time go to the procedure, and what it wants done
//! is done.

use core::cell::Cell;
use core::task::Poll;

use critical_section::Mutex;
use heapless::Vec;
use heapless::spsc::Consumer;
use palpate_node::acquisition::{Sampled, Scheme, Wanted};
use palpate_procedure::boot::Boot;
use palpate_procedure::event::{Conditions, Failure};
use palpate_procedure::units::Ampere;
use palpate_procedure::{
    Action, Actions, Board, Conversion, Duration, Event, Instant, Limits, Procedure, Scan,
};
use palpate_wire::code::{self, Chip, FaultCode, Outcome, Place};
use palpate_wire::command::Command;
use palpate_wire::record::{Acknowledgement, Hello};
use palpate_wire::{Frame, MINOR_VERSION, Message, Record, SCHEMA_HASH};
use rtic_monotonics::rp2040::prelude::*;

use crate::link::{Inbox, Outbox, Received, log};
use crate::supervision::{Task, check_in};
use crate::wakeup::Sleeper;
use crate::{Mono, app, board, coil, report};

/// Samples that are taken before it looks at everything else.
const AT_ONCE: usize = 4;
/// Bytes of commands that are looked at in a turn: two of the longest frames.
const COMMAND_BYTES: usize = 212;
/// How long the converter may take to wake, to say who it is and to show what releases its
/// interrupt line; an absent one is known after 5 ms.
const IDENTITY_MS: u64 = 60;
/// How often the procedure hears of temperature, supply and load.
const CONDITIONS_US: u64 = 100_000;
/// Channels of an LDC1614.
const CHANNELS: u8 = 0b1111;

/// What the sensing task is to follow, and a number that changes with it.
static WANTED: Mutex<Cell<Option<(Wanted, u32)>>> = Mutex::new(Cell::new(None));

/// What is wanted of the converter with its number; nothing before the procedure has begun.
pub fn wanted() -> Option<(Wanted, u32)> {
    critical_section::with(|section| WANTED.borrow(section).get())
}

/// The number of what is wanted.
pub fn wanted_number() -> u32 {
    wanted().map_or(0, |(_, number)| number)
}

fn want(wanted: Wanted) {
    critical_section::with(|section| {
        let place = WANTED.borrow(section);
        let next = match place.get() {
            Some((already, _)) if already == wanted => return,
            Some((_, number)) => number.wrapping_add(1),
            None => 1,
        };
        place.set(Some((wanted, next)));
    });
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
    pub boot: Boot,
    /// The number of this run.
    pub boot_id: u32,
    /// The clocks run as planned.
    pub clocks_run: bool,
    /// What the instrument does, once it is known which converter is there.
    pub procedure: Option<Procedure>,
    /// What it wanted done last.
    pub actions: Actions,
    /// The failures that were reported to the procedure and that last: of the converter, of the
    /// bridge.
    pub standing: [Option<FaultCode>; 2],
    /// The fault that the procedure stands in, as it said.
    pub latched: Option<FaultCode>,
    /// When the next conditions are due.
    pub conditions_due_us: u64,
    /// Time of the last conditions, and the sleep up to then.
    pub last_conditions: (u64, u32),
}

/// Takes what comes, for ever.
pub async fn instrument(cx: app::instrument::Context<'_>) {
    let instrument = cx.local.instrument;
    let arrived = cx.local.arrived;
    for _ in 0..IDENTITY_MS {
        check_in(Task::Instrument);
        if report::chip().is_some() {
            break;
        }
        Mono::delay(1.millis()).await;
    }
    instrument.begin();
    loop {
        check_in(Task::Instrument);
        instrument.work();
        #[cfg(planted_defect = "panic")]
        crate::planted::panic_if_asked(Task::Instrument);
        wait(arrived).await;
    }
}

/// Waits for a sample or a millisecond without, but lets the supervisor have its turn even if one waits already.
async fn wait(arrived: &mut Sleeper) {
    let mut yielded = false;
    core::future::poll_fn(|context| {
        if core::mem::replace(&mut yielded, true) {
            return Poll::Ready(());
        }
        context.waker().wake_by_ref();
        Poll::Pending
    })
    .await;
    arrived.wait().await;
}

impl Instrument {
    /// The procedure. It is made in a frame of its own: what making it takes of the stack is free
    /// again before it runs.
    #[inline(never)]
    fn make(&mut self) {
        let board = self.board();
        self.procedure = Some(Procedure::new(board));
    }

    /// What a run begins with.
    fn begin(&mut self) {
        self.make();
        self.step(&Event::Tick);
        if !self.clocks_run {
            self.fail(Failure::new(FaultCode::Clock, Place::Clock));
        }
    }

    fn board(&mut self) -> Board {
        Board {
            boot_id: self.boot_id,
            hello: Hello {
                minor_version: MINOR_VERSION,
                schema_hash: SCHEMA_HASH,
                firmware_major: decimal(env!("CARGO_PKG_VERSION_MAJOR")),
                firmware_minor: decimal(env!("CARGO_PKG_VERSION_MINOR")),
                firmware_patch: decimal(env!("CARGO_PKG_VERSION_PATCH")),
                commit: hexadecimal(env!("PALPATE_COMMIT")),
                dirty: hexadecimal(env!("PALPATE_DIRTY")) != 0,
                simulated: false,
                board: code::Board::Pico,
                unit: 0,
                reset_cause: self.boot.cause,
                chip: report::chip().unwrap_or(Chip::Absent),
                second_chip: Chip::Absent,
                configuration_crc: 0,
            },
            crashes: self.boot.streak,
            crash: self.boot.crash.take(),
            channels: [CHANNELS, 0],
            coil: true,
            limits: Limits::REFERENCE,
        }
    }

    fn work(&mut self) {
        let mut stepped = false;
        for _ in 0..AT_ONCE {
            let Some(scan) = self.samples.peek().map(scan_of) else {
                break;
            };
            let _ = self.samples.dequeue();
            self.sampled(&scan);
            stepped = true;
        }
        if let Some(received) = self.inbox.receive(COMMAND_BYTES) {
            self.received(&received);
            stepped = true;
        }
        self.follow_faults();
        let now_us = Mono::now().as_ticks();
        if now_us >= self.conditions_due_us {
            self.conditions_due_us = now_us + CONDITIONS_US;
            let conditions = self.conditions(now_us);
            self.step(&Event::Conditions(conditions));
            let expects = |of: &Procedure| of.expects_thermometer();
            coil::expect_thermometer(self.procedure.as_ref().is_some_and(expects));
        } else if !stepped {
            self.step(&Event::Tick);
        }
    }

    /// Tells the procedure, and does what it wants done.
    fn step(&mut self, event: &Event<'_>) {
        let Some(procedure) = &mut self.procedure else {
            return;
        };
        let now_us = Mono::now().as_ticks();
        procedure.step_into(Instant::from_ticks(now_us), event, &mut self.actions);
        for action in &self.actions {
            match action {
                Action::SafeState => coil::stop(),
                Action::Current { at, from, to, over } => {
                    let course = coil::Course {
                        at_us: at.as_ticks(),
                        from_a: from.0,
                        to_a: to.0,
                        over_s: over.as_ticks() as f32 * 1e-6,
                    };
                    coil::go(now_us, &course);
                }
                Action::TestCoil => coil::test(now_us),
                Action::TraceCurrent { interval } => coil::trace(now_us, interval.0),
                Action::CorrectCurrent(correction) => coil::correct(correction),
                Action::ConfigureSensors { channels, rate } => want(Wanted {
                    channels: *channels,
                    rate_hz: rate.0,
                }),
                Action::Record { at, record } => {
                    if let Record::Fault(fault) = record {
                        if !fault.active {
                            coil::clear(fault.code);
                            // Where its cause lasts, it is a new one.
                            let [_, of_coil] = &mut self.standing;
                            of_coil.take_if(|code| *code == fault.code);
                        }
                        self.latched = match self.latched {
                            Some(code) if !fault.active && code == fault.code => None,
                            None if fault.active => Some(fault.code),
                            latched => latched,
                        };
                    }
                    self.outbox.send(at.as_ticks(), record);
                }
            }
        }
    }

    fn fail(&mut self, failure: Failure) {
        self.step(&Event::Fault(failure));
    }

    // ---- what happens ----

    fn sampled(&mut self, scan: &Scan) {
        // Whatever stood against converter or bus has ended with this.
        if let Some(code) = self.latched {
            self.step(&Event::Recovered(code));
        }
        defmt::debug!("procedure has {} us", scan.middle.as_ticks());
        self.step(&Event::Scan(scan));
    }

    fn received(&mut self, received: &Received) {
        match received {
            Ok(frame) if self.is_beyond_the_converter(frame) => {
                let kind = frame.message.kind();
                let refusal = Acknowledgement::new(&frame.header, kind, Outcome::OutOfRange);
                let now_us = Mono::now().as_ticks();
                self.outbox.send(now_us, &Record::Acknowledgement(refusal));
            }
            Ok(frame) => self.step(&Event::Command(frame)),
            Err(error) => self.step(&Event::NotUnderstood(*error)),
        }
    }

    /// Whether it asks for channels and a rate that the converter cannot follow. The procedure
    /// knows the limits of each by itself only.
    fn is_beyond_the_converter(&self, frame: &Frame<Command>) -> bool {
        let Command::SetSettings(settings) = &frame.message else {
            return false;
        };
        let wanted = Wanted {
            channels: settings.channels,
            rate_hz: settings.rate_hz,
        };
        let is_for_us = frame.message.is_for(self.boot_id, frame.header.boot_id);
        is_for_us && frame.message.validate().is_ok() && Scheme::new(wanted).is_err()
    }

    /// Reports failures when they begin, and those of the bridge when they end too. The converter's
    /// next sample shows that its failures have ended.
    fn follow_faults(&mut self) {
        if let Some(found) = coil::take_found() {
            self.step(&Event::CoilTested(found));
        }
        if let Some((at_us, trace)) = coil::take_trace() {
            let at = Instant::from_ticks(at_us);
            self.step(&Event::CurrentTraced { at, trace });
        }
        for (place, failure) in [report::fault(), coil::failure()].into_iter().enumerate() {
            let Some(standing) = self.standing.get_mut(place) else {
                continue;
            };
            let code = failure.as_ref().map(|failure| failure.code);
            let before = core::mem::replace(standing, code);
            if let Some(failure) = failure
                && before != code
            {
                self.fail(failure);
            }
        }
    }

    fn conditions(&mut self, now_us: u64) -> Conditions {
        let asleep_us = report::ASLEEP_US.get();
        let (then_us, slept_us) =
            core::mem::replace(&mut self.last_conditions, (now_us, asleep_us));
        let passed_us = now_us.saturating_sub(then_us) as f32;
        let idle = asleep_us.wrapping_sub(slept_us) as f32 / passed_us;
        Conditions {
            temperature: coil::temperature(),
            supply_v: coil::supply_v(),
            processor_load: (passed_us > 0.0).then_some((1.0 - idle).clamp(0.0, 1.0)),
            stack_bytes: board::stack_used(),
            logs_dropped: log::dropped(),
            bus_errors: report::BUS_ERRORS.get(),
            recoveries: report::RECOVERIES.get(),
        }
    }
}

/// A sample as the procedure takes it, with the current that flowed meanwhile.
fn scan_of(sampled: &Sampled) -> Scan {
    let half_us = u64::from(sampled.window_us / 2);
    let begin_us = sampled.time_us.saturating_sub(half_us);
    let end_us = begin_us + u64::from(sampled.window_us);
    let readings = sampled.frame.readings().iter();
    let conversions = readings
        .zip(sampled.offsets_us)
        .map(|(reading, offset_us)| Conversion {
            reading: *reading,
            offset: Duration::from_ticks(offset_us.into()),
        });
    let current_a = coil::mean_current_a(begin_us, end_us);
    let mut scan = Scan {
        sensor: 0,
        middle: Instant::from_ticks(sampled.time_us),
        window: Duration::from_ticks(sampled.window_us.into()),
        conversions: Vec::new(),
        lost: sampled.missed,
        gap: sampled.gap,
        current: current_a.map(Ampere),
        ripple: current_a.and_then(coil::ripple_a).map(Ampere),
        account: coil::account(),
    };
    scan.conversions.extend(conversions);
    scan
}

/// A decimal number from the build; 0 if it is none.
const fn decimal(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => 0,
    }
}

/// A hexadecimal number from the build; 0 if it is none.
const fn hexadecimal(text: &str) -> u32 {
    match u32::from_str_radix(text, 16) {
        Ok(number) => number,
        Err(_) => 0,
    }
}
