//! Plants each defect of `planted-defects.toml` in a copy of the workspace and runs the tests
//! that have to find it.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use system_tests::{
    evidence::conclude,
    planted::{Defect, LIST, parse},
};

fn main() -> ExitCode {
    match run() {
        Ok((text, holds)) => conclude(&text, holds),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(String, bool), String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let copy = tempfile::tempdir().map_err(|error| format!("no folder to work in: {error}"))?;
    copy_workspace(&root, copy.path())?;
    let mut text = String::from("| planted defect | found by | red tests |\n|---|---|---|\n");
    let mut holds = true;
    for defect in parse(LIST)? {
        let red = try_out(&defect, copy.path())?;
        eprintln!(
            "{}: {}",
            defect.name,
            if red.is_empty() { "NOT FOUND" } else { "found" }
        );
        holds &= !red.is_empty();
        let tests = if red.is_empty() {
            "**none**".into()
        } else {
            red.join(", ")
        };
        text.push_str(&format!(
            "| {} | `cargo test {}` | {tests} |\n",
            defect.name,
            defect.test.join(" ")
        ));
    }
    Ok((text, holds))
}

/// Copies what git tracks or would track.
fn copy_workspace(root: &Path, to: &Path) -> Result<(), String> {
    let listing = Command::new("git")
        .args([
            "ls-files",
            "--cached",
            "--others",
            "--exclude-standard",
            "-z",
        ])
        .current_dir(root)
        .output()
        .map_err(|error| format!("git ls-files: {error}; install git"))?;
    for file in listing
        .stdout
        .split(|byte| *byte == 0)
        .filter(|name| !name.is_empty())
    {
        let name = PathBuf::from(String::from_utf8_lossy(file).into_owned());
        let (source, target) = (root.join(&name), to.join(&name));
        if !source.is_file() {
            continue;
        }
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        }
        fs::copy(&source, &target).map_err(|error| format!("{}: {error}", source.display()))?;
    }
    Ok(())
}

/// Plants, tests, and restores. The names of the tests that failed.
fn try_out(defect: &Defect, workspace: &Path) -> Result<Vec<String>, String> {
    let path = workspace.join(&defect.file);
    let source = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", defect.file))?;
    fs::write(&path, defect.plant(&source)?)
        .map_err(|error| format!("{}: {error}", defect.file))?;
    let output = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["test", "--locked"])
        .args(&defect.test)
        .current_dir(workspace)
        .env("CARGO_TARGET_DIR", workspace.join("target"))
        .output()
        .map_err(|error| format!("cargo test: {error}"))?;
    fs::write(&path, source).map_err(|error| format!("{}: {error}", defect.file))?;
    let printed = String::from_utf8_lossy(&output.stdout);
    let red: Vec<_> = printed
        .lines()
        .filter_map(|line| line.strip_prefix("test ")?.strip_suffix(" ... FAILED"))
        .map(str::to_owned)
        .collect();
    if red.is_empty() && !output.status.success() {
        // Not even compiled: the defect proves nothing about the tests.
        return Err(format!(
            "{}: {}",
            defect.name,
            String::from_utf8_lossy(&output.stderr)
        ));
    }
    Ok(red)
}
