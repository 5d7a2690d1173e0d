//! The chip as a whole: its time, its pins, its supply, and the truth about it.

use crate::conversion::TrueConversion;
use crate::faults::{
    ChipFault, Disturbances, FaultChange, FaultEvent, FaultId, FaultState, Lost, Schedule,
    ScheduleFull,
};
use crate::i2c::{Link, Traffic};
use crate::random::Random;
use crate::registers::{RegisterFile, address};
use crate::results::{Reporting, Results};
use crate::sensor::Sensors;
use crate::sequence::Sequence;
use crate::settings::{ExternalClock, Settings};
use crate::time::Time;

/// Steps of the schedule that one call of [`Chip::advance_to`] runs before it skips the rest: some
/// two million conversions, or half an hour at a kilohertz. It keeps a call with a senseless time
/// from running for days.
const LONGEST_RUN: u32 = 1 << 22;

/// Breaches of the datasheet's rules by the driver. A driver's test asserts that this equals its
/// `default()`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Misuse {
    /// Writes of another value than the required one to reserved bits (7.6.1).
    pub reserved_bits: u64,
    /// Writes to read-only registers.
    pub read_only_writes: u64,
    /// Accesses to addresses at which there is no register.
    pub unknown_registers: u64,
    /// Writes of the configuration while converting, other than to sleep or to reset (7.4.1).
    pub writes_while_active: u64,
    /// Accesses broken off between the two bytes of a register by the master (7.5.2).
    pub early_terminations: u64,
    /// Conversions with RCOUNT below 9, SETTLECOUNT below 4 or FIN_DIVIDER 0 (tables 21, 43); each
    /// counts.
    pub reserved_values: u64,
    /// Conversions with the reference above 35 MHz (single channel), 40 MHz (autoscan, external) or
    /// 55 MHz (autoscan, internal) (table 43).
    pub reference_too_fast: u64,
    /// Conversions with the divided sensor at a quarter of the reference or above, or a sensor of
    /// 8.75 MHz or above undivided (table 43).
    pub sensor_too_fast: u64,
    /// Conversions in autoscan with HIGH_CURRENT_DRV set (8.1.5.5).
    pub high_current_in_autoscan: u64,
}

/// One LDC1612 or LDC1614 with its sensors.
///
/// Time moves only forward, by [`Chip::advance_to`] and by the calls of the bus, which carry their
/// own times; an earlier time than [`Chip::now`] counts as now. A clone is a snapshot of everything.
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
    /// [`crate::SleepExit::LosesOnce`] has struck.
    pub(crate) has_lost_registers: bool,
    shut_down: bool,
    /// From when on the bus answers.
    awake: Time,
    address_pin_high: bool,
}

impl<S: Sensors> Chip<S> {
    /// A chip that has long been powered: asleep, with its registers at their reset values.
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

    /// The present of this chip.
    #[must_use]
    pub fn now(&self) -> Time {
        self.now
    }

    /// Runs the chip up to a time.
    ///
    /// A call that would run more than some two million conversions skips the rest of them: the
    /// channel under way then begins anew at `time`.
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

    /// When something next happens inside the chip; nothing if only the bus or a pin can wake it.
    /// An emulated microcontroller need not poll INTB before that.
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

    /// Runs the chip until INTB is low, or up to `limit`. The time of the falling edge, or now if
    /// the pin is low already; nothing if it stays high.
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

    /// The level of INTB: push-pull, active low.
    #[must_use]
    pub fn intb_is_low(&self) -> bool {
        let stuck = self.intb_is_stuck();
        let driven_low = self.results.interrupt() && !self.registers.config().interrupt_disabled();
        stuck.unwrap_or(driven_low)
    }

    /// Whether INTB does not follow the chip, and whether it is low then.
    #[must_use]
    pub fn intb_is_stuck(&self) -> Option<bool> {
        self.faults.active().find_map(|fault| match fault {
            ChipFault::IntbStuck { low } => Some(*low),
            _ => None,
        })
    }

    /// The level of the SD pin, now. High resets everything and silences the bus; low brings the
    /// bus back after [`Settings::wake_up`] (datasheet 7.4.4).
    pub fn set_shutdown(&mut self, high: bool) {
        if high {
            self.reset();
            self.link.lose_power();
        } else if self.shut_down {
            self.awake = self.now + self.settings.wake_up;
        }
        self.shut_down = high;
    }

    /// The level of the ADDR pin. The chip follows it in shutdown only (datasheet 7.4.4).
    pub fn set_address_pin(&mut self, high: bool) {
        if self.shut_down {
            self.address_pin_high = high;
        }
    }

    /// The clock at CLKIN from now on, or none. The conversion under way begins anew if it is
    /// counted with that clock.
    pub fn set_external_clock(&mut self, clock: Option<ExternalClock>) {
        self.settings.external_clock = clock;
        self.follow_clkin();
    }

    /// The supply dips and returns at once: a power-on reset, and silence for the wake-up time.
    pub fn brown_out(&mut self) {
        self.reset();
        self.link.lose_power();
        self.awake = self.now + self.settings.wake_up;
    }

    /// All registers to their reset values, which is sleep; results, errors and INTB cleared.
    pub(crate) fn reset(&mut self) {
        self.registers = RegisterFile::new();
        self.fall_asleep();
    }

    pub(crate) fn fall_asleep(&mut self) {
        self.sequence.halt();
        self.results.clear();
    }

    /// Whether the chip follows the bus at all.
    pub(crate) fn is_on_the_bus(&self) -> bool {
        !self.shut_down && self.now >= self.awake
    }

    pub(crate) fn bus_address(&self) -> u8 {
        if self.address_pin_high { 0x2B } else { 0x2A }
    }

    // ---- faults ----

    /// Schedules a fault; one whose time has come begins at once.
    ///
    /// # Errors
    /// [`ScheduleFull`] when [`crate::FAULT_SLOTS`] faults wait or act.
    pub fn schedule(&mut self, event: FaultEvent) -> Result<FaultId, ScheduleFull> {
        let fault = self.faults.add(event)?;
        self.advance_to(self.now);
        Ok(fault)
    }

    /// Ends all faults that act and forgets those that wait.
    pub fn clear_faults(&mut self) {
        let clock_was_lost = self.clkin_is_lost();
        self.faults.clear(self.now);
        if clock_was_lost {
            self.follow_clkin();
        }
    }

    /// The state of a fault; nothing once a later one has taken its slot.
    #[must_use]
    pub fn fault_state(&self, fault: FaultId) -> Option<FaultState> {
        self.faults.state(fault)
    }

    /// Whether any fault acts now.
    #[must_use]
    pub fn is_disturbed(&self) -> bool {
        self.faults.is_disturbed()
    }

    /// What faults have done so far.
    #[must_use]
    pub fn disturbances(&self) -> Disturbances {
        self.faults.log
    }

    pub(crate) fn clkin_is_lost(&self) -> bool {
        self.faults
            .active()
            .any(|fault| *fault == ChipFault::ClockLoss)
    }

    /// Applies what a fault does once, when it begins or ends; the rest is polled while it acts.
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

    /// Changes a stored register behind the bus; CONFIG still puts the chip to sleep or wakes it.
    fn put_register(&mut self, address: u8, value: u16) {
        let slept = self.registers.config().sleeps();
        self.registers.set(address, value);
        if address == address::CONFIG {
            self.follow_sleep(slept);
        }
    }

    /// Begins or ends conversions after CONFIG has changed.
    pub(crate) fn follow_sleep(&mut self, slept: bool) {
        match (slept, self.registers.config().sleeps()) {
            (true, false) => self.wake(),
            (false, true) => self.fall_asleep(),
            _ => {}
        }
    }

    /// The clock at CLKIN has come or gone.
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

    /// The parameters that it was made with.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// What is connected to its inputs.
    #[must_use]
    pub fn sensors(&self) -> &S {
        &self.sensors
    }

    /// What is connected to its inputs, to be changed. The conversion under way is counted with what
    /// is connected at its end.
    pub fn sensors_mut(&mut self) -> &mut S {
        &mut self.sensors
    }

    /// Whether it is out of sleep and shutdown.
    #[must_use]
    pub fn is_converting(&self) -> bool {
        !self.shut_down && !self.registers.config().sleeps()
    }

    /// Conversions of a channel that have ended with a result, good or bad.
    #[must_use]
    pub fn conversions(&self, channel: u8) -> u64 {
        self.results.finished(channel)
    }

    /// Results of a channel that were overwritten before DATAx_MSB was read, whatever UNREADCONVx
    /// said.
    #[must_use]
    pub fn overwritten(&self, channel: u8) -> u64 {
        self.results.overwritten(channel)
    }

    /// The truth about the last conversion of a channel.
    #[must_use]
    pub fn last_conversion(&self, channel: u8) -> Option<&TrueConversion> {
        self.results.newest(channel)
    }

    /// The truth about the conversion whose result was last latched by a read of DATAx_MSB: the
    /// one that the driver has read. Nothing if there was none to be read: since sleep, or because
    /// the watchdog had aborted it.
    #[must_use]
    pub fn last_read(&self, channel: u8) -> Option<&TrueConversion> {
        self.results.last_read(channel)
    }

    /// Falling edges that the chip has driven on INTB, stuck line or not.
    #[must_use]
    pub fn interrupts(&self) -> u64 {
        self.results.falling_edges()
    }

    /// The last of those edges.
    #[must_use]
    pub fn last_interrupt(&self) -> Option<Time> {
        self.results.last_fall()
    }

    /// What the driver has done against the datasheet.
    #[must_use]
    pub fn misuse(&self) -> Misuse {
        self.misuse
    }

    /// What has passed on the bus.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }
}
