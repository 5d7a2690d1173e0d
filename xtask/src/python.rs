//! `cargo xtask ci --only python`: tests in Python that read the tool's output files with other
//! programs.
//!
//! A list gives the versions of the packages, which are installed from the Python package index
//! into a virtual environment below `target`. The first run needs a network, so the gate runs this
//! step only when it is named.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use crate::firmware;
use crate::process::{Invocation, Workspace};

/// Folder of the tests, and the environment in which they run.
const TESTS: &str = "host/tool/tests/python";
const ENVIRONMENT: Environment = Environment {
    folder: "target/python",
    packages: "host/tool/tests/python/requirements.txt",
};

/// Builds the tool and the image, installs missing packages, and runs the tests.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let tool = text(&build_tool(workspace)?)?;
    let image = text(&firmware::build(workspace)?)?;
    let python = ENVIRONMENT.install(workspace)?;
    // Python writes nothing beside the tests: no bytecode, no cache.
    let tests = Invocation::new(
        &python,
        &["-B", "-m", "pytest", "-p", "no:cacheprovider", TESTS],
    );
    workspace.run(
        &tests
            .with_env("PALPATE", &tool)
            .with_env("PALPATE_IMAGE", &image),
    )?;
    Ok("other programs read what the tool writes".to_owned())
}

/// Builds the tool with the settings of the tests, and returns its path.
pub(crate) fn build_tool(workspace: &Workspace) -> Result<PathBuf> {
    let mut arguments = vec!["build", "--locked", "--package", "palpate"];
    arguments.extend(["--message-format", "json-render-diagnostics"]);
    workspace.build(&Invocation::cargo(&arguments))
}

/// A virtual environment below `target`, with the packages of a list.
pub(crate) struct Environment {
    pub(crate) folder: &'static str,
    pub(crate) packages: &'static str,
}

impl Environment {
    /// Creates the environment with all packages of the list; returns its Python.
    pub(crate) fn install(&self, workspace: &Workspace) -> Result<String> {
        let Self { folder, packages } = self;
        let environment = workspace.root().join(folder);
        let python = text(&environment.join("bin/python"))?;
        let listed = fs::read_to_string(workspace.root().join(packages))
            .with_context(|| format!("{packages} could not be read"))?;
        // A copy of the list, written when all packages are installed.
        let installed = environment.join("requirements.txt");
        if fs::read_to_string(&installed).is_ok_and(|before| before == listed) {
            return Ok(python);
        }
        let create = ["-m", "venv", "--clear", &text(&environment)?];
        workspace
            .run(&Invocation::new("python3", &create))
            .context(
                "there is no Python 3.11 with venv: install it, on Debian with `apt-get install python3-venv`",
            )?;
        let arguments = ["-m", "pip", "install", "--quiet", "--requirement", packages];
        let install = Invocation::new(&python, &arguments);
        workspace.run(&install).with_context(|| {
            format!("the packages of {packages} could not be installed; this needs a network")
        })?;
        fs::write(&installed, listed)
            .with_context(|| format!("{folder}/requirements.txt could not be written"))?;
        Ok(python)
    }
}

pub(crate) fn text(path: &Path) -> Result<String> {
    let text = path.to_str().context("the path is not UTF-8")?;
    Ok(text.to_owned())
}
