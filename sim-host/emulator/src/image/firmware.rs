//! Builds the firmware image, for tests and tools that run it.

use std::env;
use std::fmt;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Rust target of the firmware's processor.
pub const TARGET: &str = "thumbv6m-none-eabi";
/// Build profile of images.
pub const PROFILE: &str = "firmware";
/// Package of the firmware, and name of its image.
pub const PACKAGE: &str = "palpate-firmware";
/// Environment variable that selects the log lines that are compiled into the image.
const LOGS: &str = "DEFMT_LOG";

/// Reason why no image was built.
#[derive(Debug)]
pub struct BuildError(String);

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BuildError {}

/// Builds the image, if it is not up to date, and returns its path. Adds the target through rustup
/// if the toolchain lacks it.
///
/// # Errors
/// [`BuildError`], with a remedy.
pub fn build() -> Result<PathBuf, BuildError> {
    let workspace = required()?;
    build_in(&workspace, &target_folder(&workspace), &[])
}

/// Builds an image with a planted defect of `firmware/planted-defects.toml`, if it is not up to
/// date, and returns its path, to test the tests. `cargo xtask firmware --planted` uses it.
///
/// # Errors
/// [`BuildError`], with a remedy.
pub fn build_with_defect(defect: &str) -> Result<PathBuf, BuildError> {
    let workspace = required()?;
    let mut cargo = cargo(&workspace);
    cargo.args(["xtask", "firmware", "--planted", defect]);
    let what = format!("the image with the defect {defect} could not be built");
    let printed = run(cargo, &what)?;
    let path = printed.lines().last().map(PathBuf::from);
    path.ok_or_else(|| BuildError(format!("{what}: no path was printed")))
}

/// Builds an image with the log lines of a level and above (`off`, `error` to `trace`) instead of
/// those of a release. An existing image that is newer than the release image is used as it is.
///
/// # Errors
/// [`BuildError`], with a remedy.
pub fn build_with_logs(level: &str) -> Result<PathBuf, BuildError> {
    let workspace = required()?;
    let folder = target_folder(&workspace).join("logs");
    let kept = folder.join(format!("{level}.elf"));
    if is_newer(&kept, &build()?) {
        return Ok(kept);
    }
    let image = build_in(&workspace, &folder, &[(LOGS, level)])?;
    std::fs::copy(&image, &kept)
        .map_err(|error| BuildError(format!("{} cannot be written: {error}", kept.display())))?;
    Ok(kept)
}

/// Builds the image with all of its code shifted by `bytes` bytes, and returns its path: for tests
/// whose result must not depend on the code's address.
///
/// # Errors
/// [`BuildError`], with a remedy.
pub fn build_shifted(bytes: u32) -> Result<PathBuf, BuildError> {
    let workspace = required()?;
    let folder = target_folder(&workspace).join("shifted");
    let mut cargo = cargo_for_image("rustc", &workspace, &folder, &["--bin", PACKAGE])?;
    cargo.args(["--", "-C", &format!("link-arg=--defsym=CODE_SHIFT={bytes}")]);
    run(cargo, "the firmware image could not be built")?;
    Ok(folder.join(TARGET).join(PROFILE).join(PACKAGE))
}

/// Builds an example of the firmware's package, as the firmware itself is built: `on_target`, which
/// compares bits, or `bring_up`, with which a PC tests the converter.
///
/// # Errors
/// [`BuildError`], with a remedy.
pub fn build_example(name: &str) -> Result<PathBuf, BuildError> {
    let workspace = required()?;
    let folder = target_folder(&workspace);
    cargo_build(&workspace, &folder, &["--example", name], &[])?;
    Ok(folder
        .join(TARGET)
        .join(PROFILE)
        .join("examples")
        .join(name))
}

fn is_newer(file: &Path, than: &Path) -> bool {
    let changed = |path: &Path| std::fs::metadata(path).and_then(|data| data.modified());
    matches!((changed(file), changed(than)), (Ok(file), Ok(than)) if file > than)
}

/// The palpate workspace that builds the image: the nearest folder, from the working directory
/// upwards, with the firmware's package.
#[must_use]
pub fn workspace() -> Option<PathBuf> {
    let here = env::current_dir().ok()?;
    let found = here.ancestors().find(|folder| is_workspace(folder))?;
    Some(found.to_path_buf())
}

fn is_workspace(folder: &Path) -> bool {
    let manifest = std::fs::read_to_string(folder.join("firmware/Cargo.toml"));
    let name = format!("name = \"{PACKAGE}\"");
    folder.join("Cargo.toml").is_file()
        && manifest.is_ok_and(|text| text.lines().any(|line| line.trim() == name))
}

fn required() -> Result<PathBuf, BuildError> {
    workspace().ok_or_else(|| {
        BuildError(
            "the firmware image is built in a palpate checkout, and the working directory is in \
             none: change to one"
                .to_owned(),
        )
    })
}

/// Target folder of cargo: from the environment, or in the workspace.
fn target_folder(workspace: &Path) -> PathBuf {
    workspace.join(env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

fn build_in(
    workspace: &Path,
    folder: &Path,
    variables: &[(&str, &str)],
) -> Result<PathBuf, BuildError> {
    cargo_build(workspace, folder, &["--bin", PACKAGE], variables)?;
    Ok(folder.join(TARGET).join(PROFILE).join(PACKAGE))
}

fn cargo_build(
    workspace: &Path,
    folder: &Path,
    what: &[&str],
    variables: &[(&str, &str)],
) -> Result<(), BuildError> {
    let mut cargo = cargo_for_image("build", workspace, folder, what)?;
    cargo.envs(variables.iter().copied());
    run(cargo, "the firmware image could not be built").map(drop)
}

fn cargo_for_image(
    verb: &str,
    workspace: &Path,
    folder: &Path,
    what: &[&str],
) -> Result<Command, BuildError> {
    provide_target(workspace)?;
    let mut cargo = cargo(workspace);
    cargo
        .args([verb, "--locked", "--package", PACKAGE])
        .args(["--profile", PROFILE, "--target", TARGET])
        .args(what)
        .env("CARGO_TARGET_DIR", folder);
    Ok(cargo)
}

/// A cargo command whose image does not depend on flags and log levels in the environment.
fn cargo(workspace: &Path) -> Command {
    let mut cargo = command("cargo", workspace);
    cargo
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove(LOGS);
    cargo
}

/// A child process without the environment variables of the cargo that runs this program.
fn command(program: &str, workspace: &Path) -> Command {
    let mut command = Command::new(program);
    command.current_dir(workspace);
    for (name, _) in env::vars_os() {
        let describes_parent = name.to_str().is_some_and(|name| {
            matches!(
                name,
                "CARGO" | "RUSTC" | "RUSTDOC" | "RUSTUP_TOOLCHAIN" | "OUT_DIR"
            ) || name.starts_with("CARGO_PKG_")
                || name.starts_with("CARGO_MANIFEST_")
        });
        if describes_parent {
            command.env_remove(name);
        }
    }
    command
}

fn provide_target(workspace: &Path) -> Result<(), BuildError> {
    let mut query = command("rustc", workspace);
    query.args(["--print", "target-libdir", "--target", TARGET]);
    let output = query.output().map_err(|error| {
        BuildError(format!("rustc could not be started: {error}; install Rust"))
    })?;
    let folder = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    if Path::new(&folder).is_dir() {
        return Ok(());
    }
    let mut add = command("rustup", workspace);
    add.args(["target", "add", TARGET]);
    run(
        add,
        concat!(
            "the toolchain lacks the target thumbv6m-none-eabi and it could not be added; with a \
             network, run `rustup target add thumbv6m-none-eabi`; where that is not offered for your \
             version of Rust, run `rustup override set ",
            env!("CARGO_PKG_RUST_VERSION"),
            "` before it; without rustup, install your distribution's package for it"
        ),
    )
    .map(drop)
}

/// Runs a child and returns its standard output. Its messages go to standard error as they come, so
/// that the user sees it build, or wait for another cargo; only the message about an up-to-date
/// build is left out.
fn run(mut command: Command, what: &str) -> Result<String, BuildError> {
    let failed = |error| BuildError(format!("{what}: {error}"));
    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(failed)?;
    let mut said = String::new();
    for line in child
        .stderr
        .take()
        .into_iter()
        .flat_map(|pipe| BufReader::new(pipe).lines())
    {
        let line = line.map_err(failed)?;
        if !line.trim_start().starts_with("Finished") {
            eprintln!("{line}");
        }
        said.push_str(&line);
        said.push('\n');
    }
    let output = child.wait_with_output().map_err(failed)?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    Err(BuildError(format!("{what}\n{said}")))
}
