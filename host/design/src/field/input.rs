//! Designs and settings from the command line.

use std::io::{self, Write};
use std::path::Path;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice::say;
use palpate_cli::quantity::within;
use palpate_cli::text;
use palpate_field::design::{Design, DesignError, builtin_names, builtin_text, vary};
use palpate_field::geometry::Point;
use palpate_field::solve::{Accuracy, Solved};

/// Print a built-in design, to start an own one from
#[derive(Args)]
pub(super) struct Show {
    /// Its name
    name: String,
}

pub(super) fn show(arguments: &Show) -> Result<(), Failure> {
    let (_, text) = text_of(&arguments.name)?;
    Ok(io::stdout().lock().write_all(text.as_bytes())?)
}

/// A design, numbers to change in it, and how accurately to solve it.
#[derive(Args, Clone)]
pub(super) struct DesignSource {
    /// File, or name of a built-in design
    pub(super) design: String,
    #[command(flatten)]
    pub(super) effort: Effort,
}

/// What goes with every design of a command.
#[derive(Args, Clone)]
pub(super) struct Effort {
    /// Change a number of the design, as in parameters.gap=4 or body.mse.shape.semi_r=12
    #[arg(long = "set", value_name = "PATH=NUMBER", value_parser = setting)]
    pub(super) settings: Vec<(String, f64)>,
    /// Relative error of centre and core mean to reach
    #[arg(long, default_value_t = 1e-4, value_parser = within(1e-8, 0.1, ""))]
    accuracy: f64,
    /// Order of the elements, 2 to 5
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(2..=5))]
    order: u32,
}

impl Effort {
    pub(super) fn accuracy(&self) -> Accuracy {
        Accuracy {
            relative: self.accuracy,
            order: self.order,
            ..Accuracy::default()
        }
    }

    /// Returns the effort with the accuracy `relative`, or with its own if that is coarser.
    pub(super) fn at_most_accurate(&self, relative: f64) -> Self {
        Self {
            accuracy: self.accuracy.max(relative),
            ..self.clone()
        }
    }
}

fn setting(text: &str) -> Result<(String, f64), String> {
    let (path, value) = text.split_once('=').ok_or("allowed: PATH=NUMBER")?;
    let value: f64 = value
        .trim()
        .parse()
        .map_err(|_| format!("{value:?} is not a number"))?;
    Ok((path.trim().to_owned(), value))
}

/// Parses a positive current, A.
pub(super) fn current(text: &str) -> Result<f64, String> {
    within(1e-6, 1e6, "A")(text)
}

/// Returns name and text of a design.
pub(super) fn text_of(name: &str) -> Result<(String, String), Failure> {
    if let Some(text) = builtin_text(name) {
        return Ok((format!("{name}.toml"), text.to_owned()));
    }
    if !Path::new(name).exists() && !name.contains(['.', '/', '\\']) {
        return Err(Failure::Input {
            file: name.into(),
            line: 1,
            problem: format!("there is neither a file nor a built-in design {name:?}"),
            allowed: format!("a file, or {}", builtin_names().join(", ")),
        });
    }
    Ok((name.to_owned(), text_of_file(name)?))
}

/// Largest size of a design file, bytes: a thousand times a built-in design.
const MOST_BYTES: u64 = 2_000_000;

/// Reads the text of a file. Refuses pipes and devices, which may never end, and files too large
/// for a design.
pub(super) fn text_of_file(name: &str) -> Result<String, Failure> {
    let unreadable = |reason: io::Error| Failure::Unreadable {
        file: name.into(),
        reason,
    };
    let data = std::fs::metadata(name).map_err(unreadable)?;
    if data.is_dir() || (data.is_file() && data.len() <= MOST_BYTES) {
        return text::of_file(name.as_ref());
    }
    Err(Failure::Input {
        file: name.into(),
        line: 1,
        problem: "is not a regular file, or too large".to_owned(),
        allowed: format!("a file of at most {MOST_BYTES} bytes"),
    })
}

/// Parses a design and applies settings to its numbers.
pub(super) fn parse(name: &str, text: &str, settings: &[(String, f64)]) -> Result<Design, Failure> {
    // Parses the unchanged text first, so that errors refer to lines that the user can find.
    let design = Design::parse(name, text).map_err(refused)?;
    if settings.is_empty() {
        return Ok(design);
    }
    let text = vary::set(text, settings).map_err(|problem| Failure::Input {
        file: name.into(),
        line: 1,
        problem,
        allowed: "a path to a number, as in parameters.gap or body.mse.shape.semi_r".to_owned(),
    })?;
    // The changed text keeps the user's lines.
    Design::parse(name, &text).map_err(|mut error| {
        let changes = settings
            .iter()
            .map(|(path, value)| format!("{path}={value}"));
        let changes: Vec<String> = changes.collect();
        error
            .problem
            .push_str(&format!(", with {}", changes.join(" ")));
        refused(error)
    })
}

fn refused(error: DesignError) -> Failure {
    let place = if error.place.is_empty() {
        String::new()
    } else {
        format!("{}: ", error.place)
    };
    Failure::Input {
        file: error.file.into(),
        line: error.line as u64,
        problem: format!("{place}{}", error.problem),
        allowed: if error.allowed.is_empty() {
            "what the message says".to_owned()
        } else {
            error.allowed
        },
    }
}

/// Prints the files that a design names, with sizes and units, on standard error.
pub(super) fn say_files(design: &Design) {
    for file in &design.files {
        say(format!("read of {file}"));
    }
}

impl DesignSource {
    /// Loads the design and prints the files that it names on standard error.
    pub(super) fn load(&self) -> Result<Design, Failure> {
        let design = self.load_silently()?;
        say_files(&design);
        Ok(design)
    }

    pub(super) fn load_silently(&self) -> Result<Design, Failure> {
        let (name, text) = text_of(&self.design)?;
        parse(&name, &text, &self.effort.settings)
    }
}

/// Allowed refinement error at the points of profiles and drawings, over the accuracy of centre and
/// core mean: 2e-3 at 1e-4. The error stated for these points is five times the refinement error;
/// the greatest error found is 1.8 times the refinement error (docs/evidence/field-accuracy.md).
const SHARP: f64 = 20.0;

/// Refines the mesh of a solved field at these points.
pub(super) fn sharpened(
    design: &Design,
    solved: Solved,
    points: &[Point],
    effort: &Effort,
) -> Result<Solved, Failure> {
    let sharpened = solved.sharpened(design, points, SHARP * effort.accuracy);
    sharpened.map_err(|error| Failure::Refused(format!("{}: {error}", design.name)))
}
