//! Parameters of the board and of the coil found on it.

use crate::fault::Refusal;

/// Decay mode: how the current falls when it has to fall faster than in the shorted coil.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Decay {
    /// Slow decay only: both outputs are high, so the bridge shorts the coil.
    Slow,
    /// Fast decay: both inputs are low for a part of each period, and the coil drives its current
    /// through the diodes back into the supply. The current cannot change its sign meanwhile.
    #[default]
    Fast,
}

/// Bridge, PWM and current measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hardware {
    /// Period of the PWM, s: 10⁻⁶ to 10⁻³.
    pub period_s: f32,
    /// Compare value of an output that is high all the time: 16 to 2048.
    pub full_level: u16,
    /// Current per count of the converter, A; negative if the amplifier is reversed.
    pub ampere_per_count: f32,
    /// Nominal count without current.
    pub zero_count: u16,
    /// Largest deviation of the true count without current from `zero_count`, in counts.
    pub zero_tolerance: u16,
    /// Highest count of the converter.
    pub greatest_count: u16,
    /// Forward voltage of one diode of the bridge, V.
    pub diode_v: f32,
    /// Decay mode.
    pub decay: Decay,
    /// Time from nSLEEP high until the outputs follow the inputs, s: 0 to 0.02. During this time
    /// the current is not regulated and the bridge's fault output is ignored.
    pub wake_s: f32,
    /// Current to which the hardware limits while [`Output::limit_low`](crate::Output::limit_low)
    /// is set, A; `None` if the board has no input for that. In that case the self-test cannot
    /// check that the hardware limits the current.
    pub reduced_limit_a: Option<f32>,
}

impl Hardware {
    /// Checks the ranges of all fields.
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

    /// Current per unit of the driver, A: a period's two samples are added, so a unit is half a
    /// count.
    pub(crate) fn ampere_per_unit(&self) -> f32 {
        0.5 * self.ampere_per_count.abs()
    }

    /// Number of whole periods that the bridge needs to wake.
    pub(crate) fn wake_periods(&self) -> u16 {
        let periods = self.wake_s / self.period_s;
        let whole = periods as u16;
        whole + u16::from(f32::from(whole) < periods)
    }

    /// Converts a current, A, to units; saturates.
    pub(crate) fn units(&self, current_a: f32) -> i32 {
        (current_a / self.ampere_per_unit()) as i32
    }
}

/// Parameters of a coil and its circuit, as found by the self-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoilParameters {
    /// Resistance of coil, bridge and supply together, ohm: the load on the supply's voltage
    /// without load.
    pub resistance_ohm: f32,
    /// Inductance, H.
    pub inductance_h: f32,
    /// Fraction of a period that dead time takes from every pulse, 0 to 0.2.
    pub dead_time_share: f32,
}

impl CoilParameters {
    /// Time constant L/R, s.
    #[must_use]
    pub fn time_constant_s(&self) -> f32 {
        self.inductance_h / self.resistance_ohm
    }
}

/// Example for tests, with a unit of 3 mA.
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
