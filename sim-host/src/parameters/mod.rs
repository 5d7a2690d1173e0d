//! The parameters of one plant.

mod check;
mod draw;

pub use check::ParameterError;
pub(crate) use check::within;
pub use draw::{
    CURVATURE_PER_M, EDGE_S, FRAME_SPRING_N_PER_M, INTERFERENCE_V_PER_V, central, draw,
};

use crate::current::CurrentParameters;
use crate::magnetorheological::MagnetorheologicalParameters;
use crate::mechanics::contact::ContactParameters;
use crate::mechanics::friction::FrictionParameters;
use crate::mechanics::layer::LayerParameters;
use crate::mechanics::press::{Jumps, Shake};
use crate::sensing_coil::interference::InterferenceParameters;
use crate::sensing_coil::tank::TankParameters;
use crate::switches::Switches;
use crate::thermal::ThermalParameters;

/// Distance over which the error of the stage's scale repeats, m: a lead screw's pitch (guess).
pub const STAGE_PITCH_M: f64 = 0.5e-3;

/// All parameters in which plants differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Name of the stack.
    pub stack: String,
    /// Seed of the draw and of the noise.
    pub seed: u64,
    /// Sensing layer.
    pub sensing: LayerParameters,
    /// Actuated layer.
    pub actuated: LayerParameters,
    /// Friction beside the sensing layer; the draw has none.
    pub friction: FrictionParameters,
    /// Effect of the load's face on the coils' fields; the draw has none.
    pub object: ObjectParameters,
    /// What place and tilt of a contact change.
    pub contact: ContactParameters,
    /// Stiffening of the actuated layer.
    pub magnetorheological: MagnetorheologicalParameters,
    /// Attraction of the actuated layer's halves.
    pub attraction: AttractionParameters,
    /// Crosstalk of the actuating field on the sensing coil.
    pub crosstalk: CrosstalkParameters,
    /// Heat.
    pub thermal: ThermalParameters,
    /// The sensing coil and its capacitor.
    pub tank: TankParameters,
    /// Coupling from the bridge's switching to the sensing coil.
    pub interference: InterferenceParameters,
    /// The converter.
    pub ldc: LdcParameters,
    /// Current of the actuating coils.
    pub current: CurrentParameters,
    /// Press: depth, frame and vibration.
    pub press: PressParameters,
    /// The bench on which the instrument is calibrated.
    pub rig: RigParameters,
}

/// Attraction between the halves of the actuated layer: k I² (1 + γ x_D).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttractionParameters {
    /// k, attraction per squared current at an uncompressed layer, N/A², 0 to 0.1.
    pub n_per_a2: f64,
    /// γ, relative growth of the attraction per compression of the layer, 1/m, 0 to 10⁴.
    pub gradient_per_m: f64,
}

/// A load with a permeable face. It lies on the upper slab of MSE and reflects the sensing coil's
/// field there (see [`crate::sensing_coil::integral::CoilIntegral::facing`]). The actuating field
/// lowers the face's permeability, which reduces the reflection by the relative amount
/// s (I/I_peak)². While load and sensor touch, the actuating coils pull the load towards them by
/// k I²; the sensor's layers between coils and load carry this pull.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ObjectParameters {
    /// Reflection (μ − 1)/(μ + 1) of the face without current: 1 for an ideal ferrite, −1 for an
    /// ideal conductor, 0 without an effect.
    pub reflection: f64,
    /// s, relative loss of the reflection at the peak current, 0 to 0.5.
    pub lost_at_peak: f64,
    /// k, pull of the actuating coils on the load per squared current, N/A², 0 to 0.1.
    pub n_per_a2: f64,
}

/// Apparent displacement of the sensing layer by the actuating field: the field lowers the
/// permeability, so the layer seems to be pressed less by X (I/I_peak)² (1 + g x_S/press depth).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrosstalkParameters {
    /// X, apparent displacement at the peak current without a press, m, 0 to 10⁻⁴.
    pub at_peak_m: f64,
    /// g, relative growth of the apparent displacement over one press depth, ±0.9.
    pub slope_per_press_depth: f64,
}

/// The converter and its clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LdcParameters {
    /// Relative error of the reference clock, ±0.01.
    pub reference_clock_error: f64,
    /// White noise of the frequency in a conversion of 1 ms, relative, 0 to 10⁻³.
    pub white_noise_relative: f64,
    /// Whether the converter counts whole edges only.
    pub quantised: bool,
    /// Whether the converter's drive current shifts the frequency.
    pub drive_shift: bool,
}

/// Press: depth, frame and vibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressParameters {
    /// Intended displacement of the sensing layer, m, 1 µm to 0.8 mm.
    pub depth_m: f64,
    /// Compliance of the frame under the load, m/N, 0 to 10⁻³.
    pub frame_m_per_n: f64,
    /// Vibration of a stand.
    pub vibration: Shake,
    /// Tremor of a hand.
    pub tremor: Shake,
    /// Jumps of the sensor or of its support; the draw has none.
    pub jumps: Jumps,
}

/// The bench on which the instrument is calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigParameters {
    /// Compliance of the rig's frame, m/N, 0 to 10⁻³.
    pub frame_m_per_n: f64,
    /// Noise of a reading of the load cell, N rms, 0 to 1.
    pub load_cell_noise_n: f64,
    /// Relative error of the load cell, ±0.1.
    pub load_cell_gain_error: f64,
    /// Greatest error of the stage's scale, m, 0 to 10⁻³; it repeats every [`STAGE_PITCH_M`].
    pub stage_error_m: f64,
    /// Phase of that error at zero, rad.
    pub stage_phase: f64,
    /// Relative tolerance of the rig's springs, 0 to 0.5. The error of each spring is a random
    /// fraction of the tolerance.
    pub spring_tolerance: f64,
    /// Angle between specimen and sensor in every press of the bench, rad, 0 to 0.1; zero in a
    /// drawn plant.
    pub tilt_rad: f64,
}

impl Parameters {
    /// The plant with every disabled disturbance at its neutral value. No formula has to check a
    /// switch, and a disabled disturbance has no effect at all.
    #[must_use]
    pub fn effective(&self, on: &Switches) -> Self {
        let mut p = self.clone();
        neutral(on.crosstalk, [&mut p.crosstalk.at_peak_m]);
        neutral(on.attraction, [&mut p.attraction.n_per_a2]);
        neutral(on.heating, [&mut p.thermal.heating]);
        neutral(on.ambient_change, [&mut p.thermal.ambient_change_k]);
        neutral(on.growth, [&mut p.thermal.growth_m_per_k]);
        neutral(
            on.copper_temperature,
            [&mut p.thermal.resistance_per_kelvin],
        );
        let springs = [
            &mut p.sensing.spring_per_kelvin,
            &mut p.actuated.spring_per_kelvin,
        ];
        neutral(on.spring_temperature, springs);
        let law = &mut p.magnetorheological;
        neutral(on.stiffening_temperature, [&mut law.stiffening_per_kelvin]);
        neutral(on.memory, [&mut law.memory]);
        neutral(on.lag, [&mut law.lag_s]);
        for mode in p.sensing.creep.iter_mut().chain(&mut p.actuated.creep) {
            neutral(on.creep, [&mut mode.amplitude]);
        }
        neutral(on.frame, [&mut p.press.frame_m_per_n]);
        neutral(on.vibration, [&mut p.press.vibration.amplitude_m]);
        neutral(on.tremor, [&mut p.press.tremor.amplitude_m]);
        p.neutralise_electronics(on);
        p.neutralise_rig(on);
        p
    }

    fn neutralise_electronics(&mut self, on: &Switches) {
        neutral(
            on.capacitance_temperature,
            [&mut self.tank.capacitance_per_kelvin],
        );
        neutral(on.coil_bending, [&mut self.tank.curvature_per_m]);
        self.tank.copper &= on.copper_image;
        let current = &mut self.current;
        if !on.supply {
            current.supply_v = f64::INFINITY;
        }
        neutral(on.ripple, [&mut current.ripple]);
        neutral(on.pwm_coupling, [&mut self.interference.volt_per_volt]);
        neutral(on.current_gain, [&mut current.gain_error]);
        neutral(on.adc_nonlinearity, [&mut current.nonlinearity_lsb]);
        neutral(on.adc_noise, [&mut current.noise_lsb]);
        neutral(on.reference_clock, [&mut self.ldc.reference_clock_error]);
        neutral(on.ldc_noise, [&mut self.ldc.white_noise_relative]);
        self.ldc.quantised &= on.ldc_quantisation;
        self.ldc.drive_shift &= on.ldc_drive_shift;
    }

    fn neutralise_rig(&mut self, on: &Switches) {
        let rig = &mut self.rig;
        neutral(on.rig_frame, [&mut rig.frame_m_per_n]);
        neutral(on.load_cell_noise, [&mut rig.load_cell_noise_n]);
        neutral(on.load_cell_gain, [&mut rig.load_cell_gain_error]);
        neutral(on.stage_error, [&mut rig.stage_error_m]);
        neutral(on.spring_tolerance, [&mut rig.spring_tolerance]);
    }
}

/// Sets the amplitudes of a disabled disturbance to zero.
fn neutral<const N: usize>(on: bool, amplitudes: [&mut f64; N]) {
    if !on {
        amplitudes
            .into_iter()
            .for_each(|amplitude| *amplitude = 0.0);
    }
}
