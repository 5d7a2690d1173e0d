//! Random draw of a plant from the ranges of its kind.

use core::f64::consts::TAU;

use super::{
    AttractionParameters, CrosstalkParameters, LdcParameters, ObjectParameters, Parameters,
    PressParameters, RigParameters,
};
use crate::current::CurrentParameters;
use crate::magnetorheological::MagnetorheologicalParameters;
use crate::mechanics::contact::ContactParameters;
use crate::mechanics::friction::FrictionParameters;
use crate::mechanics::layer::{CreepMode, LayerParameters, MODES};
use crate::mechanics::press::{Jumps, Shake};
use crate::random::Stream;
use crate::sensing_coil::interference::InterferenceParameters;
use crate::sensing_coil::tank::TankParameters;
use crate::stack::quantity::Quantity;
use crate::stack::{Disturbances, Stack};
use crate::thermal::{COPPER_PER_KELVIN, ThermalParameters};

/// Range of the spring constant of the frame under the load, N/m (SOURCES.md 3.7: 20 to 200 N/mm).
/// The stack files give only that of the calibration rig's frame.
pub const FRAME_SPRING_N_PER_M: Quantity = Quantity::LogUniform {
    min: 20e3,
    max: 200e3,
};

/// Range of the sensing coil's curvature at full press depth, 1/m: a radius of 50 mm or more, the
/// milder of the two radii in SOURCES.md 3.10 (guess).
pub const CURVATURE_PER_M: Quantity = Quantity::Uniform {
    min: 0.0,
    max: 20.0,
};

/// Range of the voltage induced in the sensing coil near its resonance, per volt across the drive
/// coils. It is the ratio of mutual to own inductance: 5·10⁻⁵ to 9·10⁻⁵ for the paper's coils
/// through a plane of 70 µm of copper (computed, [`crate::sensing_coil::mutual`]). The range
/// extends to twice and to a third of that, because the computation leaves out elastomer, the
/// plane's edge and the capacitance between turns.
pub const INTERFERENCE_V_PER_V: Quantity = Quantity::LogUniform {
    min: 2e-5,
    max: 2e-4,
};

/// Range of the duration of a bridge edge, s: 12 V at 60 to 24 V/µs. Integrated bridges have a
/// selectable slew rate, 1.5 to 50 V/µs (data sheet of the DRV8245-Q1).
pub const EDGE_S: Quantity = Quantity::Uniform {
    min: 0.2e-6,
    max: 0.5e-6,
};

/// Draws one plant: the same seed gives the same plant, and each quantity has its own stream.
///
/// ```
/// use palpate_sim::{parameters::draw, stack::{Disturbances, Stack}};
///
/// let (stack, disturbances) = (Stack::builtin("ultrasoft")?, Disturbances::builtin()?);
/// let plant = draw(&stack, &disturbances, 7);
/// assert!((4.8e3..7.2e3).contains(&plant.sensing.spring_n_per_m));
/// assert_eq!(plant, draw(&stack, &disturbances, 7));
/// assert_ne!(plant, draw(&stack, &disturbances, 8));
/// # Ok::<(), palpate_sim::stack::document::FileError>(())
/// ```
#[must_use]
pub fn draw(stack: &Stack, disturbances: &Disturbances, seed: u64) -> Parameters {
    let mut pick = |quantity: &Quantity, name: &str| quantity.draw(&mut Stream::named(seed, name));
    let parameters = assemble(stack, disturbances, &mut pick);
    Parameters { seed, ..parameters }
}

/// The plant at the centre of all ranges, with seed 0 for its noise.
#[must_use]
pub fn central(stack: &Stack, disturbances: &Disturbances) -> Parameters {
    assemble(stack, disturbances, &mut |quantity, _| quantity.centre())
}

type Pick<'a> = &'a mut dyn FnMut(&Quantity, &str) -> f64;

const PHASE: Quantity = Quantity::Uniform { min: 0.0, max: TAU };

fn assemble(stack: &Stack, d: &Disturbances, pick: Pick<'_>) -> Parameters {
    let spring_per_kelvin = pick(&d.magnetorheological.spring_per_kelvin, "spring_per_kelvin");
    let depth_m = pick(&stack.press_depth_of_sensing_layer_m, "press_depth");
    let peak_a = pick(&stack.peak_current_a, "peak_current");
    Parameters {
        stack: stack.name.clone(),
        seed: 0,
        sensing: LayerParameters {
            spring_n_per_m: pick(&stack.sensing_spring_n_per_m, "sensing_spring"),
            spring_per_kelvin,
            creep: creep(d, "sensing", pick),
        },
        actuated: LayerParameters {
            spring_n_per_m: pick(&stack.actuated_spring_n_per_m, "actuated_spring"),
            spring_per_kelvin,
            creep: creep(d, "actuated", pick),
        },
        friction: FrictionParameters::default(),
        object: ObjectParameters::default(),
        contact: ContactParameters {
            lost_per_m2: pick(&d.contact.stiffening_lost_per_m2, "contact_lost"),
            radius_m: pick(&d.contact.radius_m, "contact_radius"),
            tilted_share: pick(&d.contact.tilted_share, "contact_tilted"),
        },
        magnetorheological: magnetorheological(stack, d, pick),
        attraction: AttractionParameters {
            n_per_a2: pick(&stack.attraction_n_per_a2, "attraction"),
            gradient_per_m: pick(&d.attraction_relative_gradient_per_m, "attraction_gradient"),
        },
        crosstalk: CrosstalkParameters {
            at_peak_m: pick(&stack.crosstalk_at_peak_m, "crosstalk"),
            slope_per_press_depth: pick(
                &d.crosstalk_relative_slope_per_press_depth,
                "crosstalk_slope",
            ),
        },
        thermal: thermal(stack, d, pick),
        tank: TankParameters {
            coil: d.tank.coil,
            capacitance_f: pick(&d.tank.capacitance_f, "capacitance"),
            capacitance_per_kelvin: pick(&d.tank.capacitance_tempco_per_k, "capacitance_tempco"),
            curvature_per_m: pick(&CURVATURE_PER_M, "coil_curvature") / depth_m,
            copper: true,
        },
        interference: InterferenceParameters {
            volt_per_volt: pick(&INTERFERENCE_V_PER_V, "pwm_coupling"),
            edge_s: pick(&EDGE_S, "bridge_edge"),
        },
        ldc: LdcParameters {
            reference_clock_error: pick(&d.ldc.reference_clock_error, "reference_clock"),
            white_noise_relative: pick(&d.ldc.white_noise_relative, "ldc_noise"),
            quantised: true,
            drive_shift: true,
        },
        current: current(stack, d, peak_a, pick),
        press: press(d, depth_m, pick),
        rig: rig(d, pick),
    }
}

/// Creep modes of a layer; every mode draws its own amplitude and time constant.
fn creep(d: &Disturbances, layer: &str, pick: Pick<'_>) -> [CreepMode; MODES] {
    let creep = &d.creep;
    let (fast, mid, slow) = (&creep.tau_fast_s, &creep.tau_mid_s, &creep.tau_slow_s);
    [(fast, "fast"), (mid, "mid"), (slow, "slow")].map(|(tau_s, mode)| CreepMode {
        amplitude: pick(
            &d.creep.amplitude,
            &format!("creep.{layer}.{mode}.amplitude"),
        ),
        tau_s: pick(tau_s, &format!("creep.{layer}.{mode}.tau")),
    })
}

fn magnetorheological(
    stack: &Stack,
    d: &Disturbances,
    pick: Pick<'_>,
) -> MagnetorheologicalParameters {
    let ranges = &d.magnetorheological;
    MagnetorheologicalParameters {
        stiffening_at_peak: pick(&stack.stiffening_at_peak, "stiffening"),
        field_at_peak_t: pick(&stack.field_at_peak_t, "field_at_peak"),
        field_half_t: pick(&stack.field_half_t, "field_half"),
        memory: pick(&ranges.memory, "memory"),
        lag_s: pick(&ranges.lag_s, "lag"),
        stiffening_per_kelvin: pick(&ranges.stiffening_per_kelvin, "stiffening_per_kelvin"),
    }
}

fn thermal(stack: &Stack, d: &Disturbances, pick: Pick<'_>) -> ThermalParameters {
    let ranges = &d.thermal;
    ThermalParameters {
        ambient_change_k: pick(
            &ranges.temperature_change_since_calibration_k,
            "ambient_change",
        ),
        growth_m_per_k: pick(&ranges.growth_m_per_k, "growth"),
        copper_j_per_k: pick(&ranges.copper_heat_capacity_j_per_k, "copper_heat_capacity"),
        pad_j_per_k: pick(&ranges.pad_heat_capacity_j_per_k, "pad_heat_capacity"),
        copper_to_pad_k_per_w: pick(&ranges.copper_to_pad_k_per_w, "copper_to_pad"),
        pad_to_ambient_k_per_w: pick(&ranges.pad_to_ambient_k_per_w, "pad_to_ambient"),
        resistance_ohm: pick(&stack.coil_resistance_ohm, "coil_resistance"),
        resistance_per_kelvin: COPPER_PER_KELVIN,
        heating: 1.0,
    }
}

fn current(stack: &Stack, d: &Disturbances, peak_a: f64, pick: Pick<'_>) -> CurrentParameters {
    let ranges = &d.current_chain;
    CurrentParameters {
        peak_a,
        inductance_h: pick(&stack.coil_inductance_h, "coil_inductance"),
        supply_v: pick(&ranges.supply_v, "supply"),
        supply_ohm: pick(&ranges.supply_resistance_ohm, "supply_resistance"),
        gain_error: pick(&ranges.gain_error, "current_gain"),
        nonlinearity_lsb: pick(&ranges.inl_lsb, "adc_nonlinearity"),
        nonlinearity_phase: pick(&PHASE, "adc_nonlinearity_phase"),
        noise_lsb: pick(&ranges.noise_lsb_rms, "adc_noise"),
        ripple: 1.0,
    }
}

fn press(d: &Disturbances, depth_m: f64, pick: Pick<'_>) -> PressParameters {
    PressParameters {
        depth_m,
        frame_m_per_n: 1.0 / pick(&FRAME_SPRING_N_PER_M, "frame_spring"),
        vibration: Shake {
            amplitude_m: pick(&d.press.vibration_amplitude_m, "vibration_amplitude"),
            hertz: pick(&d.press.vibration_hz, "vibration_hz"),
            phase: pick(&PHASE, "vibration_phase"),
        },
        tremor: Shake {
            amplitude_m: pick(&d.press.hand_tremor_amplitude_m, "tremor_amplitude"),
            hertz: pick(&d.press.hand_tremor_hz, "tremor_hz"),
            phase: pick(&PHASE, "tremor_phase"),
        },
        jumps: Jumps::default(),
    }
}

fn rig(d: &Disturbances, pick: Pick<'_>) -> RigParameters {
    let ranges = &d.calibration_rig;
    RigParameters {
        frame_m_per_n: 1.0 / pick(&ranges.frame_spring_n_per_m, "rig_frame_spring"),
        load_cell_noise_n: pick(&ranges.load_cell_noise_n, "load_cell_noise"),
        load_cell_gain_error: pick(&ranges.load_cell_gain_error, "load_cell_gain"),
        stage_error_m: pick(&ranges.stage_error_m, "stage_error"),
        stage_phase: pick(&PHASE, "stage_phase"),
        spring_tolerance: pick(&ranges.spring_tolerance, "spring_tolerance"),
        tilt_rad: 0.0,
    }
}
