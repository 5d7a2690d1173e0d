//! Checks cargo commands in a text: the verbs, packages, targets, features and tests that they name
//! must exist.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Parser;

use crate::arguments::{Arguments, Verb};
use crate::metadata::{Package, packages};
use crate::process::Workspace;
use crate::{evidence, gate, repository};

/// Verbs of cargo itself, of its usual components, and of tools that `cargo xtask setup` installs.
const VERBS: &[&str] = &[
    "bench",
    "build",
    "check",
    "clippy",
    "deny",
    "doc",
    "fmt",
    "install",
    "metadata",
    "run",
    "test",
    "uninstall",
];

/// Names that commands may use.
#[derive(Debug, Default)]
pub(super) struct Cargo {
    aliases: BTreeSet<String>,
    packages: BTreeMap<String, Contents>,
}

/// Contents of a package.
#[derive(Debug)]
struct Contents {
    /// Folder of the package, relative to the root.
    folder: PathBuf,
    features: BTreeSet<String>,
    /// Programs, tests, examples and benchmarks of the package, each as cargo's option, such as
    /// `--test integration`.
    targets: BTreeSet<String>,
    /// Text of the package's sources, which has the names that select tests.
    sources: String,
}

/// Names in the options of a command.
#[derive(Default)]
struct Named<'t> {
    package: Option<&'t str>,
    path: Option<&'t str>,
    features: Vec<&'t str>,
    targets: Vec<String>,
    filters: Vec<&'t str>,
}

impl Cargo {
    /// Reads the workspace's metadata from cargo, and its sources.
    pub(super) fn read(workspace: &Workspace) -> Result<Self> {
        let files = repository::files(workspace)?;
        let packages = packages(workspace)?.into_iter();
        let packages = packages.map(|package| Contents::read(package, workspace, &files));
        let config = fs::read_to_string(workspace.root().join(".cargo/config.toml"))?;
        let config: toml::Table = config.parse()?;
        let aliases = config.get("alias").and_then(toml::Value::as_table);
        let aliases = aliases.into_iter().flat_map(|table| table.keys().cloned());
        Ok(Self {
            aliases: aliases.collect(),
            packages: packages.collect::<Result<_>>()?,
        })
    }

    /// Describes a name in a command that does not exist; `None` if all names exist. Words in
    /// capitals are placeholders.
    pub(super) fn fault_of(&self, command: &str) -> Option<String> {
        let command = command.split(" #").next().unwrap_or_default();
        let mut words = command.split_whitespace();
        words.find(|word| *word == "cargo")?;
        let words: Vec<_> = words.skip_while(|word| word.starts_with('+')).collect();
        let mut words = words.as_slice();
        while let ["--config", _, rest @ ..] = words {
            words = rest;
        }
        match words {
            // A sentence that only names the program, or a toolchain of cargo.
            [] | ["xtask"] => None,
            ["xtask", ..] => fault_of_xtask(words),
            [verb, ..] if self.aliases.contains(*verb) => None,
            [verb, rest @ ..] if VERBS.contains(verb) => {
                let mut named = Named::read(rest);
                if *verb != "test" {
                    named.filters.clear();
                }
                self.missing(&named)
            }
            _ => Some(format!("cargo has no such verb: {command}")),
        }
    }

    fn missing(&self, named: &Named<'_>) -> Option<String> {
        let asked = self.packages.iter();
        let asked = asked.filter(|(name, _)| named.package.is_none_or(|package| package == *name));
        let asked: Vec<_> = asked.map(|(_, package)| package).collect();
        if let Some(package) = named.package.filter(|_| asked.is_empty()) {
            return Some(format!("there is no package {package}"));
        }
        let any = |has: &dyn Fn(&Contents) -> bool| asked.iter().any(|package| has(package));
        let targets = named.targets.iter().map(String::as_str);
        let targets = targets.map(|name| (name, any(&|package| package.targets.contains(name))));
        let features = named.features.iter().copied();
        let features = features.map(|name| (name, any(&|package| package.features.contains(name))));
        let paths = named.path.into_iter();
        let paths = paths.map(|name| (name, any(&|package| package.folder == Path::new(name))));
        let filters = named.filters.iter().copied();
        let filters = filters.map(|name| (name, any(&|package| package.has_test(name))));
        let mut all = targets.chain(features).chain(paths).chain(filters);
        let (name, _) = all.find(|(_, exists)| !exists)?;
        Some(format!("there is no {name}"))
    }
}

impl Contents {
    fn read(package: Package, workspace: &Workspace, files: &[String]) -> Result<(String, Self)> {
        let folder = package.folder().strip_prefix(workspace.root())?.to_owned();
        let sources = files.iter().filter(|file| file.ends_with(".rs"));
        let sources = sources.filter(|file| Path::new(file).starts_with(&folder));
        // Git may list a deleted file; it has no names.
        let sources = sources.map(|file| fs::read_to_string(workspace.root().join(file)));
        let sources = sources.map(Result::unwrap_or_default).collect();
        let targets = package.targets.iter().flat_map(|target| {
            let kinds = target.kind.iter();
            kinds.map(|kind| format!("--{kind} {}", target.name))
        });
        let contents = Self {
            targets: targets.collect(),
            features: package.features.into_keys().collect(),
            folder,
            sources,
        };
        Ok((package.name, contents))
    }

    /// Whether the sources have every part of a test's path.
    fn has_test(&self, path: &str) -> bool {
        path.split("::").all(|part| self.sources.contains(part))
    }
}

impl<'t> Named<'t> {
    fn read(words: &[&'t str]) -> Self {
        let mut named = Self::default();
        let is_literal = |name: &&str| name.chars().any(|c| c.is_ascii_lowercase());
        let mut words = words.iter().copied();
        while let Some(word) = words.next() {
            match word {
                "--" => break,
                "-p" | "--package" => named.package = words.next().filter(is_literal),
                "--path" => named.path = words.next(),
                "--features" => named.features.extend(words.next()),
                "--test" | "--example" | "--bin" | "--bench" => {
                    let name = words.next().filter(is_literal);
                    named
                        .targets
                        .extend(name.map(|name| format!("{word} {name}")));
                }
                "--profile" | "--target" | "--manifest-path" => drop(words.next()),
                option if option.starts_with('-') => {}
                filter => named.filters.push(filter),
            }
        }
        named
    }
}

/// Description of a fault in a command of xtask; `None` if it is right.
fn fault_of_xtask(words: &[&str]) -> Option<String> {
    let words = words.iter().copied().filter(|word| *word != "...");
    let parsed = match Arguments::try_parse_from(words) {
        Ok(arguments) => arguments.verb,
        Err(error) => return Some(error.to_string()),
    };
    match parsed {
        Verb::Ci { only, .. } => gate::ci_steps(false, &only)
            .err()
            .map(|error| error.to_string()),
        Verb::Evidence { name: Some(name) } if name != "NAME" && !evidence::exists(&name) => {
            Some(format!("there is no evidence {name}"))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_command_names_exists() {
        let cargo = Cargo::read(&Workspace::find(None).unwrap()).unwrap();
        for good in [
            "cargo demo",
            "cargo +1.88.0 check --package ldc161x --all-features",
            "A=b cargo xtask ci --only fmt --only clippy    # two",
            "cargo xtask evidence NAME",
            "cargo --config env.A='1' --config env.B='2' test -p palpate-emulator --test integration flash::",
            "cargo test -p NAME",
            "cargo test -p palpate-emulator --test integration flash::",
            "cargo run --example linux -- /dev/i2c-1",
            "cargo install --locked --path host/tool --features probe",
        ] {
            assert_eq!(cargo.fault_of(good), None, "{good}");
        }
        for bad in [
            "cargo dmeo",
            "cargo xtask tset",
            "cargo xtask ci --only format",
            "cargo xtask evidence nothing",
            "cargo test -p palpate-emulators",
            "cargo test -p palpate-emulator --test unit",
            "cargo test -p palpate-emulator --test integration flesh::",
            "cargo run --example macos",
            "cargo install --path hosts",
            "cargo install --path host/tool --features probes",
        ] {
            assert!(cargo.fault_of(bad).is_some(), "{bad}");
        }
    }
}
