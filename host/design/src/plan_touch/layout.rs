//! Layouts of sensing coils as TOML files.

use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_cli::text;
use palpate_sim::stack::document::{FileError, TableSection};
use palpate_sim::stack::quantity::Allowed;

use super::coil::Winding;
use super::inside::{Inside, Shape};
use super::layer::Layer;

/// A layout with its layer, its presses and the errors of its readings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) name: String,
    pub(super) layer: Layer,
    /// Side of the square layer, centred at the origin, m.
    pub(super) width_m: f64,
    pub(super) coils: Vec<Coil>,
    pub(super) force_n: f64,
    pub(super) radius: Radius,
    pub(super) noise: Noise,
    /// Relative standard error of each channel's gain.
    pub(super) gain_error: f64,
    pub(super) inside: Inside,
}

/// A coil and the position of its axis, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coil {
    pub(super) centre_m: [f64; 2],
    pub(super) winding: Winding,
}

/// What is known of the contact's radius before a press, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Radius {
    /// Unknown: computed at both ends of a range.
    Free([f64; 2]),
    /// The radius, with its relative standard error.
    Declared(f64, f64),
}

impl Radius {
    /// Radii at which errors are computed, m.
    pub(super) fn computed_m(&self) -> Vec<f64> {
        match *self {
            Self::Free([least, greatest]) if least < greatest => vec![least, greatest],
            Self::Free([radius, _]) | Self::Declared(radius, _) => vec![radius],
        }
    }
}

/// Standard error of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Noise {
    /// Standard error of the mean approach, m.
    Approach(f64),
    /// Relative standard error of the inductance.
    Relative(f64),
}

const LAYER: [&str; 5] = [
    "thickness_m",
    "shear_modulus_Pa",
    "poisson",
    "width_m",
    "relative_permeability",
];
const WINDING: [&str; 4] = ["inner_radius_m", "outer_radius_m", "turns", "depth_m"];
const PRESS: [&str; 5] = [
    "force_N",
    "radius_m",
    "tolerance",
    "least_radius_m",
    "greatest_radius_m",
];
const SECTIONS: [&str; 7] = [
    "name", "layer", "winding", "coil", "press", "reading", "inside",
];

const THICKNESS: Allowed = Allowed::new(1e-3, 5e-2, "m");
const SHEAR_MODULUS: Allowed = Allowed::new(1e3, 1e8, "Pa");
const POISSON: Allowed = Allowed::new(0.0, 0.5, "");
const WIDTH: Allowed = Allowed::new(1e-3, 0.2, "m");
const PERMEABILITY: Allowed = Allowed::new(1.01, 1e4, "");
const INNER: Allowed = Allowed::new(1e-4, 4.9e-2, "m");
/// The outer edge is above the inner one by this factor, as [`palpate_sim::sensing_coil::CoilDesign`] asks for.
const OUTER_OVER_INNER: f64 = 1.02;
const OUTER: Allowed = Allowed::new(5e-4, 5e-2, "m");
const TURNS: Allowed = Allowed::new(1.0, 200.0, "");
const DEPTH: Allowed = Allowed::new(1e-4, 2e-2, "m");
const FORCE: Allowed = Allowed::new(1e-3, 1e3, "N");
const RADIUS: Allowed = Allowed::new(1e-4, 5e-2, "m");
const TOLERANCE: Allowed = Allowed::new(1e-4, 1.0, "");
const NOISE: Allowed = Allowed::new(1e-12, 1e-3, "m");
const RELATIVE_NOISE: Allowed = Allowed::new(1e-9, 0.1, "");
const GAIN_ERROR: Allowed = Allowed::new(0.0, 0.5, "");
const MARGIN: Allowed = Allowed::new(-5e-2, 5e-2, "m");
/// Most coils: sixteen converters of four channels.
const MOST_COILS: usize = 64;

/// Names and files of the built-in layouts.
const BUILTIN: [(&str, &str); 2] = [
    (
        "three-around-one",
        include_str!("../../layouts/three-around-one.toml"),
    ),
    ("seven", include_str!("../../layouts/seven.toml")),
];

/// Text of a layout: a built-in one by its name, or a file.
pub(super) fn text_of(name: &str) -> Result<String, Failure> {
    if let Some((_, text)) = BUILTIN.iter().find(|(builtin, _)| *builtin == name) {
        return Ok((*text).to_owned());
    }
    if !Path::new(name).exists() && !name.contains(['.', '/', '\\']) {
        let names = BUILTIN.map(|(name, _)| name).join(", ");
        return Err(Failure::Argument(format!(
            "there is neither a file nor a built-in layout {name:?}; allowed: a file, or {names}"
        )));
    }
    text::of_file(Path::new(name))
}

impl Layout {
    /// Reads a layout; `file` appears only in messages.
    pub(super) fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let document = TableSection::parse(file, text, &SECTIONS)?;
        let name = document.text("name")?;
        let layer = document.section("layer", &LAYER)?;
        let number = |key, allowed| layer.number_within(key, allowed);
        let [width_m, relative_permeability] = [
            number("width_m", &WIDTH)?,
            number("relative_permeability", &PERMEABILITY)?,
        ];
        let winding = document.section("winding", &WINDING)?;
        let keys = [&["x_m", "y_m"][..], &WINDING].concat();
        let coils = document.sections("coil", &keys)?;
        if coils.len() > MOST_COILS {
            return Err(FileError {
                file: file.to_owned(),
                line: 1,
                key: "coil".to_owned(),
                problem: format!("{} coils", coils.len()),
                allowed: format!("1 to {MOST_COILS} coils"),
            });
        }
        let coil = |section: &TableSection<'_>| {
            let reader = WindingReader {
                section,
                winding: &winding,
            };
            reader.coil(width_m, relative_permeability)
        };
        let coils = coils.iter().map(coil).collect::<Result<Vec<_>, _>>()?;
        let press = document.section("press", &PRESS)?;
        let reading = document.section("reading", &["noise_m", "noise_relative", "gain_error"])?;
        let inside = document.section("inside", &["shape", "margin_m"])?;
        let shapes = [("disc", Shape::Disc), ("hull", Shape::Hull)];
        Ok(Self {
            name,
            layer: Layer {
                thickness_m: number("thickness_m", &THICKNESS)?,
                shear_modulus_pa: number("shear_modulus_Pa", &SHEAR_MODULUS)?,
                poisson: number("poisson", &POISSON)?,
            },
            width_m,
            force_n: press.number_within("force_N", &FORCE)?,
            radius: radius(&press)?,
            noise: noise(&reading)?,
            gain_error: reading.number_within("gain_error", &GAIN_ERROR)?,
            inside: Inside::new(
                inside.choice("shape", &shapes)?,
                inside.number_within("margin_m", &MARGIN)?,
                &coils.iter().map(|coil| coil.centre_m).collect::<Vec<_>>(),
            ),
            coils,
        })
    }
}

/// Reads a coil, whose own keys precede those of all coils.
struct WindingReader<'s, 't> {
    section: &'s TableSection<'t>,
    winding: &'s TableSection<'t>,
}

impl WindingReader<'_, '_> {
    fn of(&self, key: &str) -> &TableSection<'_> {
        if self.section.has(key) {
            self.section
        } else {
            self.winding
        }
    }

    fn number(&self, key: &str, allowed: &Allowed) -> Result<f64, FileError> {
        self.of(key).number_within(key, allowed)
    }

    fn coil(&self, width_m: f64, relative_permeability: f64) -> Result<Coil, FileError> {
        let within = Allowed::new(-0.5 * width_m, 0.5 * width_m, "m");
        let inner_m = self.number("inner_radius_m", &INNER)?;
        let outer = Allowed::new(OUTER.min.max(OUTER_OVER_INNER * inner_m), OUTER.max, "m");
        Ok(Coil {
            centre_m: [
                self.section.number_within("x_m", &within)?,
                self.section.number_within("y_m", &within)?,
            ],
            winding: Winding {
                inner_m,
                outer_m: self.number("outer_radius_m", &outer)?,
                turns: self.of("turns").whole_within("turns", &TURNS)?,
                depth_m: self.number("depth_m", &DEPTH)?,
                relative_permeability,
            },
        })
    }
}

fn radius(press: &TableSection<'_>) -> Result<Radius, FileError> {
    if press.has("radius_m") {
        for key in ["least_radius_m", "greatest_radius_m"] {
            press.refuse(key, "radius_m and tolerance, or a range without them")?;
        }
        return Ok(Radius::Declared(
            press.number_within("radius_m", &RADIUS)?,
            press.number_within("tolerance", &TOLERANCE)?,
        ));
    }
    press.refuse("tolerance", "only with radius_m")?;
    let least_m = press.number_within("least_radius_m", &RADIUS)?;
    let above = Allowed::new(least_m, RADIUS.max, "m");
    let greatest_m = press.number_within("greatest_radius_m", &above)?;
    Ok(Radius::Free([least_m, greatest_m]))
}

fn noise(reading: &TableSection<'_>) -> Result<Noise, FileError> {
    if reading.has("noise_relative") {
        reading.refuse("noise_m", "one of noise_m and noise_relative")?;
        let relative = reading.number_within("noise_relative", &RELATIVE_NOISE)?;
        return Ok(Noise::Relative(relative));
    }
    Ok(Noise::Approach(reading.number_within("noise_m", &NOISE)?))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TEXT: &str = BUILTIN[0].1;

    fn refused(from: &str, to: &str) -> String {
        assert!(TEXT.contains(from), "{from}");
        let text = TEXT.replacen(from, to, 1);
        Layout::parse("mine.toml", &text).unwrap_err().to_string()
    }

    fn line_of(part: &str) -> usize {
        1 + TEXT.lines().position(|line| line.contains(part)).unwrap()
    }

    #[test]
    fn the_built_in_layouts_are_read() {
        for (name, text) in BUILTIN {
            let layout = Layout::parse(name, text).unwrap();
            assert_eq!(layout.name, name);
            assert_eq!(layout.coils.len(), if name == "seven" { 7 } else { 4 });
            let around = layout.coils.iter().filter(|coil| coil.centre_m != [0.0; 2]);
            assert_eq!(around.clone().count(), layout.coils.len() - 1);
            for coil in around {
                let [x, y] = coil.centre_m;
                assert!((x.hypot(y) - 5.6e-3).abs() < 1e-6, "{name}");
            }
        }
    }

    #[test]
    fn a_coil_may_have_keys_of_its_own() {
        let text = TEXT.replacen(
            "y_m = 0.0",
            "y_m = 0.0\nturns = 20\nouter_radius_m = 8e-3",
            1,
        );
        let layout = Layout::parse("mine.toml", &text).unwrap();
        let [first, second] = [layout.coils[0].winding, layout.coils[1].winding];
        assert_eq!((first.turns, first.outer_m), (20, 8e-3));
        assert_eq!((second.turns, second.outer_m), (10, 5e-3));
        assert_eq!(first.depth_m, second.depth_m);
    }

    #[test]
    fn a_radius_is_free_or_declared_and_a_noise_of_one_kind() {
        let declared = "radius_m = 3e-3\ntolerance = 0.1\n#";
        let text = TEXT.replace("least_radius_m = 2e-3", declared);
        let text = text.replace("greatest_radius_m = 4e-3", "#");
        let text = text.replace("noise_m = 5e-7", "noise_relative = 1e-5");
        let layout = Layout::parse("mine.toml", &text).unwrap();
        assert_eq!(layout.radius, Radius::Declared(3e-3, 0.1));
        assert_eq!(layout.noise, Noise::Relative(1e-5));
        let message = refused(
            "least_radius_m",
            "radius_m = 2e-3\ntolerance = 0.1\nleast_radius_m",
        );
        assert!(message.contains("a range without them"), "{message}");
        let message = refused("least_radius_m", "tolerance = 0.1\nleast_radius_m");
        assert!(message.contains("only with radius_m"), "{message}");
        let message = refused("noise_m", "noise_relative = 1e-6\nnoise_m");
        assert!(message.contains("one of noise_m"), "{message}");
    }

    #[test]
    fn a_refusal_names_line_key_and_range() {
        for (from, to, key, allowed) in [
            (
                "thickness_m = 5e-3",
                "thickness_m = 5",
                "layer.thickness_m",
                "0.05 m",
            ),
            (
                "poisson = 0.5",
                "poisson = 0.51",
                "layer.poisson",
                "0 to 0.5",
            ),
            (
                "turns = 10",
                "turns = 10.5",
                "winding.turns",
                "whole number, 1 to 200",
            ),
            ("turns = 10", "turn = 10", "winding.turn", "turns"),
            (
                "outer_radius_m = 5e-3",
                "outer_radius_m = 1e-3",
                "winding.outer_radius_m",
                "0.05 m",
            ),
            ("y_m = 5.6e-3", "y_m = 30e-3", "coil.y_m", "0.025 m"),
            (
                "greatest_radius_m = 4e-3",
                "greatest_radius_m = 1e-3",
                "press.greatest_radius_m",
                "0.002",
            ),
            (
                "gain_error = 0.01",
                "gain_error = nan",
                "reading.gain_error",
                "0 to 0.5",
            ),
            (
                "\"disc\"                  #",
                "\"ring\" #",
                "inside.shape",
                "\"hull\"",
            ),
        ] {
            let message = refused(from, to);
            let place = format!("mine.toml:{}: {key}: ", line_of(from));
            assert!(
                message.starts_with(&place) && message.contains(allowed),
                "{message}"
            );
        }
        assert!(refused("force_N = 1.0", "").contains("press.force_N: missing"));
    }

    /// Compares the ranges in the built-in file's comments with the ranges in force.
    #[test]
    fn the_file_states_the_ranges() {
        for (key, allowed) in [
            ("thickness_m", THICKNESS),
            ("shear_modulus_Pa", SHEAR_MODULUS),
            ("poisson", POISSON),
            ("width_m", WIDTH),
            ("relative_permeability", PERMEABILITY),
            ("inner_radius_m", INNER),
            ("turns", TURNS),
            ("depth_m", DEPTH),
            ("force_N", FORCE),
            ("least_radius_m", RADIUS),
            ("noise_m", NOISE),
            ("gain_error", GAIN_ERROR),
            ("margin_m", MARGIN),
        ] {
            let line = TEXT.lines().find(|line| line.starts_with(key)).unwrap();
            let bounds = Allowed {
                unit: "",
                ..allowed
            }
            .bounds();
            assert!(line.contains(&bounds), "{line}: {bounds}");
        }
    }

    proptest! {
        /// A file with a piece replaced is read or refused with one of its lines, and what is read is within the ranges.
        #[test]
        fn any_damage_is_read_or_refused_with_a_line(
            start in 0..TEXT.len(),
            length in 0_usize..40,
            piece in "[-a-z0-9_=.\\[\\]\"# \n]{0,12}",
        ) {
            let end = (start + length).min(TEXT.len());
            let text = format!("{}{piece}{}", &TEXT[..start], &TEXT[end..]);
            match Layout::parse("mine.toml", &text) {
                Err(error) => {
                    let lines = text.lines().count().max(1);
                    prop_assert!((1..=lines + 1).contains(&error.line), "{error}");
                    prop_assert!(!error.problem.is_empty());
                }
                Ok(layout) => {
                    prop_assert!((1e-3..=5e-2).contains(&layout.layer.thickness_m));
                    prop_assert!(layout.force_n > 0.0 && layout.gain_error >= 0.0);
                    let most_m = 0.5 * layout.width_m;
                    for coil in &layout.coils {
                        prop_assert!(coil.centre_m.iter().all(|at| at.abs() <= most_m));
                        prop_assert!(coil.winding.outer_m > coil.winding.inner_m);
                    }
                }
            }
        }
    }
}
