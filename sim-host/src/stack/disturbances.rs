//! The file of disturbances, which act on every stack at once.

use std::path::Path;

use super::document::{FileError, TableSection};
use super::quantity::{Allowed, Quantity};
use super::{LoadError, read};
use crate::sensing_coil::{CoilDesign, Sides};

/// Ranges of all disturbances, by section of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Disturbances {
    /// Relative growth of the crosstalk over one press depth, ±0.9.
    pub crosstalk_relative_slope_per_press_depth: Quantity,
    /// Relative growth of the attraction per compression of the actuated layer, 1/m, 0 to 10⁴.
    pub attraction_relative_gradient_per_m: Quantity,
    /// Creep of the sensor's springs.
    pub creep: CreepRanges,
    /// The magnetorheological effect.
    pub magnetorheological: MagnetorheologicalRanges,
    /// Heat.
    pub thermal: ThermalRanges,
    /// The tank.
    pub tank: TankRanges,
    /// The converter.
    pub ldc: LdcRanges,
    /// Drive and measurement of the coil's current.
    pub current_chain: CurrentChainRanges,
    /// The press.
    pub press: PressRanges,
    /// The bench on which an instrument is calibrated.
    pub calibration_rig: RigRanges,
    /// Loads to be measured, as ratios of their spring to the sensing layer's, 10⁻³ to 10³.
    pub load_ratios_to_sensing_spring: Vec<f64>,
}

/// `[creep]`: each spring of the sensor has three modes.
#[derive(Clone, Debug, PartialEq)]
pub struct CreepRanges {
    /// Long-term displacement of a mode, as a share of the spring's instant displacement, 0 to 1.
    pub amplitude: Quantity,
    /// Time constants of the fast, the middle and the slow mode, s, 1 ms to 10⁶.
    pub tau_s: [Quantity; 3],
}

/// `[magnetorheological]`.
#[derive(Clone, Debug, PartialEq)]
pub struct MagnetorheologicalRanges {
    /// Share of the stiffening that goes through a play operator, 0 to 0.9.
    pub memory: Quantity,
    /// Time constant of the stiffening, s, 0 to 1.
    pub lag_s: Quantity,
    /// Relative change of the stiffening with temperature, 1/K, ±0.05.
    pub stiffening_per_kelvin: Quantity,
    /// Relative change of the springs with temperature, 1/K, ±0.05.
    pub spring_per_kelvin: Quantity,
}

/// `[thermal]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ThermalRanges {
    /// Ambient temperature less that at calibration, K, ±50.
    pub temperature_change_since_calibration_k: Quantity,
    /// Growth of the sensor per kelvin, m/K, 0 to 10⁻⁴.
    pub growth_m_per_k: Quantity,
    /// Heat capacity of the copper, J/K, 10⁻³ to 10⁵.
    pub copper_heat_capacity_j_per_k: Quantity,
    /// Heat capacity of the pad, J/K, 10⁻³ to 10⁵.
    pub pad_heat_capacity_j_per_k: Quantity,
    /// Thermal resistance from copper to pad, K/W, 10⁻³ to 10⁴.
    pub copper_to_pad_k_per_w: Quantity,
    /// Thermal resistance from pad to ambient, K/W, 10⁻³ to 10⁴.
    pub pad_to_ambient_k_per_w: Quantity,
}

/// `[tank]`.
#[derive(Clone, Debug, PartialEq)]
pub struct TankRanges {
    /// The sensing coil.
    pub coil: CoilDesign,
    /// Capacitance, F, 1 pF to 1 µF.
    pub capacitance_f: Quantity,
    /// Temperature coefficient of the capacitance, 1/K, ±10⁻³.
    pub capacitance_tempco_per_k: Quantity,
}

/// `[ldc]`.
#[derive(Clone, Debug, PartialEq)]
pub struct LdcRanges {
    /// Relative error of the reference clock, ±0.01.
    pub reference_clock_error: Quantity,
    /// White noise of the frequency in a conversion of 1 ms, relative, 0 to 10⁻³.
    pub white_noise_relative: Quantity,
}

/// `[current_chain]`.
#[derive(Clone, Debug, PartialEq)]
pub struct CurrentChainRanges {
    /// Relative error of the measured current, ±0.5.
    pub gain_error: Quantity,
    /// Integral non-linearity of the ADC, LSB, 0 to 200.
    pub inl_lsb: Quantity,
    /// Noise of the ADC, LSB rms, 0 to 200.
    pub noise_lsb_rms: Quantity,
    /// Supply of the coil, V, 0.5 to 100.
    pub supply_v: Quantity,
    /// Resistance of the supply, ohm, 0 to 10.
    pub supply_resistance_ohm: Quantity,
}

/// `[press]`.
#[derive(Clone, Debug, PartialEq)]
pub struct PressRanges {
    /// Amplitude of a stand's vibration, m, 0 to 10⁻³.
    pub vibration_amplitude_m: Quantity,
    /// Frequency of the vibration, Hz, 0.1 to 200.
    pub vibration_hz: Quantity,
    /// Amplitude of a hand's tremor, m, 0 to 10⁻³.
    pub hand_tremor_amplitude_m: Quantity,
    /// Frequency of the tremor, Hz, 0.1 to 100.
    pub hand_tremor_hz: Quantity,
}

/// `[calibration_rig]`.
#[derive(Clone, Debug, PartialEq)]
pub struct RigRanges {
    /// Spring constant of the rig's frame, N/m, 10³ to 10⁹.
    pub frame_spring_n_per_m: Quantity,
    /// Noise of the load cell, N rms, 0 to 1.
    pub load_cell_noise_n: Quantity,
    /// Relative error of the load cell, ±0.1.
    pub load_cell_gain_error: Quantity,
    /// Error of the stage's scale, m, 0 to 10⁻³.
    pub stage_error_m: Quantity,
    /// Relative tolerance of the rig's springs, 0 to 0.5.
    pub spring_tolerance: Quantity,
}

/// Form of `[tank] coil`.
const COIL_FORM: &str = "\"do 14 mm, di 4 mm, 25 turns, MSE on both sides, slabs 2 mm, \
                         gap 1 mm at rest\", with other numbers, or MSE on one side";

/// Sections of the file.
const SECTIONS: [&str; 11] = [
    "crosstalk",
    "attraction",
    "creep",
    "magnetorheological",
    "thermal",
    "tank",
    "ldc",
    "current_chain",
    "press",
    "calibration_rig",
    "load",
];

/// Only key of `[load]`.
const RATIOS: &str = "ratio_to_sensing_spring";

impl Disturbances {
    /// The disturbances file in this crate.
    ///
    /// # Errors
    /// Never, except for a broken file in the crate, which a test excludes.
    pub fn builtin() -> Result<Self, FileError> {
        Self::parse(
            "disturbances.toml",
            include_str!("../../stacks/disturbances.toml"),
        )
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`LoadError`] if it cannot be read or is refused.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let text = read(path)?;
        Ok(Self::parse(&path.display().to_string(), &text)?)
    }

    /// Parses a text; `file` appears only in messages.
    ///
    /// # Errors
    /// [`FileError`] names line, key and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let mut s = TableSection::parse(file, text, &SECTIONS)?;
        Ok(Self {
            crosstalk_relative_slope_per_press_depth: alone(
                &mut s,
                "crosstalk",
                "relative_slope_per_press_depth",
                &Allowed::new(-0.9, 0.9, ""),
            )?,
            attraction_relative_gradient_per_m: alone(
                &mut s,
                "attraction",
                "relative_gradient_per_m",
                &Allowed::new(0.0, 1e4, "1/m"),
            )?,
            creep: section(&mut s, "creep", &CREEP_KEYS, creep)?,
            magnetorheological: section(
                &mut s,
                "magnetorheological",
                &MAGNETORHEOLOGICAL_KEYS,
                magnetorheological,
            )?,
            thermal: section(&mut s, "thermal", &THERMAL_KEYS, thermal)?,
            tank: section(&mut s, "tank", &TANK_KEYS, tank)?,
            ldc: section(&mut s, "ldc", &LDC_KEYS, ldc)?,
            current_chain: section(&mut s, "current_chain", &CURRENT_CHAIN_KEYS, current_chain)?,
            press: section(&mut s, "press", &PRESS_KEYS, press)?,
            calibration_rig: section(
                &mut s,
                "calibration_rig",
                &CALIBRATION_RIG_KEYS,
                calibration_rig,
            )?,
            load_ratios_to_sensing_spring: section(&mut s, "load", &[RATIOS], |load| {
                load.numbers(RATIOS, &Allowed::new(1e-3, 1e3, ""))
            })?,
        })
    }
}

fn section<'t, T>(
    parent: &mut TableSection<'t>,
    name: &str,
    keys: &[&str],
    read: impl FnOnce(&mut TableSection<'t>) -> Result<T, FileError>,
) -> Result<T, FileError> {
    read(&mut parent.section(name, keys)?)
}

/// Reads the only quantity of a section.
fn alone(
    parent: &mut TableSection<'_>,
    name: &str,
    key: &str,
    allowed: &Allowed,
) -> Result<Quantity, FileError> {
    section(parent, name, &[key], |s| s.quantity(key, allowed))
}

const CREEP_KEYS: [&str; 4] = ["amplitude", "tau_fast_s", "tau_mid_s", "tau_slow_s"];

fn creep(s: &mut TableSection<'_>) -> Result<CreepRanges, FileError> {
    let tau = Allowed::new(1e-3, 1e6, "s");
    Ok(CreepRanges {
        amplitude: s.quantity("amplitude", &Allowed::new(0.0, 1.0, ""))?,
        tau_s: [
            s.quantity("tau_fast_s", &tau)?,
            s.quantity("tau_mid_s", &tau)?,
            s.quantity("tau_slow_s", &tau)?,
        ],
    })
}

const MAGNETORHEOLOGICAL_KEYS: [&str; 4] = [
    "memory",
    "lag_s",
    "dlnstiffening_dT_per_K",
    "dlnspring_dT_per_K",
];

fn magnetorheological(s: &mut TableSection<'_>) -> Result<MagnetorheologicalRanges, FileError> {
    let per_kelvin = Allowed::new(-0.05, 0.05, "1/K");
    Ok(MagnetorheologicalRanges {
        memory: s.quantity("memory", &Allowed::new(0.0, 0.9, ""))?,
        lag_s: s.quantity("lag_s", &Allowed::new(0.0, 1.0, "s"))?,
        stiffening_per_kelvin: s.quantity("dlnstiffening_dT_per_K", &per_kelvin)?,
        spring_per_kelvin: s.quantity("dlnspring_dT_per_K", &per_kelvin)?,
    })
}

const THERMAL_KEYS: [&str; 6] = [
    "temperature_change_since_calibration_K",
    "growth_m_per_K",
    "copper_heat_capacity_J_per_K",
    "pad_heat_capacity_J_per_K",
    "copper_to_pad_K_per_W",
    "pad_to_ambient_K_per_W",
];

fn thermal(s: &mut TableSection<'_>) -> Result<ThermalRanges, FileError> {
    let capacity = Allowed::new(1e-3, 1e5, "J/K");
    let resistance = Allowed::new(1e-3, 1e4, "K/W");
    Ok(ThermalRanges {
        temperature_change_since_calibration_k: s.quantity(
            "temperature_change_since_calibration_K",
            &Allowed::new(-50.0, 50.0, "K"),
        )?,
        growth_m_per_k: s.quantity("growth_m_per_K", &Allowed::new(0.0, 1e-4, "m/K"))?,
        copper_heat_capacity_j_per_k: s.quantity("copper_heat_capacity_J_per_K", &capacity)?,
        pad_heat_capacity_j_per_k: s.quantity("pad_heat_capacity_J_per_K", &capacity)?,
        copper_to_pad_k_per_w: s.quantity("copper_to_pad_K_per_W", &resistance)?,
        pad_to_ambient_k_per_w: s.quantity("pad_to_ambient_K_per_W", &resistance)?,
    })
}

const TANK_KEYS: [&str; 3] = ["coil", "capacitance_F", "capacitance_tempco_per_K"];

fn tank(s: &mut TableSection<'_>) -> Result<TankRanges, FileError> {
    Ok(TankRanges {
        coil: s.parsed("coil", COIL_FORM, coil)?,
        capacitance_f: s.quantity("capacitance_F", &Allowed::new(1e-12, 1e-6, "F"))?,
        capacitance_tempco_per_k: s.quantity(
            "capacitance_tempco_per_K",
            &Allowed::new(-1e-3, 1e-3, "1/K"),
        )?,
    })
}

const LDC_KEYS: [&str; 2] = ["reference_clock_error", "white_noise_relative"];

fn ldc(s: &mut TableSection<'_>) -> Result<LdcRanges, FileError> {
    Ok(LdcRanges {
        reference_clock_error: s
            .quantity("reference_clock_error", &Allowed::new(-0.01, 0.01, ""))?,
        white_noise_relative: s.quantity("white_noise_relative", &Allowed::new(0.0, 1e-3, ""))?,
    })
}

const CURRENT_CHAIN_KEYS: [&str; 5] = [
    "gain_error",
    "inl_lsb",
    "noise_lsb_rms",
    "supply_V",
    "supply_resistance_ohm",
];

fn current_chain(s: &mut TableSection<'_>) -> Result<CurrentChainRanges, FileError> {
    Ok(CurrentChainRanges {
        gain_error: s.quantity("gain_error", &Allowed::new(-0.5, 0.5, ""))?,
        inl_lsb: s.quantity("inl_lsb", &Allowed::new(0.0, 200.0, "LSB"))?,
        noise_lsb_rms: s.quantity("noise_lsb_rms", &Allowed::new(0.0, 200.0, "LSB"))?,
        supply_v: s.quantity("supply_V", &Allowed::new(0.5, 100.0, "V"))?,
        supply_resistance_ohm: s
            .quantity("supply_resistance_ohm", &Allowed::new(0.0, 10.0, "ohm"))?,
    })
}

const PRESS_KEYS: [&str; 4] = [
    "vibration_amplitude_m",
    "vibration_hz",
    "hand_tremor_amplitude_m",
    "hand_tremor_hz",
];

fn press(s: &mut TableSection<'_>) -> Result<PressRanges, FileError> {
    let amplitude = Allowed::new(0.0, 1e-3, "m");
    Ok(PressRanges {
        vibration_amplitude_m: s.quantity("vibration_amplitude_m", &amplitude)?,
        vibration_hz: s.quantity("vibration_hz", &Allowed::new(0.1, 200.0, "Hz"))?,
        hand_tremor_amplitude_m: s.quantity("hand_tremor_amplitude_m", &amplitude)?,
        hand_tremor_hz: s.quantity("hand_tremor_hz", &Allowed::new(0.1, 100.0, "Hz"))?,
    })
}

const CALIBRATION_RIG_KEYS: [&str; 5] = [
    "frame_spring_N_per_m",
    "load_cell_noise_N",
    "load_cell_gain_error",
    "stage_error_m",
    "spring_tolerance",
];

fn calibration_rig(s: &mut TableSection<'_>) -> Result<RigRanges, FileError> {
    Ok(RigRanges {
        frame_spring_n_per_m: s.quantity("frame_spring_N_per_m", &Allowed::new(1e3, 1e9, "N/m"))?,
        load_cell_noise_n: s.quantity("load_cell_noise_N", &Allowed::new(0.0, 1.0, "N"))?,
        load_cell_gain_error: s.quantity("load_cell_gain_error", &Allowed::new(-0.1, 0.1, ""))?,
        stage_error_m: s.quantity("stage_error_m", &Allowed::new(0.0, 1e-3, "m"))?,
        spring_tolerance: s.quantity("spring_tolerance", &Allowed::new(0.0, 0.5, ""))?,
    })
}

/// Reads a coil written as in [`COIL_FORM`].
fn coil(text: &str) -> Result<CoilDesign, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let &[outer, inner, turns, sides, slabs, gap] = parts.as_slice() else {
        return Err(format!("{text:?} has {} parts, not 6", parts.len()));
    };
    let design = CoilDesign {
        outer_diameter_m: metres(outer, "do ", " mm")?,
        inner_diameter_m: metres(inner, "di ", " mm")?,
        turns: amid(turns, "", " turns")?,
        sides: match sides {
            "MSE on one side" => Sides::One,
            "MSE on both sides" => Sides::Both,
            _ => return Err(format!("{sides:?} is no choice of sides")),
        },
        slab_m: metres(slabs, "slabs ", " mm")?,
        gap_at_rest_m: metres(gap, "gap ", " mm at rest")?,
        ..CoilDesign::REFERENCE
    };
    design.check().map_err(|error| error.to_string())?;
    Ok(design)
}

/// Millimetres between two words, converted to metres.
fn metres(text: &str, before: &str, after: &str) -> Result<f64, String> {
    // A quotient, not a product with 1e-3: the quotient is the nearest number to the written one.
    amid::<f64>(text, before, after).map(|millimetres| millimetres / 1e3)
}

/// A number between two words.
fn amid<T: core::str::FromStr>(text: &str, before: &str, after: &str) -> Result<T, String> {
    text.strip_prefix(before)
        .and_then(|rest| rest.strip_suffix(after))
        .and_then(|number| number.parse().ok())
        .ok_or_else(|| format!("{text:?} is not \"{before}...{after}\""))
}
