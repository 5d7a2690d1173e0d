//! Third-party content of a release: bills of materials (CycloneDX), and licences with their texts.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use super::files::{self, new_folder};
use crate::members::{FIRMWARE, FIRMWARE_TARGET};
use crate::metadata;
use crate::process::{Invocation, Workspace};

/// Name of a bill of materials, which cargo-cyclonedx writes beside each manifest.
const BILL: &str = "bill-of-materials";

/// A program of the release.
struct Program<'a> {
    /// Name of the program's files.
    name: &'a str,
    /// Package of the program, and its manifest.
    package: &'a str,
    manifest: &'a str,
    /// Target of the build.
    target: &'a str,
}

/// Writes bills of materials and licences of tool and firmware into the folders `materials` and
/// `licences`. The time in the bills is that of the commit, s since 1970.
pub(super) fn write(
    workspace: &Workspace,
    platform: &str,
    time_s: u64,
    folder: &Path,
) -> Result<()> {
    let programs = [
        Program {
            name: "tool",
            package: "palpate",
            manifest: "host/tool/Cargo.toml",
            target: platform,
        },
        Program {
            name: "firmware",
            package: FIRMWARE,
            manifest: "firmware/Cargo.toml",
            target: FIRMWARE_TARGET,
        },
    ];
    let materials = new_folder(&folder.join("materials"))?;
    let licences = new_folder(&folder.join("licences"))?;
    for program in &programs {
        let file = materials.join(format!("{}.cdx.json", program.name));
        files::write(&file, &bill(workspace, program, time_s)?)?;
        let file = licences.join(format!("{}.txt", program.name));
        files::write(&file, &licence_texts(workspace, program)?)?;
    }
    Ok(())
}

/// Bill of materials of a program. The tool writes one beside each manifest of the workspace, and
/// includes the workspace's path.
fn bill(workspace: &Workspace, program: &Program<'_>, time_s: u64) -> Result<String> {
    let arguments = [
        "cyclonedx",
        "--manifest-path",
        program.manifest,
        "--target",
        program.target,
        "--format",
        "json",
        "--spec-version",
        "1.5",
        "--override-filename",
        BILL,
        "--quiet",
    ];
    // Without this variable, a bill has a random serial number and the present time.
    let time = time_s.to_string();
    workspace.run(&Invocation::cargo(&arguments).with_env("SOURCE_DATE_EPOCH", &time))?;
    let mut found = None;
    for package in metadata::packages(workspace)? {
        let file = package.manifest_path.with_file_name(format!("{BILL}.json"));
        let Ok(text) = fs::read_to_string(&file) else {
            continue;
        };
        fs::remove_file(&file).with_context(|| format!("{} stays", file.display()))?;
        if package.name == program.package {
            found = Some(text);
        }
    }
    let text = found.with_context(|| format!("no bill of materials of {}", program.package))?;
    Ok(text.replace(&workspace.root().to_string_lossy().into_owned(), "/palpate"))
}

/// Licences of everything that a program contains, as text.
fn licence_texts(workspace: &Workspace, program: &Program<'_>) -> Result<String> {
    let arguments = [
        "about",
        "generate",
        "--locked",
        "--offline",
        "--fail",
        "--manifest-path",
        program.manifest,
        "--target",
        program.target,
        "--config",
        "xtask/src/release/about.toml",
        "xtask/src/release/licences.hbs",
    ];
    workspace.output(&Invocation::cargo(&arguments))
}
