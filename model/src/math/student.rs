//! Quantile of Student's t distribution, for intervals whose noise is estimated from residuals.

/// The 97.5 % quantile of the normal distribution.
pub const NORMAL_975: f32 = 1.959_964;

/// The 97.5 % quantile of Student's t for `degrees` of freedom: relative error at most 2.0e-4, and
/// 1.5e-5 from 8 degrees on. Infinite for zero degrees, which do not allow an estimate of the
/// noise.
///
/// Uses a table for 1 to 4 degrees, then the Cornish-Fisher expansion about the normal quantile to
/// the fourth order in 1/degrees (Abramowitz and Stegun 26.7.5).
///
/// ```
/// use palpate_model::math::student::quantile_975;
/// assert!((quantile_975(7) - 2.3646).abs() < 5e-4);
/// assert!(quantile_975(0).is_infinite());
/// ```
pub fn quantile_975(degrees: u32) -> f32 {
    match degrees {
        0 => f32::INFINITY,
        1 => 12.706_205,
        2 => 4.302_653,
        3 => 3.182_446,
        4 => 2.776_445,
        _ => cornish_fisher(NORMAL_975, 1.0 / degrees as f32),
    }
}

/// The expansion of Abramowitz and Stegun 26.7.5 as polynomials in z^2; `inverse` is 1/degrees.
fn cornish_fisher(z: f32, inverse: f32) -> f32 {
    let s = z * z;
    let g1 = z * (s + 1.0) / 4.0;
    let g2 = z * ((5.0 * s + 16.0) * s + 3.0) / 96.0;
    let g3 = z * (((3.0 * s + 19.0) * s + 17.0) * s - 15.0) / 384.0;
    let g4 = z * ((((79.0 * s + 776.0) * s + 1482.0) * s - 1920.0) * s - 945.0) / 92_160.0;
    z + inverse * (g1 + inverse * (g2 + inverse * (g3 + inverse * g4)))
}
