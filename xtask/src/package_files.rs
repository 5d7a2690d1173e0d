//! Checks the files of each separate package: licences, a README with a title, a manifest with
//! keywords, and dependencies that are packages too.
//!
//! The licences are copies, since a link does not survive packaging on every platform; the check
//! compares them with those of the root.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::process::{Invocation, Workspace};

/// Licence files, in the root and in each package.
const LICENCES: &[&str] = &["LICENSE-APACHE", "LICENSE-MIT"];

/// Output of `cargo metadata --no-deps`.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    manifest_path: PathBuf,
    /// Registries to which the package may be published; `None` means any.
    publish: Option<Vec<String>>,
    description: Option<String>,
    readme: Option<PathBuf>,
    keywords: Vec<String>,
    categories: Vec<String>,
    rust_version: Option<String>,
    dependencies: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    /// `None` for `[dependencies]`.
    kind: Option<String>,
}

/// Checks every package without `publish = false`.
pub(crate) fn check_workspace(workspace: &Workspace) -> Result<String> {
    let query = Invocation::cargo(&["metadata", "--format-version", "1", "--no-deps"]);
    let metadata: Metadata = serde_json::from_str(&workspace.output(&query)?)
        .context("the answer of `cargo metadata` could not be read")?;
    let (packages, private): (Vec<_>, Vec<_>) = metadata
        .packages
        .into_iter()
        .partition(|package| package.publish.as_deref() != Some(&[]));
    let private: Vec<_> = private
        .iter()
        .map(|package| package.name.as_str())
        .collect();
    let mut faults = Vec::new();
    for package in &packages {
        let found = faults_of(workspace.root(), package)?.into_iter();
        let found = found.chain(dependencies_on(&private, package));
        faults.extend(found.map(|fault| format!("{}: {fault}", package.name)));
    }
    if faults.is_empty() {
        return Ok(format!("{} packages are complete", packages.len()));
    }
    bail!("{} findings:\n    {}", faults.len(), faults.join("\n    "));
}

/// All faults of a package.
fn faults_of(root: &Path, package: &Package) -> Result<Vec<String>> {
    let folder = package
        .manifest_path
        .parent()
        .with_context(|| format!("{} has no folder", package.name))?;
    let mut faults = licence_faults(root, folder)?;
    let readme = fs::read_to_string(folder.join("README.md")).unwrap_or_default();
    if !readme.starts_with(&format!("# {}\n", package.name)) {
        faults.push(format!(
            "README.md has to start with \"# {}\"",
            package.name
        ));
    }
    let fields = [
        ("description", package.description.is_none()),
        ("readme", package.readme.is_none()),
        ("keywords", package.keywords.is_empty()),
        ("categories", package.categories.is_empty()),
        ("rust-version", package.rust_version.is_none()),
    ];
    let empty = fields.into_iter().filter(|(_, is_empty)| *is_empty);
    faults.extend(empty.map(|(field, _)| format!("Cargo.toml has no {field}")));
    Ok(faults)
}

/// Dependencies that are not published.
fn dependencies_on(private: &[&str], package: &Package) -> impl Iterator<Item = String> {
    package
        .dependencies
        .iter()
        .filter(|dependency| dependency.kind.as_deref() != Some("dev"))
        .filter(|dependency| private.contains(&dependency.name.as_str()))
        .map(|dependency| format!("depends on {}, which has publish = false", dependency.name))
}

/// Licences that are missing in a folder, or differ from the root's.
fn licence_faults(root: &Path, folder: &Path) -> Result<Vec<String>> {
    let mut faults = Vec::new();
    for name in LICENCES {
        let original = fs::read(root.join(name))
            .with_context(|| format!("{name} of the root could not be read"))?;
        let path = folder.join(name);
        if path.is_symlink() || fs::read(&path).ok() != Some(original) {
            faults.push(format!("{name} is no copy of that in the root"));
        }
    }
    Ok(faults)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_licence_that_is_missing_or_differs_is_found() {
        let workspace = Workspace::find(None).unwrap();
        let root = workspace.root();
        assert_eq!(licence_faults(root, root).unwrap(), Vec::<String>::new());
        // A folder of the repository without its own licences.
        assert_eq!(licence_faults(root, &root.join("docs")).unwrap().len(), 2);
    }
}
