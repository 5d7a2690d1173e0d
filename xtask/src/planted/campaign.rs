//! The campaign `planted-defects`: plants each defect of the tests' list and runs the tests that
//! must find it.

use anyhow::{Result, bail};

use super::{Patch, copy, list};
use crate::evidence::{BEGIN, END};
use crate::process::{Invocation, Workspace};

/// List of the defects.
pub(super) const LIST: &str = "tests/planted-defects.toml";
/// Folder of the copy of the sources, and of the copy's build.
const SOURCE: &str = "target/planted-defects/source";
const BUILD: &str = "target/planted-defects/build";

/// Tries every defect and prints the tests that found it; fails if one is not found.
pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let defects = list(workspace, LIST)?;
    let count = defects.len();
    let mut missed = Vec::new();
    for defect in defects {
        let red = try_out(workspace, &defect)?;
        let tests = if red.is_empty() {
            "NOT FOUND".to_owned()
        } else {
            red.join(", ")
        };
        println!(
            "{}, `cargo test {}`: {tests}",
            defect.name,
            defect.test.join(" ")
        );
        if red.is_empty() {
            missed.push(defect.name);
        }
    }
    println!(
        "{BEGIN}\n{} of {count} planted defects turn a test red.\n{END}",
        count - missed.len()
    );
    if missed.is_empty() {
        return Ok(());
    }
    bail!("no test found: {}", missed.join(", "))
}

/// Plants a defect and runs its tests; returns the names of the failed tests.
fn try_out(workspace: &Workspace, defect: &Patch) -> Result<Vec<String>> {
    let folder = workspace.root().join(SOURCE);
    copy(workspace, std::slice::from_ref(defect), &folder)?;
    let build = workspace.root().join(BUILD);
    let build = build.to_string_lossy();
    let mut arguments = vec!["test", "--locked", "--target-dir", &build];
    arguments.extend(defect.test.iter().map(String::as_str));
    let test = Invocation::cargo(&arguments);
    let output = test.command(&workspace.copied_to(folder)).output()?;
    let printed = String::from_utf8_lossy(&output.stdout);
    let red: Vec<_> = printed
        .lines()
        .filter_map(|line| line.strip_prefix("test ")?.strip_suffix(" ... FAILED"))
        .map(str::to_owned)
        .collect();
    if red.is_empty() && !output.status.success() {
        // The defect did not compile: it shows nothing about the tests.
        let said = String::from_utf8_lossy(&output.stderr);
        bail!("{}: {said}", defect.name);
    }
    Ok(red)
}
