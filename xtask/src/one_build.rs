//! `cargo demo` and `cargo xtask test` share one build: each reuses the crates that the other has
//! compiled.
//!
//! Cargo rebuilds a crate, and all crates that depend on it, if the crate is requested with other
//! features.

use std::collections::{BTreeMap, BTreeSet};

use crate::members::TESTED_FEATURES;
use crate::process::{Invocation, Workspace};

/// Sets of features with which each package, by name and version, is built.
type Builds = BTreeMap<String, BTreeSet<String>>;

fn builds(edges: &str, arguments: &[&str]) -> Builds {
    let query = ["tree", "--locked", "--prefix", "none", "--format"];
    let format = ["{p}|{f}", "--edges", edges];
    let query = Invocation::cargo(&[&query[..], &format, arguments].concat());
    let printed = Workspace::find(None).unwrap().output(&query).unwrap();
    let mut builds = Builds::new();
    for line in printed.lines() {
        // A package that cargo has listed earlier is marked with `(*)`.
        let Some((package, features)) = line.trim_end_matches(" (*)").split_once('|') else {
            continue;
        };
        let features = features.to_owned();
        builds
            .entry(package.to_owned())
            .or_default()
            .insert(features);
    }
    builds
}

#[test]
fn the_tests_take_what_the_demo_has_built() {
    let alone = builds("normal,build", &["--package", "palpate-simulate"]);
    // Without `--package`, as in the alias `cargo demo`, all default members enable features.
    let demo = builds("normal,build", &[]);
    let tests = builds("normal,build,dev", &["--features", TESTED_FEATURES]);
    for package in alone.keys() {
        let (demo, tests) = (&demo[package], &tests[package]);
        assert!(
            !demo.is_disjoint(tests),
            "{package} is built twice, for the demo with {demo:?} and for the tests with {tests:?}: add what \
             is missing to tests/campaigns/Cargo.toml"
        );
    }
    assert!(alone.len() > 50, "{}", alone.len());
}
