//! Scenario files: sensor, disturbances and pressed objects.
//!
//! ```
//! use palpate_sim::scenario::Scenario;
//!
//! let text = r#"
//! stack = "ultrasoft"
//! disturbances = "all"
//! except = ["vibration"]
//!
//! [[press]]
//! load = "spring"
//! stiffness_N_per_m = 6e3
//! "#;
//! let scenario = Scenario::parse("mine.toml", text)?;
//! assert!(scenario.switches.creep && !scenario.switches.vibration);
//!
//! let wrong = text.replace("6e3", "-6e3");
//! let error = Scenario::parse("mine.toml", &wrong).unwrap_err();
//! assert_eq!(
//!     error.to_string(),
//!     "mine.toml:8: press.stiffness_N_per_m: -6000 is out of range; allowed: 1 to 1e10 N/m"
//! );
//! # Ok::<(), palpate_sim::stack::LoadError>(())
//! ```

use std::path::Path;

use crate::mechanics::indented::{Indented, Material, Tip};
use crate::mechanics::layer::CreepMode;
use crate::mechanics::load::{LOAD_MODES, Load};
use crate::stack::document::{FileError, TableSection};
use crate::stack::quantity::Allowed;
use crate::stack::{LoadError, Stack, checked_name, names, read};
use crate::switches::Switches;
use crate::world::Holder;

/// One scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Kind of sensor.
    pub stack: Stack,
    /// Active disturbances.
    pub switches: Switches,
    /// Presses, each on a sensor in the same initial state.
    pub presses: Vec<Press>,
}

/// A press.
#[derive(Clone, Debug, PartialEq)]
pub struct Press {
    /// Name in tables.
    pub name: String,
    /// Pressed object.
    pub load: Load,
    /// Stand or hand.
    pub holder: Holder,
    /// Intended displacement of the sensing layer, m; by default the depth for which the sensor was
    /// drawn.
    pub depth_m: Option<f64>,
    /// Speed, m/s; by default that of the calibration bench.
    pub speed_m_per_s: Option<f64>,
}

const KEYS: [&str; 4] = ["stack", "disturbances", "except", "press"];
const PRESS_KEYS: [&str; 13] = [
    "name",
    "load",
    "stiffness_N_per_m",
    "cubic_N_per_m3",
    "radius_m",
    "modulus_Pa",
    "poisson_ratio",
    "thickness_m",
    "creep",
    "creep_time_s",
    "depth_m",
    "speed_m_per_s",
    "holder",
];

/// Allowed stiffness, as for [`Load`].
const STIFFNESS: Allowed = Allowed::new(1.0, 1e10, "N/m");
const CUBIC: Allowed = Allowed::new(0.0, 1e20, "N/m^3");
/// Allowed tip and object, as for [`Indented`].
const RADIUS: Allowed = Allowed::new(1e-5, 0.1, "m");
const MODULUS: Allowed = Allowed::new(1e3, 1e10, "Pa");
const POISSON: Allowed = Allowed::new(0.0, 0.5, "");
const THICKNESS: Allowed = Allowed::new(1e-4, 1.0, "m");
/// Allowed creep of a load, in units of its instant compression.
const CREEP: Allowed = Allowed::new(0.0, 10.0, "1");
const CREEP_TIME: Allowed = Allowed::new(1e-3, 1e6, "s");
/// Allowed depth, as in a stack file.
const DEPTH: Allowed = Allowed::new(1e-6, 0.8e-3, "m");
/// Allowed speed: from a press of a minute to a press of a few conversions.
const SPEED: Allowed = Allowed::new(1e-5, 0.1, "m/s");

impl Scenario {
    /// Reads a file. A stack file that it names is searched in the same folder.
    ///
    /// # Errors
    /// [`LoadError`] if the scenario or a stack cannot be read or is refused.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let folder = path.parent().unwrap_or_else(|| Path::new(""));
        Self::read(&path.display().to_string(), &read(path)?, folder)
    }

    /// Reads a text; `file` is only for messages. A stack file is searched in the working
    /// directory.
    ///
    /// # Errors
    /// [`LoadError`] names line, key and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, LoadError> {
        Self::read(file, text, Path::new(""))
    }

    fn read(file: &str, text: &str, folder: &Path) -> Result<Self, LoadError> {
        let document = TableSection::parse(file, text, &KEYS)?;
        let name = document.parsed("stack", &names(), checked_name)?;
        let switches = switches(&document)?;
        let presses = document.sections("press", &PRESS_KEYS)?;
        let presses = presses.iter().map(press).collect::<Result<_, _>>()?;
        Ok(Self {
            stack: Stack::named(&name, folder)?,
            switches,
            presses,
        })
    }
}

fn switches(document: &TableSection<'_>) -> Result<Switches, FileError> {
    let all = document.choice("disturbances", &[("all", true), ("none", false)])?;
    let mut switches = if all {
        Switches::all()
    } else {
        Switches::none()
    };
    let allowed = format!("names of disturbances: {}", Switches::NAMES.join(", "));
    let known = |text: &str| match switches.get(text) {
        Some(_) => Ok(text.to_owned()),
        None => Err(format!("there is no disturbance {text:?}")),
    };
    let except = document.if_given("except", |key| document.texts(key, &allowed, known))?;
    for name in except.unwrap_or_default() {
        switches = switches.with(&name, !all);
    }
    Ok(switches)
}

fn press(section: &TableSection<'_>) -> Result<Press, FileError> {
    let load = load(section)?;
    let holders = [("stand", Holder::Stand), ("hand", Holder::Hand)];
    let holder = section.if_given("holder", |key| section.choice(key, &holders))?;
    let number = |key, allowed| section.if_given(key, |key| section.number_within(key, allowed));
    Ok(Press {
        depth_m: number("depth_m", &DEPTH)?,
        speed_m_per_s: number("speed_m_per_s", &SPEED)?,
        holder: holder.unwrap_or(Holder::Stand),
        name: section
            .if_given("name", |key| section.text(key))?
            .unwrap_or_else(|| describe(&load)),
        load,
    })
}

fn load(section: &TableSection<'_>) -> Result<Load, FileError> {
    const OF_A_SPRING: [&str; 1] = ["stiffness_N_per_m"];
    const OF_HARDENING: [&str; 2] = ["stiffness_N_per_m", "cubic_N_per_m3"];
    const OF_RELAXING: [&str; 3] = ["stiffness_N_per_m", "creep", "creep_time_s"];
    const OF_A_TIP: [&str; 4] = ["radius_m", "modulus_Pa", "poisson_ratio", "thickness_m"];
    let kinds = [
        "spring",
        "hardening",
        "viscoelastic",
        "pin",
        "ball",
        "rigid",
    ];
    let kind = section.choice("load", &kinds.map(|kind| (kind, kind)))?;
    let stiffness = |key| section.number_within(key, &STIFFNESS);
    let (load, keys) = match kind {
        "spring" => {
            let n_per_m = stiffness("stiffness_N_per_m")?;
            (Load::Spring { n_per_m }, &OF_A_SPRING[..])
        }
        "hardening" => {
            let load = Load::Hardening {
                n_per_m: stiffness("stiffness_N_per_m")?,
                cubic_n_per_m3: section.number_within("cubic_N_per_m3", &CUBIC)?,
            };
            (load, &OF_HARDENING[..])
        }
        "viscoelastic" => {
            let n_per_m = stiffness("stiffness_N_per_m")?;
            let mut creep = [CreepMode::default(); LOAD_MODES];
            creep[0] = CreepMode {
                amplitude: section.number_within("creep", &CREEP)?,
                tau_s: section.number_within("creep_time_s", &CREEP_TIME)?,
            };
            (Load::Viscoelastic { n_per_m, creep }, &OF_RELAXING[..])
        }
        "pin" => (indented(section, Tip::Pin)?, &OF_A_TIP[..]),
        "ball" => (indented(section, Tip::Ball)?, &OF_A_TIP[..]),
        _ => (Load::Rigid, &[][..]),
    };
    let others = OF_HARDENING.iter().chain(&OF_RELAXING).chain(&OF_A_TIP);
    for key in others.filter(|key| !keys.contains(key)) {
        section.refuse(key, &format!("nothing, with load = {kind:?}"))?;
    }
    Ok(load)
}

fn indented(section: &TableSection<'_>, tip: Tip) -> Result<Load, FileError> {
    let number = |key, allowed| section.number_within(key, allowed);
    let material = Material {
        young_pa: number("modulus_Pa", &MODULUS)?,
        poisson_ratio: number("poisson_ratio", &POISSON)?,
        thickness_m: section
            .if_given("thickness_m", |key| section.number_within(key, &THICKNESS))?,
    };
    let radius_m = number("radius_m", &RADIUS)?;
    Ok(Load::Indented(Indented::new(tip, radius_m, material)))
}

fn describe(load: &Load) -> String {
    match load {
        Load::Spring { n_per_m } => format!("{} N/mm", n_per_m * 1e-3),
        Load::Hardening { n_per_m, .. } => format!("{} N/mm, hardening", n_per_m * 1e-3),
        Load::Indented(object) => {
            let tip = match object.tip {
                Tip::Pin => "pin",
                Tip::Ball => "ball",
            };
            let kpa = object.material.young_pa * 1e-3;
            format!("{tip} of {} mm on {kpa} kPa", object.radius_m * 1e3)
        }
        Load::Viscoelastic { n_per_m, .. } => format!("{} N/mm, relaxing", n_per_m * 1e-3),
        Load::Rigid => "block".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RELAXING: &str = "stack = \"ultrasoft\"\ndisturbances = \"none\"\n[[press]]\n\
        load = \"viscoelastic\"\nstiffness_N_per_m = 3e3\ncreep = 0.5\ncreep_time_s = 2\n";

    #[test]
    fn a_load_that_relaxes_has_one_mode() {
        let scenario = Scenario::parse("mine.toml", RELAXING).unwrap();
        let mut modes = [CreepMode::default(); LOAD_MODES];
        modes[0] = CreepMode {
            amplitude: 0.5,
            tau_s: 2.0,
        };
        let [press] = scenario.presses.as_slice() else {
            panic!("one press: {scenario:?}");
        };
        let n_per_m = 3e3;
        let load = Load::Viscoelastic {
            n_per_m,
            creep: modes,
        };
        assert_eq!(
            (press.load, press.name.as_str()),
            (load, "3 N/mm, relaxing")
        );
        let spring = RELAXING.replace("viscoelastic", "spring");
        let error = Scenario::parse("mine.toml", &spring)
            .unwrap_err()
            .to_string();
        assert!(error.contains("creep"), "{error}");
    }
}
