//! What is on the board, and the coil that was found at it.

use crate::fault::Refusal;

/// How the current falls where it has to fall faster than the shorted coil lets it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Decay {
    /// Never faster: both outputs high, the coil shorted through the bridge (slow decay).
    Slow,
    /// Both inputs low for as much of a period as it takes: the coil drives its current through
    /// the diodes back into the supply (fast decay). The current cannot change its sign in that.
    #[default]
    Fast,
}

/// Bridge, PWM and current measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Hardware {
    /// Period of the PWM, s: 10⁻⁶ to 10⁻³.
    pub period_s: f32,
    /// Compare value of an output that is high all the time: 16 to 2048.
    pub full_level: u16,
    /// Amperes of one count of the converter; negative where the amplifier is turned round.
    pub ampere_per_count: f32,
    /// Count without current, nominally.
    pub zero_count: u16,
    /// Counts by which the true one may differ from it.
    pub zero_tolerance: u16,
    /// Highest count of the converter.
    pub greatest_count: u16,
    /// Forward voltage of one diode of the bridge, V.
    pub diode_v: f32,
    /// How the current falls.
    pub decay: Decay,
    /// From nSLEEP high to outputs that follow the inputs, s: 0 to 0.02. Meanwhile nothing is regulated,
    /// and the bridge's fault output counts for nothing.
    pub wake_s: f32,
    /// Current to which the hardware limits while [`Output::limit_low`](crate::Output::limit_low)
    /// is set, A, where it has an input for that. Without it the self-test cannot tell whether
    /// there is a limit.
    pub reduced_limit_a: Option<f32>,
}

impl Hardware {
    /// Checks ranges.
    ///
    /// # Errors
    /// [`Refusal::Hardware`] with the field's name.
    pub fn check(&self) -> Result<(), Refusal> {
        let is = |ok: bool, field| {
            if ok {
                Ok(())
            } else {
                Err(Refusal::Hardware(field))
            }
        };
        is((1e-6..=1e-3).contains(&self.period_s), "period_s")?;
        is((16..=2048).contains(&self.full_level), "full_level")?;
        let count_a = self.ampere_per_count.abs();
        is((1e-5..=1.0).contains(&count_a), "ampere_per_count")?;
        is(
            (255..=4095).contains(&self.greatest_count),
            "greatest_count",
        )?;
        is(
            self.zero_count > self.zero_tolerance
                && self.zero_count < self.greatest_count - self.zero_tolerance,
            "zero_count",
        )?;
        is((0.0..=2.0).contains(&self.diode_v), "diode_v")?;
        is((0.0..=0.02).contains(&self.wake_s), "wake_s")?;
        is(
            self.reduced_limit_a.is_none_or(|of| of > 0.0),
            "reduced_limit_a",
        )
    }

    /// Amperes of a unit of the driver: two samples are added, so a unit is half a count.
    pub(crate) fn ampere_per_unit(&self) -> f32 {
        0.5 * self.ampere_per_count.abs()
    }

    /// Whole periods in which the bridge wakes.
    pub(crate) fn wake_periods(&self) -> u16 {
        let periods = self.wake_s / self.period_s;
        let whole = periods as u16;
        whole + u16::from(f32::from(whole) < periods)
    }

    /// A current in units; saturates.
    pub(crate) fn units(&self, current_a: f32) -> i32 {
        (current_a / self.ampere_per_unit()) as i32
    }
}

/// A coil with everything in its circuit, as the self-test finds it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CoilParameters {
    /// Resistance of coil, bridge and supply together, ohm: what the voltage at the supply's input
    /// has to overcome.
    pub resistance_ohm: f32,
    /// Inductance, H.
    pub inductance_h: f32,
    /// Part of a period that dead time takes from every pulse, 0 to 0.2.
    pub lost: f32,
}

impl CoilParameters {
    /// L/R, s.
    #[must_use]
    pub fn time_constant_s(&self) -> f32 {
        self.inductance_h / self.resistance_ohm
    }
}

/// One for tests, with a unit of 3 mA.
#[cfg(test)]
pub(crate) const EXAMPLE: Hardware = Hardware {
    period_s: 16e-6,
    full_level: 960,
    ampere_per_count: 0.006,
    zero_count: 2048,
    zero_tolerance: 64,
    greatest_count: 4095,
    diode_v: 0.8,
    decay: Decay::Fast,
    wake_s: 0.0,
    reduced_limit_a: None,
};
