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

/// A crate, with its example that calls every public method.
const PROGRAMS: &[(&str, &str)] = &[("ldc161x", "every_method")];

/// Parts of names by which all panic functions are found, in either mangling scheme.
const MACHINERY: &[&str] = &[
    "9panicking",
    "expect_failed",
    "unwrap_failed",
    "begin_unwind",
];

/// Runs the check of the step `panic-free`.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    for (package, example) in PROGRAMS {
        let found = machinery(&link(workspace, package, example, false)?)?;
        if !found.is_empty() {
            bail!(
                "{package}: the panic machinery is reachable: {}",
                found.join(", ")
            );
        }
        if machinery(&link(workspace, package, example, true)?)?.is_empty() {
            bail!("{package}: the planted panic was not found, so that finding none shows nothing");
        }
    }
    Ok(format!(
        "{} linked for {TARGET} without a panic; a planted one is found",
        PROGRAMS.len()
    ))
}

/// Links an example as a firmware image and returns its path.
fn link(workspace: &Workspace, package: &str, example: &str, planted: bool) -> Result<PathBuf> {
    let mut arguments = vec!["rustc", "--locked", "--release", "--quiet"];
    arguments.extend([
        "--package",
        package,
        "--example",
        example,
        "--target",
        TARGET,
    ]);
    // One unit with link-time optimisation, as firmware is built: only reachable code remains.
    arguments.extend(["--config", "profile.release.lto=\"fat\""]);
    arguments.extend(["--config", "profile.release.codegen-units=1"]);
    arguments.extend(["--message-format", "json-render-diagnostics"]);
    arguments.extend(["--", "-C", "link-arg=-Tlink.x"]);
    let folder = format!("link-arg=-L{}", examples(workspace, package)?.display());
    arguments.extend(["-C", &folder]);
    if planted {
        arguments.extend(["--cfg", "planted_panic"]);
    }
    workspace.build(&Invocation::cargo(&arguments))
}

/// Folder of a driver's examples, with the memory map.
fn examples(workspace: &Workspace, package: &str) -> Result<PathBuf> {
    let folder = workspace
        .root()
        .join("drivers")
        .join(package)
        .join("examples");
    if folder.join("board-memory.x").is_file() {
        Ok(folder)
    } else {
        bail!("{} holds no board-memory.x", folder.display())
    }
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
