//! Heat of the coil: present temperatures and forecast for a train.

use palpate_model::math::sqrt;
use palpate_model::thermal::{Copper, Temperatures, TwoNode};
use palpate_model::units::{
    Ampere, Celsius, JoulePerKelvin, Kelvin, KelvinPerWatt, Ohm, OutOfRange, Second, Watt,
};
use palpate_wire::command::Coil;

use crate::measurement::train::TrainProfile;
use crate::time::in_seconds;

/// Ambient temperature that is assumed without a thermometer: a warm room, to which the coil's own
/// heating is added.
const WARM_ROOM: Celsius = Celsius(30.0);

/// Upper bound of the computed copper temperature, the melting point. Without this bound an ever growing
/// resistance would end in infinity minus infinity, NaN, which is not greater than any limit.
const MELTING: Celsius = Celsius(1085.0);

/// Temperatures of copper and pad, computed from the square of the current.
#[derive(Clone, Debug)]
pub(crate) struct Heat {
    nodes: TwoNode,
    copper: Copper,
    now: Temperatures,
    /// Ambient temperature: the lowest that the thermometer has reported, since the pad is never colder
    /// than its surroundings.
    ambient: Option<Celsius>,
    /// Time since the last temperature step. `square_a2_s` is the integral of the squared current over
    /// this time.
    elapsed: Second,
    square_a2_s: f32,
    /// Energy into the coil since the measurement began, in joules.
    energy_j: f32,
}

/// Time between two temperature steps. The two-node solution is exact for any step of constant power; in
/// 10 ms the copper of the paper's coils warms by 0.5 K at 10 A, which changes its resistance by 0.2 %.
const STEP: Second = Second(0.01);

/// Energy and temperature of a train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Forecast {
    pub(crate) energy_j: f32,
    /// Highest copper temperature, an upper bound; `None` above the limit.
    pub(crate) hottest: Option<Celsius>,
}

impl Heat {
    /// Creates the state of a coil whose copper had this temperature `ago`, without current since.
    pub(crate) fn new(
        coil: &Coil,
        temperature: Option<Celsius>,
        (copper, ago): (Celsius, Second),
    ) -> Result<Self, OutOfRange> {
        let pad = temperature.unwrap_or(WARM_ROOM);
        let nodes = TwoNode::new(
            JoulePerKelvin(coil.copper_capacity_j_per_k),
            JoulePerKelvin(coil.pad_capacity_j_per_k),
            KelvinPerWatt(coil.copper_to_pad_k_per_w),
            KelvinPerWatt(coil.pad_to_ambient_k_per_w),
        )?;
        let then = Temperatures { copper, pad };
        let cooled = nodes.after(then, Watt(0.0), pad, ago).copper;
        let copper = if cooled > pad { cooled } else { pad };
        Ok(Self {
            nodes,
            copper: Copper(Ohm(coil.resistance_ohm)),
            now: Temperatures { copper, pad },
            ambient: temperature,
            elapsed: Second(0.0),
            square_a2_s: 0.0,
            energy_j: 0.0,
        })
    }

    /// Adds a mean square of the current over an interval.
    pub(crate) fn push(&mut self, square_a2: f32, interval: Second) {
        self.elapsed = self.elapsed + interval;
        self.square_a2_s += square_a2 * interval.0;
        if self.elapsed < STEP {
            return;
        }
        let resistance = self.copper.resistance(self.now.copper);
        let heat_j = self.square_a2_s * resistance.0;
        let power = Watt(heat_j / self.elapsed.0);
        let Temperatures { copper, pad } =
            self.nodes
                .after(self.now, power, self.ambient(), self.elapsed);
        // `min` limits a temperature to the melting point, and also replaces a NaN by the melting point.
        self.now = Temperatures {
            copper: Celsius(copper.0.min(MELTING.0)),
            pad: Celsius(pad.0.min(MELTING.0)),
        };
        self.energy_j += heat_j;
        self.elapsed = Second(0.0);
        self.square_a2_s = 0.0;
    }

    /// Takes a reading of the pad's thermometer: the copper is at least as warm, and the surroundings
    /// are at most as warm.
    pub(crate) fn measured(&mut self, temperature: Celsius) {
        self.now.pad = temperature;
        if self.ambient.is_none_or(|ambient| temperature < ambient) {
            self.ambient = Some(temperature);
        }
        if self.now.copper < temperature {
            self.now.copper = temperature;
        }
    }

    pub(crate) const fn start_measurement(&mut self) {
        self.energy_j = 0.0;
    }

    pub(crate) const fn energy_j(&self) -> f32 {
        self.energy_j
    }

    pub(crate) const fn copper(&self) -> Celsius {
        self.now.copper
    }

    /// Returns the coil's resistance at a temperature, by its calibration.
    pub(crate) fn resistance(&self, temperature: Celsius) -> Ohm {
        self.copper.resistance(temperature)
    }

    /// Returns the computed pad temperature, a lower bound of the copper's temperature.
    pub(crate) const fn pad(&self) -> Celsius {
        self.now.pad
    }

    fn ambient(&self) -> Celsius {
        self.ambient.unwrap_or(WARM_ROOM)
    }

    /// Returns the time without current, in seconds to within one, after which a train stays below the
    /// limit. `None` if an hour is not enough.
    pub(crate) fn wait_s(&self, profile: &TrainProfile, limit: Celsius) -> Option<f32> {
        const LONGEST_S: f32 = 3_600.0;
        let allows = |after_s: f32| {
            let mut later = self.clone();
            later.now = self
                .nodes
                .after(self.now, Watt(0.0), self.ambient(), Second(after_s));
            later.forecast(profile, limit).hottest.is_some()
        };
        if !allows(LONGEST_S) {
            return None;
        }
        let (mut no_s, mut yes_s) = (0.0, LONGEST_S);
        while yes_s - no_s > 1.0 {
            let middle_s = 0.5 * (no_s + yes_s);
            if allows(middle_s) {
                yes_s = middle_s;
            } else {
                no_s = middle_s;
            }
        }
        Some(yes_s)
    }

    /// Returns the forecast of a train that starts at this time. A train whose copper starts above the
    /// limit is refused even if it would cool during the train.
    pub(crate) fn forecast(&self, profile: &TrainProfile, limit: Celsius) -> Forecast {
        let duration = in_seconds(profile.duration());
        let mean_square_a2 = profile.mean_square_a2();
        // The computed bound is for a constant current of the same mean square. Within a period of the
        // train, the copper exceeds that bound by at most the heating of rise and hold.
        let at_peak = in_seconds(profile.rise) + in_seconds(profile.hold);
        let swing_j = self.copper.heat(profile.peak, limit).0 * at_peak.0;
        let swing = Kelvin(swing_j / self.nodes.copper_capacity().0);
        let end = self.nodes.after_pulse(
            self.now,
            self.copper,
            Ampere(sqrt(mean_square_a2)),
            self.ambient(),
            duration,
            Celsius(limit.0 - swing.0),
        );
        let end = end.filter(|_| self.now.copper <= limit);
        let warmest = end.map_or(limit, |end| end.copper);
        Forecast {
            energy_j: mean_square_a2 * self.copper.resistance(warmest).0 * duration.0,
            hottest: end.map(|end| end.copper + swing),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::tests::COIL;

    fn heat(temperature: Option<Celsius>, copper: (f32, f32)) -> Heat {
        let (copper_c, ago_s) = copper;
        Heat::new(&COIL, temperature, (Celsius(copper_c), Second(ago_s))).unwrap()
    }

    /// The thermometer may first report after start-up. Its lowest report is the ambient temperature.
    #[test]
    fn the_surroundings_are_those_that_the_thermometer_reports() {
        let mut heat = heat(None, (25.0, 0.0));
        for reported_c in [45.0, 44.0, 60.0] {
            heat.measured(Celsius(reported_c));
        }
        // The pad cools to the ambient temperature in an hour without current and without a report.
        (0..3_600).for_each(|_| heat.push(0.0, Second(1.0)));
        assert!((heat.pad().0 - 44.0).abs() < 0.1, "{:?}", heat.pad());
    }

    #[test]
    fn the_copper_is_as_hot_as_the_run_before_may_have_left_it_and_cools_from_there() {
        // 0.4 s is the time constant of copper against pad: 0.8 J/K and 0.5 K/W.
        for (ago_s, expected_c) in [(0.0, 100.0), (0.4, 52.9), (2.0, 25.8)] {
            let Celsius(copper_c) = heat(Some(Celsius(25.0)), (100.0, ago_s)).copper();
            assert!((copper_c - expected_c).abs() < 1.0, "{ago_s} s: {copper_c}");
        }
        // The copper is never colder than the pad.
        let warm = heat(Some(Celsius(60.0)), (30.0, 1.0));
        assert_eq!(warm.copper(), Celsius(60.0));
    }
}
