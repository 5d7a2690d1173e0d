//! The tank: the coil with its capacitor, as the converter measures it.

use core::f64::consts::TAU;
use std::sync::Arc;

use super::CoilDesign;
use super::curve::CoilCurve;

/// Quality factor of the reference coil in air with 330 pF (published; SOURCES.md section 5).
pub const QUALITY_IN_AIR: f64 = 37.0;

/// Relative loss of inductance of a bent coil, times the squared radius of bending, m² (SOURCES.md
/// section 3: inductance ratios of 0.9974 at 50 mm, 0.984 at 20 mm).
pub const BENDING_M2: f64 = 6.5e-6;

/// Distance of the actuated layer's copper from the coil's turns, m (SOURCES.md section 3).
pub const COPPER_M: f64 = 5e-3;

/// Parameters of the tank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TankParameters {
    /// The coil.
    pub coil: CoilDesign,
    /// Capacitance at the temperature of calibration, F, 1 pF to 1 µF.
    pub capacitance_f: f64,
    /// Temperature coefficient of the capacitance, 1/K, ±10⁻³ at most.
    pub capacitance_per_kelvin: f64,
    /// Curvature of the coil per metre of displacement of the layer, 1/m². The coil bends with the
    /// layer. The stack files do not give the curvature; the draw has a radius of 50 mm or more at
    /// full press depth (guess).
    pub curvature_per_m: f64,
    /// Whether the actuated layer's copper lies under the coil, at [`COPPER_M`].
    pub copper: bool,
}

/// State of the layer that determines the frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TankState {
    /// Displacement of the sensing layer plus the apparent displacement by the field, m.
    pub apparent_m: f64,
    /// True displacement of the sensing layer, m.
    pub displacement_m: f64,
    /// Temperature above that of calibration, K.
    pub warmer_k: f64,
    /// Distance of the load's face from the upper slab, m.
    pub opening_m: f64,
    /// Remaining share of the reflection of the load's face: 1 without actuating field.
    pub object: f64,
}

/// Resonance of the tank, with its slope in each quantity of [`TankState`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Resonance {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Slope in the apparent displacement, Hz/m.
    pub per_apparent: f64,
    /// Slope in the true displacement, by bending, Hz/m.
    pub per_displacement: f64,
    /// Slope in the temperature, Hz/K.
    pub per_kelvin: f64,
    /// Slope in the distance of the load's face, Hz/m.
    pub per_opening: f64,
    /// Slope in the remaining share of the face's reflection, Hz.
    pub per_object: f64,
}

/// The tank with its coil's curve.
#[derive(Clone, Debug)]
pub struct SensingTank {
    curve: Arc<CoilCurve>,
    /// Curve of the coil before a load whose face reflects its field.
    facing: Option<Arc<CoilCurve>>,
    parameters: TankParameters,
    /// Relative loss of inductance by bending, per squared displacement of the layer, 1/m².
    bending_per_m2: f64,
    series_resistance_ohm: f64,
}

impl SensingTank {
    /// A tank; builds the coil's curve if it is not known yet.
    #[must_use]
    pub fn new(parameters: &TankParameters) -> Self {
        let copper_m = parameters.copper.then_some(COPPER_M);
        let curve = CoilCurve::shared(&parameters.coil, copper_m);
        let impedance_ohm = libm::sqrt(curve.in_air_h() / parameters.capacitance_f);
        Self {
            curve,
            facing: None,
            parameters: *parameters,
            bending_per_m2: BENDING_M2 * parameters.curvature_per_m * parameters.curvature_per_m,
            series_resistance_ohm: impedance_ohm / QUALITY_IN_AIR,
        }
    }

    /// Adds a load whose face reflects the coil's field (see
    /// [`super::integral::CoilIntegral::facing`]); zero means no such load.
    #[must_use]
    pub fn facing(self, reflection: f64) -> Self {
        let copper_m = self.parameters.copper.then_some(COPPER_M);
        let coil = &self.parameters.coil;
        let facing =
            (reflection != 0.0).then(|| CoilCurve::shared_facing(coil, copper_m, reflection));
        Self { facing, ..self }
    }

    /// Resonance in a state of the layer: f = 1/(2π √(LC)).
    ///
    /// Each slab comes closer by the layer's displacement: gap = gap at rest − apparent
    /// displacement. The sensitivities of SOURCES.md section 5 count the same way.
    #[must_use]
    pub fn resonance(&self, state: &TankState) -> Resonance {
        let gap_m = self.parameters.coil.gap_at_rest_m - state.apparent_m;
        let (bare_h, bare_slope) = self.curve.at(gap_m);
        let (object_h, object_slope) = self.object(gap_m + state.opening_m);
        let flat_h = bare_h + state.object * object_h;
        let slope = bare_slope + state.object * object_slope;
        let x_m = state.displacement_m;
        let straight = 1.0 - self.bending_per_m2 * x_m * x_m;
        let growth = 1.0 + self.parameters.capacitance_per_kelvin * state.warmer_k;
        let lc = flat_h * straight * self.parameters.capacitance_f * growth;
        let frequency_hz = 1.0 / (TAU * libm::sqrt(lc));
        // df = -f/2 d ln(LC)
        let half = -0.5 * frequency_hz;
        Resonance {
            frequency_hz,
            per_apparent: half * -slope / flat_h,
            per_displacement: half * -2.0 * self.bending_per_m2 * x_m / straight,
            per_kelvin: half * self.parameters.capacitance_per_kelvin / growth,
            per_opening: half * state.object * object_slope / flat_h,
            per_object: half * object_h / flat_h,
        }
    }

    /// Contribution of the load's face to the inductance, H, and its slope in the distance, H/m.
    /// The distance is the gap plus the air before the face, as if the slab moved with the face:
    /// exact in contact, and within 7, 21 and 29 % of the contribution at 0.2, 1 and 3 mm.
    fn object(&self, distance_m: f64) -> (f64, f64) {
        let Some(facing) = &self.facing else {
            return (0.0, 0.0);
        };
        let (with, without) = (facing.at(distance_m), self.curve.at(distance_m));
        (with.0 - without.0, with.1 - without.1)
    }

    /// Inductance for a displacement of the layer without field, H.
    #[must_use]
    pub fn inductance_h(&self, displacement_m: f64) -> f64 {
        let gap_m = self.parameters.coil.gap_at_rest_m - displacement_m;
        let straight = 1.0 - self.bending_per_m2 * displacement_m * displacement_m;
        self.curve.at(gap_m).0 * straight
    }

    /// Quality factor at a frequency. The series resistance is the one that gives
    /// [`QUALITY_IN_AIR`], at any gap: losses in the MSE are not modelled.
    #[must_use]
    pub fn quality_factor(&self, frequency_hz: f64) -> f64 {
        let reactance_ohm = 1.0 / (TAU * frequency_hz * self.parameters.capacitance_f);
        reactance_ohm / self.series_resistance_ohm
    }

    /// Parallel loss resistance at a frequency, ohm.
    #[must_use]
    pub fn parallel_resistance_ohm(&self, frequency_hz: f64) -> f64 {
        let quality = self.quality_factor(frequency_hz);
        quality * quality * self.series_resistance_ohm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tank(curvature_per_m: f64, copper: bool) -> SensingTank {
        SensingTank::new(&TankParameters {
            coil: CoilDesign::REFERENCE,
            capacitance_f: 330e-12,
            capacitance_per_kelvin: 30e-6,
            curvature_per_m,
            copper,
        })
    }

    #[test]
    fn the_sensitivity_is_that_of_the_table() {
        let tank = tank(0.0, false);
        let at_rest = tank.resonance(&TankState::default());
        let per_um = -1e-6 * at_rest.per_apparent / at_rest.frequency_hz;
        assert!((per_um - 158e-6).abs() < 0.5e-6, "{per_um}");
    }

    #[test]
    fn a_bent_coil_loses_what_the_source_says() {
        for (radius_m, kept) in [(50e-3, 0.9974), (20e-3, 0.984)] {
            let x = 0.3e-3;
            let ratio =
                tank(1.0 / radius_m / x, false).inductance_h(x) / tank(0.0, false).inductance_h(x);
            assert!((ratio - kept).abs() < 5e-4, "{radius_m}: {ratio}");
        }
    }

    #[test]
    fn slopes_are_those_of_the_values() {
        let tank = tank(5e4, true);
        let here = TankState {
            apparent_m: 0.2e-3,
            displacement_m: 0.21e-3,
            warmer_k: 3.0,
            ..TankState::default()
        };
        let at = |apparent_m: f64, displacement_m: f64, warmer_k: f64| {
            tank.resonance(&TankState {
                apparent_m: here.apparent_m + apparent_m,
                displacement_m: here.displacement_m + displacement_m,
                warmer_k: here.warmer_k + warmer_k,
                ..here
            })
            .frequency_hz
        };
        let slopes = tank.resonance(&here);
        let h = 1e-7;
        let apparent = (at(h, 0.0, 0.0) - at(-h, 0.0, 0.0)) / (2.0 * h);
        assert!((apparent / slopes.per_apparent - 1.0).abs() < 1e-6);
        let displacement = (at(0.0, h, 0.0) - at(0.0, -h, 0.0)) / (2.0 * h);
        assert!((displacement / slopes.per_displacement - 1.0).abs() < 1e-5);
        let kelvin = (at(0.0, 0.0, 0.1) - at(0.0, 0.0, -0.1)) / 0.2;
        assert!((kelvin / slopes.per_kelvin - 1.0).abs() < 1e-6);
    }

    #[test]
    fn losses_are_those_of_the_coil_in_air() {
        let tank = tank(0.0, false);
        let hertz = 3.743e6;
        assert!((tank.quality_factor(hertz) - 37.0).abs() < 0.05);
        assert!((tank.parallel_resistance_ohm(hertz) - 4.77e3).abs() < 20.0);
    }
}
