//! The plant behind the converter: the sensor with the object pressed on it.

use std::cell::RefCell;

use ldc161x_sim::{Sensors, Time, Window};
use palpate_sim::world::World;

/// State of the plant besides the sensor: coil and supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantConditions {
    /// Temperature of the coil's thermometer, degrees Celsius.
    pub coil_c: f64,
    /// Voltage of the coil's supply without load, V.
    pub supply_v: f64,
    /// Resistance of the coil's supply, ohm.
    pub supply_ohm: f64,
    /// Resistance of the coil at its present temperature, ohm.
    pub coil_ohm: f64,
    /// Inductance of the coil, H.
    pub inductance_h: f64,
}

impl Default for PlantConditions {
    fn default() -> Self {
        Self {
            coil_c: 25.0,
            supply_v: 12.0,
            supply_ohm: 0.05,
            coil_ohm: 0.389,
            inductance_h: 40e-6,
        }
    }
}

/// Resonators for the converter, which depend on time and on the coil's current.
pub trait Plant: Sensors + Clone {
    /// Advances to a time.
    fn advance_to(&mut self, time: Time);
    /// Sets the coil's mean current and its ripple, A rms, from the plant's present time on.
    fn set_current(&mut self, mean_a: f64, ripple_a: f64);
    /// Coil and supply at the present time.
    fn conditions(&self) -> PlantConditions {
        PlantConditions::default()
    }
}

/// Sensors of constant frequencies, Hz, by channel, with a common drift.
#[derive(Clone, Debug)]
pub struct Still {
    /// Frequencies at time zero.
    pub frequencies_hz: [f64; 4],
    /// Drift, Hz per second.
    pub drift_hz_per_s: f64,
}

impl Still {
    /// Sensors of these frequencies, without drift.
    #[must_use]
    pub const fn new(frequencies_hz: [f64; 4]) -> Self {
        Self {
            frequencies_hz,
            drift_hz_per_s: 0.0,
        }
    }
}

impl Sensors for Still {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        let start_hz = self.frequencies_hz.get(channel).copied();
        start_hz.map_or(0.0, |hz| hz + self.drift_hz_per_s * time_s)
    }
}

impl Plant for Still {
    fn advance_to(&mut self, _: Time) {}

    fn set_current(&mut self, _: f64, _: f64) {}
}

/// An owned [`World`]: the sensing coil is on channel 0, the other channels have none. A clone is a
/// snapshot, unlike a clone of `SharedWorld`.
#[derive(Clone, Debug)]
pub struct PressedWorld(RefCell<World>);

impl PressedWorld {
    /// Wraps a world.
    #[must_use]
    pub const fn new(world: World) -> Self {
        Self(RefCell::new(world))
    }

    /// The world, to change or to read.
    pub fn world_mut(&mut self) -> &mut World {
        self.0.get_mut()
    }

    fn of_coil<T>(&self, channel: usize, otherwise: T, read: impl Fn(&mut World) -> T) -> T {
        match self.0.try_borrow_mut() {
            Ok(mut world) if channel == 0 => read(&mut world),
            _ => otherwise,
        }
    }

    fn losses(&self, channel: usize, time_s: f64) -> (f64, f64) {
        self.of_coil(channel, (1.0, 1.0), |world| {
            match world.frequency_ahead_hz(time_s) {
                Some(frequency_hz) if frequency_hz > 0.0 => world.losses(frequency_hz),
                _ => (1.0, 1.0),
            }
        })
    }
}

impl Sensors for PressedWorld {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        self.of_coil(channel, 0.0, |world| {
            let known = world.frequency_hz(time_s);
            known
                .or_else(|| world.frequency_ahead_hz(time_s))
                .unwrap_or(0.0)
        })
    }

    fn parallel_resistance_ohm(&self, channel: usize, time_s: f64) -> f64 {
        self.losses(channel, time_s).1
    }

    fn quality_factor(&self, channel: usize, time_s: f64) -> f64 {
        self.losses(channel, time_s).0
    }

    fn pulled_cycles(&self, channel: usize, window: &Window) -> f64 {
        self.of_coil(channel, 0.0, |world| world.pulled_cycles(window))
    }
}

impl Plant for PressedWorld {
    fn advance_to(&mut self, time: Time) {
        self.world_mut().advance_to(time);
    }

    fn set_current(&mut self, mean_a: f64, ripple_a: f64) {
        self.world_mut().set_current_with_ripple(mean_a, ripple_a);
    }

    fn conditions(&self) -> PlantConditions {
        let Ok(world) = self.0.try_borrow() else {
            return PlantConditions::default();
        };
        let usual = PlantConditions::default();
        let parameters = world.parameters();
        let current = &parameters.current;
        let truth = world.truth();
        PlantConditions {
            coil_c: truth.pad_c,
            supply_v: if current.supply_v.is_finite() {
                current.supply_v
            } else {
                usual.supply_v
            },
            supply_ohm: current.supply_ohm,
            coil_ohm: truth.coil_ohm,
            inductance_h: current.inductance_h,
        }
    }
}
