//! The coil: pulse widths for the bridge, an open-loop course of the current, what is measured.

#![allow(unsafe_code)]

use core::cell::Cell;

use critical_section::Mutex;
use rp2040_pac::PWM;

use crate::board::pico::{self, Function};
use crate::history::History;
use crate::safe;

/// Counts of a period: 20 kHz of 120 MHz, above what is heard.
const PERIOD: u32 = 6_000;
/// Counts of a microsecond.
const COUNTS_PER_US: u32 = crate::board::CORE_MHZ;
/// The current at full pulse width, which the open loop takes for granted; the hardware's own limit
/// is the first line of defence.
const FULL_SCALE_A: f32 = 20.0;
/// No current above this, whatever is asked for.
const GREATEST_CURRENT_A: f32 = 15.0;
/// How long a pulse width stays: the course becomes steps of this length, each at its middle.
pub const STEP_US: u64 = 1_000;
/// From a new pulse width to its measurement: it holds from the next period on, 50 us at most.
pub const MEASURED_AFTER_US: u64 = 100;
/// Conversions of the current that are averaged: they take 8 us.
const CONVERSIONS: u16 = 4;
/// Steps from one look at supply and thermometer to the next.
const SLOW_EVERY: u8 = 50;
/// Volts of a count of the ADC, of which the middle counts.
const VOLTS_PER_COUNT: f32 = 3.3 / 4096.0;
/// Gain and zero of the current amplifier (docs/firmware.md).
const GAIN_V_PER_A: f32 = 0.125;
/// See [`GAIN_V_PER_A`].
const ZERO_V: f32 = 1.65;
/// Divider of the coil's supply: 100 kiloohm over 10 kiloohm.
const SUPPLY_RATIO: f32 = 11.0;
/// Inputs of the ADC.
const CURRENT_INPUT: u8 = 0;
const THERMISTOR_INPUT: u8 = 1;
const SUPPLY_INPUT: u8 = 2;

/// A course of the current: straight from one value to another.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Course {
    from_us: u64,
    to_us: u64,
    from_a: f32,
    to_a: f32,
}

impl Course {
    const fn at(&self, now_us: u64) -> f32 {
        if now_us >= self.to_us {
            return self.to_a;
        }
        let passed = now_us.saturating_sub(self.from_us) as f32;
        let length = self.to_us.saturating_sub(self.from_us) as f32;
        self.from_a + (self.to_a - self.from_a) * (passed / length)
    }
}

/// The course that the task follows; nothing is off.
static COURSE: Mutex<Cell<Option<Course>>> = Mutex::new(Cell::new(None));
/// The current as it was measured.
static CURRENTS: History = History::new();

fn course() -> Option<Course> {
    critical_section::with(|section| COURSE.borrow(section).get())
}

/// Lets the current go from where it is to another value, in a straight line.
pub fn go(now_us: u64, to_a: f32, over_us: u64) {
    let from_a = course().map_or(0.0, |course| course.at(now_us));
    let next = Course {
        from_us: now_us,
        to_us: now_us.saturating_add(over_us),
        from_a,
        to_a,
    };
    critical_section::with(|section| COURSE.borrow(section).set(Some(next)));
}

/// No course any more: the bridge is off when this returns.
pub fn stop() {
    critical_section::with(|section| COURSE.borrow(section).set(None));
    safe::bridge_off();
}

/// Mean of the measured current over a past window, A; nothing if it was not measured.
pub fn mean_current_a(from_us: u64, to_us: u64) -> Option<f32> {
    CURRENTS.mean(from_us, to_us)
}

/// What is measured slowly, in volts at the input.
#[derive(Clone, Copy)]
struct Slow {
    supply_v: Option<f32>,
    thermistor_v: Option<f32>,
}

static SLOW: Mutex<Cell<Slow>> = Mutex::new(Cell::new(Slow {
    supply_v: None,
    thermistor_v: None,
}));

fn slow() -> Slow {
    critical_section::with(|section| SLOW.borrow(section).get())
}

/// Supply of the coil, V; nothing if the ADC does not answer.
pub fn supply_v() -> Option<f32> {
    slow().supply_v.map(|volts| volts * SUPPLY_RATIO)
}

/// Temperature of the coil, degrees Celsius; nothing without a thermometer.
pub fn temperature_c() -> Option<f32> {
    slow().thermistor_v.and_then(crate::thermistor::celsius)
}

fn volts(input: u8) -> Option<f32> {
    Some((f32::from(pico::convert(input)?) + 0.5) * VOLTS_PER_COUNT)
}

/// The bridge.
pub struct Coil {
    /// The pins are given to the PWM and the bridge is awake.
    is_on: bool,
    /// Since when the present pulse width holds.
    since_us: u64,
    /// Steps since the last look at supply and thermometer.
    steps: u8,
}

impl Coil {
    /// The bridge, off.
    pub fn new() -> Self {
        // SAFETY: the slice belongs to the coil; within the fields.
        unsafe {
            let slice = (*PWM::ptr()).ch(pico::COIL_SLICE);
            slice.top().write(|w| w.bits(PERIOD - 1));
            slice.cc().write(|w| w.bits(0));
            slice.csr().write(|w| w.bits(1));
        }
        Self {
            is_on: false,
            since_us: 0,
            steps: SLOW_EVERY,
        }
    }

    /// Sets what the course wants of the step that begins now.
    pub fn set(&mut self, now_us: u64) {
        match course() {
            Some(course) => self.drive(now_us, course.at(now_us + STEP_US / 2)),
            None => {
                self.since_us = now_us;
                self.off();
            }
        }
    }

    /// Measures the current of the step under way.
    pub fn measure(&mut self) {
        let mut sum = 0;
        for _ in 0..CONVERSIONS {
            let Some(count) = pico::convert(CURRENT_INPUT) else {
                return;
            };
            sum += count;
        }
        // Four times 4095 fits.
        let mean = (f32::from(sum) / f32::from(CONVERSIONS) + 0.5) * VOLTS_PER_COUNT;
        CURRENTS.push(self.since_us, (mean - ZERO_V) / GAIN_V_PER_A);
        self.steps += 1;
        if self.steps > SLOW_EVERY {
            self.steps = 0;
            let slow = Slow {
                supply_v: volts(SUPPLY_INPUT),
                thermistor_v: volts(THERMISTOR_INPUT),
            };
            critical_section::with(|section| SLOW.borrow(section).set(slow));
        }
    }

    fn drive(&mut self, now_us: u64, current_a: f32) {
        let duty = (current_a / FULL_SCALE_A).clamp(0.0, GREATEST_CURRENT_A / FULL_SCALE_A);
        let level = (duty * PERIOD as f32 + 0.5) as u32;
        // SAFETY: within the field; IN2 stays low.
        let count = unsafe {
            let slice = (*PWM::ptr()).ch(pico::COIL_SLICE);
            slice.cc().write(|w| w.bits(level.min(PERIOD)));
            slice.ctr().read().bits()
        };
        let left_us = PERIOD.saturating_sub(count) / COUNTS_PER_US;
        self.since_us = now_us + u64::from(left_us);
        if !self.is_on {
            self.is_on = true;
            pico::set_function(pico::IN1, Function::Pwm);
            pico::set(pico::BRIDGE_ENABLE, true);
        }
    }

    fn off(&mut self) {
        self.is_on = false;
        safe::bridge_off();
        // SAFETY: within the field.
        unsafe {
            let slice = (*PWM::ptr()).ch(pico::COIL_SLICE);
            slice.cc().write(|w| w.bits(0));
        }
    }
}

/// Whether the bridge reports a fault.
pub fn bridge_faults() -> bool {
    !pico::is_high(pico::BRIDGE_FAULT)
}
