//! The workspace's packages, as `cargo metadata` describes them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::Deserialize;

use crate::process::{Invocation, Workspace};

/// Output of `cargo metadata --no-deps`.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Package {
    pub(crate) name: String,
    pub(crate) manifest_path: PathBuf,
    /// Registries to which the package may be published; `None` means any.
    pub(crate) publish: Option<Vec<String>>,
    pub(crate) description: Option<String>,
    pub(crate) readme: Option<PathBuf>,
    pub(crate) keywords: Vec<String>,
    pub(crate) categories: Vec<String>,
    pub(crate) rust_version: Option<String>,
    pub(crate) features: BTreeMap<String, Vec<String>>,
    pub(crate) dependencies: Vec<Dependency>,
    pub(crate) targets: Vec<Target>,
}

/// An entry of a manifest's tables of dependencies.
#[derive(Debug, Deserialize)]
pub(crate) struct Dependency {
    pub(crate) name: String,
    /// `None` for `[dependencies]`, otherwise `dev` or `build`.
    pub(crate) kind: Option<String>,
    /// Whether the dependency is active only with a feature.
    pub(crate) optional: bool,
    /// Platform of the entry; `None` means all platforms.
    pub(crate) target: Option<String>,
}

/// A library, program, test, example or benchmark.
#[derive(Debug, Deserialize)]
pub(crate) struct Target {
    pub(crate) name: String,
    pub(crate) kind: Vec<String>,
    /// Root of its source.
    #[cfg(test)]
    pub(crate) src_path: PathBuf,
    /// Whether cargo runs the target's tests.
    #[cfg(test)]
    pub(crate) test: bool,
    /// Whether cargo runs the tests of the target's documentation.
    #[cfg(test)]
    pub(crate) doctest: bool,
}

/// Packages of the workspace.
pub(crate) fn packages(workspace: &Workspace) -> Result<Vec<Package>> {
    let query = ["metadata", "--locked", "--format-version", "1", "--no-deps"];
    let printed = workspace.output(&Invocation::cargo(&query))?;
    let metadata: Metadata = serde_json::from_str(&printed)
        .context("the answer of `cargo metadata` could not be read")?;
    Ok(metadata.packages)
}

impl Package {
    /// Folder of the package.
    pub(crate) fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap_or(&self.manifest_path)
    }

    /// The package's library, if it has one.
    pub(crate) fn library(&self) -> Option<&Target> {
        let is_library = |target: &&Target| target.kind.iter().any(|kind| kind == "lib");
        self.targets.iter().find(is_library)
    }
}
