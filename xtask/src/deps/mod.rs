//! The direction of dependencies between the workspace's crates.
//!
//! The rules are a table in [`rules`], the check is a pure function over a [graph](graph::Graph)
//! in [`check`], and [`check_workspace`] runs it on what `cargo metadata` says of this workspace.
//! What stands in the manifests is judged, for all features and all platforms.
//!
//! Whether a dependency from the registry uses the standard library does not stand there: that
//! is what the step `no-std` of the gate finds, which builds for targets that have none.

mod check;
mod graph;
mod rules;

#[cfg(test)]
mod tests;

use anyhow::{Context, Result, bail};

use crate::members::MEMBERS;
use crate::process::{Invocation, Workspace};

/// Checks this workspace and tells how many crates there are.
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
