//! Colour scale of a map.

use palpate_cli::plot::Area;
use plotters::prelude::*;

use super::picture::{FONT, LABEL};

/// Number of colour bands.
const BANDS: i32 = 18;
/// Share of the map's cells that may exceed the scale: edges of plates and copper, where the field
/// is strongest.
const ABOVE: f64 = 0.005;
/// Share of the map's cells that may be below the scale.
const BELOW: f64 = 0.05;
/// Smallest and largest span of the scale, in decades.
const DECADES: [f64; 2] = [1.0, 4.0];

/// A logarithmic scale that shows nearly all of a map.
pub(super) struct ColourScale {
    /// |B| at the upper end, in the picture's unit.
    top: f64,
    decades: f64,
    /// The greatest |B| of the map.
    greatest: f64,
}

impl ColourScale {
    /// Creates the scale for the cells of a map.
    pub(super) fn of(sizes: &[f64]) -> Self {
        let mut sorted = sizes.to_vec();
        sorted.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "an index of the cells"
            )]
            let index = (share * (sorted.len().saturating_sub(1)) as f64) as usize;
            sorted.get(index).copied().unwrap_or(0.0)
        };
        let (top, low) = (quantile(1.0 - ABOVE), quantile(BELOW));
        let decades = (top / low).log10();
        let [least, most] = DECADES;
        Self {
            top,
            decades: if decades.is_finite() {
                decades.clamp(least, most)
            } else {
                most
            },
            greatest: quantile(1.0),
        }
    }

    /// Index of a value's band.
    pub(super) fn band(&self, size: f64) -> i32 {
        let decades = (size / self.top).log10();
        #[allow(clippy::cast_possible_truncation, reason = "clamped to the bands")]
        let band = (f64::from(BANDS) * (1.0 + decades / self.decades)) as i32;
        band.clamp(0, BANDS - 1)
    }

    /// Draws the scale with its labels.
    pub(super) fn draw(&self, area: &Area<'_>, unit: &str) -> Result<(), String> {
        #[allow(clippy::cast_possible_wrap, reason = "pixels")]
        let height = area.dim_in_pixel().1 as i32;
        let (top, bottom) = (120, height - 120);
        let at = |band: i32| bottom - (bottom - top) * band / BANDS;
        for band in 0..BANDS {
            let corners = [(10, at(band + 1)), (60, at(band))];
            let block = Rectangle::new(corners, colour(band).filled());
            area.draw(&block).map_err(text)?;
        }
        let label = |words: String, place: (i32, i32)| {
            area.draw(&Text::new(words, place, (FONT, LABEL)))
                .map_err(text)
        };
        label(format!("|B| / {unit}"), (0, top - 60))?;
        for band in (0..=BANDS).step_by(3) {
            let share = f64::from(band) / f64::from(BANDS) - 1.0;
            let size = short(self.top * 10_f64.powf(self.decades * share));
            let words = match band {
                0 => format!("< {size}"),
                BANDS => format!("{size} to {}", short(self.greatest)),
                _ => size,
            };
            label(words, (72, at(band) - 15))?;
        }
        Ok(())
    }
}

/// The colour of a band.
pub(super) fn colour(band: i32) -> RGBColor {
    ViridisRGB::get_color_normalized(f64::from(band), 0.0, f64::from(BANDS - 1))
}

/// Formats a value with three digits.
fn short(value: f64) -> String {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 6"
    )]
    let digits = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.digits$}")
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}
