//! Presses that are compared.

use palpate_sim::touch::{
    Demand, Indenter, Layer, Layout, Press, Surroundings, TouchParameters, TouchSensor, TouchTruth,
};
use serde_json::{Value, json};

/// Shear modulus of all layers, Pa.
const SHEAR_MODULUS_PA: f64 = 20e3;

/// Thickness of a layer that stands for a half-space, m: its base adds 0.1 % to the force of a pin of 4 mm.
const ENDLESS_M: f64 = 5.0;

/// A press on a layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) indenter: Indenter,
    /// Thickness of the layer, m; none for a half-space.
    pub(super) thickness_m: Option<f64>,
    pub(super) poisson: f64,
    /// Depth, m.
    pub(super) depth_m: f64,
}

const fn ball(radius_m: f64, depth_m: f64) -> Case {
    Case {
        indenter: Indenter::Ball { radius_m },
        thickness_m: Some(5e-3),
        poisson: 0.499,
        depth_m,
    }
}

const fn pressed(indenter: Indenter, depth_m: f64) -> Case {
    Case {
        indenter,
        ..ball(1e-3, depth_m)
    }
}

const fn pin(radius_m: f64, depth_m: f64) -> Case {
    pressed(Indenter::Pin { radius_m }, depth_m)
}

const fn tilted(radius_m: f64, tilt_rad: f64, toward_rad: f64) -> Case {
    let indenter = Indenter::Tilted {
        radius_m,
        tilt_rad,
        toward_rad,
    };
    pressed(indenter, 0.2e-3)
}

const fn bar(toward_rad: f64) -> Case {
    let indenter = Indenter::Bar {
        length_m: 8e-3,
        width_m: 4e-3,
        toward_rad,
    };
    pressed(indenter, 0.2e-3)
}

const fn on(thickness_m: Option<f64>, poisson: f64, case: Case) -> Case {
    Case {
        thickness_m,
        poisson,
        ..case
    }
}

/// The compared presses.
pub(super) const CASES: [Case; 17] = [
    on(None, 0.499, ball(3e-3, 0.3e-3)),
    on(None, 0.3, ball(10e-3, 0.2e-3)),
    ball(3e-3, 0.3e-3),
    ball(10e-3, 0.5e-3),
    on(Some(5e-3), 0.45, ball(10e-3, 0.5e-3)),
    on(Some(2e-3), 0.499, ball(10e-3, 0.2e-3)),
    on(Some(1e-3), 0.499, ball(20e-3, 0.07e-3)),
    on(None, 0.499, pin(2e-3, 0.2e-3)),
    pin(1.5e-3, 0.2e-3),
    pin(4e-3, 0.2e-3),
    on(Some(2e-3), 0.499, pin(4e-3, 0.1e-3)),
    on(Some(2e-3), 0.45, pin(6e-3, 0.1e-3)),
    tilted(4e-3, 0.02, 0.0),
    tilted(6e-3, 0.1, 0.5),
    pressed(
        Indenter::TwoBalls {
            radius_m: 3e-3,
            apart_m: 8e-3,
            toward_rad: 0.0,
        },
        0.3e-3,
    ),
    bar(0.0),
    bar(0.3),
];

impl Case {
    /// Short name: indenter, layer, Poisson's ratio, depth.
    pub(super) fn name(&self) -> String {
        let mm = |length_m: f64| (1e7 * length_m).round() / 1e4;
        let indenter = match self.indenter {
            Indenter::Ball { radius_m } => format!("ball {} mm", mm(radius_m)),
            Indenter::Pin { radius_m } => format!("pin {} mm", mm(radius_m)),
            Indenter::Tilted {
                radius_m,
                tilt_rad,
                toward_rad,
            } => format!(
                "pin {} mm, tilted by {tilt_rad} toward {toward_rad}",
                mm(radius_m)
            ),
            Indenter::Bar {
                length_m,
                width_m,
                toward_rad,
            } => format!(
                "bar {} x {} mm along {toward_rad}",
                mm(length_m),
                mm(width_m)
            ),
            Indenter::TwoBalls {
                radius_m, apart_m, ..
            } => format!("two balls {} mm, {} mm apart", mm(radius_m), mm(apart_m)),
        };
        let layer = match self.thickness_m {
            Some(thickness_m) => format!("{} mm", mm(thickness_m)),
            None => "half-space".to_owned(),
        };
        format!(
            "{indenter} | {layer} | {} | {}",
            self.poisson,
            mm(self.depth_m)
        )
    }

    /// Whether the simulated world solves an integral equation for it; otherwise a grid.
    pub(super) fn is_round(&self) -> bool {
        matches!(self.indenter, Indenter::Ball { .. } | Indenter::Pin { .. })
    }

    /// Whether the area is found, and not given by an edge.
    pub(super) fn has_free_area(&self) -> bool {
        !matches!(self.indenter, Indenter::Pin { .. } | Indenter::Bar { .. })
    }

    /// What the simulated world finds: a sensor without tolerances, creep and noise.
    pub(super) fn simulated(&self) -> TouchTruth {
        let layer = Layer {
            thickness_m: self.thickness_m.unwrap_or(ENDLESS_M),
            shear_modulus_pa: SHEAR_MODULUS_PA,
            poisson: self.poisson,
        };
        let mut layout = Layout::three_around_one();
        layout.coils.truncate(1);
        layout.boundary_m = layer.thickness_m;
        let sensor = TouchSensor::new(TouchParameters::ideal(&layout, &layer));
        let press = Press {
            place_m: [0.0; 2],
            demand: Demand::Depth(self.depth_m),
        };
        let mut pressing = sensor.pressed_by(&self.indenter, [0.0; 2], 0);
        let (_, truth) = pressing.inductances_h(0.0, &press, &Surroundings::default());
        truth
    }

    /// Stiffness of a half-space to indenters, 4G/(1 − ν), Pa.
    pub(super) fn stiffness_pa(&self) -> f64 {
        4.0 * SHEAR_MODULUS_PA / (1.0 - self.poisson)
    }

    /// The case for the peer.
    pub(super) fn json(&self) -> Value {
        let mut case = match self.indenter {
            Indenter::Ball { radius_m } => json!({ "kind": "ball", "radius_m": radius_m }),
            Indenter::Pin { radius_m } => json!({ "kind": "pin", "radius_m": radius_m }),
            Indenter::Tilted {
                radius_m,
                tilt_rad,
                toward_rad,
            } => json!({
                "kind": "tilted", "radius_m": radius_m, "tilt_rad": tilt_rad, "toward_rad": toward_rad,
            }),
            Indenter::Bar {
                length_m,
                width_m,
                toward_rad,
            } => json!({
                "kind": "bar", "length_m": length_m, "width_m": width_m, "toward_rad": toward_rad,
            }),
            Indenter::TwoBalls {
                radius_m,
                apart_m,
                toward_rad,
            } => json!({
                "kind": "two balls", "radius_m": radius_m, "apart_m": apart_m, "toward_rad": toward_rad,
            }),
        };
        case["shear_modulus_pa"] = json!(SHEAR_MODULUS_PA);
        case["poisson"] = json!(self.poisson);
        case["thickness_m"] = json!(self.thickness_m);
        case["depth_m"] = json!(self.depth_m);
        // The peer's grid repeats, so it extends eight thicknesses beyond the contact, where nothing moves.
        // Of a half-space only the contact is computed.
        let (side_m, cells) = match self.thickness_m {
            Some(thickness_m) => (8.0 * thickness_m + 4.0 * self.reach_m(), [400, 800]),
            None => (5e-3, [200, 400]),
        };
        case["side_m"] = json!(side_m);
        case["cells"] = json!(cells);
        case
    }

    /// Radius beyond which the indenter does not touch, m.
    fn reach_m(&self) -> f64 {
        let ball_m = |radius_m: f64| (2.0 * radius_m * self.depth_m).sqrt();
        match self.indenter {
            Indenter::Ball { radius_m } => ball_m(radius_m),
            Indenter::Pin { radius_m } | Indenter::Tilted { radius_m, .. } => radius_m,
            Indenter::Bar { length_m, .. } => 0.5 * length_m,
            Indenter::TwoBalls {
                radius_m, apart_m, ..
            } => 0.5 * apart_m + ball_m(radius_m),
        }
    }
}
