//! Which pages of evidence are older than the code on which they rest.

use std::fs;

use anyhow::{Context, Result, bail};

use super::{FOLDER, document};
use crate::process::{Invocation, Workspace};

/// Lists the pages that are older than their code. Age is no error: a campaign takes long, and one
/// run stands for many commits. A page that names no commit or path of this repository is one.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let git = |arguments: &[&str]| workspace.output(&Invocation::new("git", arguments));
    if git(&["rev-parse", "--is-shallow-repository"])?.trim() == "true" {
        return Ok("a shallow clone has no history: the age of the pages is unknown".to_owned());
    }
    let mut pages = 0;
    let mut old = 0;
    for (name, text) in read_pages(workspace)? {
        let age = age(workspace, &text).with_context(|| format!("{FOLDER}/{name}"))?;
        pages += 1;
        if age > 0 {
            old += 1;
            println!("    {name}: {age} commits changed its code since");
        }
    }
    Ok(format!("{old} of {pages} pages are older than their code"))
}

/// The pages with their names, in order.
fn read_pages(workspace: &Workspace) -> Result<Vec<(String, String)>> {
    let folder = workspace.root().join(FOLDER);
    let mut pages = Vec::new();
    for entry in fs::read_dir(&folder).with_context(|| format!("{FOLDER} cannot be read"))? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.ends_with(".md") && name != "README.md" {
            pages.push((name.into_owned(), fs::read_to_string(&path)?));
        }
    }
    pages.sort();
    Ok(pages)
}

/// How many commits have changed a page's code since the commit that it names.
fn age(workspace: &Workspace, page: &str) -> Result<u32> {
    let (commit, paths) = document::origin(page)?;
    let range = format!("{commit}..HEAD");
    let mut arguments = vec!["rev-list", "--count", &range, "--"];
    arguments.extend(&paths);
    let count = workspace
        .output(&Invocation::new("git", &arguments))
        .with_context(|| format!("its commit `{commit}` is not in this repository"))?;
    // Asked of git: a folder whose files are gone may be left in one checkout.
    if let Some(path) = paths.iter().find(|path| {
        let files = workspace.output(&Invocation::new("git", &["ls-files", "--", path]));
        files.unwrap_or_default().is_empty()
    }) {
        bail!("it rests on `{path}`, which is not in this repository");
    }
    Ok(count.trim().parse()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn age_of(commit: &str, paths: &str) -> Result<u32> {
        let workspace = Workspace::find(None)?;
        age(
            &workspace,
            &format!("| Commit | {commit} |\n| Rests on | {paths} |\n"),
        )
    }

    /// In a clone without history, and where there is no git, there is nothing to compare.
    #[test]
    fn a_page_is_as_old_as_the_commits_on_its_paths() {
        let workspace = Workspace::find(None).unwrap();
        let git = |arguments: &[&str]| workspace.output(&Invocation::new("git", arguments));
        let file = "xtask/src/main.rs";
        let changed = git(&["rev-list", "-1", "HEAD", "--", file]).unwrap_or_default();
        let before = format!("{}~", changed.trim());
        if git(&["rev-parse", "--verify", &before]).is_ok() {
            assert_eq!(age_of(&before, &format!("`{file}`")).unwrap(), 1);
            assert_eq!(age_of(changed.trim(), &format!("`{file}`")).unwrap(), 0);
        }
    }

    #[test]
    fn an_unknown_commit_or_path_is_an_error_that_names_it() {
        for (commit, paths, cause) in [
            ("0123abcd", "`xtask`", "its commit `0123abcd`"),
            ("HEAD", "`xtask`, `no/such`", "rests on `no/such`"),
        ] {
            let message = age_of(commit, paths).unwrap_err().to_string();
            assert!(message.contains(cause), "{message}");
        }
        let workspace = Workspace::find(None).unwrap();
        assert!(age(&workspace, "# A page without a table\n").is_err());
    }

    #[test]
    fn every_page_names_its_commit_and_paths() {
        let pages = read_pages(&Workspace::find(None).unwrap()).unwrap();
        assert!(!pages.is_empty());
        for (name, text) in pages {
            assert!(document::origin(&text).is_ok(), "{name}");
        }
    }
}
