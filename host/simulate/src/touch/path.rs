//! Paths of touches: the built-in ones, and those of a file.

use std::path::Path;

use palpate_calibration::touch::Tip;
use palpate_cli::failure::Failure;
use palpate_cli::notice::printable;
use palpate_cli::text;
use palpate_sim::stack::document::{FileError, TableSection};
use palpate_sim::stack::quantity::Allowed;
use palpate_sim::touch::{Demand, Indenter, Press};

use super::bench::{Kind, LIFTED};

/// What is touched, and by what.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchScenario {
    /// The array.
    pub kind: Kind,
    /// The touches, each on a layer at rest.
    pub touches: Vec<TouchPath>,
}

/// A touch: straight down, along a line while down, and up again.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchPath {
    /// Name in tables.
    pub name: String,
    /// What presses.
    pub indenter: Indenter,
    /// What is declared of it, where the array needs that.
    pub declared: Tip,
    /// Where the line begins and ends, m.
    pub from_m: [f64; 2],
    /// See `from_m`.
    pub to_m: [f64; 2],
    /// Depth or force while down.
    pub demand: Demand,
    /// Time down, s.
    pub seconds: f64,
    /// Tangential traction over pressure, along x and y.
    pub drag: [f64; 2],
}

/// The built-in touches.
const BUILTIN: &str = include_str!("paths.toml");

const KEYS: [&str; 2] = ["layout", "touch"];
const TOUCH_KEYS: [&str; 17] = [
    "name",
    "indenter",
    "radius_m",
    "length_m",
    "width_m",
    "apart_m",
    "toward_deg",
    "tilt_deg",
    "x_m",
    "y_m",
    "to_x_m",
    "to_y_m",
    "depth_m",
    "force_N",
    "seconds",
    "drag_x",
    "drag_y",
];

/// Allowed radii, as of [`Indenter`]; a flat face is a ten-millimetre one at most.
const BALL: Allowed = Allowed::new(0.5e-3, 20e-3, "m");
const FACE: Allowed = Allowed::new(0.5e-3, 10e-3, "m");
const SIDE: Allowed = Allowed::new(0.5e-3, 20e-3, "m");
const TILT: Allowed = Allowed::new(0.0, 11.0, "degrees");
const TOWARD: Allowed = Allowed::new(-360.0, 360.0, "degrees");
const PLACE: Allowed = Allowed::new(-20e-3, 20e-3, "m");
/// Contacts are computed up to a depth of a fifth of the layer's thickness.
const DEPTH: Allowed = Allowed::new(1e-6, 1e-3, "m");
const FORCE: Allowed = Allowed::new(1e-4, 100.0, "N");
const SECONDS: Allowed = Allowed::new(0.05, 60.0, "s");
const DRAG: Allowed = Allowed::new(-1.0, 1.0, "1");

/// Times before the press, for the way down, for the way up, and afterwards, s. The instrument learns
/// the untouched sensor for half a second.
const UNTOUCHED_S: f64 = 0.6;
const DOWN_S: f64 = 0.3;
const UP_S: f64 = 0.2;
const AFTERWARDS_S: f64 = 0.1;

impl TouchScenario {
    /// The built-in touches.
    ///
    /// # Errors
    /// Never: a test reads the built-in paths.
    pub fn builtin() -> Result<Self, Failure> {
        Self::parse("the built-in paths", BUILTIN).map_err(Failure::Document)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, or something in it is not allowed: line, key and what is allowed.
    pub fn load(file: &Path) -> Result<Self, Failure> {
        let text = text::of_file(file)?;
        Self::parse(&file.display().to_string(), &text).map_err(Failure::Document)
    }

    fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let document = TableSection::parse(file, text, &KEYS)?;
        let touches = document.sections("touch", &TOUCH_KEYS)?;
        Ok(Self {
            kind: document.choice("layout", &Kind::NAMED)?,
            touches: touches.iter().map(touch).collect::<Result<_, _>>()?,
        })
    }
}

fn touch(section: &TableSection<'_>) -> Result<TouchPath, FileError> {
    let number = |key, allowed| section.number_within(key, allowed);
    let (indenter, declared) = indenter(section)?;
    let from_m = [number("x_m", &PLACE)?, number("y_m", &PLACE)?];
    let to = |key, from_m| {
        let to_m = section.if_given(key, |key| section.number_within(key, &PLACE))?;
        Ok(to_m.unwrap_or(from_m))
    };
    let demand = if section.has("force_N") {
        section.refuse("depth_m", "depth_m or force_N, not both")?;
        Demand::Force(number("force_N", &FORCE)?)
    } else {
        Demand::Depth(number("depth_m", &DEPTH)?)
    };
    let drag = |key| {
        let drag = section.if_given(key, |key| section.number_within(key, &DRAG))?;
        Ok::<_, FileError>(drag.unwrap_or(0.0))
    };
    Ok(TouchPath {
        name: printable(&section.text("name")?),
        indenter,
        declared,
        from_m,
        to_m: [to("to_x_m", from_m[0])?, to("to_y_m", from_m[1])?],
        demand,
        seconds: number("seconds", &SECONDS)?,
        drag: [drag("drag_x")?, drag("drag_y")?],
    })
}

/// Reads the indenter. Where the array needs a declared one, two balls are declared as one ball, and a
/// tilted face or a bar as a round face.
fn indenter(section: &TableSection<'_>) -> Result<(Indenter, Tip), FileError> {
    const OF_A_TIP: &[&str] = &["radius_m"];
    const OF_TILTED: &[&str] = &["radius_m", "tilt_deg", "toward_deg"];
    const OF_A_BAR: &[&str] = &["length_m", "width_m", "toward_deg"];
    const OF_TWO: &[&str] = &["radius_m", "apart_m", "toward_deg"];
    let kinds = ["ball", "pin", "tilted", "bar", "two-balls"];
    let kind = section.choice("indenter", &kinds.map(|kind| (kind, kind)))?;
    let number = |key, allowed| section.number_within(key, allowed);
    let angle = |key, allowed| Ok::<_, FileError>(number(key, allowed)?.to_radians());
    let (indenter, declared, keys) = match kind {
        "ball" => {
            let radius_m = number("radius_m", &BALL)?;
            (Indenter::Ball { radius_m }, Tip::Ball(radius_m), OF_A_TIP)
        }
        "pin" => {
            let radius_m = number("radius_m", &FACE)?;
            (Indenter::Pin { radius_m }, Tip::Pin(radius_m), OF_A_TIP)
        }
        "tilted" => {
            let radius_m = number("radius_m", &FACE)?;
            let indenter = Indenter::Tilted {
                radius_m,
                tilt_rad: angle("tilt_deg", &TILT)?,
                toward_rad: angle("toward_deg", &TOWARD)?,
            };
            (indenter, Tip::Pin(radius_m), OF_TILTED)
        }
        "bar" => {
            let (length_m, width_m) = (number("length_m", &SIDE)?, number("width_m", &SIDE)?);
            let indenter = Indenter::Bar {
                length_m,
                width_m,
                toward_rad: angle("toward_deg", &TOWARD)?,
            };
            (indenter, Tip::Pin(0.5 * width_m), OF_A_BAR)
        }
        _ => {
            let radius_m = number("radius_m", &BALL)?;
            let indenter = Indenter::TwoBalls {
                radius_m,
                apart_m: number("apart_m", &SIDE)?,
                toward_rad: angle("toward_deg", &TOWARD)?,
            };
            (indenter, Tip::Ball(radius_m), OF_TWO)
        }
    };
    for key in [
        "radius_m",
        "length_m",
        "width_m",
        "apart_m",
        "toward_deg",
        "tilt_deg",
    ] {
        if !keys.contains(&key) {
            section.refuse(key, &format!("with {kind:?}: {}", keys.join(", ")))?;
        }
    }
    Ok((indenter, declared))
}

impl TouchPath {
    /// The press at a time from the start of the recording, s.
    pub fn at(&self, time_s: f64) -> Press {
        let down_s = time_s - UNTOUCHED_S;
        let moved_s = down_s - DOWN_S;
        let up_s = moved_s - self.seconds;
        if down_s <= 0.0 || up_s >= UP_S {
            return LIFTED;
        }
        let along = (moved_s / self.seconds).clamp(0.0, 1.0);
        let pressed = (down_s / DOWN_S).min(1.0).min(1.0 - up_s / UP_S);
        let place = |from_m: f64, to_m: f64| from_m + along * (to_m - from_m);
        Press {
            place_m: [
                place(self.from_m[0], self.to_m[0]),
                place(self.from_m[1], self.to_m[1]),
            ],
            demand: match self.demand {
                Demand::Depth(depth_m) => Demand::Depth(pressed * depth_m),
                Demand::Force(force_n) => Demand::Force(pressed * force_n),
            },
        }
    }

    /// Whether the touch is down fully, from the end of the way down to the begin of the way up.
    pub fn is_down(&self, time_s: f64) -> bool {
        let moved_s = time_s - UNTOUCHED_S - DOWN_S;
        (0.0..=self.seconds).contains(&moved_s)
    }

    /// Time since the begin of the way down, s.
    pub fn since_contact_s(time_s: f64) -> f64 {
        time_s - UNTOUCHED_S
    }

    /// Length of the recording, s.
    pub fn length_s(&self) -> f64 {
        UNTOUCHED_S + DOWN_S + self.seconds + UP_S + AFTERWARDS_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_goes_down_along_its_line_and_up() {
        let path = &TouchScenario::builtin().unwrap().touches[1];
        assert_ne!(path.from_m, path.to_m);
        assert_eq!(path.at(0.5), LIFTED);
        let depth = |time_s: f64| match path.at(time_s).demand {
            Demand::Depth(of) | Demand::Force(of) => of,
        };
        let whole = depth(0.9);
        assert!((depth(0.75) - 0.5 * whole).abs() < 1e-9);
        let up_s = 0.9 + path.seconds;
        let middle = path.at(0.9 + 0.5 * path.seconds).place_m;
        assert!((middle[0] - 0.5 * (path.from_m[0] + path.to_m[0])).abs() < 1e-9);
        assert_eq!(path.at(up_s + 0.1).place_m, path.to_m);
        assert!((depth(up_s + 0.1) - 0.5 * whole).abs() < 1e-9);
        assert_eq!(path.at(up_s + 0.21), LIFTED);
        assert!(path.is_down(1.0) && !path.is_down(0.8) && !path.is_down(up_s + 0.05));
    }

    #[test]
    fn what_is_wrong_in_a_file_is_named_with_its_line() {
        let press = "layout = \"seven\"\n[[touch]]\nname = \"a\"\nindenter = \"ball\"\nradius_m = 5e-3\nx_m = 0\ny_m = 0\n\
                     depth_m = 1e-4\nseconds = 1\n";
        assert!(TouchScenario::parse("a.toml", press).is_ok());
        for (from, to, said) in [
            ("seven", "eight", "a.toml:1: layout"),
            (
                "radius_m = 5e-3",
                "radius_m = 5",
                "a.toml:5: touch.radius_m",
            ),
            ("1e-4", "1e-4\nforce_N = 1", "depth_m or force_N"),
            ("1e-4", "1e-4\ntilt_deg = 1", "with \"ball\": radius_m"),
            ("1e-4", "1e-4\ndrag_x = 2", "touch.drag_x"),
            ("seconds = 1", "", "touch.seconds"),
        ] {
            let error = TouchScenario::parse("a.toml", &press.replace(from, to)).unwrap_err();
            assert!(error.to_string().contains(said), "{said}: {error}");
        }
    }
}
