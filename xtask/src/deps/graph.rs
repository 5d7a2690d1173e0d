//! The part of `cargo metadata` that the rules look at.

use std::collections::BTreeSet;

use anyhow::{Context, Result};
use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};

/// The workspace's crates and what they depend on directly.
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
    /// Its folder below the workspace's, with `/` between the parts.
    pub(super) folder: String,
    /// Its features, without `default`.
    pub(super) features: BTreeSet<String>,
    /// What its manifest names, from the workspace and from elsewhere.
    pub(super) dependencies: Vec<Dependency>,
}

/// One entry of a manifest's dependency tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Dependency {
    /// Package name, whatever the manifest renames it to.
    pub(super) name: String,
    /// Which table it stands in.
    pub(super) kind: Kind,
    /// Whether a feature has to ask for it.
    pub(super) optional: bool,
    /// Whether it counts on some platforms only (`[target.'cfg(..)'.dependencies]`).
    pub(super) target_gated: bool,
}

/// The table of the manifest in which a dependency stands.
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
        let metadata = MetadataCommand::parse(json)?;
        let crates = metadata
            .workspace_packages()
            .into_iter()
            .map(|package| Crate::read(package, &metadata))
            .collect::<Result<_>>()?;
        Ok(Self { crates })
    }

    /// The crate of this name.
    pub(super) fn find(&self, name: &str) -> Option<&Crate> {
        self.crates.iter().find(|krate| krate.name == name)
    }
}

impl Crate {
    fn read(package: &Package, metadata: &Metadata) -> Result<Self> {
        let folder = package
            .manifest_path
            .parent()
            .and_then(|folder| folder.strip_prefix(&metadata.workspace_root).ok())
            .with_context(|| format!("{} lies outside the workspace's folder", package.name))?;
        Ok(Self {
            name: package.name.to_string(),
            folder: folder.as_str().replace('\\', "/"),
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
    fn read(entry: &cargo_metadata::Dependency) -> Self {
        Self {
            name: entry.name.clone(),
            kind: match entry.kind {
                DependencyKind::Development => Kind::Dev,
                DependencyKind::Build => Kind::Build,
                // A kind that cargo may invent later is judged as strictly as there is.
                _ => Kind::Normal,
            },
            optional: entry.optional,
            target_gated: entry.target.is_some(),
        }
    }
}
