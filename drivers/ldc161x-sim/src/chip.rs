//! The whole chip: its time, pins, supply and ground truth.

use crate::conversion::TrueConversion;
use crate::faults::{ChipFault, FaultChange, FaultEvent, Lost, Schedule, ScheduleFull};
use crate::i2c_state::{Link, Traffic};
use crate::random::Random;
use crate::registers::{RegisterFile, address};
use crate::results::{Reporting, Results};
use crate::sensor::Sensors;
use crate::sequence_state::Sequence;
use crate::settings::{ExternalClock, Settings};
use crate::time::Time;

/// Largest number of schedule steps in one call of [`Chip::advance_to`] before it skips ahead:
/// about two million conversions, or half an hour at 1 kHz. The limit keeps a call with a senseless
/// time from running for days.
const LONGEST_RUN: u32 = 1 << 22;

/// Counts of the driver's violations of the datasheet. A driver's test asserts that this equals
/// `Misuse::default()`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Misuse {
    /// Writes to reserved bits with another value than required (7.6.1).
    pub reserved_bits: u64,
    /// Writes to read-only registers.
    pub read_only_writes: u64,
    /// Accesses to addresses without a register.
    pub unknown_registers: u64,
    /// Writes to the configuration while converting, except to sleep or reset (7.4.1).
    pub writes_while_active: u64,
    /// Accesses that the master broke off between the two bytes of a register (7.5.2).
    pub early_terminations: u64,
    /// Conversions with RCOUNT below 9, SETTLECOUNT below 4 or FIN_DIVIDER 0 (tables 21, 43);
    /// counted once for each such conversion.
    pub reserved_values: u64,
    /// Conversions with the reference above 35 MHz (single channel), 40 MHz (autoscan, external) or
    /// 55 MHz (autoscan, internal) (table 43).
    pub reference_too_fast: u64,
    /// Conversions with the divided sensor at a quarter of the reference or above, or with an
    /// undivided sensor at 8.75 MHz or above (table 43).
    pub sensor_too_fast: u64,
    /// Conversions in autoscan with HIGH_CURRENT_DRV set (8.1.5.5).
    pub high_current_in_autoscan: u64,
}

/// One LDC1612 or LDC1614 with its sensors.
///
/// Time only moves forward, by [`Chip::advance_to`] and by the methods of the bus, which receive
/// the time of each byte; a time before [`Chip::now`] counts as now. A clone is a snapshot of the
/// whole state.
///
/// ```
/// use ldc161x_sim::{Chip, Settings, Time};
///
/// let mut chip = Chip::new(Settings::default(), [3.2e6, 3.3e6]);
/// chip.advance_to(Time::from_ms(1));
/// assert_eq!(chip.register(0x7E), 0x5449);
/// assert_eq!(chip.conversions(0), 0, "it sleeps until it is configured");
/// ```
#[derive(Clone, Debug)]
pub struct Chip<S> {
    pub(crate) settings: Settings,
    pub(crate) sensors: S,
    pub(crate) now: Time,
    pub(crate) registers: RegisterFile,
    pub(crate) sequence: Sequence,
    pub(crate) results: Results,
    pub(crate) link: Link,
    pub(crate) traffic: Traffic,
    pub(crate) faults: Schedule,
    pub(crate) random: Random,
    pub(crate) misuse: Misuse,
    /// Whether [`crate::SleepExit::LosesOnce`] has taken effect.
    pub(crate) has_lost_registers: bool,
    shut_down: bool,
    /// Time from which on the chip answers on the bus.
    awake: Time,
    address_pin_high: bool,
}

impl<S: Sensors> Chip<S> {
    /// Creates a chip whose start-up after power-on is over: asleep, with its registers at their
    /// reset values.
    #[must_use]
    pub fn new(settings: Settings, sensors: S) -> Self {
        Self {
            sensors,
            now: Time::ZERO,
            registers: RegisterFile::new(),
            sequence: Sequence::new(),
            results: Results::default(),
            link: Link::default(),
            traffic: Traffic::default(),
            faults: Schedule::new(Random::new(settings.seed, 1)),
            random: Random::new(settings.seed, 0),
            misuse: Misuse::default(),
            has_lost_registers: false,
            shut_down: false,
            awake: Time::ZERO,
            address_pin_high: settings.address_pin_high,
            settings,
        }
    }

    /// Current time of this chip.
    #[must_use]
    pub fn now(&self) -> Time {
        self.now
    }

    /// Runs the chip up to a time.
    ///
    /// A call that would run more than about two million conversions skips the remaining ones: the
    /// current channel then restarts at `time`.
    pub fn advance_to(&mut self, time: Time) {
        let mut steps_left = LONGEST_RUN;
        while let Some(due) = self.next_event().filter(|&due| due <= time) {
            self.now = self.now.max(due);
            self.do_what_is_due();
            steps_left = steps_left.saturating_sub(1);
            if steps_left == 0 {
                self.now = self.now.max(time);
                self.restart_channel();
            }
        }
        self.now = self.now.max(time);
    }

    /// Time at which the chip next changes by itself; `None` if only the bus or a pin can wake it.
    /// An emulated microcontroller need not poll INTB before that time.
    #[must_use]
    pub fn next_event(&self) -> Option<Time> {
        let sequence = self.sequence_due().time();
        let fault = self.faults.due().unwrap_or(Time::MAX);
        let due = sequence.min(fault);
        (due < Time::MAX).then_some(due)
    }

    fn do_what_is_due(&mut self) {
        match self.faults.advance(self.now) {
            Some(change) => self.apply(change),
            None => self.advance_sequence(),
        }
    }

    /// Runs the chip until INTB is low, or up to `limit`. Returns the time of the falling edge, or
    /// the current time if the pin is low already; `None` if the pin stays high.
    pub fn advance_to_interrupt(&mut self, limit: Time) -> Option<Time> {
        while !self.intb_is_low() {
            match self.next_event().filter(|&due| due <= limit) {
                Some(due) => self.advance_to(due),
                None => {
                    self.advance_to(limit);
                    break;
                }
            }
        }
        self.intb_is_low().then_some(self.now)
    }

    // ---- pins and supply ----

    /// Whether INTB is low. The pin is push-pull and active low.
    #[must_use]
    pub fn intb_is_low(&self) -> bool {
        let stuck = self.intb_is_stuck();
        let driven_low = self.results.interrupt() && !self.registers.config().interrupt_disabled();
        stuck.unwrap_or(driven_low)
    }

    /// Level at which INTB is stuck, `Some(true)` for low; `None` if INTB follows the chip.
    #[must_use]
    pub fn intb_is_stuck(&self) -> Option<bool> {
        self.faults.active().find_map(|fault| match fault {
            ChipFault::IntbStuck { low } => Some(*low),
            _ => None,
        })
    }

    /// Sets the level of the SD pin at the current time. High resets everything and silences the
    /// bus; low brings the bus back after [`Settings::wake_up`] (datasheet 7.4.4).
    pub fn set_shutdown(&mut self, high: bool) {
        if high {
            self.reset();
            self.link.lose_power();
        } else if self.shut_down {
            self.awake = self.now + self.settings.wake_up;
        }
        self.shut_down = high;
    }

    /// Sets the level of the ADDR pin. It changes the chip's address only while the chip is shut
    /// down (datasheet 7.4.4).
    pub fn set_address_pin(&mut self, high: bool) {
        if self.shut_down {
            self.address_pin_high = high;
        }
    }

    /// Sets the clock at CLKIN from the current time on; `None` for no clock. A current conversion
    /// restarts if it uses that clock.
    pub fn set_external_clock(&mut self, clock: Option<ExternalClock>) {
        self.settings.external_clock = clock;
        self.follow_clkin();
    }

    /// Simulates a short dip of the supply: a power-on reset, and no answer on the bus for the
    /// wake-up time.
    pub fn brown_out(&mut self) {
        self.reset();
        self.link.lose_power();
        self.awake = self.now + self.settings.wake_up;
    }

    /// Sets all registers to their reset values, which puts the chip to sleep; clears results,
    /// errors and INTB.
    pub(crate) fn reset(&mut self) {
        self.registers = RegisterFile::new();
        self.fall_asleep();
    }

    pub(crate) fn fall_asleep(&mut self) {
        self.sequence.halt();
        self.results.clear();
    }

    /// Whether the chip takes part in bus transfers.
    pub(crate) fn is_on_the_bus(&self) -> bool {
        !self.shut_down && self.now >= self.awake
    }

    pub(crate) fn bus_address(&self) -> u8 {
        if self.address_pin_high { 0x2B } else { 0x2A }
    }

    // ---- faults ----

    /// Schedules a fault; it starts at once if its start time has passed.
    ///
    /// # Errors
    /// [`ScheduleFull`] if sixteen faults are waiting or active.
    pub fn schedule(&mut self, event: FaultEvent) -> Result<(), ScheduleFull> {
        self.faults.add(event)?;
        self.advance_to(self.now);
        Ok(())
    }

    /// Ends all active faults and removes those that wait.
    pub fn clear_faults(&mut self) {
        let clock_was_lost = self.clkin_is_lost();
        self.faults.clear();
        if clock_was_lost {
            self.follow_clkin();
        }
    }

    pub(crate) fn clkin_is_lost(&self) -> bool {
        self.faults
            .active()
            .any(|fault| *fault == ChipFault::ClockLoss)
    }

    /// Applies the immediate effect of a fault that starts or ends. All other effects are polled
    /// while the fault is active.
    pub(crate) fn apply(&mut self, change: FaultChange) {
        match change.fault {
            ChipFault::BrownOut(Lost::Everything) => self.brown_out(),
            ChipFault::BrownOut(Lost::Registers(which)) => self.lose_registers(which),
            ChipFault::RegisterUpset { address, bits } => {
                let value = self.registers.get(address) ^ bits;
                self.put_register(address, value);
            }
            ChipFault::ClockLoss => self.follow_clkin(),
            _ => {}
        }
    }

    fn lose_registers(&mut self, which: u64) {
        let fresh = RegisterFile::new();
        for address in 0..=0x21_u8 {
            if which >> address & 1 == 1 {
                self.put_register(address, fresh.get(address));
            }
        }
    }

    /// Changes a stored register without a bus transfer; as over the bus, CONFIG puts the chip to
    /// sleep or wakes it.
    fn put_register(&mut self, address: u8, value: u16) {
        let slept = self.registers.config().sleeps();
        self.registers.set(address, value);
        if address == address::CONFIG {
            self.follow_sleep(slept);
        }
    }

    /// Starts or stops conversions after CONFIG has changed; `slept` is whether the chip slept
    /// before.
    pub(crate) fn follow_sleep(&mut self, slept: bool) {
        match (slept, self.registers.config().sleeps()) {
            (true, false) => self.wake(),
            (false, true) => self.fall_asleep(),
            _ => {}
        }
    }

    /// Handles the arrival or loss of the clock at CLKIN.
    fn follow_clkin(&mut self) {
        if self.registers.config().external_clock() {
            self.restart_channel();
        }
    }

    // ---- ground truth ----

    pub(crate) fn reporting(&self) -> Reporting {
        Reporting {
            error_config: self.registers.error_config(),
            interrupt_disabled: self.registers.config().interrupt_disabled(),
            status: self.settings.switches.status_reporting,
            overwrite: self.settings.switches.overwrite,
            now: self.now,
        }
    }

    /// The parameters with which the chip was created.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The sensors connected to the inputs.
    #[must_use]
    pub fn sensors(&self) -> &S {
        &self.sensors
    }

    /// The sensors connected to the inputs, mutable. The current conversion is computed at its end,
    /// with the sensors that are connected then.
    pub fn sensors_mut(&mut self) -> &mut S {
        &mut self.sensors
    }

    /// Whether the chip is neither asleep nor shut down.
    #[must_use]
    pub fn is_converting(&self) -> bool {
        !self.shut_down && !self.registers.config().sleeps()
    }

    /// Number of conversions of a channel that ended with a result, with or without errors.
    #[must_use]
    pub fn conversions(&self, channel: u8) -> u64 {
        self.results.finished(channel)
    }

    /// Number of results of a channel that were overwritten before DATAx_MSB was read, independent
    /// of UNREADCONVx.
    #[must_use]
    pub fn overwritten(&self, channel: u8) -> u64 {
        self.results.overwritten(channel)
    }

    /// Ground truth of the last conversion of a channel.
    #[must_use]
    pub fn last_conversion(&self, channel: u8) -> Option<&TrueConversion> {
        self.results.newest(channel)
    }

    /// Ground truth of the conversion whose result the last read of DATAx_MSB latched. `None` if
    /// there was no result since sleep, or if the watchdog had aborted the conversion.
    #[must_use]
    pub fn last_read(&self, channel: u8) -> Option<&TrueConversion> {
        self.results.last_read(channel)
    }

    /// Number of falling edges of INTB that the chip has driven, including those that a stuck line
    /// hides.
    #[must_use]
    pub fn interrupts(&self) -> u64 {
        self.results.falling_edges()
    }

    /// Time of the last falling edge on INTB.
    #[must_use]
    pub fn last_interrupt(&self) -> Option<Time> {
        self.results.last_fall()
    }

    /// Counts of the driver's violations of the datasheet.
    #[must_use]
    pub fn misuse(&self) -> Misuse {
        self.misuse
    }

    /// Counts of the traffic on the bus.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }
}
