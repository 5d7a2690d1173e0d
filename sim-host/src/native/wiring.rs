//! Wiring of the native board: converters, coil, world and flash.

use core::cell::{Cell, RefCell};
use std::rc::Rc;

use coil_hbridge::{Drive, Supervisor};
use ldc161x_sim::{Chip, Sensors, Time, Window};
use palpate_node::board::{CORE_HZ, Clkin};
use palpate_node::coil::{CoilCircuit, EnergyWords};
use palpate_node::converter::CONVERTERS;

use super::drive::CoilDrive;
use super::flash::Flash;
use crate::world::{SharedWorld, World};

/// Converters, coil, world and flash that are connected to a board.
pub struct Wiring {
    world: SharedWorld,
    /// Both converters; the second one may be absent.
    chips: [RefCell<Chip<DrivenWorld>>; CONVERTERS],
    has_second: bool,
    pub(super) drive: Rc<RefCell<CoilDrive>>,
    pub(super) supervisor: Supervisor,
    flash: Flash,
    /// Memory that survives a reset.
    pub(super) kept_energy: Cell<EnergyWords>,
}

impl core::fmt::Debug for Wiring {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Wiring")
            .field("world", &self.world)
            .finish_non_exhaustive()
    }
}

impl Wiring {
    /// Connects a world to one converter. Virtual time starts at the world's time.
    ///
    /// # Panics
    /// If the reference board's constants do not fit each other, which a test of the driver excludes.
    #[must_use]
    pub fn new(world: World) -> Self {
        Self::of(world, false)
    }

    /// Connects a world to two converters, both with the same sensing coil on channel 0.
    #[must_use]
    pub fn with_second_converter(world: World) -> Self {
        Self::of(world, true)
    }

    fn of(world: World, has_second: bool) -> Self {
        let settings = world.chip_settings(clkin_hz(Clkin::SINGLE));
        let start = world.now();
        let world = SharedWorld::new(world);
        let (supervisor, drive) = reference_drive();
        let drive = Rc::new(RefCell::new(CoilDrive::new(world.clone(), drive)));
        let chips = [false, true].map(|is_second| {
            let driven = DrivenWorld {
                world: world.clone(),
                drive: Rc::clone(&drive),
            };
            let mut chip = Chip::new(settings, driven);
            chip.advance_to(start);
            if is_second {
                chip.set_shutdown(true);
                chip.set_address_pin(true);
            }
            RefCell::new(chip)
        });
        Self {
            chips,
            has_second,
            world,
            drive,
            supervisor,
            flash: Flash::new(),
            kept_energy: Cell::default(),
        }
    }

    /// The world, to move its press and to read its true state.
    #[must_use]
    pub const fn world(&self) -> &SharedWorld {
        &self.world
    }

    /// The flash, which keeps stored data from one board to the next.
    #[must_use]
    pub const fn flash(&self) -> &Flash {
        &self.flash
    }

    /// The first converter, to schedule faults and to read its record.
    #[must_use]
    pub const fn chip(&self) -> &RefCell<Chip<DrivenWorld>> {
        let [first, _] = &self.chips;
        first
    }

    /// The connected converters, one or two.
    #[must_use]
    pub const fn chips(&self) -> &[RefCell<Chip<DrivenWorld>>] {
        let [first, _] = &self.chips;
        if self.has_second {
            &self.chips
        } else {
            core::slice::from_ref(first)
        }
    }

    /// Current virtual time: that of the most advanced converter.
    pub(super) fn now(&self) -> Time {
        let times = self.chips().iter().map(|chip| chip.borrow().now());
        times.max().unwrap_or(Time::ZERO)
    }

    /// Advances until INTB of a converter falls, or to `limit`.
    pub(super) fn advance_to_edge(&self, limit: Time) {
        let falls = || -> u64 {
            let falls = self.chips().iter().map(|chip| chip.borrow().interrupts());
            falls.sum()
        };
        let before = falls();
        while falls() == before {
            let events = self.chips().iter().map(|chip| chip.borrow().next_event());
            let due = events.flatten().min().filter(|&due| due < limit);
            for chip in self.chips() {
                chip.borrow_mut().advance_to(due.unwrap_or(limit));
            }
            if due.is_none() {
                break;
            }
        }
    }

    /// Advances coil and world to the converters' time.
    pub(super) fn advance_world(&self) {
        let now = self.now();
        self.drive.borrow_mut().advance_to(now);
    }
}

/// Exact frequency at CLKIN; the driver plans with whole hertz.
pub(super) fn clkin_hz(clkin: Clkin) -> f64 {
    f64::from(CORE_HZ) / f64::from(clkin.divisor())
}

/// Supervisor and drive of the reference board.
#[expect(
    clippy::expect_used,
    reason = "a board without a drive simulates nothing"
)]
fn reference_drive() -> (Supervisor, Drive) {
    CoilCircuit::REFERENCE
        .drive()
        .expect("constants that fit each other")
}

/// The world as a converter reads it: the coil's drive first advances to the time of the reading.
#[derive(Clone)]
pub struct DrivenWorld {
    world: SharedWorld,
    drive: Rc<RefCell<CoilDrive>>,
}

impl core::fmt::Debug for DrivenWorld {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.world.fmt(f)
    }
}

impl DrivenWorld {
    fn at(&self, time_s: f64) -> &SharedWorld {
        if let Ok(mut drive) = self.drive.try_borrow_mut() {
            drive.advance_to(Time::from_secs_f64(time_s));
        }
        &self.world
    }
}

impl Sensors for DrivenWorld {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        self.at(time_s).frequency_hz(channel, time_s)
    }

    fn parallel_resistance_ohm(&self, channel: usize, time_s: f64) -> f64 {
        self.at(time_s).parallel_resistance_ohm(channel, time_s)
    }

    fn quality_factor(&self, channel: usize, time_s: f64) -> f64 {
        self.at(time_s).quality_factor(channel, time_s)
    }

    fn pulled_cycles(&self, channel: usize, window: &Window) -> f64 {
        let end_s = window.start_s + window.length_s;
        self.at(end_s).pulled_cycles(channel, window)
    }
}

/// A time in whole microseconds, truncated as a timer does.
pub(super) const fn micros(time: Time) -> u64 {
    time.as_ps() / 1_000_000
}
