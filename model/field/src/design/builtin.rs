//! The built-in designs.

use super::{Design, DesignError};

/// Names of the built-in designs.
///
/// All but the last, `closed`, are the cases of the sensor's paper, read from its table and text.
/// The stack `closed` measures stiffness better.
pub const BUILTIN: [&str; 14] = [
    "air",
    "A",
    "A0",
    "A10",
    "B1",
    "B2",
    "B3",
    "C1in",
    "C1out",
    "C3in",
    "CAin",
    "backplates",
    "pot",
    "closed",
];

/// Names of built-in designs with a sensing coil, for alternating fields: the sensing coil alone
/// between its slabs, and the sensing coil above the stacks `A` and `closed`. Each has a copper
/// plane that does not conduct until its material's conductivity is set.
pub const WITH_SENSING_COIL: [&str; 3] = ["sensing", "A-sensing", "closed-sensing"];

/// Names of built-in designs with magnets only: a pot magnet above a plate.
pub const WITH_MAGNETS: [&str; 1] = ["holder"];

/// Names of all built-in designs.
#[must_use]
pub fn builtin_names() -> Vec<&'static str> {
    [&BUILTIN[..], &WITH_SENSING_COIL, &WITH_MAGNETS].concat()
}

/// Text of a built-in design; `None` for an unknown name.
#[must_use]
pub fn builtin_text(name: &str) -> Option<&'static str> {
    Some(match name {
        "air" => include_str!("../../designs/air.toml"),
        "A" => include_str!("../../designs/A.toml"),
        "A0" => include_str!("../../designs/A0.toml"),
        "A10" => include_str!("../../designs/A10.toml"),
        "B1" => include_str!("../../designs/B1.toml"),
        "B2" => include_str!("../../designs/B2.toml"),
        "B3" => include_str!("../../designs/B3.toml"),
        "C1in" => include_str!("../../designs/C1in.toml"),
        "C1out" => include_str!("../../designs/C1out.toml"),
        "C3in" => include_str!("../../designs/C3in.toml"),
        "CAin" => include_str!("../../designs/CAin.toml"),
        "backplates" => include_str!("../../designs/backplates.toml"),
        "pot" => include_str!("../../designs/pot.toml"),
        "closed" => include_str!("../../designs/closed.toml"),
        "sensing" => include_str!("../../designs/sensing.toml"),
        "A-sensing" => include_str!("../../designs/A-sensing.toml"),
        "closed-sensing" => include_str!("../../designs/closed-sensing.toml"),
        "holder" => include_str!("../../designs/holder.toml"),
        _ => return None,
    })
}

/// Reads a built-in design.
///
/// # Errors
/// [`DesignError`] for any name that is not in [`builtin_names`].
pub fn builtin(name: &str) -> Result<Design, DesignError> {
    match builtin_text(name) {
        Some(text) => Design::parse(&format!("{name}.toml"), text),
        None => Err(DesignError {
            file: format!("{name}.toml"),
            line: 1,
            place: String::new(),
            problem: format!("there is no built-in design {name:?}"),
            allowed: builtin_names().join(", "),
        }),
    }
}
