//! Tests of the tests: defects that are planted into a copy of the sources.
//!
//! A list of defects is a TOML file of patches; each replaces a text that occurs exactly once in a
//! file. There are two lists: `tests/planted-defects.toml`, whose defects must make the named tests
//! fail ([`campaign`]), and `firmware/planted-defects.toml`, from which images are built for tests
//! that must detect them ([`crate::firmware`]).

mod campaign;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::process::Workspace;
use crate::repository;

pub(crate) use campaign::run as run_campaign;

/// A text to replace. All patches of one name form one defect.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Patch {
    /// Description or name of the defect.
    pub(crate) name: String,
    /// The source file, from the root of the workspace.
    file: String,
    /// Text that occurs exactly once.
    find: String,
    /// Replacement.
    replace: String,
    /// Arguments of `cargo test` for the tests that the defect must make fail, in the tests' list.
    #[serde(default)]
    test: Vec<String>,
}

/// A list of defects, as in its file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    defect: Vec<Patch>,
}

pub(crate) fn list(workspace: &Workspace, file: &str) -> Result<Vec<Patch>> {
    let path = workspace.root().join(file);
    let text =
        fs::read_to_string(&path).with_context(|| format!("{file} could not be read as a list"))?;
    let list: List = toml::from_str(&text).with_context(|| format!("{file} is no list"))?;
    Ok(list.defect)
}

impl Patch {
    /// Source with this patch applied.
    fn apply(&self, source: &str) -> Result<String> {
        match source.matches(&self.find).count() {
            1 => Ok(source.replace(&self.find, &self.replace)),
            count => bail!(
                "{}: `{}` stands {count} times in {} instead of once",
                self.name,
                self.find,
                self.file
            ),
        }
    }
}

/// Makes `copy` equal to the workspace as git tracks it or would track it, except for the patches.
/// Unchanged files are left alone, so cargo builds only the changed ones.
pub(crate) fn copy(workspace: &Workspace, patches: &[Patch], copy: &Path) -> Result<()> {
    let mut patched = BTreeMap::new();
    for patch in patches {
        let source = match patched.remove(patch.file.as_str()) {
            Some(source) => source,
            None => fs::read_to_string(workspace.root().join(&patch.file))
                .with_context(|| format!("{}: {} cannot be read", patch.name, patch.file))?,
        };
        patched.insert(patch.file.as_str(), patch.apply(&source)?);
    }
    let files = repository::files(workspace)?;
    // Files that git lists but that are deleted cannot be copied.
    let files: BTreeSet<&str> = files
        .iter()
        .map(String::as_str)
        .filter(|name| workspace.root().join(name).is_file())
        .collect();
    for name in &files {
        let from = workspace.root().join(name);
        let wanted = match patched.remove(name) {
            Some(text) => text.into_bytes(),
            None => fs::read(&from).with_context(|| format!("{name} cannot be read"))?,
        };
        let to = copy.join(name);
        if fs::read(&to).is_ok_and(|there| there == wanted) {
            continue;
        }
        let folder = to.parent().unwrap_or(copy);
        fs::create_dir_all(folder)
            .and_then(|()| fs::write(&to, wanted))
            .with_context(|| format!("{} cannot be written", to.display()))?;
    }
    if let Some(file) = patched.keys().next() {
        bail!("{file} is to be patched, and git does not list it");
    }
    prune(copy, copy, &files)
}

/// Removes files of a folder of the copy that are not in the list.
fn prune(copy: &Path, folder: &Path, files: &BTreeSet<&str>) -> Result<()> {
    let unreadable = || format!("{} cannot be read", folder.display());
    for entry in fs::read_dir(folder).with_context(unreadable)? {
        let path = entry.with_context(unreadable)?.path();
        if path.is_dir() {
            prune(copy, &path, files)?;
            continue;
        }
        let name = path
            .strip_prefix(copy)?
            .to_string_lossy()
            .replace('\\', "/");
        if !files.contains(name.as_str()) {
            fs::remove_file(&path)
                .with_context(|| format!("{} cannot be removed", path.display()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(find: &str, replace: &str) -> Patch {
        Patch {
            name: "a defect".to_owned(),
            file: "README.md".to_owned(),
            find: find.to_owned(),
            replace: replace.to_owned(),
            test: Vec::new(),
        }
    }

    #[test]
    fn a_text_is_replaced_where_it_stands_once() {
        assert_eq!(patch("b", "x").apply("abc").unwrap(), "axc");
        for source in ["ac", "abcb"] {
            let error = patch("b", "x").apply(source).unwrap_err().to_string();
            assert!(error.contains("instead of once"), "{error}");
        }
    }

    #[test]
    fn a_copy_has_its_patches_and_no_others_and_is_not_written_twice() {
        let workspace = Workspace::find(None).unwrap();
        let folder = workspace
            .root()
            .join(format!("target/planted-test-{}", std::process::id()));
        let title = patch("# palpate\n", "# planted\n");
        let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
        let original = |name: &str| fs::read_to_string(workspace.root().join(name)).unwrap();

        copy(&workspace, &[title], &folder).unwrap();
        assert!(read("README.md").contains("# planted\n"));
        assert_eq!(read("Cargo.lock"), original("Cargo.lock"));

        fs::write(folder.join("stray.rs"), "").unwrap();
        let written = |name: &str| fs::metadata(folder.join(name)).unwrap().modified().unwrap();
        let before = written("Cargo.lock");
        copy(&workspace, &[], &folder).unwrap();
        assert_eq!(read("README.md"), original("README.md"));
        assert_eq!(written("Cargo.lock"), before);
        assert!(!folder.join("stray.rs").exists());

        let wrong = patch("no such text", "");
        assert!(copy(&workspace, &[wrong], &folder).is_err());
        fs::remove_dir_all(&folder).unwrap();
    }

    /// Checks that the defect's patches fit, and change their files.
    fn check_plantable(file: &str) -> Vec<Patch> {
        let workspace = Workspace::find(None).unwrap();
        let patches = list(&workspace, file).unwrap();
        let mut sources: BTreeMap<(&str, &str), String> = BTreeMap::new();
        for patch in &patches {
            let source = sources
                .entry((&patch.name, &patch.file))
                .or_insert_with(|| {
                    let path = workspace.root().join(&patch.file);
                    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path:?}: {error}"))
                });
            let planted = patch.apply(source).unwrap();
            assert_ne!(&planted, source, "{}", patch.name);
            *source = planted;
        }
        patches
    }

    #[test]
    fn every_defect_of_the_tests_list_can_be_planted() {
        let patches = check_plantable(campaign::LIST);
        assert!(patches.len() >= 5);
        assert!(patches.iter().all(|patch| !patch.test.is_empty()));
    }

    #[test]
    fn every_defect_of_the_image_can_be_planted() {
        let patches = check_plantable(crate::firmware::DEFECTS);
        let names: BTreeSet<_> = patches.iter().map(|patch| patch.name.as_str()).collect();
        let expected = [
            "asks_always",
            "fed_by_idle",
            "late_stamp",
            "no_safe_state",
            "panic",
            "words_swapped",
            "write_dropped",
        ];
        assert!(names.into_iter().eq(expected));
        assert!(patches.iter().all(|patch| patch.test.is_empty()));
    }
}
