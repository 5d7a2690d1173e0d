//! Hard limits, as a type. The values are the program's: those of the Pico's firmware stand in
//! `firmware/node/src/board.rs`.

use crate::fault::Refusal;
use crate::hardware::Hardware;

/// Hard limits that no command, setting or line exceeds. Given once, when the drive is created,
/// usually as a constant of the program, and not changeable afterwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Greatest setpoint of the current, A.
    pub setpoint_a: f32,
    /// Measured current at which the bridge is switched off and stays off, A. It is higher than
    /// `setpoint_a` by at least ripple, overshoot and noise, and below the end of the measuring
    /// range.
    pub trip_a: f32,
    /// Greatest fraction of a period for which a voltage is applied, 0 to 1: the bridge's upper
    /// switches may need the remaining time to keep their gate drivers supplied.
    pub duty: f32,
    /// Longest time with the bridge on, s.
    pub on_time_s: f32,
    /// Greatest net energy of the circuit, J: energy taken less energy given off since then.
    pub energy_j: f32,
    /// Power that the circuit can give off continuously, W: the rate at which the counted energy
    /// falls.
    pub continuous_w: f32,
    /// Lowest and highest supply voltage, V.
    pub supply_v: [f32; 2],
    /// Lowest and highest resistance of the circuit, ohm: a short below, an open circuit above.
    pub resistance_ohm: [f32; 2],
    /// Lowest and highest inductance, H.
    pub inductance_h: [f32; 2],
}

impl Limits {
    /// Checks that the limits are valid for this hardware.
    ///
    /// # Errors
    /// [`Refusal::Limits`] with the field's name.
    pub fn check(&self, hardware: &Hardware) -> Result<(), Refusal> {
        let is = |ok: bool, field| {
            if ok {
                Ok(())
            } else {
                Err(Refusal::Limits(field))
            }
        };
        let rises = |[low, high]: [f32; 2]| low > 0.0 && high > low && high.is_finite();
        is(self.setpoint_a > 0.0, "setpoint_a")?;
        is(self.trip_a > self.setpoint_a, "trip_a")?;
        // The trip level must be within the converter's range, wherever the reading without current
        // is within its tolerance.
        let upwards = hardware.greatest_count - hardware.zero_count;
        let span = upwards.min(hardware.zero_count) - hardware.zero_tolerance;
        let visible_a = f32::from(span) * hardware.ampere_per_count.abs();
        is(self.trip_a < visible_a, "trip_a")?;
        is((0.01..=1.0).contains(&self.duty), "duty")?;
        is(
            self.on_time_s > 0.0 && self.on_time_s <= 3_600.0,
            "on_time_s",
        )?;
        is(self.energy_j > 0.0 && self.energy_j.is_finite(), "energy_j")?;
        is(
            self.continuous_w >= 0.0 && self.continuous_w.is_finite(),
            "continuous_w",
        )?;
        is(rises(self.supply_v), "supply_v")?;
        is(rises(self.resistance_ohm), "resistance_ohm")?;
        is(rises(self.inductance_h), "inductance_h")
    }
}

/// Example for tests.
#[cfg(test)]
pub(crate) const EXAMPLE: Limits = Limits {
    setpoint_a: 10.0,
    trip_a: 11.0,
    duty: 0.98,
    on_time_s: 20.0,
    energy_j: 60.0,
    continuous_w: 3.5,
    supply_v: [4.5, 14.0],
    resistance_ohm: [0.15, 3.0],
    inductance_h: [10e-6, 400e-6],
};
