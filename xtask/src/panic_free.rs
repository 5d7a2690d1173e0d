//! No panic path: a program that calls every method is linked for the least capable core, and must
//! contain no part of the panic machinery.
//!
//! The positive control is the same program with a planted panic, which must be found.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::process::{Invocation, Workspace};

/// Target for which the program is linked.
pub(crate) const TARGET: &str = "thumbv6m-none-eabi";

/// Example that is linked: it calls every public method of the driver.
const PROGRAM: &str = "every_method";
/// Package of the example.
const PACKAGE: &str = "ldc161x";
/// Folder of the memory map.
const FOLDER: &str = "drivers/ldc161x/examples";

/// Parts of names by which all panic functions are found, in either mangling scheme.
const MACHINERY: &[&str] = &[
    "9panicking",
    "expect_failed",
    "unwrap_failed",
    "begin_unwind",
];

/// Runs the check of the step `panic-free`.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let found = machinery(&link(workspace, false)?)?;
    if !found.is_empty() {
        bail!("the panic machinery is reachable: {}", found.join(", "));
    }
    if machinery(&link(workspace, true)?)?.is_empty() {
        bail!("the planted panic was not found, so that finding none shows nothing");
    }
    Ok(format!(
        "{PACKAGE} linked for {TARGET} without a panic; a planted one is found"
    ))
}

/// Links the program as a firmware image and returns its path.
fn link(workspace: &Workspace, planted: bool) -> Result<PathBuf> {
    let mut arguments = vec!["rustc", "--locked", "--release", "--quiet"];
    arguments.extend(["--package", PACKAGE, "--example", PROGRAM]);
    arguments.extend(["--target", TARGET]);
    // One unit with link-time optimisation, as firmware is built: only reachable code remains.
    arguments.extend(["--config", "profile.release.lto=\"fat\""]);
    arguments.extend(["--config", "profile.release.codegen-units=1"]);
    arguments.extend(["--message-format", "json-render-diagnostics"]);
    arguments.extend(["--", "-C", "link-arg=-Tlink.x"]);
    let folder = workspace.root().join(FOLDER);
    let folder = format!("link-arg=-L{}", folder.display());
    arguments.extend(["-C", &folder]);
    if planted {
        arguments.extend(["--cfg", "planted_panic"]);
    }
    workspace.build(&Invocation::cargo(&arguments))
}

/// Names of the panic machinery in an image's symbol table.
fn machinery(image: &PathBuf) -> Result<Vec<&'static str>> {
    let bytes = fs::read(image).with_context(|| format!("{} cannot be read", image.display()))?;
    let holds = |name: &str| {
        bytes
            .windows(name.len())
            .any(|window| window == name.as_bytes())
    };
    if !holds("exercise") && !holds("main") {
        bail!("{} has no table of symbols", image.display());
    }
    Ok(MACHINERY
        .iter()
        .copied()
        .filter(|name| holds(name))
        .collect())
}
