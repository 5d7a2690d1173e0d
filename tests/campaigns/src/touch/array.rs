//! A calibration as the instrument takes it.

use palpate_calibration::touch::ArrayCalibration;
use palpate_model::touch as model;
use palpate_model::units::{Metre, Newton};

/// The array as the instrument takes it.
pub(super) fn array(
    calibration: &ArrayCalibration,
    noise: f64,
    reach_m: f64,
) -> Option<model::Array> {
    let table = |of: &[f64]| of.iter().map(|of| *of as f32).collect::<Vec<_>>();
    let [linear, quadratic] = calibration.by_radius();
    let scales = calibration.scales();
    let [least_m, greatest_m] = scales.radii_m;
    let bent: Vec<_> = table(calibration.bent()).as_chunks().0.to_vec();
    let profile = model::Profile::new(model::Coefficients {
        spacing: Metre(scales.spacing_m as f32),
        least_radius: Metre(least_m as f32),
        greatest_radius: Metre(greatest_m as f32),
        base: table(calibration.base()).try_into().ok()?,
        linear: table(linear).try_into().ok()?,
        quadratic: table(quadratic).try_into().ok()?,
        bent: bent.try_into().ok()?,
        greatest_force: Newton(calibration.greatest_force_n() as f32),
    });
    let coils: Vec<_> = calibration
        .coils()
        .iter()
        .map(|coil| model::Coil {
            x: Metre(coil.place_m[0] as f32),
            y: Metre(coil.place_m[1] as f32),
            gain: coil.gain as f32,
            noise: noise as f32,
        })
        .collect();
    let (reading, common) = (calibration.reading_error, calibration.common_error);
    let errors = (
        model::ReadingError {
            relative: reading.relative as f32,
            of_largest: reading.of_largest as f32,
        },
        model::CommonError {
            place: Metre(common.place_m as f32),
            ln_force: common.ln_force as f32,
            ln_radius: common.ln_radius as f32,
        },
    );
    let region = model::Region::Disc {
        centre: [Metre(0.0); 2],
        radius: Metre(reach_m as f32),
    };
    model::Array::new(&coils, profile.ok()?, errors, region).ok()
}
