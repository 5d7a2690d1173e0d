//! The coil: pulse widths for the bridge, an open-loop course of the current, what is measured.

#![allow(unsafe_code)]

use core::cell::Cell;
use core::sync::atomic::{AtomicBool, Ordering};

use critical_section::Mutex;
use rp2040_pac::PWM;

use crate::board::pico::{self, Function};
use crate::safe;

/// Counts of a period: 20 kHz of 120 MHz, above what is heard.
const PERIOD: u32 = 6_000;
/// The current at full pulse width, which the open loop takes for granted; the hardware's own limit
/// is the first line of defence.
const FULL_SCALE_A: f32 = 20.0;
/// No current above this, whatever is asked for.
pub const GREATEST_CURRENT_A: f32 = 15.0;
/// Volts of a count of the ADC.
const VOLTS_PER_COUNT: f32 = 3.3 / 4096.0;
/// Gain and zero of the current amplifier until a calibration says otherwise.
const GAIN_V_PER_A: f32 = 0.125;
const ZERO_V: f32 = 1.65;
/// Divider of the coil's supply: 100 kiloohm over 10 kiloohm.
const SUPPLY_RATIO: f32 = 11.0;

/// A course of the current: straight from one value to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// When it begins, by the microsecond timer.
    pub from_us: u64,
    /// When it ends.
    pub to_us: u64,
    /// Current at its beginning, A.
    pub from_a: f32,
    /// Current at its end and after it, A.
    pub to_a: f32,
}

impl Course {
    /// No current.
    pub const OFF: Self = Self {
        from_us: 0,
        to_us: 0,
        from_a: 0.0,
        to_a: 0.0,
    };

    /// The current at a time, A.
    pub fn at(&self, now_us: u64) -> f32 {
        if now_us >= self.to_us {
            return self.to_a;
        }
        let passed = now_us.saturating_sub(self.from_us) as f32;
        let length = self.to_us.saturating_sub(self.from_us) as f32;
        self.from_a + (self.to_a - self.from_a) * (passed / length)
    }
}

/// What is measured of the coil.
#[derive(Clone, Copy, Debug, Default)]
pub struct Measured {
    /// Current, A; absent while the ADC does not answer.
    pub current_a: Option<f32>,
    /// Supply of the coil, V.
    pub supply_v: Option<f32>,
}

/// The course that the task follows; nothing is off.
static COURSE: Mutex<Cell<Option<Course>>> = Mutex::new(Cell::new(None));
static MEASURED: Mutex<Cell<Measured>> = Mutex::new(Cell::new(Measured {
    current_a: None,
    supply_v: None,
}));
/// The coil may be driven.
static ARMED: AtomicBool = AtomicBool::new(false);

/// Allows the coil to be driven, or forbids it: then the bridge is off when this returns.
pub fn arm(armed: bool) {
    ARMED.store(armed, Ordering::Relaxed);
    if !armed {
        follow(None);
        safe::bridge_off();
    }
}

/// Takes another course, or none: the bridge is then off.
pub fn follow(course: Option<Course>) {
    critical_section::with(|section| COURSE.borrow(section).set(course));
    if course.is_none() {
        safe::bridge_off();
    }
}

/// What was measured last.
pub fn measured() -> Measured {
    critical_section::with(|section| MEASURED.borrow(section).get())
}

/// The bridge.
pub struct Coil {
    /// The pins are given to the PWM and the bridge is awake.
    is_on: bool,
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
        Self { is_on: false }
    }

    /// Sets what the course wants now, and measures.
    pub fn update(&mut self, now_us: u64) {
        let course = critical_section::with(|section| COURSE.borrow(section).get());
        match course.filter(|_| ARMED.load(Ordering::Relaxed)) {
            Some(course) => self.drive(course.at(now_us)),
            None => self.off(),
        }
        let volts = |input| pico::convert(input).map(|count| f32::from(count) * VOLTS_PER_COUNT);
        let measured = Measured {
            current_a: volts(0).map(|volts| (volts - ZERO_V) / GAIN_V_PER_A),
            supply_v: volts(2).map(|volts| volts * SUPPLY_RATIO),
        };
        critical_section::with(|section| MEASURED.borrow(section).set(measured));
    }

    fn drive(&mut self, current_a: f32) {
        let duty = (current_a / FULL_SCALE_A).clamp(0.0, GREATEST_CURRENT_A / FULL_SCALE_A);
        let level = (duty * PERIOD as f32) as u32;
        // SAFETY: within the field; IN2 stays low.
        unsafe {
            let slice = (*PWM::ptr()).ch(pico::COIL_SLICE);
            slice.cc().write(|w| w.bits(level.min(PERIOD)));
        }
        if !self.is_on {
            self.is_on = true;
            pico::set_function(pico::IN1, Function::Pwm);
            pico::set(pico::BRIDGE_ENABLE, true);
        }
        // A task of higher priority may have forbidden it meanwhile.
        if !ARMED.load(Ordering::Relaxed) {
            self.off();
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
