//! Python programs from elsewhere, in environments of their own.

use std::path::Path;
use std::process::Command;

use palpate_cli::failure::Failure;

use crate::tool;

/// Creates a virtual environment in a folder, with these packages, and returns its Python.
pub(crate) fn with_packages(folder: &Path, packages: &[&str]) -> Result<String, Failure> {
    let environment = folder.join("venv");
    let python = environment.join("bin/python");
    if !python.exists() {
        tool::printed(
            Command::new("python3")
                .args(["-m", "venv"])
                .arg(&environment),
        )?;
    }
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet"]);
    tool::printed(install.args(packages))?;
    Ok(python.to_string_lossy().into_owned())
}
