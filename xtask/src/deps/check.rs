//! The check itself: a pure function from a graph to its violations.

use std::fmt;

use super::graph::{Crate, Dependency, Graph, Kind};
use super::rules::{DRIVERS, FIRMWARE, LOG_FORMAT, MCU_ONLY, MODEL, NOT_MCU, On, RULES, Rule};
use crate::members::{Member, RunsOn};

/// A violation of a rule by a crate.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Violation {
    /// Name of the rule.
    pub(super) rule: &'static str,
    /// Crate that breaks the rule.
    pub(super) who: String,
    /// Description, with the reason for the rule.
    fault: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} (rule {})", self.who, self.fault, self.rule)
    }
}

impl Violation {
    fn new(rule: &'static str, krate: &Crate, fault: String) -> Self {
        Self {
            rule,
            who: krate.name.clone(),
            fault,
        }
    }
}

/// All violations of the workspace, given the gate's table of its members.
pub(super) fn violations(graph: &Graph, members: &[Member]) -> Vec<Violation> {
    let mut found = missing_crates(graph, members);
    for krate in &graph.crates {
        found.extend(entered(krate, members));
        found.extend(directions(krate, graph));
        found.extend(no_std(krate, graph, members));
        found.extend(hardware(krate));
    }
    found
}

/// Rows of the table without a crate.
fn missing_crates(graph: &Graph, members: &[Member]) -> Vec<Violation> {
    members
        .iter()
        .filter(|member| graph.find(member.name).is_none())
        .map(|member| Violation {
            rule: "table-current",
            who: member.name.to_owned(),
            fault: "has a row in xtask/src/members.rs, but is no crate of the workspace".to_owned(),
        })
        .collect()
}

/// Violations of registration: a crate needs a row, all its features in it, and a rule that applies
/// to it.
fn entered(krate: &Crate, members: &[Member]) -> Vec<Violation> {
    let mut found = Vec::new();
    match members.iter().find(|member| member.name == krate.name) {
        None => found.push(Violation::new(
            "crate-entered",
            krate,
            "has no row in xtask/src/members.rs, so the gate passes it by".to_owned(),
        )),
        Some(member) if !same_features(krate, member) => found.push(Violation::new(
            "features-entered",
            krate,
            format!(
                "has the features {:?}, but its row in xtask/src/members.rs names {:?}",
                krate.features, member.features
            ),
        )),
        Some(_) => {}
    }
    if !RULES.iter().any(|rule| names(rule.who, krate)) {
        found.push(Violation::new(
            "crate-bound",
            krate,
            "is bound by no rule in xtask/src/deps/rules.rs".to_owned(),
        ));
    }
    found
}

fn same_features(krate: &Crate, member: &Member) -> bool {
    krate.features.len() == member.features.len()
        && member
            .features
            .iter()
            .all(|&feature| krate.features.contains(feature))
}

/// Violations of [`RULES`] by dependencies on other crates of the workspace.
fn directions(krate: &Crate, graph: &Graph) -> Vec<Violation> {
    let mut found = Vec::new();
    for rule in RULES.iter().filter(|rule| names(rule.who, krate)) {
        for (dependency, other) in inside(krate, graph) {
            if !allows(rule, other) {
                found.push(Violation::new(
                    rule.name,
                    krate,
                    format!("must not {}: {}", depend(dependency), rule.because),
                ));
            }
        }
    }
    found
}

/// Violations by a `no_std` crate that depends on a crate with the standard library. Tests and
/// build scripts run on a PC and may.
fn no_std(krate: &Crate, graph: &Graph, members: &[Member]) -> Vec<Violation> {
    let is_no_std = |name: &str| {
        members
            .iter()
            .any(|member| member.name == name && member.runs_on != RunsOn::Host)
    };
    if !is_no_std(&krate.name) {
        return Vec::new();
    }
    inside(krate, graph)
        .filter(|(dependency, _)| dependency.kind == Kind::Normal)
        .filter(|(dependency, _)| !is_no_std(&dependency.name))
        .map(|(dependency, _)| {
            let fault = format!(
                "must not {}: it is no_std, the other is not",
                depend(dependency)
            );
            Violation::new("no-std-below-std", krate, fault)
        })
        .collect()
}

/// Violations by a dependency that only the firmware may have. An example of a driver or of the
/// model for a microcontroller may also have it, as a dev-dependency for that microcontroller's
/// target.
fn hardware(krate: &Crate) -> Vec<Violation> {
    if krate.name == FIRMWARE {
        return Vec::new();
    }
    let mut found = Vec::new();
    for dependency in &krate.dependencies {
        let has_examples = names(DRIVERS, krate) || krate.name == MODEL;
        let for_an_example =
            has_examples && dependency.kind == Kind::Dev && dependency.target_gated;
        if for_an_example {
            continue;
        }
        if is_mcu_only(&dependency.name) {
            let fault = format!(
                "must not {}: only {FIRMWARE} names a HAL, RTIC or a log channel",
                depend(dependency)
            );
            found.push(Violation::new("hardware-in-firmware", krate, fault));
        }
        if dependency.name == LOG_FORMAT && !dependency.optional {
            let fault = format!(
                "must not {} unless a feature asks for it",
                depend(dependency)
            );
            found.push(Violation::new("log-format-optional", krate, fault));
        }
    }
    found
}

/// Dependencies of a crate within the workspace.
fn inside<'a>(
    krate: &'a Crate,
    graph: &'a Graph,
) -> impl Iterator<Item = (&'a Dependency, &'a Crate)> {
    krate.dependencies.iter().filter_map(|dependency| {
        graph
            .find(&dependency.name)
            .map(|other| (dependency, other))
    })
}

fn allows(rule: &Rule, other: &Crate) -> bool {
    match rule.may_depend {
        On::Only(list) => list.iter().any(|pattern| names(pattern, other)),
        On::AnyBut(list) => !list.iter().any(|pattern| names(pattern, other)),
    }
}

/// Whether a name, or a folder with `/*`, matches this crate.
fn names(pattern: &str, krate: &Crate) -> bool {
    match pattern.strip_suffix("/*") {
        Some(folder) => krate
            .folder
            .strip_prefix(folder)
            .is_some_and(|rest| rest.starts_with('/')),
        None => pattern == krate.name,
    }
}

/// Whether a crate from the registry belongs to a microcontroller.
fn is_mcu_only(name: &str) -> bool {
    !NOT_MCU.contains(&name)
        && MCU_ONLY.iter().any(|pattern| {
            if let Some(beginning) = pattern.strip_suffix('*') {
                name.starts_with(beginning)
            } else if let Some(end) = pattern.strip_prefix('*') {
                name.ends_with(end)
            } else {
                name == *pattern
            }
        })
}

/// "depend on" with the dependency's name and table.
fn depend(dependency: &Dependency) -> String {
    let table = match dependency.kind {
        Kind::Normal => "",
        Kind::Dev => ", not even as a dev-dependency",
        Kind::Build => ", not even as a build-dependency",
    };
    format!("depend on {}{table}", dependency.name)
}
