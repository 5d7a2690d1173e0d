//! The file of disturbances, which act on every stack at once.

use super::document::{FileError, TableSection};
use super::key::table;
use super::quantity::{Allowed, Quantity};
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
    /// The contact, always as in contact.toml of this crate.
    pub contact: ContactRanges,
    /// The bench on which an instrument is calibrated.
    pub calibration_rig: RigRanges,
    /// Loads to be measured, as ratios of their spring to the sensing layer's, 10⁻³ to 10³.
    pub load_ratios_to_sensing_spring: Vec<f64>,
}

table! {
    /// `[creep]`: each spring of the sensor has three modes.
    CreepRanges {
        amplitude = "amplitude", 0.0 to 1.0 "",
            "Long-term displacement of a mode, as a share of the spring's instant displacement";
        tau_fast_s = "tau_fast_s", 1e-3 to 1e6 "s", "Time constant of the fast mode";
        tau_mid_s = "tau_mid_s", 1e-3 to 1e6 "s", "Time constant of the middle mode";
        tau_slow_s = "tau_slow_s", 1e-3 to 1e6 "s", "Time constant of the slow mode";
    }
}

table! {
    /// `[magnetorheological]`.
    MagnetorheologicalRanges {
        memory = "memory", 0.0 to 0.9 "", "Share of the stiffening that goes through a play operator";
        lag_s = "lag_s", 0.0 to 1.0 "s", "Time constant of the stiffening";
        stiffening_per_kelvin = "dlnstiffening_dT_per_K", -0.05 to 0.05 "1/K",
            "Relative change of the stiffening with temperature";
        spring_per_kelvin = "dlnspring_dT_per_K", -0.05 to 0.05 "1/K",
            "Relative change of the springs with temperature";
    }
}

table! {
    /// `[thermal]`.
    ThermalRanges {
        temperature_change_since_calibration_k = "temperature_change_since_calibration_K",
            -50.0 to 50.0 "K", "Ambient temperature less that at calibration";
        growth_m_per_k = "growth_m_per_K", 0.0 to 1e-4 "m/K", "Growth of the sensor per kelvin";
        copper_heat_capacity_j_per_k = "copper_heat_capacity_J_per_K", 1e-3 to 1e5 "J/K",
            "Heat capacity of the copper";
        pad_heat_capacity_j_per_k = "pad_heat_capacity_J_per_K", 1e-3 to 1e5 "J/K",
            "Heat capacity of the pad";
        copper_to_pad_k_per_w = "copper_to_pad_K_per_W", 1e-3 to 1e4 "K/W",
            "Thermal resistance from copper to pad";
        pad_to_ambient_k_per_w = "pad_to_ambient_K_per_W", 1e-3 to 1e4 "K/W",
            "Thermal resistance from pad to ambient";
    }
}

table! {
    /// `[tank]`.
    TankRanges {
        /// The sensing coil.
        coil: CoilDesign = "coil", coil;
        capacitance_f = "capacitance_F", 1e-12 to 1e-6 "F", "Capacitance";
        capacitance_tempco_per_k = "capacitance_tempco_per_K", -1e-3 to 1e-3 "1/K",
            "Temperature coefficient of the capacitance";
    }
}

table! {
    /// `[ldc]`.
    LdcRanges {
        reference_clock_error = "reference_clock_error", -0.01 to 0.01 "",
            "Relative error of the reference clock";
        white_noise_relative = "white_noise_relative", 0.0 to 1e-3 "",
            "White noise of the frequency in a conversion of 1 ms, relative";
    }
}

table! {
    /// `[current_chain]`.
    CurrentChainRanges {
        gain_error = "gain_error", -0.5 to 0.5 "", "Relative error of the measured current";
        inl_lsb = "inl_lsb", 0.0 to 200.0 "LSB", "Integral non-linearity of the ADC";
        noise_lsb_rms = "noise_lsb_rms", 0.0 to 200.0 "LSB", "Noise of the ADC, rms";
        supply_v = "supply_V", 0.5 to 100.0 "V", "Supply of the coil";
        supply_resistance_ohm = "supply_resistance_ohm", 0.0 to 10.0 "ohm", "Resistance of the supply";
    }
}

table! {
    /// `[press]`.
    PressRanges {
        vibration_amplitude_m = "vibration_amplitude_m", 0.0 to 1e-3 "m",
            "Amplitude of a stand's vibration";
        vibration_hz = "vibration_hz", 0.1 to 200.0 "Hz", "Frequency of the vibration";
        hand_tremor_amplitude_m = "hand_tremor_amplitude_m", 0.0 to 1e-3 "m",
            "Amplitude of a hand's tremor";
        hand_tremor_hz = "hand_tremor_hz", 0.1 to 100.0 "Hz", "Frequency of the tremor";
    }
}

table! {
    /// `[contact]` of contact.toml.
    ContactRanges {
        stiffening_lost_per_m2 = "stiffening_lost_per_m2", -1e5 to 1e5 "1/m2",
            "Relative loss of the stiffening per square of the distance from the axis";
        radius_m = "radius_m", 1e-4 to 20e-3 "m", "Radius of the contact";
        tilted_share = "tilted_share", 0.1 to 1.0 "",
            "Share of its stiffness that the sensing layer has while a tilted face touches in part";
    }
}

table! {
    /// `[calibration_rig]`.
    RigRanges {
        frame_spring_n_per_m = "frame_spring_N_per_m", 1e3 to 1e9 "N/m",
            "Spring constant of the rig's frame";
        load_cell_noise_n = "load_cell_noise_N", 0.0 to 1.0 "N", "Noise of the load cell, rms";
        load_cell_gain_error = "load_cell_gain_error", -0.1 to 0.1 "", "Relative error of the load cell";
        stage_error_m = "stage_error_m", 0.0 to 1e-3 "m", "Error of the stage's scale";
        spring_tolerance = "spring_tolerance", 0.0 to 0.5 "", "Relative tolerance of the rig's springs";
    }
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

    /// Parses a text; `file` appears only in messages.
    ///
    /// # Errors
    /// [`FileError`] names line, key and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let file = TableSection::parse(file, text, &SECTIONS)?;
        let contact = include_str!("../../stacks/contact.toml");
        let contact = TableSection::parse("contact.toml", contact, &["contact"])?;
        let alone = |section, key, allowed| file.section(section, &[key])?.quantity(key, &allowed);
        Ok(Self {
            crosstalk_relative_slope_per_press_depth: alone(
                "crosstalk",
                "relative_slope_per_press_depth",
                Allowed::new(-0.9, 0.9, ""),
            )?,
            attraction_relative_gradient_per_m: alone(
                "attraction",
                "relative_gradient_per_m",
                Allowed::new(0.0, 1e4, "1/m"),
            )?,
            creep: file.table("creep")?,
            magnetorheological: file.table("magnetorheological")?,
            thermal: file.table("thermal")?,
            tank: file.table("tank")?,
            ldc: file.table("ldc")?,
            current_chain: file.table("current_chain")?,
            press: file.table("press")?,
            contact: contact.table("contact")?,
            calibration_rig: file.table("calibration_rig")?,
            load_ratios_to_sensing_spring: file
                .section("load", &["ratio_to_sensing_spring"])?
                .numbers("ratio_to_sensing_spring", &Allowed::new(1e-3, 1e3, ""))?,
        })
    }
}

fn coil(tank: &TableSection<'_>, key: &str) -> Result<CoilDesign, FileError> {
    tank.parsed(key, COIL_FORM, coil_of)
}

/// Reads a coil written as in [`COIL_FORM`].
fn coil_of(text: &str) -> Result<CoilDesign, String> {
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
