//! Random fault schedules: a chip with random switches, an unreliable bus, and a program that
//! follows the driver's documentation. Every reading that the program trusts is compared with the
//! simulated chip's own record of the conversion.

use std::{cell::RefCell, collections::BTreeMap, fmt};

use ldc161x::{
    Acquisition, Address, BusAccess, Channel, Error, Frame, Ldc161x, Model, Plan, Quality, Rate,
    ReferenceClock, Request, Sensor, Sequence,
};
use ldc161x_sim::{
    ActiveWrite, BurstRead, Bus, Chip, ChipFault, ConfigReadback, Counter, Deglitch33, Delay,
    EarlyTermination, FaultEvent, FlagRead, I2cError, IntbPin, InterruptRelease, Lost, Overhead,
    Overwrite, Path, RcountMinimum, Sensors, Settings, ShadowLatch, ShutdownPin, SleepExit,
    StatusReporting, Strike, Switches, Time, TrueConversion, UnreadCleared,
};
use rand::{RngExt, SeedableRng, seq::IndexedRandom};
use rand_pcg::Pcg64Mcg;

/// Length of the first part of a schedule, in which faults happen, in milliseconds of simulated
/// time; temporary faults are over by its end.
const FAULTS_MS: u64 = 60;
/// Time from the start of a schedule within which faults start, ms.
const FAULTS_BEGIN_WITHIN_MS: u64 = 40;
/// Longest duration of a temporary fault.
const LONGEST_FAULT_MS: u64 = 20;
/// Time after which a chip that is healthy again must deliver confirmed readings.
const RECOVERY_MS: u64 = 60;
/// Number of standard deviations from the truth at which a reading is wrong. A two-gate count errs
/// by at most two reference periods in all, five times the least deviation.
const WRONG_FROM_SIGMA: f64 = 6.0;

/// Faults that a schedule may contain, and the protection against them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrity {
    /// Every word is read twice: any fault may happen.
    ReadTwice,
    /// Every word is read once: faults that change bytes undetected on the wire are left out, since
    /// the bus has no checksum.
    ReadOnce,
    /// Every word is read once and any fault may happen: wrong words are counted, to show the
    /// benefit of reading twice and of the check by the ratio of counts.
    Unprotected,
}

/// Outcome of one schedule.
#[derive(Clone, Debug)]
pub struct ScheduleOutcome {
    /// Documented errors that occurred, by name.
    pub errors: BTreeMap<&'static str, u32>,
    /// Number of trusted readings.
    pub trusted: u32,
    /// Number of frames discarded because a later comparison of registers failed.
    pub withdrawn: u32,
    /// Number of successful recoveries.
    pub recoveries: u32,
    /// Unprotected schedules: trusted readings that differ from the chip's word.
    pub wrong: u32,
    /// Unprotected schedules: wrong trusted readings that were plausible as ratios of counts.
    pub wrong_but_plausible: u32,
    /// Whether the program measured again at the end. A permanent fault may prevent that.
    pub measuring: bool,
    /// Whether the schedule contained a permanent fault.
    pub lasting_fault: bool,
}

/// A violation of the driver's promises.
#[derive(Clone, Debug)]
pub struct Defect(pub String);

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Runs the schedule of `seed`; one in two reads words twice.
///
/// # Errors
///
/// The [`Defect`] found.
pub fn run(seed: u64) -> Result<ScheduleOutcome, Defect> {
    let integrity = if seed % 4 < 2 {
        Integrity::ReadTwice
    } else {
        Integrity::ReadOnce
    };
    run_with(integrity, seed)
}

/// Runs the schedule of `seed` with the given protection.
///
/// # Errors
///
/// The [`Defect`] found.
pub fn run_with(integrity: Integrity, seed: u64) -> Result<ScheduleOutcome, Defect> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let settings = Settings {
        seed,
        switches: switches(seed, integrity, &mut random),
        ..Settings::default()
    };
    let base = random.random_range(2.95e6..3.75e6);
    let depth = random.random_range(0.0..0.02);
    let press = move |channel: usize, time_s: f64| {
        base * (1.0 + 0.003 * channel as f64 - depth * (30.0 * time_s).sin().abs())
    };
    let plan = plan(integrity, &mut random);
    let mut chip = Chip::new(settings, press);
    let mut lasting_fault = false;
    let mut registers_disturbed = false;
    for _ in 0..random.random_range(1..=4) {
        let (event, lasts) = fault(integrity, &mut random);
        // If one fault changes a register and another one restores it before it is compared, only
        // the conversions show it: at most one fault per schedule changes single registers.
        let disturbs = matches!(
            event.fault,
            ChipFault::RegisterUpset { .. } | ChipFault::BrownOut(Lost::Registers(_))
        );
        if disturbs && registers_disturbed {
            continue;
        }
        registers_disturbed |= disturbs;
        lasting_fault |= lasts;
        chip.schedule(event)
            .map_err(|_| Defect("the schedule is full".into()))?;
    }
    let chip = RefCell::new(chip);
    let mut program = Program::new(&chip, &plan, integrity, &mut random);
    program.run(lasting_fault)?;
    Ok(ScheduleOutcome {
        lasting_fault,
        ..program.outcome
    })
}

/// One in two schedules differs from the defaults in one switch, the others in any number.
fn switches(seed: u64, integrity: Integrity, random: &mut Pcg64Mcg) -> Switches {
    let mut switches = if seed.is_multiple_of(2) {
        let all: Vec<_> = Switches::one_at_a_time().collect();
        all[(seed / 2) as usize % all.len()]
    } else {
        random_switches(random)
    };
    if integrity != Integrity::ReadTwice {
        // Without a latch the halves of a word can come from two conversions, which only reading
        // twice reveals.
        switches.shadow_latch = ShadowLatch::OnMsbRead;
    }
    switches
}

fn random_switches(random: &mut Pcg64Mcg) -> Switches {
    fn pick<T: Copy>(variants: &[T], random: &mut Pcg64Mcg) -> T {
        *variants.choose(random).expect("a switch has positions")
    }
    Switches {
        interrupt_release: pick(InterruptRelease::VARIANTS, random),
        unread_cleared: pick(UnreadCleared::VARIANTS, random),
        status_reporting: pick(StatusReporting::VARIANTS, random),
        overhead: pick(Overhead::VARIANTS, random),
        sleep_exit: pick(SleepExit::VARIANTS, random),
        config_readback: pick(ConfigReadback::VARIANTS, random),
        rcount_minimum: pick(RcountMinimum::VARIANTS, random),
        active_write: pick(ActiveWrite::VARIANTS, random),
        burst_read: pick(BurstRead::VARIANTS, random),
        deglitch_33: pick(Deglitch33::VARIANTS, random),
        counter: pick(Counter::VARIANTS, random),
        flag_read: pick(FlagRead::VARIANTS, random),
        shadow_latch: pick(ShadowLatch::VARIANTS, random),
        overwrite: pick(Overwrite::VARIANTS, random),
        early_termination: pick(EarlyTermination::VARIANTS, random),
    }
}

fn plan(integrity: Integrity, random: &mut Pcg64Mcg) -> Plan {
    let acquisitions = [
        Acquisition::Single(Channel::Zero),
        Acquisition::Single(Channel::Three),
        Acquisition::Autoscan(Sequence::ZeroToOne),
        Acquisition::Autoscan(Sequence::ZeroToTwo),
        Acquisition::Autoscan(Sequence::ZeroToThree),
    ];
    let acquisition = *acquisitions.choose(random).expect("there are some");
    let channels = u32::from(acquisition.channel_count());
    // Half of the bus capacity, or an eighth when each word is read twice.
    let share = if integrity == Integrity::ReadTwice {
        8
    } else {
        2
    };
    let rate = random.random_range(100..=4_000 / channels / share);
    let sensor = Sensor {
        // The simulated sensors: 3 kiloohm, quality factor 25.
        highest_quality_factor: 25,
        lowest_rp_ohm: 3_000,
        highest_rp_ohm: 3_000,
        ..Sensor::new(2_850_000, 3_800_000)
    };
    let clock = ReferenceClock::External { hz: 40_000_000 };
    Request::new(Model::Ldc1614, clock, acquisition, sensor)
        .rate(Rate::PerSecond(rate))
        .plan()
        .expect("the schedule's plan keeps every limit")
}

/// A random fault, and whether it is permanent.
fn fault(integrity: Integrity, random: &mut Pcg64Mcg) -> (FaultEvent, bool) {
    let fault = kind(integrity, random);
    let begin = Time::from_us(random.random_range(0..FAULTS_BEGIN_WITHIN_MS * 1_000));
    if random.random_ratio(1, 12) {
        return (FaultEvent::from(begin, fault), true);
    }
    let isolated = matches!(
        fault,
        ChipFault::BitFlip {
            strike: Strike::Byte(_),
            ..
        } | ChipFault::EarlyStop { .. }
    );
    // A chip that falls silent in the middle of a byte leaves ones on the wire without any sign:
    // for words read once, it is silent from the start of a transaction.
    let whole = integrity == Integrity::ReadOnce && fault == ChipFault::Absent;
    if isolated || whole || random.random_ratio(1, 3) {
        let first = random.random_range(0..400);
        let count = if isolated {
            1
        } else {
            random.random_range(1..30)
        };
        return (FaultEvent::in_transactions(first, count, fault), false);
    }
    let length = Time::from_us(random.random_range(1..LONGEST_FAULT_MS * 1_000));
    (FaultEvent::at(begin, fault, length), false)
}

fn kind(integrity: Integrity, random: &mut Pcg64Mcg) -> ChipFault {
    let kinds = if integrity == Integrity::ReadOnce {
        9
    } else {
        12
    };
    match random.random_range(0..kinds) {
        0 => ChipFault::Nack {
            after_bytes: random.random_range(0..12),
        },
        1 => ChipFault::Absent,
        2 => ChipFault::ClockLoss,
        3 => ChipFault::SclStuck,
        4 => ChipFault::BrownOut(Lost::Everything),
        // RCOUNT0 to DRIVE_CURRENT3.
        5 => ChipFault::BrownOut(Lost::Registers(random.random::<u64>() & 0x3_FFFF_FF00)),
        6 => ChipFault::RegisterUpset {
            address: random.random_range(0x08..=0x21),
            bits: 1 << random.random_range(0..16),
        },
        7 => ChipFault::WrongIdentity {
            manufacturer: 0x5449,
            device: random.random(),
        },
        8 => ChipFault::IntbStuck {
            low: random.random(),
        },
        // The faults from here on change bytes undetected on the wire.
        9 => ChipFault::SdaStuck {
            clocks: random
                .random::<bool>()
                .then_some(random.random_range(1..10)),
        },
        10 => {
            let path = *[Path::ReadData, Path::WriteData, Path::Pointer]
                .choose(random)
                .expect("some");
            // Single flips, or one in ten thousand bytes: a thousand times the rate of a reasonable
            // bus. Both readings of one word are then hit alike less than once in a billion words.
            let strike = if random.random() {
                Strike::Byte(random.random_range(0..12))
            } else {
                Strike::Probability(1e-4)
            };
            ChipFault::BitFlip { path, strike }
        }
        _ => ChipFault::EarlyStop {
            after_bytes: random.random_range(0..16),
        },
    }
}

/// A reading without any contrary evidence so far.
struct Trusted {
    frame: u32,
    reading: ldc161x::Reading,
    truth: Option<TrueConversion>,
}

/// A careful user's program with the driver.
struct Program<'a, S> {
    chip: &'a RefCell<Chip<S>>,
    plan: &'a Plan,
    driver: Ldc161x<Bus<'a, S>>,
    interrupt: IntbPin<'a, S>,
    shutdown: ShutdownPin<'a, S>,
    delay: Delay<'a, S>,
    bus: Bus<'a, S>,
    /// Readings not yet confirmed by a round of register comparisons.
    provisional: Vec<Trusted>,
    /// Number of frames between two register comparisons.
    frames_per_canary: u32,
    integrity: Integrity,
    failed: bool,
    outcome: ScheduleOutcome,
}

type DriverError = Error<I2cError>;

impl<'a, S: Sensors> Program<'a, S> {
    fn new(
        chip: &'a RefCell<Chip<S>>,
        plan: &'a Plan,
        integrity: Integrity,
        random: &mut Pcg64Mcg,
    ) -> Self {
        let accesses = [
            BusAccess::FramePerTransaction,
            BusAccess::RegisterPerTransaction,
            BusAccess::SeparateTransfers,
        ];
        let mut driver = Ldc161x::new(bus(chip), Model::Ldc1614, Address::AddrLow);
        driver.set_access(*accesses.choose(random).expect("there are some"));
        driver.set_read_twice(integrity == Integrity::ReadTwice);
        Self {
            chip,
            plan,
            driver,
            interrupt: IntbPin::new(chip),
            shutdown: ShutdownPin::new(chip),
            delay: Delay::new(chip),
            bus: bus(chip),
            provisional: Vec::new(),
            frames_per_canary: random.random_range(1..=4),
            integrity,
            failed: true,
            outcome: ScheduleOutcome {
                errors: BTreeMap::new(),
                trusted: 0,
                withdrawn: 0,
                recoveries: 0,
                wrong: 0,
                wrong_but_plausible: 0,
                measuring: false,
                lasting_fault: false,
            },
        }
    }

    fn now(&self) -> Time {
        self.chip.borrow().now()
    }

    fn run(&mut self, lasting_fault: bool) -> Result<(), Defect> {
        let mut running = self.begin();
        running = self.run_until(Time::from_ms(FAULTS_MS), running)?;
        if !lasting_fault {
            self.chip.borrow_mut().clear_faults();
        }
        self.finish(running, lasting_fault)
    }

    fn run_until(&mut self, end: Time, mut running: bool) -> Result<bool, Defect> {
        while self.now() < end {
            let before = self.now();
            running = if running {
                self.measure()?
            } else {
                self.recover()
            };
            if self.now() <= before {
                return Err(Defect(format!("no progress at {before:?}")));
            }
        }
        Ok(running)
    }

    /// Finishes the schedule when all temporary faults have passed: unless a permanent one remains,
    /// the program must detect its losses, recover, and measure again.
    fn finish(&mut self, mut running: bool, lasting_fault: bool) -> Result<(), Defect> {
        let end = self.now() + Time::from_ms(RECOVERY_MS);
        while self.now() < end && !self.outcome.measuring {
            let verified = if running { self.verify()? } else { false };
            running = verified || self.recover();
            if running {
                let some_frames = self.now() + Time::from_ms(RECOVERY_MS / 3);
                running = self.run_until(some_frames, running)?;
                let good = !self.provisional.is_empty();
                self.outcome.measuring = running && self.verify()? && good;
            }
        }
        self.withdraw();
        if self.outcome.measuring || lasting_fault {
            Ok(())
        } else {
            Err(Defect(format!(
                "did not recover; errors met: {:?}",
                self.outcome.errors
            )))
        }
    }

    /// Compares every register; confirms or withdraws the earlier readings.
    fn verify(&mut self) -> Result<bool, Defect> {
        match self.driver.verify() {
            Ok(canary) => self.confirm(canary.confirmed).map(|()| true),
            Err(error) => Ok(self.carry_on(Err(error))),
        }
    }

    fn begin(&mut self) -> bool {
        let result = self
            .driver
            .start(&self.plan.configuration)
            .and_then(|()| self.probe());
        self.carry_on(result)
    }

    fn probe(&mut self) -> Result<(), DriverError> {
        self.driver
            .probe_interrupt_release(&mut self.interrupt, &mut self.delay)
            .map(drop)
    }

    /// Reads one frame, and compares registers now and then. Returns whether the chip still runs.
    fn measure(&mut self) -> Result<bool, Defect> {
        let frame = self
            .driver
            .wait_for_interrupt(&mut self.interrupt, &mut self.delay)
            .and_then(|()| self.driver.read_frame());
        let frame = match frame {
            Ok(frame) => frame,
            // One failed transfer is repeated; any other error requires a recovery.
            Err(error @ Error::Bus { .. }) if !self.failed => {
                self.count(&error);
                self.failed = true;
                return Ok(true);
            }
            Err(error) => return Ok(self.carry_on(Err(error))),
        };
        self.take(&frame)?;
        if frame.number.is_multiple_of(self.frames_per_canary) {
            match self.driver.check_canary() {
                Ok(canary) => self.confirm(canary.confirmed)?,
                Err(error) => return Ok(self.carry_on(Err(error))),
            }
        }
        Ok(true)
    }

    fn take(&mut self, frame: &Frame) -> Result<(), Defect> {
        if self.failed && !frame.marks.gap {
            return Err(Defect(format!("frame {} hides a gap", frame.number)));
        }
        self.failed = false;
        for reading in frame.readings() {
            if reading.quality() == Quality::Good {
                let truth = self
                    .chip
                    .borrow()
                    .last_read(reading.channel.number())
                    .copied();
                self.provisional.push(Trusted {
                    frame: frame.number,
                    reading: *reading,
                    truth,
                });
            }
        }
        Ok(())
    }

    /// Trusts the readings confirmed by a complete round of comparisons, and checks them against
    /// the truth.
    fn confirm(&mut self, up_to: Option<u32>) -> Result<(), Defect> {
        let Some(up_to) = up_to else { return Ok(()) };
        let (confirmed, rest): (Vec<_>, Vec<_>) = self
            .provisional
            .drain(..)
            .partition(|trusted| trusted.frame <= up_to);
        self.provisional = rest;
        for trusted in confirmed {
            self.outcome.trusted += 1;
            match check(&trusted) {
                Err(_) if self.integrity == Integrity::Unprotected => self.count_wrong(&trusted),
                verdict => verdict?,
            }
        }
        Ok(())
    }

    fn count_wrong(&mut self, trusted: &Trusted) {
        let scale = self.plan.configuration.scale(trusted.reading.channel);
        let ratio = scale.rational(trusted.reading.word.code());
        self.outcome.wrong += 1;
        self.outcome.wrong_but_plausible += u32::from(ratio.plausible == Some(true));
    }

    fn withdraw(&mut self) {
        self.outcome.withdrawn += self.provisional.len() as u32;
        self.provisional.clear();
    }

    /// Counts an error. Returns whether the program may continue without a recovery.
    fn carry_on(&mut self, result: Result<(), DriverError>) -> bool {
        let Err(error) = result else { return true };
        self.count(&error);
        self.withdraw();
        self.failed = true;
        false
    }

    fn count(&mut self, error: &DriverError) {
        let name = match error {
            Error::Bus { .. } => "bus",
            Error::WrongIdentity { .. } => "wrong identity",
            Error::ReadBack { .. } => "read-back",
            Error::RegistersLost { .. } => "registers lost",
            Error::NoSuchChannel => "no such channel",
            Error::NotStarted => "not started",
            Error::NotRunning => "not running",
            Error::FrameLength { .. } => "frame length",
            Error::NoInterrupt { .. } => "no interrupt",
            Error::InterruptStuck => "interrupt stuck",
            Error::Pin => "pin",
        };
        *self.outcome.errors.entry(name).or_default() += 1;
    }

    /// Recovers: nine clocks, the SD pin, the requested configuration, the probe.
    fn recover(&mut self) -> bool {
        // The pulses may free SDA or not; the reset follows in either case.
        let _ = self.bus.clock_pulses(9);
        let result = self
            .driver
            .recover_by_shutdown(&mut self.shutdown, &mut self.delay)
            .and_then(|()| self.probe());
        let recovered = self.carry_on(result);
        self.outcome.recoveries += u32::from(recovered);
        recovered
    }
}

/// A bus whose master waits 1 ms for a stuck line.
fn bus<S: Sensors>(chip: &RefCell<Chip<S>>) -> Bus<'_, S> {
    Bus::new(chip, 400_000).with_deadline(Time::from_ms(1))
}

/// Checks a trusted reading: it must be the word of the conversion that the chip recorded as read,
/// and that conversion must be valid.
fn check(trusted: &Trusted) -> Result<(), Defect> {
    let Trusted {
        reading,
        truth,
        frame,
    } = trusted;
    let wrong = |why: &str| {
        Err(Defect(format!(
            "frame {frame}: a wrong reading called good ({why}): {reading:?} {truth:?}"
        )))
    };
    let Some(truth) = truth else {
        return wrong("nothing was converted");
    };
    if reading.word.code().get() != truth.word {
        return wrong("another word");
    }
    if truth.spoilt || truth.errors != ldc161x_sim::Errors::default() {
        return wrong("an unsound conversion");
    }
    let error = (reading.frequency_hz - truth.oscillation_hz).abs();
    if error > WRONG_FROM_SIGMA * f64::from(reading.sigma_hz) {
        return wrong("far from the truth");
    }
    Ok(())
}

/// Results of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Number of schedules run.
    pub schedules: u64,
    /// Schedules that measured at their end.
    pub measuring: u64,
    /// Schedules with a permanent fault.
    pub lasting: u64,
    /// Trusted readings, all right.
    pub trusted: u64,
    /// Withdrawn readings.
    pub withdrawn: u64,
    /// Recoveries.
    pub recoveries: u64,
    /// Unprotected schedules: wrong words trusted.
    pub wrong: u64,
    /// Unprotected schedules: wrong words trusted that were plausible as ratios of counts.
    pub wrong_but_plausible: u64,
    /// Documented errors by name.
    pub errors: BTreeMap<&'static str, u64>,
    /// Defects, with their seeds.
    pub defects: Vec<(u64, Defect)>,
}

impl Summary {
    fn add(&mut self, outcome: ScheduleOutcome) {
        self.measuring += u64::from(outcome.measuring);
        self.lasting += u64::from(outcome.lasting_fault);
        self.trusted += u64::from(outcome.trusted);
        self.withdrawn += u64::from(outcome.withdrawn);
        self.recoveries += u64::from(outcome.recoveries);
        self.wrong += u64::from(outcome.wrong);
        self.wrong_but_plausible += u64::from(outcome.wrong_but_plausible);
        for (name, times) in outcome.errors {
            *self.errors.entry(name).or_default() += u64::from(times);
        }
    }

    /// Adds another campaign's figures.
    pub fn merge(&mut self, other: Self) {
        self.schedules += other.schedules;
        self.measuring += other.measuring;
        self.lasting += other.lasting;
        self.trusted += other.trusted;
        self.withdrawn += other.withdrawn;
        self.recoveries += other.recoveries;
        self.wrong += other.wrong;
        self.wrong_but_plausible += other.wrong_but_plausible;
        for (name, times) in other.errors {
            *self.errors.entry(name).or_default() += times;
        }
        self.defects.extend(other.defects);
    }
}

/// Runs the schedules of seeds `first` to `first + count - 1` by `run`, which is [`run`] or calls
/// [`run_with`] with one kind of protection.
pub fn campaign(
    first: u64,
    count: u64,
    run: impl Fn(u64) -> Result<ScheduleOutcome, Defect>,
) -> Summary {
    let mut summary = Summary::default();
    for seed in first..first + count {
        summary.schedules += 1;
        match run(seed) {
            Err(defect) => summary.defects.push((seed, defect)),
            Ok(outcome) => summary.add(outcome),
        }
    }
    summary
}
