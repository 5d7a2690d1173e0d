//! Checks the files of each separate package: licences, a README with a title, a manifest with
//! keywords.
//!
//! The licences are copies, since a link does not survive packaging on every platform; the check
//! compares them with those of the root.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::metadata::{Package, packages};
use crate::process::Workspace;

/// Licence files, in the root and in each package.
const LICENCES: &[&str] = &["LICENSE-APACHE", "LICENSE-MIT"];

/// Checks every package without `publish = false`.
pub(crate) fn check_workspace(workspace: &Workspace) -> Result<String> {
    let mut packages = packages(workspace)?;
    packages.retain(|package| package.publish.as_deref() != Some(&[]));
    let mut faults = Vec::new();
    for package in &packages {
        let found = faults_of(workspace.root(), package)?.into_iter();
        faults.extend(found.map(|fault| format!("{}: {fault}", package.name)));
    }
    if faults.is_empty() {
        return Ok(format!("{} packages are complete", packages.len()));
    }
    bail!("{} findings:\n    {}", faults.len(), faults.join("\n    "));
}

/// All faults of a package.
fn faults_of(root: &Path, package: &Package) -> Result<Vec<String>> {
    let folder = package.folder();
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
