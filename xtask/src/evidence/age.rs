//! Lists the results that are older than the code on which they rest.

use std::fs;

use anyhow::{Context, Result, bail};

use super::{CAMPAIGNS, FOLDER, OVERVIEW, document};
use crate::process::{Invocation, Workspace};

/// Lists the results that are older than their code. An old result is no error: a campaign takes
/// long, and one run stands for many commits. A result that names no commit or path of this
/// repository is an error.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let git = |arguments: &[&str]| workspace.output(&Invocation::new("git", arguments));
    if git(&["rev-parse", "--is-shallow-repository"])?.trim() == "true" {
        return Ok("a shallow clone has no history: the age of the results is unknown".to_owned());
    }
    let overview = workspace.root().join(FOLDER).join(OVERVIEW);
    let overview = fs::read_to_string(overview)
        .with_context(|| format!("{FOLDER}/{OVERVIEW} cannot be read"))?;
    let (mut results, mut old) = (0, 0);
    for campaign in CAMPAIGNS {
        let name = campaign.name;
        let Some(commit) = document::commit(&overview, name) else {
            println!("    {name}: no result");
            continue;
        };
        let age = age(workspace, commit, campaign.rests_on).context(name)?;
        results += 1;
        if age > 0 {
            old += 1;
            println!("    {name}: {age} commits changed its code since");
        }
    }
    Ok(format!(
        "{old} of {results} results are older than their code"
    ))
}

/// Number of commits that have changed a result's code since the commit that the result names.
fn age(workspace: &Workspace, commit: &str, paths: &[&str]) -> Result<u32> {
    // A commit outside the history of HEAD may be in this checkout and will not be in a clone.
    let is_ancestor = ["merge-base", "--is-ancestor", commit, "HEAD"];
    workspace
        .output(&Invocation::new("git", &is_ancestor))
        .with_context(|| format!("its commit `{commit}` is not in the history of HEAD"))?;
    let range = format!("{commit}..HEAD");
    let mut arguments = vec!["rev-list", "--count", &range, "--"];
    arguments.extend(paths);
    let count = workspace.output(&Invocation::new("git", &arguments))?;
    // Asks git: a checkout may still have a folder whose tracked files are gone.
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

    /// Checks nothing in a clone without history, or without git.
    #[test]
    fn a_result_is_as_old_as_the_commits_on_its_paths() {
        let workspace = Workspace::find(None).unwrap();
        let git = |arguments: &[&str]| workspace.output(&Invocation::new("git", arguments));
        let file = "xtask/src/main.rs";
        let changed = git(&["rev-list", "-1", "HEAD", "--", file]).unwrap_or_default();
        let before = format!("{}~", changed.trim());
        if git(&["rev-parse", "--verify", &before]).is_ok() {
            assert_eq!(age(&workspace, &before, &[file]).unwrap(), 1);
            assert_eq!(age(&workspace, changed.trim(), &[file]).unwrap(), 0);
        }
    }

    #[test]
    fn an_unknown_commit_or_path_is_an_error_that_names_it() {
        let workspace = Workspace::find(None).unwrap();
        for (commit, path, cause) in [
            ("0123abcd", "xtask", "its commit `0123abcd`"),
            ("HEAD", "no/such", "rests on `no/such`"),
        ] {
            let message = age(&workspace, commit, &["xtask", path])
                .unwrap_err()
                .to_string();
            assert!(message.contains(cause), "{message}");
        }
    }
}
