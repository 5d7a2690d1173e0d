//! The reference plants: stack files and the file of disturbances.
//!
//! `stacks/` has this crate's own copy of the frozen plants. Each quantity is read strictly (see
//! [`document`]) and limited to a range in which the model is valid, wider than any real sensor.

pub mod disturbances;
pub mod document;
mod key;
pub mod quantity;

use core::fmt;
use std::io::Read as _;
use std::path::{Path, PathBuf};

pub use disturbances::Disturbances;
use document::{FileError, Table, TableSection};
pub use key::Key;
use key::table;

table! {
    /// A kind of sensor: its nominal values and the spread between single sensors.
    ///
    /// ```
    /// use palpate_sim::stack::Stack;
    ///
    /// let stack = Stack::builtin("ultrasoft")?;
    /// assert_eq!(stack.sensing_spring_n_per_m.centre(), 6e3);
    ///
    /// let error = Stack::parse("my.toml", "name = \"x\"\nsensing_spring = 6e3\n").unwrap_err();
    /// assert!(error.to_string().starts_with("my.toml:2: sensing_spring: unknown key"));
    /// # Ok::<(), palpate_sim::stack::document::FileError>(())
    /// ```
    Stack {
        /// Name.
        name: String = "name", TableSection::text;
        sensing_spring_n_per_m = "sensing_spring_N_per_m", 10.0 to 1e8 "N/m",
            "spring constant of the sensing layer, c_S";
        actuated_spring_n_per_m = "actuated_spring_N_per_m", 10.0 to 1e8 "N/m",
            "spring constant of the actuated layer without current, c_D0";
        stiffening_at_peak = "stiffening_at_peak", 0.0 to 20.0 "",
            "relative rise of c_D at the peak current, eps; at smaller currents the rise is proportional to B^2/(B^2 + Bc^2)";
        field_at_peak_t = "field_at_peak_T", 1e-4 to 3.0 "T",
            "flux density B in the actuated layer at the peak current";
        field_half_t = "field_half_T", 1e-3 to 10.0 "T",
            "flux density Bc at which half of the saturated rise is reached";
        attraction_n_per_a2 = "attraction_N_per_A2", 0.0 to 0.1 "N/A^2",
            "attraction of the actuated layer's halves, per square of the current";
        crosstalk_at_peak_m = "crosstalk_at_peak_m", 0.0 to 1e-4 "m",
            "apparent deformation of the sensing layer by the coil's field at the peak current";
        peak_current_a = "peak_current_A", 0.01 to 100.0 "A",
            "current from which the ramps of a train fall";
        coil_resistance_ohm = "coil_resistance_ohm", 1e-3 to 1e3 "ohm",
            "resistance of the drive coil";
        coil_inductance_h = "coil_inductance_H", 1e-7 to 1.0 "H",
            "inductance L of the drive coil";
        press_depth_of_sensing_layer_m = "press_depth_of_sensing_layer_m", 1e-6 to 0.8e-3 "m",
            "working depth of the sensing layer";
    }
}

impl Stack {
    /// Names of the stacks in this crate.
    pub const BUILTIN: [&'static str; 3] = ["paper", "soft-closed", "ultrasoft"];

    /// The stack of this name, one of [`Stack::BUILTIN`].
    ///
    /// # Errors
    /// [`FileError`] for any other name.
    pub fn builtin(name: &str) -> Result<Self, FileError> {
        let texts = [
            include_str!("../../stacks/paper.toml"),
            include_str!("../../stacks/soft-closed.toml"),
            include_str!("../../stacks/ultrasoft.toml"),
        ];
        let file = format!("{name}.toml");
        match Self::BUILTIN.iter().zip(texts).find(|(of, _)| **of == name) {
            Some((_, text)) => Self::parse(&file, text),
            None => Err(FileError {
                file,
                line: 1,
                key: String::new(),
                problem: format!("there is no built-in stack {name:?}"),
                allowed: names(),
            }),
        }
    }

    /// A stack by its name: one of [`Stack::BUILTIN`], or a file in `folder` if the name ends in
    /// `.toml`.
    ///
    /// # Errors
    /// [`LoadError`] for a name that is neither, or a file that cannot be read or is refused.
    pub fn named(name: &str, folder: &Path) -> Result<Self, LoadError> {
        if is_file(name) {
            return Self::load(&folder.join(name));
        }
        Ok(Self::builtin(name)?)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`LoadError`] if it cannot be read or is refused.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let text = read(path)?;
        Ok(Self::parse(&path.display().to_string(), &text)?)
    }

    /// Parses a text; `file` appears only in messages.
    ///
    /// # Errors
    /// [`FileError`] names line, key and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let table = TableSection::parse(file, text, Self::NAMES)?;
        table.require(Self::NAMES, TEMPLATE)?;
        Self::read(&table)
    }

    /// Text of the stack's file, with the meaning, unit and range of each key.
    #[must_use]
    pub fn file(&self) -> String {
        let name = self.name.replace('\\', "\\\\").replace('"', "\\\"");
        let mut text = format!("{HEADING}\nname = \"{name}\"\n");
        for (key, quantity) in Self::KEYS.iter().zip(self.quantities()) {
            text += &format!(
                "\n# {}: {}\n{} = {quantity}\n",
                key.meaning,
                key.allowed.bounds(),
                key.name
            );
        }
        text
    }
}

/// Heading of a stack file.
const HEADING: &str = "\
# A kind of sensor. A number is the same for all sensors of the kind, single sensors are drawn from a \
range:
# { nominal, spread } evenly within nominal * (1 +- spread), { min, max } evenly, { log_min, log_max } evenly in the
# logarithm.
";
/// Hint where to find a whole file.
const TEMPLATE: &str = "`palpate stack show ultrasoft` prints a whole file";

/// Error of loading a file.
#[derive(Debug)]
pub enum LoadError {
    /// The file cannot be read.
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The content is refused.
    Refused(FileError),
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read { path, source } => write!(f, "{}: {source}", path.display()),
            Self::Refused(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for LoadError {}

impl From<FileError> for LoadError {
    fn from(error: FileError) -> Self {
        Self::Refused(error)
    }
}

fn is_file(name: &str) -> bool {
    let ending = Path::new(name).extension();
    ending.is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Valid names of a stack, for messages.
pub(crate) fn names() -> String {
    format!(
        "{}, or a file that ends in .toml",
        Stack::BUILTIN.join(", ")
    )
}

/// Returns a valid stack name, or a message.
pub(crate) fn checked_name(name: &str) -> Result<String, String> {
    if is_file(name) || Stack::BUILTIN.contains(&name) {
        return Ok(name.to_owned());
    }
    Err(format!("there is no built-in stack {name:?}"))
}

/// Size limit of a stack or scenario file, bytes: a thousand times a usual one.
const MOST_BYTES: u64 = 2_000_000;

/// Reads a text file of at most `MOST_BYTES`: a device file may never end.
pub(crate) fn read(path: &Path) -> Result<String, LoadError> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path);
    file.and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|source| LoadError::Read {
            path: path.to_owned(),
            source,
        })?;
    let name = path.display().to_string();
    if bytes.len() as u64 > MOST_BYTES {
        return Err(LoadError::Refused(FileError {
            file: name,
            line: 1,
            key: String::new(),
            problem: "is too large".to_owned(),
            allowed: format!("a file of at most {MOST_BYTES} bytes"),
        }));
    }
    Ok(document::text_of(&name, bytes)?)
}
