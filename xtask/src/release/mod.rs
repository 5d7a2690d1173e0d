//! A release for one platform: the firmware image, the tool, the licences of their contents, and
//! their bill of materials, in one archive with its checksums.
//!
//! The same commit gives the same files with the same toolchain on the same platform, wherever the
//! checkout and cargo's folder are: paths, times and users of the build computer do not enter.

mod archive;
mod checksums;
mod files;
mod materials;
mod paths;

use std::env::consts::EXE_SUFFIX;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use files::{new_folder, write};

use crate::firmware;
use crate::process::{Invocation, Workspace};
use crate::setup::{self, Need};

/// Folder of releases, in the workspace.
const FOLDER: &str = "target/release-files";
/// Profile of the released tool, in the workspace's manifest.
const PROFILE: &str = "distribution";
/// Shells with completions, each with its file name.
const COMPLETIONS: &[(&str, &str)] = &[
    ("bash", "palpate.bash"),
    ("elvish", "palpate.elv"),
    ("fish", "palpate.fish"),
    ("powershell", "_palpate.ps1"),
    ("zsh", "_palpate"),
];
/// Files and folders that are released unchanged.
const DOCUMENTS: &[&str] = &["CHANGELOG.md", "LICENSE-APACHE", "LICENSE-MIT", "docs"];

/// Builds everything, and writes the archive and its checksum.
///
/// # Errors
/// If the sources have uncommitted changes, a build fails, or a tool is missing.
pub(crate) fn make(workspace: &Workspace) -> Result<()> {
    Need::Tool(&setup::CARGO_ABOUT).provide(workspace)?;
    Need::Tool(&setup::CARGO_CYCLONEDX).provide(workspace)?;
    let time_s = commit_time(workspace)?;
    let platform = workspace.output(&Invocation::new("rustc", &["--print", "host-tuple"]))?;
    let name = format!("palpate-{}-{}", env!("CARGO_PKG_VERSION"), platform.trim());
    let releases = workspace.root().join(FOLDER);
    let folder = new_folder(&releases.join(&name))?;

    let flags = without_paths(workspace)?;
    let tool = build_tool(workspace, &flags)?;
    copy(&tool, &folder.join("palpate").with_extension(extension()))?;
    let elf = firmware::build_for_release(workspace, &flags, &folder.join("firmware"))?;
    paths::refuse(&[&tool, &elf.with_extension("uf2")], &private(workspace)?)?;
    write_log_table(workspace, &tool, &elf)?;
    write_help(workspace, &tool, &folder)?;
    materials::write(workspace, platform.trim(), time_s, &folder)?;
    for document in DOCUMENTS {
        copy_all(&workspace.root().join(document), &folder.join(document))?;
    }
    copy(
        &workspace.root().join("xtask/src/release/readme.txt"),
        &folder.join("README.md"),
    )?;
    checksums::write_for_folder(&folder)?;

    let archive = releases.join(format!("{name}.tar.gz"));
    archive::write(&folder, &name, time_s, &archive)?;
    checksums::write_for_files(&releases, &[&archive])?;
    println!("{FOLDER}/{name}.tar.gz, and its checksum in {FOLDER}/SHA256SUMS");
    Ok(())
}

/// Time of the commit, s since 1970. All files of the release get this time.
fn commit_time(workspace: &Workspace) -> Result<u64> {
    let status = ["status", "--porcelain", "--untracked-files=no"];
    let changed = workspace.output(&Invocation::new("git", &status))?;
    if !changed.is_empty() {
        bail!(
            "the sources are changed; commit them first, since a release names its commit:\n{changed}"
        );
    }
    let query = ["log", "-1", "--format=%ct"];
    let printed = workspace.output(&Invocation::new("git", &query))?;
    printed
        .trim()
        .parse()
        .context("git names no time of the commit")
}

/// Folders whose names must not appear in a release: cargo's and the checkout.
fn private(workspace: &Workspace) -> Result<[PathBuf; 2]> {
    let cargo = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let cargo = cargo.or_else(|| std::env::home_dir().map(|home| home.join(".cargo")));
    let cargo = cargo.context("neither CARGO_HOME nor a home folder is known")?;
    Ok([cargo, workspace.root().to_path_buf()])
}

/// Cargo arguments that keep the paths of this computer out of its output.
fn without_paths(workspace: &Workspace) -> Result<Vec<String>> {
    let map = |path: &Path, name: &str| {
        let flag = format!("--remap-path-prefix={}={name}", path.display());
        toml::Value::String(flag).to_string()
    };
    let [cargo, checkout] = private(workspace)?;
    let flags = [map(&cargo, "cargo"), map(&checkout, "palpate")].join(", ");
    Ok(vec![
        "--config".to_owned(),
        format!("build.rustflags=[{flags}]"),
    ])
}

fn build_tool(workspace: &Workspace, flags: &[String]) -> Result<PathBuf> {
    let mut arguments = vec![
        "build",
        "--locked",
        "--package",
        "palpate",
        "--profile",
        PROFILE,
    ];
    arguments.extend(["--message-format", "json-render-diagnostics"]);
    arguments.extend(flags.iter().map(String::as_str));
    workspace.build(&Invocation::cargo(&arguments))
}

/// Writes the table with which the tool decodes the image's log, for users without the ELF file.
fn write_log_table(workspace: &Workspace, tool: &Path, elf: &Path) -> Result<()> {
    let arguments = ["log-table", &elf.to_string_lossy()];
    let table = workspace.output(&Invocation::new(&tool.to_string_lossy(), &arguments))?;
    write(&elf.with_extension("log.json"), &table)
}

/// Writes completions and manual pages, as the tool prints them.
fn write_help(workspace: &Workspace, tool: &Path, folder: &Path) -> Result<()> {
    let tool = tool.to_string_lossy();
    let completions = new_folder(&folder.join("completions"))?;
    for (shell, file) in COMPLETIONS {
        let script = workspace.output(&Invocation::new(&tool, &["completions", shell]))?;
        write(&completions.join(file), &script)?;
    }
    let pages = folder.join("man");
    workspace.run(&Invocation::new(&tool, &["man", &pages.to_string_lossy()]))
}

fn extension() -> &'static str {
    EXE_SUFFIX.trim_start_matches('.')
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    let copied = fs::copy(from, to);
    copied.with_context(|| format!("{} cannot be copied to {}", from.display(), to.display()))?;
    Ok(())
}

/// Copies a file, or a folder with everything in it.
fn copy_all(from: &Path, to: &Path) -> Result<()> {
    if !from.is_dir() {
        return copy(from, to);
    }
    new_folder(to)?;
    for entry in archive::entries(from)? {
        let name = entry
            .file_name()
            .context("an entry of a folder has a name")?;
        copy_all(&entry, &to.join(name))?;
    }
    Ok(())
}
