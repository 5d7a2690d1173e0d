//! The commands that set an array on a board.

use palpate_wire::Command;
use palpate_wire::command::{NUMBERS_PER_CHUNK, TouchArray};

use super::ArrayCalibration;

/// A declared indenter: the contact's radius is radius_m (F/1 N)^exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeclaredIndenter {
    /// Radius of the contact at 1 N, m.
    pub radius_m: f64,
    /// Exponent of the force: 0 of a pin, 1/3 of a ball.
    pub exponent: f64,
    /// Relative standard uncertainty of the radius.
    pub uncertainty: f64,
}

impl ArrayCalibration {
    /// The commands that set this array, whose coils are on these channels from the lowest: bit n for
    /// channel n of the first, bit 4 + n for that of the second converter.
    pub fn commands(&self, channels: u8, indenter: Option<DeclaredIndenter>) -> Vec<Command> {
        let indenter = indenter.map_or([0.0; 4], |of| {
            [1.0, of.radius_m, of.exponent, of.uncertainty]
        });
        let scales = self.scales();
        let mut numbers = vec![f64::from(channels)];
        numbers.extend(indenter);
        numbers.extend([0.0, 0.0, self.design.reach_m]);
        let (reading, common) = (self.reading_error, self.common_error);
        numbers.extend([reading.relative, reading.of_largest]);
        numbers.extend([common.place_m, common.ln_force, common.ln_radius]);
        numbers.push(scales.spacing_m);
        numbers.extend(scales.radii_m);
        numbers.push(self.greatest_force_n());
        numbers.extend(self.base());
        numbers.extend(self.by_radius().concat());
        numbers.extend(self.bent());
        for coil in self.coils() {
            numbers.extend(coil.place_m);
            numbers.extend([coil.gain, self.design.noise]);
        }
        let total = numbers.len() as u8;
        let chunks = numbers.chunks(NUMBERS_PER_CHUNK).enumerate();
        let command = |(chunk, numbers): (usize, &[f64])| {
            Command::SetTouchArray(TouchArray {
                total,
                first: (chunk * NUMBERS_PER_CHUNK) as u8,
                numbers: numbers.iter().map(|number| *number as f32).collect(),
            })
        };
        chunks.map(command).collect()
    }
}
