//! Thermal model with two nodes: copper and pad.
//!
//! C_c dT_c/dt = P - (T_c - T_p)/R_cp,
//! C_p dT_p/dt = (T_c - T_p)/R_cp - (T_p - T_a)/R_pa,
//!
//! where T_a is the ambient temperature. The copper heats up within a second and passes its heat to
//! the pad, whose time constant of minutes limits the power of a train of ramps. P = I^2 R(T_c), R
//! = R_20 (1 + 0.00393 (T_c - 20)).

use crate::math;
use crate::units::{
    Ampere, Celsius, JoulePerKelvin, Kelvin, KelvinPerWatt, Ohm, OutOfRange, Second, Watt,
};

/// Temperature coefficient of copper's resistance near 20 degC, 1/K (IEC 60028).
pub const COPPER_TEMPCO: f32 = 3.93e-3;

/// Temperature at which a coil's resistance is stated.
pub const STATED_AT: Celsius = Celsius(20.0);

/// A coil's copper, given by its resistance at 20 degC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Copper(pub Ohm);

impl Copper {
    /// Resistance at a temperature: R(T) = R_20 (1 + 0.00393 (T - 20 degC)).
    pub fn resistance(&self, temperature: Celsius) -> Ohm {
        self.0 * (1.0 + COPPER_TEMPCO * (temperature - STATED_AT).0)
    }

    /// Heating power P = I^2 R(T).
    ///
    /// ```
    /// use palpate_model::{thermal::Copper, units::{Ampere, Celsius, Ohm}};
    /// let power = Copper(Ohm(0.389)).heat(Ampere(10.0), Celsius(20.0));
    /// assert!((power.0 - 38.9).abs() < 1e-4);
    /// ```
    pub fn heat(&self, current: Ampere, temperature: Celsius) -> Watt {
        Watt(current.0 * current.0 * self.resistance(temperature).0)
    }
}

/// Temperatures of the two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Temperatures {
    /// Temperature of the copper, T_c.
    pub copper: Celsius,
    /// Temperature of the pad, T_p.
    pub pad: Celsius,
}

impl Temperatures {
    /// Both nodes at the same temperature.
    pub const fn uniform(temperature: Celsius) -> Self {
        Self {
            copper: temperature,
            pad: temperature,
        }
    }
}

/// Two heat capacities and two thermal resistances, with the rates that follow from them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoNode {
    copper_capacity: JoulePerKelvin,
    copper_to_pad: KelvinPerWatt,
    pad_to_ambient: KelvinPerWatt,
    /// Rates 1/(C_c R_cp), 1/(C_p R_cp), 1/(C_p R_pa), in 1/s.
    rates: [f32; 3],
    /// Decay rates of the two modes, fast and slow, in 1/s.
    modes: [f32; 2],
}

impl TwoNode {
    /// Creates a model; all four parameters above zero.
    pub fn new(
        copper_capacity: JoulePerKelvin,
        pad_capacity: JoulePerKelvin,
        copper_to_pad: KelvinPerWatt,
        pad_to_ambient: KelvinPerWatt,
    ) -> Result<Self, OutOfRange> {
        let copper_capacity = JoulePerKelvin::positive(copper_capacity.0)?;
        let pad_capacity = JoulePerKelvin::positive(pad_capacity.0)?;
        let copper_to_pad = KelvinPerWatt::positive(copper_to_pad.0)?;
        let pad_to_ambient = KelvinPerWatt::positive(pad_to_ambient.0)?;
        let rates = [
            1.0 / (copper_capacity.0 * copper_to_pad.0),
            1.0 / (pad_capacity.0 * copper_to_pad.0),
            1.0 / (pad_capacity.0 * pad_to_ambient.0),
        ];
        let [a, b, c] = rates;
        // Roots of r^2 - (a + b + c) r + a c: real, since (a + b - c)^2 + 4 b c > 0. The smaller
        // root is computed from the product of both, since a difference would lose digits.
        let fast = 0.5 * (a + b + c + math::hypot(a + b - c, 2.0 * math::sqrt(b * c)));
        let modes = [fast, a * (c / fast)];
        Ok(Self {
            copper_capacity,
            copper_to_pad,
            pad_to_ambient,
            rates,
            modes,
        })
    }

    /// Temperatures after `duration` of constant `power`, by the exact solution: stable for any
    /// duration.
    ///
    /// Error at most 2.0e-6 of the largest temperature difference involved, for heat capacities and
    /// thermal resistances whose rates differ by a factor of at most 1e5.
    pub fn after(
        &self,
        start: Temperatures,
        power: Watt,
        ambient: Celsius,
        duration: Second,
    ) -> Temperatures {
        // Deviations from the final state: each is a sum of two decaying modes.
        let pad_end = power.0 * self.pad_to_ambient.0;
        let copper_end = pad_end + power.0 * self.copper_to_pad.0;
        let copper = (start.copper - ambient).0 - copper_end;
        let pad = (start.pad - ambient).0 - pad_end;
        let [a, b, c] = self.rates;
        let [fast, slow] = self.modes;
        // exp(M t) - 1 = slow_gone + blend (M + slow), M = [[-a, a], [b, -(b + c)]] (Sylvester's
        // formula). The change itself is computed, so that rounding does not add up over many short
        // steps.
        let slow_gone = math::exp_m1(-slow * duration.0);
        let blend = (slow_gone - math::exp_m1(-fast * duration.0)) / (fast - slow);
        let copper_rate = a * (pad - copper) + slow * copper;
        let pad_rate = b * (copper - pad) + (slow - c) * pad;
        Temperatures {
            copper: start.copper + Kelvin(slow_gone * copper + blend * copper_rate),
            pad: start.pad + Kelvin(slow_gone * pad + blend * pad_rate),
        }
    }

    /// Upper bound of the temperatures at the end of a planned pulse of `current`: the heat is
    /// computed with the resistance at the higher of the copper's initial and final temperatures.
    /// It is valid for pulses that are short compared with the pad's cooling, so that the copper is
    /// hottest at the start or at the end.
    ///
    /// The bound is too high by at most 0.4 % of the current's heating for every kelvin between the
    /// lowest and the highest temperature involved. `None` if the copper does not stay below
    /// `limit`, or if its temperature would run away.
    ///
    /// ```
    /// use palpate_model::thermal::{Copper, Temperatures, TwoNode};
    /// use palpate_model::units::*;
    /// let stack = TwoNode::new(
    ///     JoulePerKelvin(0.8), JoulePerKelvin(60.0), KelvinPerWatt(0.5), KelvinPerWatt(8.0),
    /// )?;
    /// let rest = Temperatures::uniform(Celsius(25.0));
    /// let coil = Copper(Ohm(0.389));
    /// let end = stack
    ///     .after_pulse(rest, coil, Ampere(10.0), Celsius(25.0), Second(0.2), Celsius(60.0))
    ///     .unwrap();
    /// assert!(end.copper.0 > 32.0 && end.copper.0 < 34.5);
    /// assert!(stack
    ///     .after_pulse(rest, coil, Ampere(40.0), Celsius(25.0), Second(0.2), Celsius(60.0))
    ///     .is_none());
    /// # Ok::<(), OutOfRange>(())
    /// ```
    pub fn after_pulse(
        &self,
        start: Temperatures,
        copper: Copper,
        current: Ampere,
        ambient: Celsius,
        duration: Second,
        limit: Celsius,
    ) -> Option<Temperatures> {
        /// Number of steps of the fixed-point iteration. Each step multiplies the remaining
        /// difference by the gain of the loop, 0.4 % per kelvin of the pulse's temperature rise:
        /// below 100 K, 12 steps leave 2e-5 of it, less than the bound's excess.
        const STEPS: u8 = 12;
        // The end temperature grows with the heat, and the heat with the end temperature: starting
        // from below, the steps rise towards their fixed point.
        let mut hottest = start.copper;
        let mut end = start;
        for _ in 0..STEPS {
            end = self.after(start, copper.heat(current, hottest), ambient, duration);
            // Negated, so that NaN fails too.
            if !(end.copper <= limit) {
                return None;
            }
            if end.copper > hottest {
                hottest = end.copper;
            }
        }
        Some(end)
    }

    /// Heat capacity C_c of the copper: at the start of a pulse its temperature rises at the rate
    /// P/C_c.
    pub const fn copper_capacity(&self) -> JoulePerKelvin {
        self.copper_capacity
    }
}
