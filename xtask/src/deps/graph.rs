//! The part of `cargo metadata` that the rules need.

use std::collections::{BTreeMap, BTreeSet};

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::Deserialize;

/// Output of `cargo metadata --no-deps`.
#[derive(Deserialize)]
struct Metadata {
    workspace_root: PathBuf,
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    manifest_path: PathBuf,
    features: BTreeMap<String, Vec<String>>,
    dependencies: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    name: String,
    /// `None` for `[dependencies]`.
    kind: Option<String>,
    optional: bool,
    target: Option<String>,
}

/// Crates of the workspace with their direct dependencies.
#[derive(Debug, Clone, Default)]
pub(super) struct Graph {
    /// Every crate of the workspace.
    pub(super) crates: Vec<Crate>,
}

/// One crate of the workspace.
#[derive(Debug, Clone, Default)]
pub(super) struct Crate {
    /// Package name.
    pub(super) name: String,
    /// Folder relative to the workspace, with `/` between the parts.
    pub(super) folder: String,
    /// Features of the crate, without `default`.
    pub(super) features: BTreeSet<String>,
    /// Dependencies in the crate's manifest, from the workspace and from elsewhere.
    pub(super) dependencies: Vec<Dependency>,
}

/// One entry of a manifest's dependency tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Dependency {
    /// Package name, regardless of renames in the manifest.
    pub(super) name: String,
    /// Table of the entry.
    pub(super) kind: Kind,
    /// Whether the dependency is active only with a feature.
    pub(super) optional: bool,
    /// Whether the dependency applies to some platforms only (`[target.'cfg(..)'.dependencies]`).
    pub(super) target_gated: bool,
}

/// Table of the manifest that contains a dependency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// `[dependencies]`.
    Normal,
    /// `[dev-dependencies]`.
    Dev,
    /// `[build-dependencies]`.
    Build,
}

impl Graph {
    /// Reads the output of `cargo metadata --no-deps`.
    pub(super) fn parse(json: &str) -> Result<Self> {
        let metadata: Metadata = serde_json::from_str(json)?;
        let crates = metadata
            .packages
            .iter()
            .map(|package| Crate::read(package, &metadata.workspace_root))
            .collect::<Result<_>>()?;
        Ok(Self { crates })
    }

    pub(super) fn find(&self, name: &str) -> Option<&Crate> {
        self.crates.iter().find(|krate| krate.name == name)
    }
}

impl Crate {
    fn read(package: &Package, root: &Path) -> Result<Self> {
        let folder = package
            .manifest_path
            .parent()
            .and_then(|folder| folder.strip_prefix(root).ok()?.to_str())
            .with_context(|| format!("{} lies outside the workspace's folder", package.name))?;
        Ok(Self {
            name: package.name.clone(),
            folder: folder.replace('\\', "/"),
            features: package
                .features
                .keys()
                .filter(|feature| *feature != "default")
                .cloned()
                .collect(),
            dependencies: package.dependencies.iter().map(Dependency::read).collect(),
        })
    }
}

impl Dependency {
    fn read(entry: &Entry) -> Self {
        Self {
            name: entry.name.clone(),
            kind: match entry.kind.as_deref() {
                Some("dev") => Kind::Dev,
                Some("build") => Kind::Build,
                // An unknown kind is treated as strictly as possible.
                _ => Kind::Normal,
            },
            optional: entry.optional,
            target_gated: entry.target.is_some(),
        }
    }
}
