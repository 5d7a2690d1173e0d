//! Checks that settings and calibration are still as they were set.
//!
//! Settings and calibration stay in RAM for weeks, and one inverted bit of a spring or a curve would
//! falsify every measurement unnoticed. So each part has a checksum, computed when it is set and
//! compared periodically.

use palpate_wire::code::Part;
use palpate_wire::{Command, configuration_crc};

use super::parts::{ITEMS, item, sets};
use super::{Configuration, SetStiffening};

/// Number of the record that carries the settings, for reporting their damage.
const SETTINGS: u8 = 0x10;

impl Configuration {
    /// Computes the checksum of an item from its present content.
    fn sum(&self, number: usize) -> u32 {
        let Some((part, sensor, channel)) = item(number) else {
            return configuration_crc([Command::SetSettings(self.settings.clone())]);
        };
        match (part, &self.stiffening) {
            // The checksum includes the curve's slopes, which no record carries.
            (Part::DeformationCurve, _) => {
                let curve = self.channel(sensor, channel).map(|of| &of.curve);
                curve.and_then(Option::as_ref).map_or(0, |of| of.checksum())
            }
            (Part::StiffeningCurve, Some(SetStiffening::Curve { rise, uncertainty })) => {
                rise.checksum() ^ uncertainty.to_bits()
            }
            _ => {
                let chunks = (0..).map_while(|chunk| self.setter(part, sensor, channel, chunk));
                configuration_crc(chunks)
            }
        }
    }

    /// Updates the checksums of the items that a command has set.
    pub(super) fn seal(&mut self, command: &Command) {
        self.seal_where(|number| sets(command, number));
    }

    /// Updates all checksums.
    pub(super) fn seal_all(&mut self) {
        self.seal_where(|_| true);
    }

    fn seal_where(&mut self, is_new: impl Fn(usize) -> bool) {
        for number in (0..ITEMS).filter(|number| is_new(*number)) {
            let sum = self.sum(number);
            if let Some(of) = self.sums.get_mut(number) {
                *of = sum;
            }
        }
    }

    /// Returns the kind of an item's record if the item has changed since its checksum was computed.
    pub(crate) fn damaged(&self, number: usize) -> Option<u8> {
        let is_whole = self.sums.get(number) == Some(&self.sum(number));
        (!is_whole).then(|| item(number).map_or(SETTINGS, |(part, ..)| part.number()))
    }

    /// Returns the kind of the first changed item's record.
    pub(crate) fn any_damaged(&self) -> Option<u8> {
        (0..ITEMS).find_map(|number| self.damaged(number))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    extern crate std;

    use std::{vec, vec::Vec};

    use palpate_wire::code::{Outcome, TipShape};
    use palpate_wire::command::{
        Attraction, Coil, ContactTolerance, Creep, Crosstalk, CurrentCorrection, DeformationCurve,
        DeformationKnot, Springs, Stiffening, StiffeningCurve, StiffeningKnot, Tank,
        TemperatureCoefficients, TemperatureEffect, Tip, TouchArray,
    };

    use super::*;
    use crate::board::{BoardInfo, tests::BOARD};
    use crate::configuration::DEFAULT_SETTINGS;

    const SPRINGS: Springs = Springs {
        sensing_n_per_m: 6e3,
        sensing_uncertainty: 0.0,
        actuated_n_per_m: 4e3,
        actuated_uncertainty: 0.0,
        force_scale_uncertainty: 0.0,
        zero_uncertainty_m: 0.0,
        bend: 0.0,
    };

    pub(crate) const COIL: Coil = Coil {
        resistance_ohm: 0.389,
        copper_capacity_j_per_k: 0.8,
        pad_capacity_j_per_k: 60.0,
        copper_to_pad_k_per_w: 0.5,
        pad_to_ambient_k_per_w: 8.0,
        current_uncertainty: 0.0,
    };

    fn tank(channel: u8) -> Command {
        Command::SetTank(Tank {
            sensor: 0,
            channel,
            capacitance_f: 1e-9,
            rest_frequency_hz: 3e6,
        })
    }

    fn curve(first: u8) -> Command {
        let knot = |index: u8| DeformationKnot {
            inductance_change: f32::from(index),
            deformation_m: 1e-3 * f32::from(index * index),
        };
        Command::SetDeformationCurve(DeformationCurve {
            sensor: 0,
            channel: 2,
            total: 4,
            first,
            knots: [knot(first + 1), knot(first + 2)].into_iter().collect(),
        })
    }

    fn stiffening_curve() -> Command {
        let knot = |index: u8| StiffeningKnot {
            current_a: f32::from(index),
            rise: 0.01 * f32::from(index * index),
        };
        Command::SetStiffeningCurve(StiffeningCurve {
            total: 3,
            first: 0,
            rise_uncertainty: 0.02,
            knots: (0..3).map(knot).collect(),
        })
    }

    /// An array of one coil.
    fn array() -> Vec<Command> {
        let mut numbers = [0.1; 52];
        numbers[..2].copy_from_slice(&[1.0, 1.0]);
        numbers[14] = 0.05;
        let chunks = [(0, 0..16), (16, 16..32), (32, 32..48), (48, 48..52)];
        let command = |(first, range): (u8, core::ops::Range<usize>)| {
            Command::SetTouchArray(TouchArray {
                total: 52,
                first,
                numbers: numbers[range].iter().copied().collect(),
            })
        };
        chunks.map(command).to_vec()
    }

    /// Inverts one bit of a part.
    type Upset = fn(&mut Configuration);

    fn invert(value: &mut f32) {
        *value = f32::from_bits(value.to_bits() ^ 1);
    }

    /// Commands for one item, the kind of its record, and bit errors in it.
    fn parts() -> [(Vec<Command>, u8, Vec<Upset>); 16] {
        [
            (
                vec![Command::SetSettings(DEFAULT_SETTINGS)],
                0x10,
                vec![
                    |of| invert(&mut of.settings.peak_current_a),
                    |of| of.settings.ramps ^= 1,
                    |of| of.settings.automatic ^= true,
                ],
            ),
            (
                vec![tank(3)],
                0x11,
                vec![
                    |of| invert(&mut of.channels[0][3].tank.as_mut().unwrap().capacitance_f),
                    |of| of.channels[0][3].tank = None,
                ],
            ),
            (
                vec![tank(2)],
                0x11,
                vec![|of| of.channels[0][2].tank = None],
            ),
            (
                vec![curve(0), curve(2)],
                0x12,
                vec![|of| of.channels[0][2].curve = None],
            ),
            (
                vec![Command::SetCrosstalk(Crosstalk {
                    sensor: 0,
                    channel: 1,
                    apparent_m_per_a2: 1e-9,
                    growth_per_m: 0.0,
                    uncertainty: 0.0,
                })],
                0x13,
                vec![|of| {
                    let crosstalk = &mut of.channels[0][1].crosstalk;
                    invert(&mut crosstalk.as_mut().unwrap().apparent_m_per_a2);
                }],
            ),
            (
                vec![Command::SetSprings(SPRINGS)],
                0x14,
                vec![|of| invert(&mut of.springs.as_mut().unwrap().sensing_n_per_m)],
            ),
            (
                vec![stiffening_curve()],
                0x16,
                vec![|of| {
                    if let Some(SetStiffening::Curve { uncertainty, .. }) = &mut of.stiffening {
                        invert(uncertainty);
                    }
                }],
            ),
            (
                vec![Command::SetCoil(COIL)],
                0x17,
                vec![|of| invert(&mut of.coil.as_mut().unwrap().resistance_ohm)],
            ),
            (
                vec![Command::SetAttraction(Attraction {
                    attraction_n_per_a2: 1e-3,
                    uncertainty: 0.0,
                })],
                0x18,
                vec![|of| invert(&mut of.attraction.as_mut().unwrap().attraction_n_per_a2)],
            ),
            (
                vec![Command::SetTemperatureEffect(TemperatureEffect {
                    calibrated_at_c: 25.0,
                    springs_uncertainty_per_k: 1e-3,
                    rise_uncertainty_per_k: 1e-3,
                })],
                0x19,
                vec![|of| invert(&mut of.temperature_effect.as_mut().unwrap().calibrated_at_c)],
            ),
            (
                vec![Command::SetCurrentCorrection(CurrentCorrection {
                    greatest_a: 12.0,
                    changes_a: [0.0, 0.1, 0.2].into_iter().collect(),
                })],
                0x1A,
                vec![|of| {
                    let correction = of.current_correction.as_mut().unwrap();
                    invert(&mut correction.changes_a[1]);
                }],
            ),
            (
                vec![Command::SetTemperatureCoefficients(
                    TemperatureCoefficients {
                        springs_per_k: -2e-3,
                        rise_per_k: 1e-3,
                    },
                )],
                0x1C,
                vec![|of| {
                    let coefficients = of.temperature_coefficients.as_mut().unwrap();
                    invert(&mut coefficients.rise_per_k);
                }],
            ),
            (
                vec![Command::SetTip(Tip {
                    shape: TipShape::FlatPin,
                    radius_m: 3e-3,
                    radius_uncertainty: 0.01,
                    thickness_m: 0.0,
                    thickness_uncertainty: 0.0,
                    poisson_ratio: 0.5,
                    poisson_uncertainty: 0.01,
                    support_m_per_n: 0.0,
                    support_uncertainty: 0.0,
                })],
                0x23,
                vec![|of| invert(&mut of.tip.as_mut().unwrap().radius_m)],
            ),
            (
                vec![Command::SetContact(ContactTolerance {
                    within_m: 1e-3,
                    tilt_rad: 2e-3,
                    rise_uncertainty: 0.004,
                    zero_uncertainty_m: 2e-6,
                })],
                0x28,
                vec![|of| invert(&mut of.contact.as_mut().unwrap().zero_uncertainty_m)],
            ),
            (
                vec![Command::SetCreep(Creep::TYPICAL)],
                0x2b,
                vec![|of| invert(&mut of.creep.as_mut().unwrap().uncertainty)],
            ),
            (
                array(),
                0x29,
                vec![
                    |of| invert(&mut of.array.as_mut().unwrap().indenter[3]),
                    |of| of.array = None,
                ],
            ),
        ]
    }

    fn set(configuration: &mut Configuration, board: &BoardInfo, commands: &[Command]) {
        for command in commands {
            let outcome = configuration.set(command, board);
            assert_eq!(outcome, Some(Outcome::Accepted.into()), "{command:?}");
        }
    }

    #[test]
    fn every_part_that_is_upset_is_found_and_setting_it_anew_repairs_it() {
        let board = BOARD;
        let mut sound = Configuration::new(&board);
        assert_eq!(sound.any_damaged(), None);
        for (commands, ..) in parts() {
            set(&mut sound, &board, &commands);
            assert_eq!(sound.any_damaged(), None, "{commands:?}");
        }
        for (number, (commands, kind, upsets)) in parts().into_iter().enumerate() {
            for upset in upsets {
                let mut configuration = sound.clone();
                upset(&mut configuration);
                assert_eq!(configuration.any_damaged(), Some(kind));
                // Setting any other part, or the same part of another channel, does not hide the
                // error.
                for (other, (others, ..)) in parts().into_iter().enumerate() {
                    if other != number {
                        set(&mut configuration, &board, &others);
                    }
                }
                assert_eq!(configuration.any_damaged(), Some(kind));
                set(&mut configuration, &board, &commands);
                assert_eq!(configuration.any_damaged(), None);
            }
        }
    }

    #[test]
    fn one_stiffening_takes_the_place_of_the_other() {
        let board = BOARD;
        let mut configuration = Configuration::new(&board);
        let law = Command::SetStiffening(Stiffening {
            peak_current_a: 10.0,
            rise_at_peak: 0.1,
            rise_uncertainty: 0.0,
            field_at_peak_t: 0.0,
            field_half_t: 1.0,
        });
        for command in [law.clone(), stiffening_curve(), law] {
            set(&mut configuration, &board, &[command]);
            assert_eq!(configuration.any_damaged(), None);
        }
    }

    #[test]
    fn a_chunk_of_a_curve_does_not_hide_that_the_old_one_is_upset() {
        let board = BOARD;
        let mut configuration = Configuration::new(&board);
        set(&mut configuration, &board, &[curve(0), curve(2)]);
        configuration.channels[0][2].curve = None;
        set(&mut configuration, &board, &[curve(0)]);
        assert_eq!(configuration.any_damaged(), Some(0x12));
        set(&mut configuration, &board, &[curve(2)]);
        assert_eq!(configuration.any_damaged(), None);
    }
}
