//! The reference plants: stack files and the file of disturbances.
//!
//! `stacks/` holds this crate's own copy of the frozen plants. Each quantity is read strictly (see
//! [`document`]) and limited to a range in which the model makes sense, wider than any real sensor.

pub mod disturbances;
pub mod document;
pub mod quantity;

use core::fmt;
use std::path::{Path, PathBuf};

pub use disturbances::Disturbances;
use document::{FileError, TableSection};
use quantity::{Allowed, Quantity};

/// A kind of sensor: its nominal values and how far single sensors differ.
///
/// ```
/// use palpate_sim::stack::Stack;
///
/// let stack = Stack::builtin("ultrasoft")?;
/// assert_eq!(stack.sensing_spring_n_per_m.centre(), 6e3);
///
/// let text = "name = \"x\"\nsensing_spring_N_per_m = -5\n";
/// let error = Stack::parse("my.toml", text).unwrap_err();
/// assert!(error.to_string().starts_with(
///     "my.toml:2: sensing_spring_N_per_m: -5 is out of range; allowed: 10 to 1e8 N/m"
/// ));
/// # Ok::<(), palpate_sim::stack::document::FileError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// What it is called.
    pub name: String,
    /// Spring of the sensing layer c_S, N/m, 10 to 10⁸.
    pub sensing_spring_n_per_m: Quantity,
    /// Spring of the actuated layer without current c_D0, N/m, 10 to 10⁸.
    pub actuated_spring_n_per_m: Quantity,
    /// Relative rise of that spring at the peak current, ε, 0 to 20.
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
    /// How far the sensing layer is meant to be pressed, m, 1 µm to 0.8 mm.
    pub press_depth_of_sensing_layer_m: Quantity,
}

/// Keys of a stack file.
const KEYS: [&str; 12] = [
    "name",
    "sensing_spring_N_per_m",
    "actuated_spring_N_per_m",
    "stiffening_at_peak",
    "field_at_peak_T",
    "field_half_T",
    "attraction_N_per_A2",
    "crosstalk_at_peak_m",
    "peak_current_A",
    "coil_resistance_ohm",
    "coil_inductance_H",
    "press_depth_of_sensing_layer_m",
];

const SPRING: Allowed = Allowed::new(10.0, 1e8, "N/m");

impl Stack {
    /// Names of the stacks that come with the crate.
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
                allowed: format!("{}, or a file that ends in .toml", Self::BUILTIN.join(", ")),
            }),
        }
    }

    /// A stack by its name: one of [`Stack::BUILTIN`], or a file in `folder` if the name ends in
    /// `.toml`.
    ///
    /// # Errors
    /// [`LoadError`] for a name that is neither, or a file that cannot be read or is refused.
    pub fn named(name: &str, folder: &Path) -> Result<Self, LoadError> {
        let is_file = Path::new(name)
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
        if is_file {
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

    /// Reads a text; `file` is only for messages.
    ///
    /// # Errors
    /// [`FileError`] names line, key and what is allowed.
    pub fn parse(file: &str, text: &str) -> Result<Self, FileError> {
        let mut s = TableSection::parse(file, text, &KEYS)?;
        Ok(Self {
            name: s.text("name")?,
            sensing_spring_n_per_m: s.quantity("sensing_spring_N_per_m", &SPRING)?,
            actuated_spring_n_per_m: s.quantity("actuated_spring_N_per_m", &SPRING)?,
            stiffening_at_peak: s.quantity("stiffening_at_peak", &Allowed::new(0.0, 20.0, ""))?,
            field_at_peak_t: s.quantity("field_at_peak_T", &Allowed::new(1e-4, 3.0, "T"))?,
            field_half_t: s.quantity("field_half_T", &Allowed::new(1e-3, 10.0, "T"))?,
            attraction_n_per_a2: s
                .quantity("attraction_N_per_A2", &Allowed::new(0.0, 0.1, "N/A^2"))?,
            crosstalk_at_peak_m: s
                .quantity("crosstalk_at_peak_m", &Allowed::new(0.0, 1e-4, "m"))?,
            peak_current_a: s.quantity("peak_current_A", &Allowed::new(0.01, 100.0, "A"))?,
            coil_resistance_ohm: s
                .quantity("coil_resistance_ohm", &Allowed::new(1e-3, 1e3, "ohm"))?,
            coil_inductance_h: s.quantity("coil_inductance_H", &Allowed::new(1e-7, 1.0, "H"))?,
            press_depth_of_sensing_layer_m: s.quantity(
                "press_depth_of_sensing_layer_m",
                &Allowed::new(1e-6, 0.8e-3, "m"),
            )?,
        })
    }
}

/// Why a file could not be loaded.
#[derive(Debug)]
pub enum LoadError {
    /// The file cannot be read.
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What is in it is refused.
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

pub(crate) fn read(path: &Path) -> Result<String, LoadError> {
    std::fs::read_to_string(path).map_err(|source| LoadError::Read {
        path: path.to_owned(),
        source,
    })
}
