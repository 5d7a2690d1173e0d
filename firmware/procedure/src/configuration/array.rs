//! Array of coils in force, and its numbers for readback.

use palpate_model::touch::{Array, Coefficients, Coil, Indenter, Region};
use palpate_model::units::Metre;
use palpate_wire::Command;
use palpate_wire::command::{ARRAY_NUMBERS, COIL_NUMBERS, NUMBERS_PER_CHUNK, TouchArray};

use crate::list::gathered;

/// An array of coils with its calibration and the declared indenter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ActiveArray {
    pub(crate) array: Array,
    /// Channels of the coils: bit n for channel n of the first, bit 4 + n for that of the second
    /// converter.
    pub(crate) channels: u8,
    /// Numbers of the indenter, as received.
    pub(crate) indenter: [f32; 4],
}

impl ActiveArray {
    pub(crate) fn indenter(&self) -> Indenter {
        let [is_declared, at_one_newton_m, exponent, uncertainty] = self.indenter;
        if is_declared == 0.0 {
            return Indenter::Unknown;
        }
        Indenter::Declared {
            at_one_newton: Metre(at_one_newton_m),
            exponent,
            uncertainty,
        }
    }

    /// Returns the command with chunk number `chunk`, from 0; `None` beyond the end.
    pub(super) fn chunk(&self, chunk: usize) -> Option<Command> {
        let total = ARRAY_NUMBERS + COIL_NUMBERS * self.array.coils().len();
        let first = chunk.checked_mul(NUMBERS_PER_CHUNK)?;
        (first < total).then(|| {
            Command::SetTouchArray(TouchArray {
                total: total as u8,
                first: first as u8,
                numbers: gathered(self.numbers().skip(first).take(NUMBERS_PER_CHUNK)),
            })
        })
    }

    /// Returns the numbers in the order of the protocol.
    fn numbers(&self) -> impl Iterator<Item = f32> + '_ {
        let [is_declared, at_one_newton_m, exponent, uncertainty] = self.indenter;
        let (x, y, radius) = match self.array.region() {
            Region::Disc {
                centre: [x, y],
                radius,
            } => (x, y, radius),
            Region::Hull { margin } => (Metre(0.0), Metre(0.0), margin),
        };
        let (reading, common) = self.array.errors();
        let Coefficients {
            spacing,
            least_radius,
            greatest_radius,
            base,
            linear,
            quadratic,
            bent,
            greatest_force,
        } = self.array.profile().coefficients();
        let first = [
            self.channels.into(),
            is_declared,
            at_one_newton_m,
            exponent,
            uncertainty,
            x.0,
            y.0,
            radius.0,
            reading.relative,
            reading.of_largest,
            common.place.0,
            common.ln_force,
            common.ln_radius,
            spacing.0,
            least_radius.0,
            greatest_radius.0,
            greatest_force.0,
        ];
        let profile = base.iter().chain(linear).chain(quadratic);
        let profile = profile.chain(bent.as_flattened()).copied();
        let of_coil = |coil: &Coil| [coil.x.0, coil.y.0, coil.gain, coil.noise];
        let coils = self.array.coils().iter().flat_map(of_coil);
        first.into_iter().chain(profile).chain(coils)
    }
}
