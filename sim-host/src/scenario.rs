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

use crate::mechanics::load::Load;
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
const PRESS_KEYS: [&str; 7] = [
    "name",
    "load",
    "stiffness_N_per_m",
    "cubic_N_per_m3",
    "depth_m",
    "speed_m_per_s",
    "holder",
];

/// Allowed stiffness, as for [`Load`].
const STIFFNESS: Allowed = Allowed::new(1.0, 1e10, "N/m");
const CUBIC: Allowed = Allowed::new(0.0, 1e20, "N/m^3");
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
        let mut document = TableSection::parse(file, text, &KEYS)?;
        let name = document.parsed("stack", &names(), checked_name)?;
        let switches = switches(&mut document)?;
        let mut presses = document.sections("press", &PRESS_KEYS)?;
        let presses = presses.iter_mut().map(press).collect::<Result<_, _>>()?;
        Ok(Self {
            stack: Stack::named(&name, folder)?,
            switches,
            presses,
        })
    }
}

fn switches(document: &mut TableSection<'_>) -> Result<Switches, FileError> {
    let all = document.parsed("disturbances", "\"all\" or \"none\"", |text| match text {
        "all" => Ok(true),
        "none" => Ok(false),
        other => Err(format!("is {other:?}")),
    })?;
    let mut switches = if all {
        Switches::all()
    } else {
        Switches::none()
    };
    if !document.has("except") {
        return Ok(switches);
    }
    let allowed = format!("names of disturbances: {}", Switches::NAMES.join(", "));
    let except = document.texts("except", &allowed, |text| match switches.get(text) {
        Some(_) => Ok(text.to_owned()),
        None => Err(format!("there is no disturbance {text:?}")),
    })?;
    for name in except {
        switches = switches.with(&name, !all);
    }
    Ok(switches)
}

fn press(section: &mut TableSection<'_>) -> Result<Press, FileError> {
    let load = load(section)?;
    let optional = |section: &mut TableSection<'_>, key, allowed| {
        let given = section.has(key);
        given
            .then(|| section.number_within(key, allowed))
            .transpose()
    };
    let depth_m = optional(section, "depth_m", &DEPTH)?;
    let speed_m_per_s = optional(section, "speed_m_per_s", &SPEED)?;
    let holder = if section.has("holder") {
        section.parsed("holder", "\"stand\" or \"hand\"", |text| match text {
            "stand" => Ok(Holder::Stand),
            "hand" => Ok(Holder::Hand),
            other => Err(format!("is {other:?}")),
        })?
    } else {
        Holder::Stand
    };
    let name = if section.has("name") {
        section.text("name")?
    } else {
        describe(&load)
    };
    Ok(Press {
        name,
        load,
        holder,
        depth_m,
        speed_m_per_s,
    })
}

fn load(section: &mut TableSection<'_>) -> Result<Load, FileError> {
    let kinds = "\"spring\", \"hardening\" or \"rigid\"";
    let kind = section.parsed("load", kinds, |text| match text {
        "spring" | "hardening" | "rigid" => Ok(text.to_owned()),
        other => Err(format!("is {other:?}")),
    })?;
    let (needs_stiffness, needs_cubic) = match kind.as_str() {
        "spring" => (true, false),
        "hardening" => (true, true),
        _ => (false, false),
    };
    let mut number = |key, allowed, needed| {
        if needed {
            section.number_within(key, allowed)
        } else if section.has(key) {
            section.parsed(key, &format!("nothing, with load = {kind:?}"), |_| {
                Err("is a text".to_owned())
            })
        } else {
            Ok(0.0)
        }
    };
    let n_per_m = number("stiffness_N_per_m", &STIFFNESS, needs_stiffness)?;
    let cubic_n_per_m3 = number("cubic_N_per_m3", &CUBIC, needs_cubic)?;
    Ok(match (needs_stiffness, needs_cubic) {
        (true, false) => Load::Spring { n_per_m },
        (true, true) => Load::Hardening {
            n_per_m,
            cubic_n_per_m3,
        },
        _ => Load::Rigid,
    })
}

fn describe(load: &Load) -> String {
    match load {
        Load::Spring { n_per_m } => format!("{} N/mm", n_per_m * 1e-3),
        Load::Hardening { n_per_m, .. } => format!("{} N/mm, hardening", n_per_m * 1e-3),
        Load::Rigid => "block".to_owned(),
    }
}
