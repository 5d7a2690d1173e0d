//! The reference plants: stack files and the file of disturbances.
//!
//! `stacks/` has this crate's own copy of the frozen plants. Each quantity is read strictly (see
//! [`document`]) and limited to a range in which the model is valid, wider than any real sensor.

pub mod disturbances;
pub mod document;
pub mod quantity;

use core::fmt;
use std::io::Read as _;
use std::path::{Path, PathBuf};

pub use disturbances::Disturbances;
use document::{FileError, TableSection};
use quantity::{Allowed, Quantity};

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
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// Name.
    pub name: String,
    /// Spring of the sensing layer c_S, N/m, 10 to 10⁸.
    pub sensing_spring_n_per_m: Quantity,
    /// Spring of the actuated layer without current c_D0, N/m, 10 to 10⁸.
    pub actuated_spring_n_per_m: Quantity,
    /// Relative rise ε of the actuated layer's spring at the peak current, 0 to 20.
    pub stiffening_at_peak: Quantity,
    /// Field in the actuated layer at the peak current, T, 10⁻⁴ to 3.
    pub field_at_peak_t: Quantity,
    /// Field Bc of half the saturated stiffening, T, 10⁻³ to 10.
    pub field_half_t: Quantity,
    /// Attraction of the actuated layer's halves, N/A², 0 to 0.1.
    pub attraction_n_per_a2: Quantity,
    /// Apparent displacement of the sensing layer by the field at the peak current, m, 0 to 10⁻⁴.
    pub crosstalk_at_peak_m: Quantity,
    /// Peak current, A, 0.01 to 100.
    pub peak_current_a: Quantity,
    /// Resistance of the actuating coils, ohm, 10⁻³ to 10³.
    pub coil_resistance_ohm: Quantity,
    /// Inductance of the actuating coils, H, 10⁻⁷ to 1.
    pub coil_inductance_h: Quantity,
    /// Intended displacement of the sensing layer, m, 1 µm to 0.8 mm.
    pub press_depth_of_sensing_layer_m: Quantity,
}

/// A key of a stack file that denotes a quantity.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Name, ending with the unit.
    pub name: &'static str,
    /// Allowed values.
    pub allowed: Allowed,
    /// Meaning.
    pub meaning: &'static str,
}

impl Key {
    const fn new(name: &'static str, allowed: Allowed, meaning: &'static str) -> Self {
        Self {
            name,
            allowed,
            meaning,
        }
    }

    fn read(&self, section: &mut TableSection<'_>) -> Result<Quantity, FileError> {
        section.quantity(self.name, &self.allowed)
    }
}

const SENSING_SPRING: Key = Key::new(
    "sensing_spring_N_per_m",
    Allowed::new(10.0, 1e8, "N/m"),
    "spring constant of the sensing layer, c_S",
);
const ACTUATED_SPRING: Key = Key::new(
    "actuated_spring_N_per_m",
    Allowed::new(10.0, 1e8, "N/m"),
    "spring constant of the actuated layer without current, c_D0",
);
const STIFFENING: Key = Key::new(
    "stiffening_at_peak",
    Allowed::new(0.0, 20.0, ""),
    "relative rise of c_D at the peak current, eps; between, it rises as B^2/(B^2 + Bc^2)",
);
const FIELD_AT_PEAK: Key = Key::new(
    "field_at_peak_T",
    Allowed::new(1e-4, 3.0, "T"),
    "flux density B in the actuated layer at the peak current",
);
const FIELD_HALF: Key = Key::new(
    "field_half_T",
    Allowed::new(1e-3, 10.0, "T"),
    "flux density Bc at which half of the saturated rise is reached",
);
const ATTRACTION: Key = Key::new(
    "attraction_N_per_A2",
    Allowed::new(0.0, 0.1, "N/A^2"),
    "attraction of the actuated layer's halves, per square of the current",
);
const CROSSTALK: Key = Key::new(
    "crosstalk_at_peak_m",
    Allowed::new(0.0, 1e-4, "m"),
    "apparent deformation of the sensing layer by the coil's field at the peak current",
);
const PEAK_CURRENT: Key = Key::new(
    "peak_current_A",
    Allowed::new(0.01, 100.0, "A"),
    "current from which the ramps of a train fall",
);
const COIL_RESISTANCE: Key = Key::new(
    "coil_resistance_ohm",
    Allowed::new(1e-3, 1e3, "ohm"),
    "resistance of the drive coil",
);
const COIL_INDUCTANCE: Key = Key::new(
    "coil_inductance_H",
    Allowed::new(1e-7, 1.0, "H"),
    "inductance L of the drive coil",
);
const PRESS_DEPTH: Key = Key::new(
    "press_depth_of_sensing_layer_m",
    Allowed::new(1e-6, 0.8e-3, "m"),
    "working depth of the sensing layer",
);

impl Stack {
    /// Keys of a stack file, besides `name`.
    pub const KEYS: [Key; 11] = [
        SENSING_SPRING,
        ACTUATED_SPRING,
        STIFFENING,
        FIELD_AT_PEAK,
        FIELD_HALF,
        ATTRACTION,
        CROSSTALK,
        PEAK_CURRENT,
        COIL_RESISTANCE,
        COIL_INDUCTANCE,
        PRESS_DEPTH,
    ];
    /// Names of the stacks in this crate.
    pub const BUILTIN: [&'static str; 3] = ["paper", "soft-closed", "ultrasoft"];

    /// One of [`Stack::BUILTIN`].
    ///
    /// # Errors
    /// [`FileError`] for any other name.
    pub fn builtin(name: &str) -> Result<Self, FileError> {
        match name {
            "paper" => Self::parse("paper.toml", include_str!("../../stacks/paper.toml")),
            "soft-closed" => Self::parse(
                "soft-closed.toml",
                include_str!("../../stacks/soft-closed.toml"),
            ),
            "ultrasoft" => Self::parse(
                "ultrasoft.toml",
                include_str!("../../stacks/ultrasoft.toml"),
            ),
            _ => Err(FileError {
                file: format!("{name}.toml"),
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
        let names = Self::KEYS.map(|key| key.name);
        let names: Vec<&str> = core::iter::once("name").chain(names).collect();
        let mut s = TableSection::parse(file, text, &names)?;
        let allowed = Self::KEYS.map(|key| (key.name, key.allowed.to_string()));
        let name = ("name", "a text".to_owned());
        s.require(&[&[name], &allowed[..]].concat(), TEMPLATE)?;
        Ok(Self {
            name: s.text("name")?,
            sensing_spring_n_per_m: SENSING_SPRING.read(&mut s)?,
            actuated_spring_n_per_m: ACTUATED_SPRING.read(&mut s)?,
            stiffening_at_peak: STIFFENING.read(&mut s)?,
            field_at_peak_t: FIELD_AT_PEAK.read(&mut s)?,
            field_half_t: FIELD_HALF.read(&mut s)?,
            attraction_n_per_a2: ATTRACTION.read(&mut s)?,
            crosstalk_at_peak_m: CROSSTALK.read(&mut s)?,
            peak_current_a: PEAK_CURRENT.read(&mut s)?,
            coil_resistance_ohm: COIL_RESISTANCE.read(&mut s)?,
            coil_inductance_h: COIL_INDUCTANCE.read(&mut s)?,
            press_depth_of_sensing_layer_m: PRESS_DEPTH.read(&mut s)?,
        })
    }

    /// Quantities, in the order of [`Stack::KEYS`].
    #[must_use]
    pub const fn quantities(&self) -> [Quantity; 11] {
        [
            self.sensing_spring_n_per_m,
            self.actuated_spring_n_per_m,
            self.stiffening_at_peak,
            self.field_at_peak_t,
            self.field_half_t,
            self.attraction_n_per_a2,
            self.crosstalk_at_peak_m,
            self.peak_current_a,
            self.coil_resistance_ohm,
            self.coil_inductance_h,
            self.press_depth_of_sensing_layer_m,
        ]
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
