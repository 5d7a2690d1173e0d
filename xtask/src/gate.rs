//! The gate: its steps, made from the lists in [`crate::members`].

use anyhow::Result;

use crate::members::{
    ARM_TARGETS, FIRMWARE, FIRMWARE_TARGET, MCU_EXAMPLES, NO_STD, PUBLISHED, TESTED_FEATURES,
};
use crate::metadata::{self, Package};
use crate::process::{Invocation, Workspace};
use crate::setup::{CARGO_DENY, CARGO_FUZZ, MDBOOK, Need, TYPOS};
use crate::steps::{Action, Step, select};
use crate::{
    book, deps, evidence, firmware, fuzz, hardware, hygiene, package_files, panic_free, python,
    python_package, ros,
};

/// The test suite: every crate with its default features and with those that have their own tests.
pub(crate) fn test_steps() -> Vec<Step> {
    let programs = tests(&["--lib", "--bins", "--tests"]);
    vec![Step {
        name: "test",
        purpose: "unit, integration and documentation tests",
        needs: Vec::new(),
        action: Action::Commands(vec![programs, tests(&["--doc"])]),
        remedy: "fix what the failed test describes; its name and place are printed above",
    }]
}

/// Tests that need Python and its packages.
fn python_tests() -> Step {
    Step {
        name: "python",
        purpose: "what the tool writes is read by programs from elsewhere; only when it is named",
        needs: vec![Need::Target(FIRMWARE_TARGET)],
        action: Action::Check(python::check),
        remedy: "fix what the failed test describes; for a package that is missing, see the cause",
    }
}

/// Checks of boards and exports, which need KiCad.
fn hardware_checks() -> Step {
    Step {
        name: "hardware",
        purpose: "the carrier keeps KiCad's rules, and exported boards, drawings and moulds are what the design says; \
                  only when it is named",
        needs: Vec::new(),
        action: Action::Check(hardware::check),
        remedy: "fix what is named above; the checks stand in hardware/check.py and hardware/check_exports.py",
    }
}

/// The Python package, which nothing else builds.
fn python_package() -> Step {
    Step {
        name: "python-package",
        purpose: "the Python package builds, is typed, and gives the tool's numbers; only when it is named",
        needs: vec![Need::Tool(&CARGO_DENY), Need::Target(FIRMWARE_TARGET)],
        action: Action::Check(python_package::check),
        remedy: "fix what the failed command describes; for a package that is missing, see the cause",
    }
}

/// The ROS 2 node, which nothing else builds.
fn ros() -> Step {
    Step {
        name: "ros",
        purpose: "the ROS 2 node builds, and rclpy receives what boards send; only when it is named",
        needs: vec![Need::Tool(&CARGO_DENY), Need::Target(FIRMWARE_TARGET)],
        action: Action::Check(ros::check),
        remedy: "fix what the failed command describes; for a package that is missing, see the cause",
    }
}

/// Long tests that `cargo xtask test` leaves out; they are marked `#[ignore]`.
fn long_tests() -> Step {
    let programs = tests(&["--lib", "--bins", "--tests", "--", "--ignored"]);
    Step {
        name: "long-tests",
        purpose: "the tests that take long, most of them on the emulated board",
        needs: vec![Need::Target(FIRMWARE_TARGET)],
        action: Action::Commands(vec![programs]),
        remedy: "fix what the failed test describes; its name and place are printed above",
    }
}

/// Arguments that select every crate that a PC can build.
const HOST_PACKAGES: &[&str] = &["--workspace", "--exclude", FIRMWARE];

/// Tests of every crate for the host. All use the same features, so each crate is built once.
/// Examples are left out: `clippy` checks them.
fn tests(rest: &[&str]) -> Invocation {
    let features = ["--features", TESTED_FEATURES];
    Invocation::cargo(&[&["test", "--locked"], HOST_PACKAGES, &features, rest].concat())
}

/// Steps of `cargo xtask ci`: all of them, or those in `only`. Steps that install external programs
/// run only when named.
pub(crate) fn ci_steps(skip_tests: bool, only: &[String]) -> Result<Vec<Step>> {
    let mut steps = if skip_tests { Vec::new() } else { test_steps() };
    steps.extend(source_checks());
    steps.extend(host_checks());
    steps.extend(arm_checks());
    steps.push(long_tests());
    steps.push(fuzzing());
    steps.push(packaging());
    if only.is_empty() {
        return Ok(steps);
    }
    steps.push(python_tests());
    steps.push(python_package());
    steps.push(ros());
    steps.push(hardware_checks());
    select(steps, only)
}

/// Checks that read files and compile nothing.
fn source_checks() -> Vec<Step> {
    vec![
        Step {
            name: "fmt",
            purpose: "the source has rustfmt's layout",
            needs: Vec::new(),
            action: commands(&["fmt", "--all", "--check"]),
            remedy: "run `cargo fmt --all`",
        },
        Step {
            name: "deps",
            purpose: "dependencies point the way the design says",
            needs: vec![Need::Tool(&CARGO_DENY)],
            action: Action::Check(deps::check_workspace),
            remedy: "remove the dependency or move the code; the rules stand in deny.toml and xtask/src/deps.rs",
        },
        Step {
            name: "hygiene",
            purpose: "no machine paths and no build output in the repository; the microcontroller is \
                      named in its board's folder only",
            needs: Vec::new(),
            action: Action::Check(hygiene::check_workspace),
            remedy: "fix the named lines; take build output out with `git rm --cached`",
        },
        Step {
            name: "book",
            purpose: "every page is listed, every link leads to a file, every command of cargo names what \
                      exists, and the book builds",
            needs: vec![Need::Tool(&MDBOOK)],
            action: Action::Check(book::check_workspace),
            remedy: "fix the named lines; which links are allowed stands in CONTRIBUTING.md",
        },
        Step {
            name: "fuzz-lock",
            purpose: "the fuzzer's lock file, which is not the workspace's own, is up to date",
            needs: Vec::new(),
            action: Action::Check(fuzz::check_lock_file),
            remedy: "`cargo update --workspace --manifest-path fuzz/Cargo.toml`",
        },
        Step {
            name: "package-files",
            purpose: "each package has its licences, a titled README, keywords and a Rust version",
            needs: Vec::new(),
            action: Action::Check(package_files::check_workspace),
            remedy: "copy LICENSE-MIT and LICENSE-APACHE from the root, and complete the manifest",
        },
        Step {
            name: "evidence-age",
            purpose: "which results of campaigns are older than their code; age alone fails nothing",
            needs: Vec::new(),
            action: Action::Check(evidence::check_age),
            remedy: "name a commit of this repository in the row, and paths of it in xtask/src/evidence/mod.rs",
        },
        Step {
            name: "spelling",
            purpose: "no common misspellings, no marks of unfinished work and no retired words",
            needs: vec![Need::Tool(&TYPOS)],
            action: Action::Commands(vec![Invocation::new("typos", &[])]),
            remedy: "run `typos --write-changes`, or enter a term of the trade in typos.toml, which also lists \
                     the retired words",
        },
        Step {
            name: "licences",
            purpose: "licences and sources of every dependency",
            needs: vec![Need::Tool(&CARGO_DENY)],
            action: commands(&["deny", "--locked", "check", "licenses", "sources"]),
            remedy: "replace the dependency, or allow its licence in deny.toml with a reason",
        },
    ]
}

/// Checks of the code compiled for a PC.
fn host_checks() -> Vec<Step> {
    let all_of =
        |verb: &[&str], rest: &[&str]| Invocation::cargo(&[verb, HOST_PACKAGES, rest].concat());
    vec![
        Step {
            name: "clippy",
            purpose: "lints of every crate, test and example on the host",
            needs: Vec::new(),
            action: Action::Commands(vec![all_of(
                &["clippy", "--locked", "--all-targets", "--all-features"],
                &["--", "-D", "warnings"],
            )]),
            remedy: "fix the code; a lint is allowed only at its place and with a reason",
        },
        Step {
            name: "features",
            purpose: "lints of every library and program with every set of features",
            needs: Vec::new(),
            action: Action::Check(check_features),
            remedy: "fix the `cfg` that the named features break",
        },
        Step {
            name: "doc",
            purpose: "documentation builds without a warning",
            needs: Vec::new(),
            action: Action::Commands(vec![
                all_of(&["doc", "--locked", "--no-deps", "--all-features"], &[])
                    .with_env("RUSTDOCFLAGS", "-D warnings"),
            ]),
            remedy: "fix the link or the markup that rustdoc names",
        },
    ]
}

/// Checks of the code compiled for a microcontroller.
fn arm_checks() -> Vec<Step> {
    let targets = || ARM_TARGETS.iter().map(|&target| Need::Target(target));
    vec![
        Step {
            name: "clippy-arm",
            purpose: "lints of the no_std crates on the microcontroller targets",
            needs: targets().collect(),
            action: Action::Commands(
                on_every_target("clippy", &["--all-features", "--", "-D", "warnings"])
                    .chain([clippy_for_firmware()])
                    .collect(),
            ),
            remedy: "fix the code; a lint is allowed only at its place and with a reason",
        },
        Step {
            name: "no-std",
            purpose: "the no_std crates build where there is no standard library",
            needs: targets().collect(),
            // One command per library: in a single one, a dependency would get the features of all requests.
            action: Action::Commands(
                on_every_target("build", &["--no-default-features"])
                    .chain(on_every_target("build", &["--all-features"]))
                    .collect(),
            ),
            remedy: "use `core` instead of `std`, and turn off the dependency's default features",
        },
        Step {
            name: "panic-free",
            purpose: "no panic can be reached in a program that calls every method",
            needs: vec![Need::Target(panic_free::TARGET)],
            action: Action::Check(panic_free::check),
            remedy: "find the caller with a disassembler; indexing, division by what may be zero, \
                     unwrap and expect are the usual ones",
        },
        Step {
            name: "mcu-examples",
            purpose: "the examples for a microcontroller build and link",
            needs: targets().collect(),
            action: Action::Commands(MCU_EXAMPLES.iter().map(mcu_example).collect()),
            remedy: "fix the example; the table of examples is xtask/src/members.rs",
        },
        Step {
            name: "image-size",
            purpose: "the firmware's image builds and keeps within its budget",
            needs: vec![Need::Target(FIRMWARE_TARGET)],
            action: Action::Check(firmware::check_size),
            remedy: "make it smaller, or raise firmware/size-budget.toml and say why",
        },
        Step {
            name: "image-panics",
            purpose: "the firmware's image holds no panic but those on a list",
            needs: vec![Need::Target(FIRMWARE_TARGET)],
            action: Action::Check(firmware::check_panics),
            remedy: "find the caller with a disassembler; the list with its reasons stands in \
                     xtask/src/firmware/panics.rs",
        },
    ]
}

/// Runs the fuzzer for half a minute; `cargo xtask evidence fuzz` runs longer.
fn fuzzing() -> Step {
    Step {
        name: "fuzz",
        purpose: "the fuzzer finds no bytes for links, decoders and storage that break a promise",
        needs: vec![Need::Nightly, Need::Tool(&CARGO_FUZZ)],
        action: Action::Check(fuzz::check),
        remedy: "fix the defect, and put the input that found it into fuzz/corpus, where the tests have \
                 it; its place is printed above",
    }
}

/// Packages the crates intended for the registry, and builds them from the packages.
///
/// One command for all, so that a crate may depend on another one that is not yet in the registry.
fn packaging() -> Step {
    let mut arguments = vec!["publish", "--dry-run", "--allow-dirty"];
    arguments.extend(["--locked", "--all-features"]);
    arguments.extend(PUBLISHED.iter().flat_map(|package| ["--package", package]));
    Step {
        name: "package",
        purpose: "the published crates build from their own packages",
        needs: Vec::new(),
        action: commands(&arguments),
        remedy: "complete the manifest: a dependency needs a version, and every file has to lie \
                 in the crate's folder. This step reads the registry's index: it needs a network",
    }
}

fn commands(arguments: &[&str]) -> Action {
    Action::Commands(vec![Invocation::cargo(arguments)])
}

/// Lints of each library and program with every set of its features.
fn check_features(workspace: &Workspace) -> Result<String> {
    let packages = metadata::packages(workspace)?;
    let sets: Vec<_> = packages.iter().flat_map(feature_sets).collect();
    sets.iter().try_for_each(|lints| workspace.run(lints))?;
    Ok(format!(
        "{} sets of features are free of warnings",
        sets.len()
    ))
}

/// Lints of a crate with each set of its features: none, each alone, and all.
fn feature_sets(package: &Package) -> Vec<Invocation> {
    let base = ["clippy", "--locked", "--package", &package.name];
    let run = |rest: &[&str]| Invocation::cargo(&[&base, rest, &["--", "-D", "warnings"]].concat());
    let features = package.features.keys().filter(|name| *name != "default");
    let alone = features.map(|name| run(&["--no-default-features", "--features", name]));
    let mut sets: Vec<_> = alone.collect();
    if !sets.is_empty() {
        sets.insert(0, run(&["--no-default-features"]));
    }
    if sets.len() > 2 {
        sets.push(run(&["--all-features"]));
    }
    sets
}

/// Commands for each pair of a `no_std` library and a target.
fn on_every_target(verb: &str, rest: &[&str]) -> impl Iterator<Item = Invocation> {
    let pairs = NO_STD
        .iter()
        .flat_map(|package| ARM_TARGETS.iter().map(move |target| (package, target)));
    pairs.map(move |(package, target)| {
        let library = [
            verb,
            "--locked",
            "--package",
            package,
            "--lib",
            "--target",
            target,
        ];
        Invocation::cargo(&[&library, rest].concat())
    })
}

/// Lints of the firmware, which has one target only.
fn clippy_for_firmware() -> Invocation {
    let mut arguments = vec!["clippy", "--locked", "--package", FIRMWARE];
    arguments.extend(["--target", FIRMWARE_TARGET, "--", "-D", "warnings"]);
    Invocation::cargo(&arguments)
}

/// Build of an example for a microcontroller.
fn mcu_example(&(package, example, target): &(&str, &str, &str)) -> Invocation {
    // Without the firmware's optimisation, its examples exceed the memory.
    let profile = if package == FIRMWARE {
        "firmware"
    } else {
        "dev"
    };
    let build = ["build", "--locked", "--profile", profile];
    let what = [
        "--package",
        package,
        "--example",
        example,
        "--target",
        target,
    ];
    Invocation::cargo(&[build.as_slice(), &what].concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn crate_with(features: &[&str]) -> Package {
        let workspace = Workspace::find(None).unwrap();
        let mut package = metadata::packages(&workspace).unwrap().remove(0);
        let features = features.iter().map(|name| ((*name).to_owned(), Vec::new()));
        package.features = features.collect();
        package.name = "sample".to_owned();
        package
    }

    fn lines(invocations: &[Invocation]) -> Vec<String> {
        invocations.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn crates_are_checked_without_features_with_each_alone_and_with_all() {
        let base = "cargo clippy --locked --package sample";
        let denied = "-- -D warnings";
        assert_eq!(
            lines(&feature_sets(&crate_with(&["a", "b", "default"]))),
            [
                format!("{base} --no-default-features {denied}"),
                format!("{base} --no-default-features --features a {denied}"),
                format!("{base} --no-default-features --features b {denied}"),
                format!("{base} --all-features {denied}"),
            ]
        );
        assert_eq!(feature_sets(&crate_with(&["a"])).len(), 2);
        assert!(feature_sets(&crate_with(&[])).is_empty());
    }

    #[test]
    fn step_names_are_unique_and_skipping_tests_skips_nothing_else() {
        let all = ci_steps(false, &[]).unwrap();
        let names: BTreeSet<_> = all.iter().map(|step| step.name).collect();
        assert_eq!(names.len(), all.len());
        let rest = ci_steps(true, &[]).unwrap();
        assert_eq!(rest.len() + test_steps().len(), all.len());
    }

    #[test]
    fn no_command_may_change_the_lock_file() {
        for step in ci_steps(false, &[]).unwrap() {
            let Action::Commands(invocations) = &step.action else {
                continue;
            };
            for invocation in invocations {
                let line = invocation.to_string();
                let resolves = line.contains("cargo") && !line.contains("cargo fmt");
                assert!(!resolves || line.contains("--locked"), "{line}");
            }
        }
    }
}
