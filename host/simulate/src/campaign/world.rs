//! Differences between bench and use.

use clap::ValueEnum;
use palpate_calibration::ContactEffect;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::mechanics::friction::FrictionParameters;
use palpate_sim::mechanics::layer::CreepMode;
use palpate_sim::mechanics::press::{Jumps, Shake};
use palpate_sim::parameters::{ObjectParameters, Parameters};
use palpate_sim::random::Stream;
use palpate_sim::world::Holder;
use serde::{Deserialize, Serialize};

use crate::press::CLEARANCE_M;

/// World in which a calibrated sensor presses. Every world except the first differs from the bench by something that
/// the instrument's model does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
pub enum World {
    /// As on the bench, at another temperature within the drawn 5 K
    Calibrated,
    /// The cross-talk is a fifth larger
    CrosstalkStronger,
    /// The cross-talk is a fifth smaller
    CrosstalkWeaker,
    /// The cross-talk grows by 30 % more over a press
    CrosstalkGrowth,
    /// The sensing layer has become 10 % softer
    SensingSofter,
    /// The sensing layer has become 10 % stiffer
    SensingStiffer,
    /// The actuated layer has become 10 % softer
    ActuatedSofter,
    /// The actuated layer has become 10 % stiffer
    ActuatedStiffer,
    /// The actuated layer stiffens by a tenth less
    StiffeningWeaker,
    /// The actuated layer stiffens by a tenth more
    StiffeningStronger,
    /// The stiffening is half-way to its end at the peak's field
    Saturating,
    /// The stiffening remembers 10 % more of its way
    Memory,
    /// The stiffening follows the field 5 ms later
    Lag,
    /// The halves of the actuated layer attract each other by a fifth more
    AttractionStronger,
    /// Both layers creep twice as much
    CreepStronger,
    /// Both layers creep three times as slowly
    CreepSlower,
    /// The current is measured 2 % too small
    CurrentGain,
    /// 15 K warmer than the bench
    #[value(name = "warmer-15-k")]
    Warmer15K,
    /// 30 K warmer than the bench
    #[value(name = "warmer-30-k")]
    Warmer30K,
    /// The stand shakes by 3 µm at 9.5 Hz, a little slower than the ramps
    #[value(name = "vibration-9.5-hz")]
    VibrationNear,
    /// The stand shakes by 3 µm at 10 Hz, in step with the ramps
    #[value(name = "vibration-10-hz")]
    VibrationInStep,
    /// The stand shakes by 3 µm at 20 Hz, twice in a ramp
    #[value(name = "vibration-20-hz")]
    VibrationTwice,
    /// The stand hums by 0.5 µm at 49.7 Hz, nearly five times in a ramp
    Hum,
    /// Both layers are up to 3 % stiffer in the first 20 ms of a movement
    RateHardening,
    /// What the load stands on gives way by 20 N/mm
    SoftFrame,
    /// Held in a hand that trembles
    Hand,
    /// The load's face is a tile of ferrite, 2 cm² and 3 mm thick, and comes from 3 mm away
    FerromagneticObject,
    /// The load's face is of steel, with its eddy currents, and comes from 3 mm away
    SteelObject,
    /// Friction beside the sensing layer sticks up to 5 mN and slips to 2 mN
    StickSlip,
    /// The sensor jumps by 3 µm to and fro, twice a second in the mean
    Steps,
    /// Beside the centre by up to the bench's tolerance, or by up to 1 mm
    BesideCentre,
    /// Tilted by up to the bench's tolerance, or by up to 0.1 degrees
    Tilted,
    /// Both of the last two
    BesideAndTilted,
    /// Beside the centre by twice the tolerance
    FarBeside,
    /// Tilted by twice the tolerance
    FarTilted,
}

/// Greatest distance and tilt of contacts if the bench states no tolerance: what a guide with some play allows.
const WITHIN_M: f64 = 1e-3;
const TILT_RAD: f64 = 1.75e-3;
/// Distance and tilt of contacts beyond the tolerance, in units of it.
const BEYOND: f64 = 2.0;

/// Relative change of a quantity in the worlds where it differs by a fifth or a tenth.
const FIFTH: f64 = 0.2;
const TENTH: f64 = 0.1;
/// Amplitude of a shaking stand, m. At this amplitude an interval missed the truth.
const SHAKEN_M: f64 = 3e-6;
/// Amplitude of a stand that hums, m: what a small fan or a transformer on the same bench makes.
const HUM_M: f64 = 0.5e-6;
/// Hardening with the rate, as a creep that is over within a ramp. It takes the place of the
/// layers' fastest creep.
const RATE_HARDENING: CreepMode = CreepMode {
    amplitude: 0.03,
    tau_s: 0.02,
};

/// A face of nickel-zinc ferrite, which hardly conducts, with μ = 100. Its reflection is (μ − 1)/(μ + 1).
///
/// The pull between C1in's coils and a tile of radius 8 mm, 8 mm above their board, is 3.6 mN at
/// 10 A, computed by `palpate field` with a body of that shape added to the design. By Maxwell's
/// stress this is B = √(2 μ0 F/A) = 7 mT through the face, and 9 mT where it turns into the tile's
/// plane, B r/2t. Saturation at 0.35 T lowers the permeability by the part (B/0.35 T)², that is by
/// 0.08, and the reflection by 2·0.08/(μ + 1)² = 1.6e-5.
const FERRITE: ObjectParameters = ObjectParameters {
    reflection: 0.98,
    lost_at_peak: 1.6e-5,
    n_per_a2: 3.6e-5,
};

/// A face of steel. The pull is that of ferrite, since at high permeability it hardly depends on
/// the material. To the sensing coil steel is a conductor with the reflection (μ k − k')/(μ k +
/// k'), where k'² = k² + jω μ μ0 σ (Dodd and Deeds 1968). Its real part is −0.6 for μ = 100, 1/σ =
/// 0.15 µΩ m, 2.9 MHz and k = 400/m, the inverse of the sensing coil's mean half radius. Its skin
/// depth of 9 µm is below the layer that the direct field saturates.
const STEEL: ObjectParameters = ObjectParameters {
    reflection: -0.6,
    lost_at_peak: 0.0,
    ..FERRITE
};

/// Friction of three per mille of a press's force, with a spring of half of c_S. The values are
/// guesses, chosen so that a ramp makes the contact slip.
const FRICTION: FrictionParameters = FrictionParameters {
    spring_n_per_m: 3e3,
    stick_n: 5e-3,
    slip_n: 2e-3,
};

/// Jumps with the amplitude of a shaking stand. A train takes 1.5 s, so some occur in every train.
const JUMPS: Jumps = Jumps {
    size_m: SHAKEN_M,
    interval_s: 0.5,
};

/// Distance from which a magnetic or conducting object approaches, m. The curve of the sensing coil
/// ends there.
const FAR_M: f64 = 3e-3;

impl World {
    /// Name on the command line.
    pub fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or(String::new(), |value| value.get_name().to_owned())
    }

    /// The sensor in this world.
    pub fn plant(self, calibrated: &Parameters) -> Parameters {
        let mut plant = calibrated.clone();
        let p = &mut plant;
        let law = &mut p.magnetorheological;
        match self {
            Self::Calibrated
            | Self::Hand
            | Self::BesideCentre
            | Self::Tilted
            | Self::BesideAndTilted
            | Self::FarBeside
            | Self::FarTilted => {}
            Self::CrosstalkStronger => p.crosstalk.at_peak_m *= 1.0 + FIFTH,
            Self::CrosstalkWeaker => p.crosstalk.at_peak_m *= 1.0 - FIFTH,
            Self::CrosstalkGrowth => p.crosstalk.slope_per_press_depth += 0.3,
            Self::SensingSofter => p.sensing.spring_n_per_m *= 1.0 - TENTH,
            Self::SensingStiffer => p.sensing.spring_n_per_m *= 1.0 + TENTH,
            Self::ActuatedSofter => p.actuated.spring_n_per_m *= 1.0 - TENTH,
            Self::ActuatedStiffer => p.actuated.spring_n_per_m *= 1.0 + TENTH,
            Self::StiffeningWeaker => law.stiffening_at_peak *= 1.0 - TENTH,
            Self::StiffeningStronger => law.stiffening_at_peak *= 1.0 + TENTH,
            Self::Saturating => law.field_half_t = law.field_at_peak_t,
            Self::Memory => law.memory += TENTH,
            Self::Lag => law.lag_s += 5e-3,
            Self::AttractionStronger => p.attraction.n_per_a2 *= 1.0 + FIFTH,
            Self::CreepStronger => {
                for mode in p.sensing.creep.iter_mut().chain(&mut p.actuated.creep) {
                    mode.amplitude *= 2.0;
                }
            }
            Self::CreepSlower => {
                for mode in p.sensing.creep.iter_mut().chain(&mut p.actuated.creep) {
                    mode.tau_s *= 3.0;
                }
            }
            Self::CurrentGain => p.current.gain_error -= 0.02,
            Self::Warmer15K => p.thermal.ambient_change_k = 15.0,
            Self::Warmer30K => p.thermal.ambient_change_k = 30.0,
            Self::VibrationNear => p.press.vibration = shaking(SHAKEN_M, 9.5),
            Self::VibrationInStep => p.press.vibration = shaking(SHAKEN_M, 10.0),
            Self::VibrationTwice => p.press.vibration = shaking(SHAKEN_M, 20.0),
            Self::Hum => p.press.vibration = shaking(HUM_M, 49.7),
            Self::RateHardening => {
                let [sensing, actuated] = [&mut p.sensing.creep, &mut p.actuated.creep];
                [sensing[0], actuated[0]] = [RATE_HARDENING; 2];
            }
            Self::SoftFrame => p.press.frame_m_per_n = 1.0 / 20e3,
            Self::FerromagneticObject => p.object = FERRITE,
            Self::SteelObject => p.object = STEEL,
            Self::StickSlip => p.friction = FRICTION,
            Self::Steps => p.press.jumps = JUMPS,
        }
        plant
    }

    /// Whether objects lie on the sensor as on the bench: in the centre, flat.
    pub const fn has_contact_of_bench(self) -> bool {
        !matches!(
            self,
            Self::BesideCentre
                | Self::Tilted
                | Self::BesideAndTilted
                | Self::FarBeside
                | Self::FarTilted
        )
    }

    /// Place and tilt of a press with this name on a sensor with this seed: within the bench's
    /// tolerance uniform in the disc and in the angle.
    pub fn contact(self, bench: Option<&ContactEffect>, seed: u64, name: &str) -> Contact {
        let tolerance = |of: fn(&ContactEffect) -> f64, default: f64| {
            bench.map(of).filter(|of| *of > 0.0).unwrap_or(default)
        };
        let within_m = tolerance(|of| of.within_m, WITHIN_M);
        let most_rad = tolerance(|of| of.tilt_rad, TILT_RAD);
        let mut chance = Stream::named(seed, &format!("campaign.contact.{name}"));
        let drawn = Contact {
            place_m: within_m * chance.uniform().sqrt(),
            tilt_rad: most_rad * chance.uniform(),
        };
        let centred = Contact::default();
        match self {
            Self::BesideCentre => Contact {
                tilt_rad: 0.0,
                ..drawn
            },
            Self::Tilted => Contact {
                place_m: 0.0,
                ..drawn
            },
            Self::BesideAndTilted => drawn,
            Self::FarBeside => Contact {
                place_m: BEYOND * within_m,
                ..centred
            },
            Self::FarTilted => Contact {
                tilt_rad: BEYOND * most_rad,
                ..centred
            },
            _ => centred,
        }
    }

    /// Holder of the press in this world: a stand or a hand.
    pub const fn holder(self) -> Holder {
        match self {
            Self::Hand => Holder::Hand,
            _ => Holder::Stand,
        }
    }

    /// Distance of the object above the sensor during the baseline, m.
    pub const fn clearance_m(self) -> f64 {
        match self {
            Self::FerromagneticObject | Self::SteelObject => FAR_M,
            _ => CLEARANCE_M,
        }
    }
}

const fn shaking(amplitude_m: f64, hertz: f64) -> Shake {
    Shake {
        amplitude_m,
        hertz,
        phase: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::parameters::draw;
    use palpate_sim::stack::{Disturbances, Stack};

    use super::*;

    #[test]
    fn every_world_but_the_first_differs_from_the_bench() {
        let stack = Stack::builtin("ultrasoft").unwrap();
        let drawn = draw(&stack, &Disturbances::builtin().unwrap(), 5);
        for world in World::value_variants() {
            let differs = world.plant(&drawn) != drawn
                || world.holder() != Holder::Stand
                || !world.has_contact_of_bench();
            let is_flat = world.contact(None, 5, "1 c_S") == Contact::default();
            assert_eq!(is_flat, world.has_contact_of_bench(), "{world:?}");
            assert_eq!(differs, *world != World::Calibrated, "{world:?}");
        }
    }
}
