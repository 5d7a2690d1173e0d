//! `cargo xtask ci --only python-package`: the Python package in `python/`.
//!
//! The package is a workspace of its own, with its own lock file: nothing else builds it. This step lints
//! it, builds the wheel, and runs its tests, type checks and notebooks in a virtual environment below
//! `target`. The first run needs a network, for the packages from the Python package index.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::firmware;
use crate::process::{Invocation, Workspace};
use crate::python::{Environment, build_tool, text};

const ENVIRONMENT: Environment = Environment {
    folder: "target/python-package/environment",
    packages: "python/requirements.txt",
};
/// Folder of the build: this workspace's own would be `python/target`.
const BUILD: &str = "target/python-package/build";
/// Folder of the wheel, emptied before each build.
const WHEELS: &str = "target/python-package/wheels";
/// Largest size of the wheel, bytes.
const MOST_BYTES: u64 = 5_000_000;

/// Lints, builds, installs and tests the package.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let python = ENVIRONMENT.install(workspace)?;
    let cargo = |words: &str| workspace.run(&command("cargo", words, &[]));
    let module = |words: &str, rest: &[&str]| command(&python, &format!("-m {words}"), rest);
    cargo("fmt --manifest-path python/Cargo.toml --check")?;
    // Lints in the profile of the wheel: both then share build scripts and macros.
    cargo("clippy --locked --release --manifest-path python/Cargo.toml -- -D warnings")?;
    // The repository's rules, for the dependencies of this workspace.
    let rules = "--manifest-path python/Cargo.toml --config deny.toml";
    cargo(&format!("deny --locked {rules} check licenses sources"))?;
    let wheel = build_wheel(workspace, &module)?;
    let bytes = fs::metadata(&wheel)?.len();
    if bytes > MOST_BYTES {
        bail!("the wheel has {bytes} bytes, more than {MOST_BYTES}: leave out a dependency");
    }
    let wheel = text(&wheel)?;
    let install = "pip install --quiet --no-deps --no-index --force-reinstall";
    workspace.run(&module(install, &[&wheel]))?;
    let typed = "python/package/palpate python/tests python/benches python/examples";
    let options = "--config-file python/pyproject.toml --cache-dir target/python-package/types";
    let types = format!("mypy {options} {typed}");
    workspace.run(&module(&types, &[]))?;
    workspace.run(&module(
        "mypy.stubtest --ignore-disjoint-bases palpate._palpate",
        &[],
    ))?;
    let tool = text(&build_tool(workspace)?)?;
    let image = text(&firmware::build(workspace)?)?;
    // Python writes nothing beside the tests: no bytecode, no cache.
    let tests = command(
        &python,
        "-B -m pytest -p no:cacheprovider python/tests",
        &[],
    );
    workspace.run(
        &tests
            .with_env("PALPATE", &tool)
            .with_env("PALPATE_IMAGE", &image)
            .with_env("PALPATE_WHEEL", &wheel),
    )?;
    let megabytes = bytes as f64 * 1e-6;
    Ok(format!(
        "the wheel has {megabytes:.1} MB and gives the tool's numbers"
    ))
}

/// A command of these words, and of arguments that may have spaces.
fn command(program: &str, words: &str, rest: &[&str]) -> Invocation {
    let words: Vec<&str> = words.split(' ').chain(rest.iter().copied()).collect();
    let command = match program {
        "cargo" => Invocation::cargo(&words),
        _ => Invocation::new(program, &words),
    };
    command.with_env("CARGO_TARGET_DIR", BUILD)
}

/// Builds the wheel and returns its path. `module` makes the command that runs a Python module.
fn build_wheel(
    workspace: &Workspace,
    module: &impl Fn(&str, &[&str]) -> Invocation,
) -> Result<PathBuf> {
    let folder = workspace.root().join(WHEELS);
    if folder.exists() {
        fs::remove_dir_all(&folder).with_context(|| format!("{WHEELS} could not be emptied"))?;
    }
    let build = "maturin build --release --locked --manifest-path python/Cargo.toml --out";
    workspace.run(&module(build, &[WHEELS]))?;
    let mut files = fs::read_dir(&folder)?.filter_map(Result::ok);
    files
        .find_map(|file| {
            Some(file.path()).filter(|path| path.extension().is_some_and(|ending| ending == "whl"))
        })
        .with_context(|| format!("there is no wheel in {WHEELS}"))
}
