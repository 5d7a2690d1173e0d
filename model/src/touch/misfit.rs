//! Limit of chi-square.

/// The 99.9 % quantile of chi-square for 1 to 8 degrees of freedom (Abramowitz and Stegun, table
/// 26.8): one right press in a thousand is refused.
const QUANTILES: [f32; 8] = [10.83, 13.82, 16.27, 18.47, 20.52, 22.46, 24.32, 26.12];

/// Greatest chi-square that a fit may have; infinite without degrees of freedom.
pub(super) fn greatest_chi_square(degrees: usize) -> f32 {
    let index = degrees.checked_sub(1);
    let quantile = index.and_then(|index| QUANTILES.get(index));
    quantile.copied().unwrap_or(f32::INFINITY)
}
