//! The tests; each settles a behaviour about which sources disagree (docs/fidelity.md).

use ldc161x::{Code28, DriveCode, Hypothesis, PlausibilityCount, Rational, Rcount, Word};
use ldc161x_sim::{
    ActiveWrite, BurstRead, ConfigReadback, Counter, Deglitch33, EarlyTermination, FlagRead,
    InterruptRelease, Overhead, Overwrite, RcountMinimum, ShadowLatch, SleepExit, StatusReporting,
    Switches, UnreadCleared,
};
use palpate_cli::failure::Failure;

use super::converter::register::{DATA_LSB, DATA_MSB, STATUS};
use super::converter::{
    ACTIVE, Converter, MUX, OWN_DRIVE, Op, READY, REPORTS, SCAN, Setup, UNREAD, register,
};

/// Bounds of an amplitude without a flag, V (datasheet 8.1.5).
const CLEAN_V: [f64; 2] = [1.2, 1.8];
/// DATA_MSB: all flags.
const FLAGS: u16 = 0xF << 12;

/// What the converter finds of the sensor on channel 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tank {
    pub(super) frequency_hz: Option<f64>,
    /// Bounds of the parallel resistance, ohm; `None` if no drive gives an amplitude without a flag.
    pub(super) parallel_ohm: Option<[f64; 2]>,
}

/// Result of a test.
pub(super) struct TestFinding {
    pub(super) test: &'static str,
    pub(super) found: String,
}

type Result<T> = std::result::Result<T, Failure>;

/// Conversions of 4.3 ms: longer than all accesses that a test makes during one conversion.
const SLOW: Setup = Setup {
    rcount: 8_000,
    ..QUICK
};
/// A conversion of 0.5 ms.
const QUICK: Setup = Setup {
    rcount: 1_000,
    drive: 0xA000,
    divider: 6,
    mux: MUX,
    reports: REPORTS,
    input_divider: 1,
};
/// Divisors that give CLKIN from 200 MHz, all within the limit of 35 MHz with one channel.
const DIVISORS: [u8; 5] = [6, 8, 10, 11, 13];
/// Number of words from which a standard deviation is computed.
const WORDS: usize = 40;
/// DATA_MSB: amplitude flag.
const AMPLITUDE: u16 = 1 << 12;

/// State of the tests.
pub(super) struct Tests {
    converter: Converter,
    /// Switches found so far. The others have the defaults of the simulation.
    pub(super) switches: Switches,
    pub(super) findings: Vec<TestFinding>,
    /// DRIVE_CURRENT0 that the converter found for the sensor.
    drive: u16,
    pub(super) tank: Tank,
}

impl Tests {
    pub(super) fn new(converter: Converter) -> Self {
        Self {
            converter,
            switches: Switches::default(),
            findings: Vec::new(),
            drive: QUICK.drive,
            tank: Tank::default(),
        }
    }

    /// Runs all tests; the dip of the supply only if the board makes it or the user requested it.
    pub(super) fn run(&mut self, dip: bool, done: impl Fn()) -> Result<()> {
        self.converter.greet()?;
        for test in [
            Self::first_wake,
            Self::burst,
            Self::find_drive,
            Self::measure_tank,
            Self::words,
            Self::intervals,
            Self::interrupt,
            Self::status,
            Self::flags,
            Self::halves,
            Self::overwriting,
            Self::active_writes,
            Self::limits,
            Self::drive_steps,
            Self::noise,
            Self::broken_off,
            Self::locking,
        ] {
            test(self)?;
            done();
        }
        if dip || self.converter.0.dips_itself() {
            self.supply_dip()?;
        }
        self.converter.reset()
    }

    fn tell(&mut self, test: &'static str, found: String) {
        self.findings.push(TestFinding { test, found });
    }

    fn setup(&self, setup: Setup) -> Setup {
        Setup {
            drive: self.drive,
            ..setup
        }
    }

    /// Reads CONFIG after a reset, and tests whether leaving sleep loses the registers.
    fn first_wake(&mut self) -> Result<()> {
        self.converter.reset()?;
        let config = self.converter.read(register::CONFIG)?;
        self.switches.config_readback = match config {
            0x2800 => ConfigReadback::ReservedAsZero,
            _ => ConfigReadback::AsWritten,
        };
        self.converter.start(&QUICK)?;
        self.converter.pause_ms(20)?;
        let rcount = self.converter.read(register::RCOUNT)?;
        self.switches.sleep_exit = if rcount == QUICK.rcount {
            SleepExit::Keeps
        } else {
            SleepExit::LosesOnce
        };
        self.tell(
            "CONFIG after a reset; registers after sleep",
            format!("{config:#06x}; RCOUNT0 {rcount} of {}", QUICK.rcount),
        );
        Ok(())
    }

    /// 1: reads four bytes from MANUFACTURER_ID on.
    fn burst(&mut self) -> Result<()> {
        let bytes = self.converter.read_bytes(register::MANUFACTURER, 4)?;
        self.switches.burst_read = match bytes[..] {
            [0x54, 0x49, 0x30, 0x55] => BurstRead::AutoIncrement,
            [0x54, 0x49, 0x54, 0x49] => BurstRead::Repeats,
            _ => BurstRead::Released,
        };
        self.tell("1. four bytes from 0x7E", format!("{bytes:02x?}"));
        Ok(())
    }

    /// Lets the converter find the drive of the sensor, and uses one code less.
    fn find_drive(&mut self) -> Result<()> {
        self.converter.prepare(&QUICK)?;
        self.converter
            .write(register::CONFIG, ACTIVE & !OWN_DRIVE)?;
        self.converter.pause_ms(20)?;
        let found = self.converter.read(register::DRIVE_CURRENT)? >> 6 & 0x1F;
        let drive = found.saturating_sub(1);
        self.drive = drive << 11;
        self.tell("drive that the converter seeks", format!("code {found}"));
        Ok(())
    }

    /// Measures the sensor's frequency, and its parallel resistance by the drives that give an amplitude without a flag.
    fn measure_tank(&mut self) -> Result<()> {
        let setup = self.setup(SLOW);
        self.converter.start(&setup)?;
        self.converter.words(2)?;
        let hz = mean(&self.converter.words(8)?) * setup.reference_hz();
        self.tank.frequency_hz = (hz > 0.0).then_some(hz);
        let mut clean = Vec::new();
        for code in 0..=DriveCode::STRONGEST.code() {
            let drive = u16::from(code) << 11;
            self.converter.start(&Setup { drive, ..QUICK })?;
            self.converter.pause_ms(5)?;
            if self.converter.read(DATA_MSB)? & FLAGS == 0 {
                clean.push(code);
            }
        }
        self.tank.parallel_ohm = parallel_ohm(&clean);
        let resistance = self.tank.parallel_ohm.map_or_else(
            || "no drive without a flag".to_owned(),
            |[least, greatest]| format!("RP {least:.0} to {greatest:.0} ohm"),
        );
        self.tell(
            "frequency, and RP by the drives without a flag",
            format!("{:.4} MHz; {resistance}", 1e-6 * hz),
        );
        Ok(())
    }

    fn counts(&mut self, setup: Setup, count: usize) -> Result<(PlausibilityCount, f64)> {
        self.converter.start(&setup)?;
        let words = self.converter.words(count)?;
        let mut counts = PlausibilityCount::default();
        let rcount = Rcount::new(setup.rcount);
        for word in &words {
            if let (Some(rcount), Some(code)) = (rcount, code(*word)) {
                counts.add(&Rational::decode(code, rcount));
            }
        }
        Ok((counts, relative_deviation(&words)))
    }

    /// 2: tests words as ratios of counts. Derives the counting method from their scatter over
    /// several clocks, since the scatter at a single clock depends on the phase.
    fn words(&mut self) -> Result<()> {
        let mut squares = 0.0;
        let mut all = PlausibilityCount::default();
        for divider in DIVISORS {
            let setup = self.setup(Setup { divider, ..QUICK });
            let (counts, deviation) = self.counts(setup, WORDS)?;
            all.words += counts.words;
            all.plausible += counts.plausible;
            all.expected_by_chance += counts.expected_by_chance;
            squares += (deviation * f64::from(setup.rcount)).powi(2);
        }
        let divided = self.setup(Setup {
            input_divider: 2,
            ..QUICK
        });
        let (by_two, _) = self.counts(divided, WORDS / 2)?;
        let k = (squares / DIVISORS.len() as f64).sqrt();
        // The limit is between 0.018 (two gates) and 0.0128 (half periods), for a sensor at rest.
        self.switches.counter = if k > 0.0152 {
            Counter::TwoGates
        } else {
            Counter::HalfPeriods
        };
        let holds = |counts: &PlausibilityCount| match counts.hypothesis() {
            Hypothesis::Holds => "ratios of counts",
            Hypothesis::Fails => "no ratios of counts",
            Hypothesis::Undecided => "undecided",
        };
        self.tell(
            "2. words as M/N",
            format!(
                "{} ({} of {}), with FIN_DIVIDER 2 {}; scatter {k:.4}/RCOUNT",
                holds(&all),
                all.plausible,
                all.words,
                holds(&by_two),
            ),
        );
        Ok(())
    }

    fn period(&mut self, setup: Setup) -> Result<f64> {
        self.converter.start(&setup)?;
        self.converter.words(2)?;
        Ok(self.converter.edges(200)?.period_s())
    }

    /// 3: measures the excess of an interval over 16 RCOUNT clocks, with two reference clocks.
    fn intervals(&mut self) -> Result<()> {
        let mut texts = Vec::new();
        let mut measured = Vec::new();
        for divider in [6, 12] {
            // Conversions of two lengths separate the clock from the overhead. Both lengths exceed
            // two transfers, so no edge of the sequence is seen late.
            let [short, long] = [1_500, 3_000].map(|rcount| Setup {
                rcount,
                divider,
                ..QUICK
            });
            let (short, long) = (self.setup(short), self.setup(long));
            let (of_short_s, of_long_s) = (self.period(short)?, self.period(long)?);
            let clocks = 16.0 * f64::from(long.rcount - short.rcount);
            let clock_hz = clocks / (of_long_s - of_short_s);
            let overhead_s = of_short_s - 16.0 * f64::from(short.rcount) / long.reference_hz();
            texts.push(format!(
                "{:.1} ns at {:.3} MHz",
                overhead_s * 1e9,
                clock_hz * 1e-6
            ));
            measured.push((long.reference_hz(), overhead_s));
        }
        let miss = |overhead: &Overhead| -> f64 {
            let misses = measured.iter();
            misses
                .map(|(hz, seconds)| (overhead.seconds(*hz) - seconds).powi(2))
                .sum()
        };
        let nearest = Overhead::VARIANTS
            .iter()
            .min_by(|one, other| miss(one).total_cmp(&miss(other)));
        self.switches.overhead = nearest.copied().unwrap_or_default();
        self.tell("3. interval beyond 16 RCOUNT", texts.join(", "));
        Ok(())
    }

    /// 4: tests what releases INTB, and what clears UNREADCONV.
    fn interrupt(&mut self) -> Result<()> {
        let setup = self.setup(SLOW);
        self.converter.start(&setup)?;
        self.converter.words(2)?;
        let [.., level, _, _, _, second] = self.converter.at_once::<9>(&[
            Op::Read(STATUS),
            Op::Read(DATA_MSB),
            Op::Interrupt,
            Op::Read(DATA_MSB),
            Op::Read(DATA_LSB),
            Op::Level,
            Op::Read(STATUS),
            Op::Read(DATA_MSB),
            Op::Interrupt,
            Op::Read(STATUS),
            Op::Read(STATUS),
        ])?;
        let released = level == 1;
        self.switches.interrupt_release = if released {
            InterruptRelease::StatusOrData
        } else {
            InterruptRelease::StatusOnly
        };
        let still_unread = second & UNREAD != 0;
        self.switches.unread_cleared = if still_unread {
            UnreadCleared::DataOnly
        } else {
            UnreadCleared::DataOrStatus
        };
        self.tell(
            "4. INTB after DATA alone; UNREADCONV after STATUS",
            format!(
                "{}; {}",
                if released { "released" } else { "still low" },
                if still_unread { "still set" } else { "cleared" }
            ),
        );
        Ok(())
    }

    /// Tests whether STATUS shows a result whose interrupt is not enabled.
    fn status(&mut self) -> Result<()> {
        let setup = self.setup(Setup {
            reports: 0,
            ..QUICK
        });
        self.converter.start(&setup)?;
        self.converter.pause_ms(20)?;
        let status = self.converter.read(STATUS)?;
        let shown = status & READY != 0;
        self.switches.status_reporting = if shown {
            StatusReporting::Always
        } else {
            StatusReporting::OnlyWhenEnabled
        };
        self.tell("STATUS with nothing enabled", format!("{status:#06x}"));
        Ok(())
    }

    /// Tests whether reading DATA clears its flags. The weakest drive gives the flag of a low
    /// amplitude.
    fn flags(&mut self) -> Result<()> {
        let weak = Setup { drive: 0, ..SLOW };
        self.converter.start(&weak)?;
        self.converter.words(2)?;
        let [.., first, again] = self.converter.at_once::<4>(&[
            Op::Read(STATUS),
            Op::Read(DATA_MSB),
            Op::Interrupt,
            Op::Read(DATA_MSB),
            Op::Read(DATA_MSB),
        ])?;
        let kept = again & AMPLITUDE != 0;
        if first & AMPLITUDE != 0 {
            self.switches.flag_read = if kept {
                FlagRead::Keeps
            } else {
                FlagRead::Clears
            };
        }
        self.tell(
            "flags of DATA read twice",
            match (first & AMPLITUDE != 0, kept) {
                (false, _) => "no flag appeared: undecided".to_owned(),
                (true, true) => "kept".to_owned(),
                (true, false) => "cleared".to_owned(),
            },
        );
        Ok(())
    }

    /// Tests whether DATA_LSB belongs to the previously read DATA_MSB.
    fn halves(&mut self) -> Result<()> {
        let setup = self.setup(SLOW);
        self.converter.start(&setup)?;
        self.converter.words(2)?;
        let (mut old, mut new) = (0, 0);
        for _ in 0..8 {
            let [_, _, _, _, first, _, late, _, _, newest] = self.converter.at_once(&[
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Interrupt,
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Read(DATA_LSB),
                Op::Read(DATA_MSB),
                Op::Interrupt,
                Op::Read(DATA_LSB),
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Read(DATA_LSB),
            ])?;
            old += u32::from(late == first && late != newest);
            new += u32::from(late == newest && late != first);
        }
        if old != new {
            self.switches.shadow_latch = if old > new {
                ShadowLatch::OnMsbRead
            } else {
                ShadowLatch::None
            };
        }
        self.tell(
            "DATA_LSB read a conversion after DATA_MSB",
            format!("of the old word {old} times, of the new one {new} times"),
        );
        Ok(())
    }

    /// Tests whether channel 0 of a scan is overwritten before the next scan ends.
    fn overwriting(&mut self) -> Result<()> {
        let setup = self.setup(Setup {
            mux: MUX | SCAN,
            ..SLOW
        });
        self.converter.prepare(&setup)?;
        for (register, value) in [
            (register::RCOUNT, setup.rcount),
            (register::SETTLECOUNT, 0x40),
            (register::CLOCK_DIVIDERS, setup.input_divider << 12 | 1),
            (register::DRIVE_CURRENT, setup.drive),
        ] {
            // The register of channel 1 follows that of channel 0.
            self.converter.write(register + 1, value)?;
        }
        self.converter.write(register::CONFIG, ACTIVE)?;
        self.converter.words(2)?;
        let (mut early, mut scans) = (0, 0);
        for _ in 0..8 {
            // A conversion takes 4.3 ms: 6 ms after INTB the conversion of channel 0 has ended, and
            // the conversion of channel 1 has not.
            let [_, _, _, high, low, later_high, later_low, level] = self.converter.at_once(&[
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Interrupt,
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Read(DATA_LSB),
                Op::Pause(6),
                Op::Read(DATA_MSB),
                Op::Read(DATA_LSB),
                Op::Level,
            ])?;
            scans += u32::from(level == 1);
            let is_new = (high & 0x0FFF, low) != (later_high & 0x0FFF, later_low);
            early += u32::from(level == 1 && is_new);
        }
        if scans > 0 {
            self.switches.overwrite = if early > 0 {
                Overwrite::ByChannel
            } else {
                Overwrite::ByScan
            };
        }
        self.tell(
            "DATA of channel 0 between two scans",
            format!("a new word in {early} of {scans} scans"),
        );
        Ok(())
    }

    /// 5: writes a register while converting.
    fn active_writes(&mut self) -> Result<()> {
        let setup = self.setup(SLOW);
        self.converter.start(&setup)?;
        let before = self.converter.words(4)?;
        let (mut taken, mut spoilt) = (0, 0);
        let count = 6;
        for slot in 0..count {
            let value = 0x41 + slot;
            let [_, _, _, _, read, _, high, low] = self.converter.at_once(&[
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Interrupt,
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Write(register::SETTLECOUNT, value),
                Op::Read(register::SETTLECOUNT),
                // Waits for the end of the conversion in which the register was written.
                Op::Interrupt,
                Op::Read(STATUS),
                Op::Read(DATA_MSB),
                Op::Read(DATA_LSB),
            ])?;
            let word = u32::from(high) << 16 | u32::from(low);
            taken += u16::from(read == value);
            spoilt += u16::from(!are_alike(&before, &[word]));
        }
        self.switches.active_write = match (taken, spoilt) {
            (0, _) => ActiveWrite::Ignored,
            (_, 0) => ActiveWrite::Accepted,
            _ => ActiveWrite::CorruptsConversion,
        };
        self.tell(
            "5. registers written while converting",
            format!("{taken} of {count} accepted, {spoilt} conversions corrupted"),
        );
        Ok(())
    }

    /// Finds the smallest RCOUNT that converts, and the code of the widest deglitch filter.
    fn limits(&mut self) -> Result<()> {
        let good = self.setup(QUICK);
        self.converter.start(&good)?;
        let right = self.converter.words(4)?;
        let least = self.setup(Setup { rcount: 6, ..QUICK });
        self.converter.start(&least)?;
        self.converter.pause_ms(5)?;
        let msb = self.converter.read(DATA_MSB)?;
        let lsb = self.converter.read(DATA_LSB)?;
        let counts = Word::from_registers(msb, lsb).code().get() != 0;
        self.switches.rcount_minimum = if counts {
            RcountMinimum::Five
        } else {
            RcountMinimum::Nine
        };
        let mut passes = [false; 2];
        for (slot, code) in passes.iter_mut().zip([0b111, 0b011]) {
            let setup = self.setup(Setup {
                mux: MUX & !0b111 | code,
                ..QUICK
            });
            self.converter.start(&setup)?;
            self.converter.words(2)?;
            *slot = are_alike(&right, &self.converter.words(4)?);
        }
        self.switches.deglitch_33 = match passes {
            [false, true] => Deglitch33::Code011,
            _ => Deglitch33::Code111,
        };
        self.tell(
            "RCOUNT 6; deglitch codes 111, 011",
            format!(
                "{}; {}",
                if counts { "counts" } else { "zero" },
                passes
                    .map(|it| if it { "right" } else { "wrong" })
                    .join(", ")
            ),
        );
        Ok(())
    }

    /// 6: finds the registers that a dip of the supply changes.
    fn supply_dip(&mut self) -> Result<()> {
        let setup = self.setup(QUICK);
        self.converter.start(&setup)?;
        let registers = [
            register::RCOUNT,
            register::SETTLECOUNT,
            register::CLOCK_DIVIDERS,
            register::ERROR_CONFIG,
            register::CONFIG,
            register::MUX_CONFIG,
            register::DRIVE_CURRENT,
        ];
        let read = |tests: &mut Self| -> Result<Vec<u16>> {
            registers
                .iter()
                .map(|&it| tests.converter.read(it))
                .collect()
        };
        let before = read(self)?;
        self.converter.0.dip()?;
        self.converter.pause_ms(20)?;
        let after = read(self)?;
        let changed: Vec<String> = registers
            .iter()
            .zip(before.iter().zip(&after))
            .filter(|(_, (before, after))| before != after)
            .map(|(register, _)| format!("{register:#04x}"))
            .collect();
        let found = if changed.is_empty() {
            "no register changed".to_owned()
        } else {
            format!("changed: {}", changed.join(", "))
        };
        self.tell("6. a dip of the supply", found);
        Ok(())
    }

    /// 7: measures the frequency's step for a step of the drive.
    fn drive_steps(&mut self) -> Result<()> {
        let mut steps = Vec::new();
        let mut last = None;
        for code in [-1, 0, 1] {
            let drive = (i32::from(self.drive >> 11) + code).clamp(0, 31) as u16;
            let setup = Setup {
                drive: drive << 11,
                ..SLOW
            };
            self.converter.start(&setup)?;
            self.converter.words(2)?;
            let hz = mean(&self.converter.words(8)?) * setup.reference_hz();
            steps.extend(last.map(|last: f64| format!("{:+.1} Hz", hz - last)));
            last = Some(hz);
        }
        self.tell("7. a step of the drive, down and up", steps.join(", "));
        Ok(())
    }

    /// 8: measures the scatter of the words for several RCOUNT.
    fn noise(&mut self) -> Result<()> {
        let mut points = Vec::new();
        for rcount in [300, 1_200, 4_800] {
            let setup = self.setup(Setup { rcount, ..QUICK });
            self.converter.start(&setup)?;
            let words = self.converter.words(WORDS)?;
            points.push((
                f64::from(rcount).ln(),
                relative_deviation(&words).max(1e-12).ln(),
            ));
        }
        let slope = match points[..] {
            [(from, high), .., (to, low)] => (low - high) / (to - from),
            _ => 0.0,
        };
        self.tell("8. scatter over RCOUNT", format!("exponent {slope:.2}"));
        Ok(())
    }

    /// 9: tests a truncated transfer, and a write that ends after half of the register.
    fn broken_off(&mut self) -> Result<()> {
        let setup = self.setup(QUICK);
        self.converter.prepare(&setup)?;
        self.converter.write(register::RCOUNT_1, 0x1234)?;
        self.converter.write_half(register::RCOUNT_1, 0x56)?;
        let next = self.converter.try_read(register::MANUFACTURER)?;
        let register = self.converter.try_read(register::RCOUNT_1)?;
        let harmless = next == Some(0x5449) && register == Some(0x1234);
        self.switches.early_termination = if harmless {
            EarlyTermination::Harmless
        } else {
            EarlyTermination::CorruptsFollowing
        };
        self.converter.cut_off(33)?;
        let stuck = !self.converter.data_is_high()?;
        self.converter.pulses(9)?;
        // A truncated transfer may corrupt the next transaction, by the finding above.
        self.converter.try_read(register::MANUFACTURER)?;
        let by_pulses = self.converter.try_read(register::MANUFACTURER)? == Some(0x5449);
        self.converter.reset()?;
        let by_shutdown = self.converter.try_read(register::MANUFACTURER)? == Some(0x5449);
        self.tell(
            "9. half a write; a read cut off",
            format!(
                "{}; SDA {}, back by nine clocks: {by_pulses}, by SD: {by_shutdown}",
                if harmless { "harmless" } else { "corrupts" },
                if stuck { "stuck" } else { "free" },
            ),
        );
        Ok(())
    }

    /// 10: measures the scatter for several clocks. A sensor locked to the clock does not scatter.
    fn locking(&mut self) -> Result<()> {
        let mut texts = Vec::new();
        for divider in DIVISORS {
            let setup = self.setup(Setup { divider, ..QUICK });
            self.converter.start(&setup)?;
            let words = self.converter.words(WORDS / 2)?;
            let ratio = 1.0 / mean(&words);
            let k = relative_deviation(&words) * f64::from(setup.rcount);
            texts.push(format!("{k:.3} at CLKIN/{ratio:.2}"));
        }
        self.tell("10. scatter times RCOUNT by clock", texts.join(", "));
        Ok(())
    }
}

/// Bounds of the parallel resistance, ohm, by V = 4 I RP/π (datasheet, equation 12): the first drive without a flag
/// reaches 1.2 V and the one before does not, the last does not reach 1.8 V and the one after does.
fn parallel_ohm(clean: &[u8]) -> Option<[f64; 2]> {
    let (&first, &last) = (clean.first()?, clean.last()?);
    let at = |volt: f64, code: DriveCode| {
        volt * core::f64::consts::PI / (4e-6 * f64::from(code.current_ua()))
    };
    let [low_v, high_v] = CLEAN_V;
    let before = first.checked_sub(1).and_then(DriveCode::new);
    let after = last.checked_add(1).and_then(DriveCode::new);
    let least = at(low_v, DriveCode::new(first)?).max(after.map_or(0.0, |code| at(high_v, code)));
    let greatest = at(high_v, DriveCode::new(last)?);
    let greatest = before.map_or(greatest, |code| greatest.min(at(low_v, code)));
    Some([least, greatest])
}

/// Returns the code of a word without a counting error; the amplitude flag does not matter.
fn code(word: u32) -> Option<Code28> {
    let is_good = word >> 29 == 0 && word & 0x0FFF_FFFF != 0;
    is_good.then(|| Word::from_registers((word >> 16) as u16, word as u16).code())
}

/// Mean of the valid words, as a part of full scale.
fn mean(words: &[u32]) -> f64 {
    let codes: Vec<f64> = words
        .iter()
        .filter_map(|word| Some(f64::from(code(*word)?.get())))
        .collect();
    codes.iter().sum::<f64>() / codes.len().max(1) as f64 / f64::from(1 << 28)
}

fn relative_deviation(words: &[u32]) -> f64 {
    let mean = mean(words);
    let of = |word: &u32| Some(f64::from(code(*word)?.get()) / f64::from(1 << 28) / mean - 1.0);
    let squares: Vec<f64> = words
        .iter()
        .filter_map(|word| Some(of(word)?.powi(2)))
        .collect();
    (squares.iter().sum::<f64>() / squares.len().saturating_sub(1).max(1) as f64).sqrt()
}

/// Whether words have the same frequency within a thousandth: quantisation is far smaller, and the
/// error of a corrupted conversion is larger.
fn are_alike(words: &[u32], others: &[u32]) -> bool {
    let (mean, other) = (mean(words), mean(others));
    mean > 0.0 && (other / mean - 1.0).abs() < 1e-3
}

#[cfg(test)]
mod unit_tests {
    use super::*;

    /// Drives that a resistance of 5.7 kΩ leaves without a flag, by the data sheet's currents and equation alone.
    #[test]
    fn drives_without_a_flag_enclose_the_resistance() {
        for ohm in [1.5e3, 5.7e3, 20e3] {
            let volt = |code: &u8| {
                4.0 * ohm * 1e-6 * f64::from(DriveCode::new(*code).unwrap().current_ua())
                    / std::f64::consts::PI
            };
            let clean: Vec<u8> = (0..32)
                .filter(|code| (1.2..1.8).contains(&volt(code)))
                .collect();
            let [least, greatest] = parallel_ohm(&clean).unwrap();
            assert!(
                least <= ohm && ohm <= greatest && greatest < 1.25 * least,
                "{ohm}: {least} {greatest}"
            );
        }
        assert_eq!(parallel_ohm(&[]), None);
    }
}
