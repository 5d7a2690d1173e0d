//! The schedule: start-up, activation, conversion and pause, channel after channel.

use crate::chip::Chip;
use crate::conversion::{Gate, TrueConversion, fraction};
use crate::drive::{
    AMPLITUDE_HIGH_V, AMPLITUDE_LOW_V, BuildUp, amplitude_v, calibrated_code, corrected_code,
    drive_current_a,
};
use crate::errors::Errors;
use crate::sensor::Sensors;
use crate::sequence_state::SequenceStep;
use crate::settings::PartNumber;
use crate::switches::SleepExit;
use crate::time::Moment;

/// The watchdog regards a sensor below this frequency as silent, Hz (SNOA959 3.3).
const SLOWEST_SENSOR_HZ: f64 = 250.0;
/// Drive code of the largest current, which full-current activation uses (datasheet 8.1.4.2).
const FULL_CURRENT_CODE: u8 = 31;

impl<S: Sensors> Chip<S> {
    /// Time of the next step of the schedule or of the watchdog's timeout, whichever is earlier.
    pub(crate) fn sequence_due(&self) -> Moment {
        self.sequence.ends.earlier_of(self.watchdog_due())
    }

    /// Time at which the watchdog times out. In single-channel mode it monitors the sensor (SNOA959
    /// 3.3). In autoscan the same timer only lets the sequence continue when the reference has
    /// stopped (guess).
    fn watchdog_due(&self) -> Moment {
        let watched = !self.registers.mux().autoscan() || self.sequence.ends.is_never();
        if self.sequence.measures() && watched {
            self.sequence.watchdog
        } else {
            Moment::NEVER
        }
    }

    /// Restarts the watchdog, since the sensor oscillates and the reference runs.
    fn feed_watchdog(&mut self, at: Moment) {
        self.sequence.watchdog = at.after(self.settings.watchdog());
    }

    /// Executes the step whose time has come.
    pub(crate) fn advance_sequence(&mut self) {
        let ends = self.sequence.ends;
        let watchdog = self.watchdog_due();
        if watchdog.time() < ends.time() {
            self.watch(watchdog);
            return;
        }
        match self.sequence.step {
            SequenceStep::Idle => {}
            SequenceStep::StartUp => self.first_channel(ends),
            SequenceStep::Activation => self.settle(ends),
            SequenceStep::Conversion(gate) => self.complete(&gate, ends),
            SequenceStep::Pause => self.next_channel(ends),
        }
    }

    /// Starts up after the chip has left sleep.
    pub(crate) fn wake(&mut self) {
        if self.settings.switches.sleep_exit == SleepExit::LosesOnce && !self.has_lost_registers {
            self.has_lost_registers = true;
            self.reset();
            return;
        }
        let start = Moment::at(self.now);
        self.sequence.halt();
        let ends = start.after(self.settings.start_up());
        self.sequence.enter(SequenceStep::StartUp, ends);
    }

    /// Restarts the current channel, because its reference has started or stopped, or because time
    /// has been skipped.
    pub(crate) fn restart_channel(&mut self) {
        if self.sequence.measures() {
            self.activate(self.sequence.channel, Moment::at(self.now));
        }
    }

    /// The channel that is converted in single-channel mode.
    fn active_channel(&self) -> u8 {
        let channel = self.registers.config().active_channel();
        match self.settings.part {
            PartNumber::Ldc1612 => channel & 1,
            PartNumber::Ldc1614 => channel,
        }
    }

    /// The last channel of the autoscan sequence, or the only channel in single-channel mode.
    fn last_channel(&self) -> u8 {
        let mux = self.registers.mux();
        match (mux.autoscan(), self.settings.part) {
            (false, _) => self.active_channel(),
            (true, PartNumber::Ldc1612) => 1,
            (true, PartNumber::Ldc1614) => mux.last_channel(),
        }
    }

    fn first_channel(&mut self, at: Moment) {
        let channel = if self.registers.mux().autoscan() {
            0
        } else {
            self.active_channel()
        };
        self.activate(channel, at);
    }

    /// Continues after a pause: autoscan activates the next channel; a single channel keeps
    /// oscillating and is converted again (datasheet figures 53 and 54).
    fn next_channel(&mut self, at: Moment) {
        let channel = self.sequence.channel;
        if self.registers.mux().autoscan() {
            let next = if channel < self.last_channel() {
                channel.saturating_add(1)
            } else {
                0
            };
            self.activate(next, at);
        } else if channel == self.active_channel() {
            self.convert(at);
        } else {
            self.activate(self.active_channel(), at);
        }
    }

    /// Activates a channel, so that its oscillation builds up. The phase of the oscillation
    /// relative to the reference is random, since the two clocks are independent.
    fn activate(&mut self, channel: u8, at: Moment) {
        self.calibrate(channel, at);
        let reference_hz = self.reference_hz(channel);
        let settle_s = self.registers.settle_clocks(channel) / reference_hz;
        let phase = self.random.uniform();
        self.feed_watchdog(at);
        let sequence = &mut self.sequence;
        sequence.channel = channel;
        sequence.phase = phase;
        sequence.settle_s = settle_s;
        sequence.enter(SequenceStep::Activation, at.after(settle_s));
    }

    fn settle(&mut self, at: Moment) {
        self.sequence.settled = at;
        self.convert(at);
    }

    /// Starts a conversion: the counter's gate opens.
    fn convert(&mut self, at: Moment) {
        let channel = self.sequence.channel;
        let (amplitude_v, settled_v) = self.amplitude(channel, at);
        let mut gate = Gate {
            channel,
            start: at,
            end: at,
            rcount: self.registers.rcount(channel),
            offset: self.registers.offset(channel),
            sensor_divider: self.registers.sensor_divider(channel),
            deglitch: self.registers.mux().deglitch(),
            reference_hz: self.reference_hz(channel),
            drive_code: self.drive_code(channel),
            amplitude_v,
            settled_v,
            disturbed: false,
        };
        gate.end = at.after(gate.clocks() / gate.reference_hz);
        self.sequence
            .enter(SequenceStep::Conversion(gate), gate.end);
    }

    /// Ends a conversion: the counter's gate closes, and the result is reported.
    fn complete(&mut self, gate: &Gate, at: Moment) {
        let phase = &mut self.sequence.phase;
        let mut conversion = gate.measure(&self.settings, &self.sensors, phase, &mut self.random);
        conversion.errors |= amplitude_errors(conversion.amplitude_v);
        if conversion.oscillation_hz >= SLOWEST_SENSOR_HZ {
            self.feed_watchdog(at);
        }
        self.judge(gate, &conversion);
        self.results.finish(conversion, self.reporting());
        if gate.channel == self.last_channel() {
            self.results.sequence_done(self.reporting());
        }
        self.correct_amplitude(gate.channel, conversion.amplitude_v);
        self.pause(at, gate, conversion.oscillation_hz);
    }

    /// Starts the pause after a conversion. In single-channel mode the sensor keeps oscillating
    /// during the pause, so its phase advances.
    fn pause(&mut self, at: Moment, gate: &Gate, oscillation_hz: f64) {
        let length = if self.registers.mux().autoscan() {
            self.settings.conversions.switch_delay
        } else {
            self.settings.switches.overhead
        };
        let length_s = length.seconds(gate.reference_hz);
        let divided_hz = oscillation_hz / f64::from(gate.sensor_divider.max(1));
        self.sequence.phase = fraction(self.sequence.phase + divided_hz * length_s);
        if length_s > 0.0 {
            self.sequence.enter(SequenceStep::Pause, at.after(length_s));
        } else {
            self.next_channel(at);
        }
    }

    /// Handles the watchdog's timeout: checks whether the sensor oscillates and the reference runs.
    fn watch(&mut self, at: Moment) {
        let channel = self.sequence.channel;
        if self.reference_hz(channel) > 0.0 && self.oscillates(channel, at) {
            self.feed_watchdog(at);
        } else if self.registers.mux().autoscan() {
            self.results
                .abort(channel, Errors::ZERO_COUNT, self.reporting());
            self.next_channel(at);
        } else {
            self.results
                .abort(channel, Errors::WATCHDOG, self.reporting());
            self.activate(self.active_channel(), at);
        }
    }

    fn oscillates(&self, channel: u8, at: Moment) -> bool {
        let index = usize::from(channel);
        let seconds = at.seconds();
        let resistance_ohm = self.sensors.parallel_resistance_ohm(index, seconds);
        let settled_v = amplitude_v(resistance_ohm, self.drive_a(channel));
        self.sensors.frequency_hz(index, seconds) >= SLOWEST_SENSOR_HZ
            && settled_v >= self.settings.drive.least_amplitude_v
    }

    /// True reference frequency of a channel, Hz; zero if its clock is missing, or if its divider
    /// is zero, which is a reserved value.
    pub(crate) fn reference_hz(&self, channel: u8) -> f64 {
        let source_hz = if self.registers.config().external_clock() {
            let lost = self.clkin_is_lost();
            let clock = self.settings.external_clock.filter(|_| !lost);
            clock.map_or(0.0, |clock| clock.true_hz())
        } else {
            self.settings.internal_hz()
        };
        let divider = self.registers.reference_divider(channel);
        if source_hz > 0.0 && source_hz.is_finite() && divider > 0 {
            source_hz / f64::from(divider)
        } else {
            0.0
        }
    }

    /// Amplitude of a channel's oscillation at the time `at`, and after settling, V.
    fn amplitude(&self, channel: u8, at: Moment) -> (f64, f64) {
        let index = usize::from(channel);
        let seconds = at.seconds();
        let resistance_ohm = self.sensors.parallel_resistance_ohm(index, seconds);
        let settled_v = amplitude_v(resistance_ohm, self.drive_a(channel));
        let full_v = amplitude_v(resistance_ohm, drive_current_a(FULL_CURRENT_CODE));
        let build_up = BuildUp {
            settled_v,
            driven_v: if self.registers.config().low_power_activation() {
                settled_v
            } else {
                full_v.max(settled_v)
            },
            time_constant_s: BuildUp::time_constant_s(
                self.sensors.quality_factor(index, seconds),
                self.sensors.frequency_hz(index, seconds),
            ),
        };
        let later_s = at.seconds_since(self.sequence.settled);
        (
            build_up.amplitude_v(self.sequence.settle_s, later_s),
            settled_v,
        )
    }

    /// Drive code in use: IDRIVEx with RP_OVERRIDE_EN, otherwise the calibrated code.
    fn drive_code(&self, channel: u8) -> u8 {
        let programmed = self.registers.drive_code(channel);
        if self.registers.config().overrides_rp() {
            return programmed;
        }
        self.calibrated(channel).unwrap_or(programmed)
    }

    /// Drive current in use, A.
    fn drive_a(&self, channel: u8) -> f64 {
        let high = self.registers.config().high_current() && !self.registers.mux().autoscan();
        if high && channel == 0 {
            self.settings.drive.high_current_a
        } else {
            drive_current_a(self.drive_code(channel))
        }
    }

    fn calibrated(&self, channel: u8) -> Option<u8> {
        self.sequence
            .calibrated
            .get(usize::from(channel))
            .copied()
            .flatten()
    }

    fn set_calibrated(&mut self, channel: u8, code: u8) {
        if let Some(calibrated) = self.sequence.calibrated.get_mut(usize::from(channel)) {
            *calibrated = Some(code);
        }
        self.registers.show_initial_drive(channel, code);
    }

    /// Calibrates the drive code at a channel's first activation after sleep (datasheet 8.1.5.2).
    /// That this takes no additional time is a guess.
    fn calibrate(&mut self, channel: u8, at: Moment) {
        let config = self.registers.config();
        let is_enabled = !config.overrides_rp() || config.amplitude_correction();
        if is_enabled && self.calibrated(channel).is_none() {
            let resistance_ohm = self
                .sensors
                .parallel_resistance_ohm(usize::from(channel), at.seconds());
            self.set_calibrated(channel, calibrated_code(resistance_ohm));
        }
    }

    /// Corrects the drive code after a conversion (datasheet 8.1.5.4). With RP_OVERRIDE_EN the
    /// drive current stays as programmed, and INIT_IDRIVEx stays as it is.
    fn correct_amplitude(&mut self, channel: u8, amplitude_v: f64) {
        let config = self.registers.config();
        if config.overrides_rp() || !config.amplitude_correction() {
            return;
        }
        if let Some(code) = self.calibrated(channel) {
            self.set_calibrated(channel, corrected_code(code, amplitude_v));
        }
    }

    /// Counts violations of the datasheet (sections 8.1.5.5 and 8.1.6, table 43).
    fn judge(&mut self, gate: &Gate, conversion: &TrueConversion) {
        // Limits are checked with this tolerance: a real clock may be off by as much without
        // breaking a rule.
        const TOLERANCE: f64 = 1.001;
        let config = self.registers.config();
        let autoscan = self.registers.mux().autoscan();
        let most_hz = match (autoscan, config.external_clock()) {
            (false, _) => 35e6,
            (true, true) => 40e6,
            (true, false) => 55e6,
        };
        let divided_hz = conversion.sensor_hz / f64::from(gate.sensor_divider.max(1));
        let undivided = gate.sensor_divider == 1 && conversion.sensor_hz >= 8.75e6;
        let misuse = &mut self.misuse;
        misuse.reference_too_fast += u64::from(gate.reference_hz > most_hz * TOLERANCE);
        misuse.sensor_too_fast += u64::from(divided_hz >= gate.reference_hz / 4.0 || undivided);
        misuse.reserved_values += u64::from(gate.rcount <= 8)
            + u64::from(self.registers.settle_count(gate.channel) <= 3)
            + u64::from(gate.sensor_divider == 0);
        misuse.high_current_in_autoscan += u64::from(autoscan && config.high_current());
    }
}

fn amplitude_errors(amplitude_v: f64) -> Errors {
    if amplitude_v > AMPLITUDE_HIGH_V {
        Errors::AMPLITUDE_HIGH
    } else if amplitude_v < AMPLITUDE_LOW_V {
        Errors::AMPLITUDE_LOW
    } else {
        Errors::NONE
    }
}
