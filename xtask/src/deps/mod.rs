//! The direction of dependencies between the workspace's crates.
//!
//! The rules are a table in [`rules`], the check is a pure function over a [graph](graph::Graph) in
//! [`check`], and [`check_workspace`] runs it on the `cargo metadata` of this workspace. It checks
//! the manifests, for all features and all platforms.
//!
//! The manifests do not show whether a dependency from the registry uses the standard library: the
//! gate's step `no-std` finds that, by builds for targets that have none.

mod check;
mod graph;
mod rules;

#[cfg(test)]
mod tests;

use anyhow::{Context, Result, bail};

use crate::members::MEMBERS;
use crate::process::{Invocation, Workspace};

/// Checks this workspace and returns a line with the number of crates.
pub(crate) fn check_workspace(workspace: &Workspace) -> Result<String> {
    let query = Invocation::cargo(&["metadata", "--format-version", "1", "--no-deps"]);
    let graph = graph::Graph::parse(&workspace.output(&query)?)
        .context("the answer of `cargo metadata` could not be read")?;
    let violations = check::violations(&graph, MEMBERS);
    if violations.is_empty() {
        return Ok(format!(
            "{} crates, every dependency points the right way",
            graph.crates.len()
        ));
    }
    let lines: Vec<_> = violations.iter().map(ToString::to_string).collect();
    bail!("{} violations:\n    {}", lines.len(), lines.join("\n    "));
}
