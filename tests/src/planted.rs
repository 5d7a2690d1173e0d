//! Tests of the tests: defects that are planted into the sources one at a time, each of which has
//! to turn the named tests red. The list is `planted-defects.toml` beside this crate's manifest.

use serde::Deserialize;

/// The list, as committed.
pub const LIST: &str = include_str!("../planted-defects.toml");

/// A defect to be planted.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Defect {
    /// What is wrong with it, in words.
    pub name: String,
    /// The source file, from the root of the workspace.
    pub file: String,
    /// Text that stands there exactly once.
    pub find: String,
    /// What stands there instead.
    pub replace: String,
    /// Arguments of `cargo test` that have to end in failing tests.
    pub test: Vec<String>,
}

#[derive(Deserialize)]
struct List {
    defect: Vec<Defect>,
}

/// Reads a list.
///
/// # Errors
///
/// What is wrong with it, and where.
pub fn parse(list: &str) -> Result<Vec<Defect>, String> {
    toml::from_str::<List>(list)
        .map(|list| list.defect)
        .map_err(|error| error.to_string())
}

impl Defect {
    /// The source with the defect planted.
    ///
    /// # Errors
    ///
    /// When the text to be replaced does not stand there exactly once.
    pub fn plant(&self, source: &str) -> Result<String, String> {
        match source.matches(&self.find).count() {
            1 => Ok(source.replace(&self.find, &self.replace)),
            count => Err(format!(
                "{}: `{}` stands {count} times in {}",
                self.name, self.find, self.file
            )),
        }
    }
}
