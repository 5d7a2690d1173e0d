//! The coil's thermometer: a thermistor to ground, a resistor of the same value to the supply.

/// Reference of the ADC, and supply of the divider.
const SUPPLY_V: f32 = 3.3;
/// 10 kiloohm at 25 degrees Celsius, as the resistor to the supply: the common value.
const REFERENCE_K: f32 = 298.15;
/// Its constant between 25 and 85 degrees Celsius, K, of the common 1 % parts (type 3950). By the
/// law of two points the error is below 1 K from 0 to 100 degrees Celsius.
const BETA_K: f32 = 3_950.0;
const ZERO_C_K: f32 = 273.15;
/// Outside of these nothing is connected, or a wire is shorted: -40 and 150 degrees Celsius.
const LOW_V: f32 = 0.06;
const HIGH_V: f32 = 3.22;

/// The temperature for a voltage: R/R25 = V/(V_supply - V), 1/T = 1/T25 + ln(R/R25)/beta.
pub fn celsius(volts: f32) -> Option<f32> {
    if !(LOW_V..=HIGH_V).contains(&volts) {
        return None;
    }
    let ratio = volts / (SUPPLY_V - volts);
    let inverse_per_k = 1.0 / REFERENCE_K + libm::logf(ratio) / BETA_K;
    Some(1.0 / inverse_per_k - ZERO_C_K)
}
