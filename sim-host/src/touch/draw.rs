//! Drawn sensors: what differs between sensors of one design.

use core::f64::consts::TAU;

use super::layer::Layer;
use super::layout::{Coil, Layout};
use crate::mechanics::layer::{CreepMode, MODES};
use crate::random::Stream;
use crate::stack::Disturbances;
use crate::stack::document::FileError;
use crate::stack::quantity::Quantity;

/// Place of a coil, m, along x and y: layers of a board lie within 0.1 mm of each other (IPC-2221, class
/// 2), and a stage finds the board to 0.1 mm (guess).
pub const PLACE_M: Quantity = Quantity::Uniform {
    min: -0.15e-3,
    max: 0.15e-3,
};

/// Gap of a coil relative to the design's: lacquer and spacer within a twentieth (guess).
pub const GAP: Quantity = Quantity::Spread {
    nominal: 1.0,
    spread: 0.05,
};

/// Effect of the elastomer of all coils, and of each beside it, relative to the design's: the content
/// of iron differs from batch to batch and over a slab (guess).
pub const GAIN_OF_ALL: Quantity = Quantity::Spread {
    nominal: 1.0,
    spread: 0.1,
};
/// See [`GAIN_OF_ALL`].
pub const GAIN: Quantity = Quantity::Spread {
    nominal: 1.0,
    spread: 0.02,
};

/// Capacitance of a tank relative to the design's: C0G capacitors of 1 %.
pub const CAPACITANCE: Quantity = Quantity::Spread {
    nominal: 1.0,
    spread: 0.01,
};

/// Shear modulus and thickness of the layer relative to the design's: the spread of the stacks'
/// springs (stacks/ultrasoft.toml), and the depth of a mould (guess).
pub const SHEAR_MODULUS: Quantity = Quantity::Spread {
    nominal: 1.0,
    spread: 0.2,
};
/// See [`SHEAR_MODULUS`].
pub const THICKNESS: Quantity = Quantity::Spread {
    nominal: 1.0,
    spread: 0.03,
};

/// Poisson's ratio below the design's: silicone has a bulk modulus of about 1 GPa, but bubbles make it
/// more compressible (guess).
pub const POISSON_BELOW: Quantity = Quantity::Uniform {
    min: 0.0,
    max: 0.004,
};

/// Parameters of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchParameters {
    /// Seed of its noise.
    pub seed: u64,
    /// The layer.
    pub layer: Layer,
    /// Height of the elastomer's boundary above the layer's base, m (see [`Layout::boundary_m`]).
    pub boundary_m: f64,
    /// The coils.
    pub coils: Vec<TouchCoil>,
    /// Temperature coefficient of the capacitances, 1/K.
    pub capacitance_per_kelvin: f64,
    /// d ln G / dT of the layer's shear modulus, 1/K.
    pub modulus_per_kelvin: f64,
    /// Growth of the gap with the temperature, m/K.
    pub growth_m_per_k: f64,
    /// Creep of the layer, from fast to slow.
    pub creep: [CreepMode; MODES],
    /// Vibration of the stand along the press: amplitude, m, and frequency, Hz, and phase, rad.
    pub vibration: [f64; 3],
    /// White noise of a frequency in a conversion of 1 ms, relative.
    pub white_noise_relative: f64,
    /// Relative error of the reference clock.
    pub reference_clock_error: f64,
}

/// A sensing coil with its tank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchCoil {
    /// True place and gap.
    pub coil: Coil,
    /// Effect of the elastomer relative to the computed one.
    pub gain: f64,
    /// Capacitance, F.
    pub capacitance_f: f64,
}

/// Capacitance of the tanks of the first and of the second converter, F: coils that are converted at the
/// same time do not lock to each other, and their currents are small.
const CAPACITANCES_F: [f64; 2] = [330e-12, 680e-12];

fn capacitance_f(index: usize) -> f64 {
    let [first, second] = CAPACITANCES_F;
    if index < 4 { first } else { second }
}

impl TouchParameters {
    /// The design without tolerance, noise, creep and vibration.
    #[must_use]
    pub fn ideal(layout: &Layout, layer: &Layer) -> Self {
        let coil = |(index, &coil): (usize, &Coil)| TouchCoil {
            coil,
            gain: 1.0,
            capacitance_f: capacitance_f(index),
        };
        Self {
            seed: 0,
            layer: *layer,
            boundary_m: layout.boundary_m,
            coils: layout.coils.iter().enumerate().map(coil).collect(),
            capacitance_per_kelvin: 0.0,
            modulus_per_kelvin: 0.0,
            growth_m_per_k: 0.0,
            creep: [CreepMode {
                amplitude: 0.0,
                tau_s: 1.0,
            }; MODES],
            vibration: [0.0; 3],
            white_noise_relative: 0.0,
            reference_clock_error: 0.0,
        }
    }

    /// Draws a sensor of a design; each quantity has its own stream. Ranges that the stacks have too
    /// are those of the built-in disturbances.
    ///
    /// # Errors
    /// If the built-in disturbances cannot be read.
    pub fn draw(layout: &Layout, layer: &Layer, seed: u64) -> Result<Self, FileError> {
        let d = Disturbances::builtin()?;
        let pick = |quantity: &Quantity, name: &str| {
            quantity.draw(&mut Stream::named(seed, &format!("touch.{name}")))
        };
        let thicker = pick(&THICKNESS, "thickness");
        let gain = pick(&GAIN_OF_ALL, "gain");
        let coil = |(index, coil): (usize, &Coil)| {
            let own = |quantity, name: &str| pick(quantity, &format!("{name}.{index}"));
            let [x_m, y_m] = coil.centre_m;
            let mut design = coil.design;
            design.gap_at_rest_m *= own(&GAP, "gap");
            design.slab_m *= thicker;
            TouchCoil {
                coil: Coil {
                    centre_m: [x_m + own(&PLACE_M, "x"), y_m + own(&PLACE_M, "y")],
                    design,
                },
                gain: gain * own(&GAIN, "gain"),
                capacitance_f: capacitance_f(index) * own(&CAPACITANCE, "capacitance"),
            }
        };
        let mode = |tau, name: &str| CreepMode {
            amplitude: pick(&d.creep.amplitude, &format!("creep.{name}")),
            tau_s: pick(tau, &format!("creep.{name}.tau")),
        };
        Ok(Self {
            seed,
            layer: Layer {
                thickness_m: layer.thickness_m * thicker,
                shear_modulus_pa: layer.shear_modulus_pa * pick(&SHEAR_MODULUS, "modulus"),
                poisson: (layer.poisson - pick(&POISSON_BELOW, "poisson")).max(0.0),
            },
            boundary_m: layout.boundary_m * thicker,
            coils: layout.coils.iter().enumerate().map(coil).collect(),
            capacitance_per_kelvin: pick(&d.tank.capacitance_tempco_per_k, "tempco"),
            modulus_per_kelvin: pick(&d.magnetorheological.spring_per_kelvin, "modulus.kelvin"),
            growth_m_per_k: pick(&d.thermal.growth_m_per_k, "growth"),
            creep: [
                mode(&d.creep.tau_fast_s, "fast"),
                mode(&d.creep.tau_mid_s, "mid"),
                mode(&d.creep.tau_slow_s, "slow"),
            ],
            vibration: [
                pick(&d.press.vibration_amplitude_m, "vibration"),
                pick(&d.press.vibration_hz, "vibration.hz"),
                pick(&Quantity::Uniform { min: 0.0, max: TAU }, "vibration.phase"),
            ],
            white_noise_relative: pick(&d.ldc.white_noise_relative, "noise"),
            reference_clock_error: pick(&d.ldc.reference_clock_error, "clock"),
        })
    }
}
