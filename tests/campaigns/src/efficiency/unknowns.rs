//! Initially unknown quantities of a sensor and its bench, each with the spread of its draw.

use palpate_sim::parameters::Parameters;
use palpate_sim::stack::quantity::Quantity;
use palpate_sim::stack::{Disturbances, Stack};

/// An unknown of the sensor, in units of the standard deviation of its draw.
pub(super) struct Unknown {
    pub(super) name: &'static str,
    /// Standard deviation: of the quantity, or of its logarithm.
    pub(super) deviation: f64,
    logarithmic: bool,
    quantity: fn(&mut Parameters) -> &mut f64,
}

impl Unknown {
    /// An unknown; `None` for a quantity that is the same in all sensors.
    fn new(
        name: &'static str,
        drawn: &Quantity,
        quantity: fn(&mut Parameters) -> &mut f64,
    ) -> Option<Self> {
        let (min, max) = drawn.range();
        let logarithmic = matches!(drawn, Quantity::LogUniform { .. });
        let width = if logarithmic {
            (max / min).ln()
        } else {
            max - min
        };
        // Standard deviation of a uniform distribution.
        let deviation = width / 12_f64.sqrt();
        (deviation > 0.0).then_some(Self {
            name,
            deviation,
            logarithmic,
            quantity,
        })
    }

    /// The sensor with this quantity shifted by `deviations` standard deviations.
    pub(super) fn moved(&self, sensor: &Parameters, deviations: f64) -> Parameters {
        let mut moved = sensor.clone();
        let by = deviations * self.deviation;
        let value = (self.quantity)(&mut moved);
        if self.logarithmic {
            *value *= by.exp();
        } else {
            *value += by;
        }
        // Both layers consist of one elastomer.
        moved.actuated.spring_per_kelvin = moved.sensing.spring_per_kelvin;
        moved
    }
}

/// Names of the unknowns through which a change of temperature acts.
pub(super) const SPRINGS_PER_KELVIN: &str = "springs, per kelvin";
pub(super) const STIFFENING_PER_KELVIN: &str = "stiffening, per kelvin";
/// Names of the unknowns that a change of temperature affects.
pub(super) const SENSING: &str = "c_S";
pub(super) const ACTUATED: &str = "c_D0";
pub(super) const STIFFENING: &str = "stiffening";

/// Remaining uncertainty of the frame after the bare bench, m/N: the stage's scale errs by up to a
/// micrometre, at 20 N (sim-host/stacks/disturbances.toml, host/calibration/src/bench.rs).
const FRAME_M_PER_N: f64 = 1e-6 / 20.0 / 1.414;

/// All unknowns of sensors of a stack, except those of single presses.
pub(super) fn unknowns(stack: &Stack, disturbances: &Disturbances) -> Vec<Unknown> {
    let d = disturbances;
    let law = &d.magnetorheological;
    let creep = &d.creep;
    let (fast, mid, slow) = (&creep.tau_fast_s, &creep.tau_mid_s, &creep.tau_slow_s);
    let amplitude = &d.creep.amplitude;
    let frame = Quantity::Uniform {
        min: -FRAME_M_PER_N * 3_f64.sqrt(),
        max: FRAME_M_PER_N * 3_f64.sqrt(),
    };
    let all = [
        Unknown::new(SENSING, &stack.sensing_spring_n_per_m, |p| {
            &mut p.sensing.spring_n_per_m
        }),
        Unknown::new(ACTUATED, &stack.actuated_spring_n_per_m, |p| {
            &mut p.actuated.spring_n_per_m
        }),
        Unknown::new(STIFFENING, &stack.stiffening_at_peak, |p| {
            &mut p.magnetorheological.stiffening_at_peak
        }),
        Unknown::new("field at the peak", &stack.field_at_peak_t, |p| {
            &mut p.magnetorheological.field_at_peak_t
        }),
        Unknown::new("field of saturation", &stack.field_half_t, |p| {
            &mut p.magnetorheological.field_half_t
        }),
        Unknown::new("attraction", &stack.attraction_n_per_a2, |p| {
            &mut p.attraction.n_per_a2
        }),
        Unknown::new(
            "attraction's gradient",
            &d.attraction_relative_gradient_per_m,
            |p| &mut p.attraction.gradient_per_m,
        ),
        Unknown::new("cross-talk", &stack.crosstalk_at_peak_m, |p| {
            &mut p.crosstalk.at_peak_m
        }),
        Unknown::new(
            "cross-talk's growth",
            &d.crosstalk_relative_slope_per_press_depth,
            |p| &mut p.crosstalk.slope_per_press_depth,
        ),
        Unknown::new("memory", &law.memory, |p| &mut p.magnetorheological.memory),
        Unknown::new("lag", &law.lag_s, |p| &mut p.magnetorheological.lag_s),
        Unknown::new(SPRINGS_PER_KELVIN, &law.spring_per_kelvin, |p| {
            &mut p.sensing.spring_per_kelvin
        }),
        Unknown::new(STIFFENING_PER_KELVIN, &law.stiffening_per_kelvin, |p| {
            &mut p.magnetorheological.stiffening_per_kelvin
        }),
        Unknown::new("growth", &d.thermal.growth_m_per_k, |p| {
            &mut p.thermal.growth_m_per_k
        }),
        Unknown::new(FRAME, &frame, |p| &mut p.press.frame_m_per_n),
        Unknown::new("fast creep of c_S", amplitude, |p| {
            &mut p.sensing.creep[0].amplitude
        }),
        Unknown::new("middle creep of c_S", amplitude, |p| {
            &mut p.sensing.creep[1].amplitude
        }),
        Unknown::new("slow creep of c_S", amplitude, |p| {
            &mut p.sensing.creep[2].amplitude
        }),
        Unknown::new("fast creep of c_D", amplitude, |p| {
            &mut p.actuated.creep[0].amplitude
        }),
        Unknown::new("middle creep of c_D", amplitude, |p| {
            &mut p.actuated.creep[1].amplitude
        }),
        Unknown::new("slow creep of c_D", amplitude, |p| {
            &mut p.actuated.creep[2].amplitude
        }),
        Unknown::new("time of fast creep of c_S", fast, |p| {
            &mut p.sensing.creep[0].tau_s
        }),
        Unknown::new("time of middle creep of c_S", mid, |p| {
            &mut p.sensing.creep[1].tau_s
        }),
        Unknown::new("time of slow creep of c_S", slow, |p| {
            &mut p.sensing.creep[2].tau_s
        }),
        Unknown::new("time of fast creep of c_D", fast, |p| {
            &mut p.actuated.creep[0].tau_s
        }),
        Unknown::new("time of middle creep of c_D", mid, |p| {
            &mut p.actuated.creep[1].tau_s
        }),
        Unknown::new("time of slow creep of c_D", slow, |p| {
            &mut p.actuated.creep[2].tau_s
        }),
    ];
    all.into_iter().flatten().collect()
}

/// Name of the frame's unknown, which belongs to the bench alone.
pub(super) const FRAME: &str = "frame of the bench";
