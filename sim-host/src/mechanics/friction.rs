//! Dry friction beside the sensing layer.
//!
//! A spring in series with a slider (Iwan 1966, "A distributed-element model for hysteresis"), in
//! parallel with the layer. The slider sticks until its force reaches `stick_n`, then slips within
//! a step until its force is `slip_n`: the difference of static and sliding friction (Coulomb)
//! makes stick-slip.

use super::layer::Response;

/// Friction beside the layer; a spring of zero means no friction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionParameters {
    /// Spring between layer and slider, N/m, 0 to 10⁶.
    pub spring_n_per_m: f64,
    /// Force at which the slider breaks loose, N, 0 to 10.
    pub stick_n: f64,
    /// Force at which the slider stops again, N, 0 to `stick_n`.
    pub slip_n: f64,
}

/// The friction element at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionState {
    /// Force that the element takes from the layer, N.
    pub force_n: f64,
    /// Position of the slider, as a displacement of the layer, m.
    pub slider_m: f64,
    /// Whether the slider moved in the step that ended here.
    pub slipped: bool,
}

impl FrictionParameters {
    /// Ratio of the layer's compliance beside a sticking slider to that without friction.
    pub(crate) fn part_left(&self, layer_m_per_n: f64) -> f64 {
        1.0 / (1.0 + layer_m_per_n * self.spring_n_per_m)
    }

    /// Response of the layer with a sticking slider: x = b + C (F - k (x - s)), solved for x, with
    /// offset b, compliance C, friction's spring k and position s of the slider.
    pub(crate) fn stuck(&self, layer: &Response, from: &FrictionState) -> Response {
        let part = self.part_left(layer.compliance_m_per_n);
        let drawn_m = layer.compliance_m_per_n * self.spring_n_per_m * from.slider_m;
        Response {
            offset_m: (layer.offset_m + drawn_m) * part,
            compliance_m_per_n: layer.compliance_m_per_n * part,
        }
    }

    /// State of the sticking slider at a displacement of the layer.
    pub(crate) fn stays(&self, from: &FrictionState, sensing_m: f64) -> FrictionState {
        FrictionState {
            force_n: self.spring_n_per_m * (sensing_m - from.slider_m),
            slider_m: from.slider_m,
            slipped: false,
        }
    }

    /// Force of the slider after a slip, N, if `force_n` causes one.
    pub(crate) fn slips(&self, force_n: f64) -> Option<f64> {
        (force_n.abs() > self.stick_n).then(|| self.slip_n.copysign(force_n))
    }

    /// Response of the layer beside a slipping slider of friction J: x = b + C (F - J).
    pub(crate) fn moving(layer: &Response, force_n: f64) -> Response {
        Response {
            offset_m: layer.offset_m - layer.compliance_m_per_n * force_n,
            ..*layer
        }
    }

    /// State of the slider after a slip, at a displacement of the layer.
    pub(crate) fn moved(&self, force_n: f64, sensing_m: f64) -> FrictionState {
        FrictionState {
            force_n,
            slider_m: sensing_m - force_n / self.spring_n_per_m,
            slipped: true,
        }
    }

    /// Energy stored in the spring, J.
    pub(crate) fn stored_j(&self, state: &FrictionState) -> f64 {
        if self.spring_n_per_m > 0.0 {
            0.5 * state.force_n * state.force_n / self.spring_n_per_m
        } else {
            0.0
        }
    }
}
