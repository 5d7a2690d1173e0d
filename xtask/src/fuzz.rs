//! `cargo xtask fuzz`: runs every target of `fuzz/` for a while, by cargo-fuzz on a nightly
//! toolchain.
//!
//! The targets' code is in `tests/src/fuzz`, and the tests run the corpus without a fuzzer. New
//! inputs that the fuzzer finds go to `target/fuzz`, inputs that break a promise to
//! `fuzz/artifacts`.

use std::fs;
use std::process::Command;

use anyhow::{Context, Result};

use crate::evidence::{BEGIN, END};
use crate::process::{Invocation, Workspace};
use crate::setup::NIGHTLY;

/// Targets, as in `fuzz/Cargo.toml`.
const TARGETS: &[&str] = &["commands", "frames", "storage"];
/// Seconds per target in the gate: enough to run some hundred boards.
const SECONDS_IN_GATE: u32 = 10;
/// Seed of the fuzzer in the gate: the same for all developers.
const SEED_IN_GATE: u32 = 1;
/// Folder of a run's build and results.
const FOLDER: &str = "target/fuzz";
/// Seconds after which an input counts as endless: a script of half a minute of board time takes
/// one second.
const LONGEST: u32 = 60;

/// Result of a target.
#[derive(Debug, Default, PartialEq, Eq)]
struct FuzzOutcome {
    /// Number of inputs run.
    runs: u64,
    /// Number of inputs that reached new code.
    found: u64,
}

/// Runs every target for some seconds each, as a campaign, and prints the result.
pub(crate) fn run(workspace: &Workspace, seconds: u32, seed: u32) -> Result<()> {
    let outcomes = all(workspace, seconds, seed)?;
    println!("{BEGIN}\n{}\n{END}", sentence(&outcomes, seconds));
    Ok(())
}

/// Runs every target within the gate.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let outcomes = all(workspace, SECONDS_IN_GATE, SEED_IN_GATE)?;
    let runs: u64 = outcomes.iter().map(|(_, outcome)| outcome.runs).sum();
    Ok(format!("{runs} inputs kept every promise"))
}

fn all(workspace: &Workspace, seconds: u32, seed: u32) -> Result<Vec<(&'static str, FuzzOutcome)>> {
    check_lock_file(workspace)?;
    let one = |&target: &&'static str| Ok((target, fuzz(workspace, target, seconds, seed)?));
    TARGETS.iter().map(one).collect()
}

/// Checks the lock file, which cargo-fuzz would change silently.
pub(crate) fn check_lock_file(workspace: &Workspace) -> Result<String> {
    let manifest = "fuzz/Cargo.toml";
    let arguments = ["metadata", "--locked", "--format-version", "1"];
    let query = [&arguments[..], &["--manifest-path", manifest]].concat();
    let read = workspace.output(&Invocation::cargo(&query));
    read.map(|_| "every dependency is locked".to_owned())
        .with_context(|| {
            format!(
                "bring it up to date with `cargo update --workspace --manifest-path {manifest}`"
            )
        })
}

fn fuzz(workspace: &Workspace, target: &str, seconds: u32, seed: u32) -> Result<FuzzOutcome> {
    let found = format!("{FOLDER}/found/{target}");
    fs::create_dir_all(workspace.root().join(&found))
        .with_context(|| format!("{found} could not be created"))?;
    let invocation = invocation(target, &found, seconds, seed);
    let said = workspace
        .observe(&invocation, Command::stderr)
        .with_context(|| {
            format!("an input that breaks a promise lies in fuzz/artifacts/{target}")
        })?;
    outcome(&said).with_context(|| format!("`{invocation}` did not say how many inputs it ran"))
}

fn invocation(target: &str, found: &str, seconds: u32, seed: u32) -> Invocation {
    let toolchain = format!("+{NIGHTLY}");
    let corpus = format!("fuzz/corpus/{target}");
    // The fuzzed code has no unsafe code of this project: a sanitizer would only slow it down.
    let build = ["--sanitizer", "none", "--target-dir", FOLDER];
    let options = [
        format!("-seed={seed}"),
        format!("-max_total_time={seconds}"),
        format!("-timeout={LONGEST}"),
        "-print_final_stats=1".to_owned(),
        "-verbosity=0".to_owned(),
    ];
    let mut arguments = vec![toolchain.as_str(), "fuzz", "run"];
    arguments.extend(build);
    arguments.extend([target, found, &corpus, "--"]);
    arguments.extend(options.iter().map(String::as_str));
    Invocation::cargo(&arguments)
}

/// Parses libFuzzer's statistics.
fn outcome(said: &str) -> Option<FuzzOutcome> {
    let number = |name: &str| {
        let mut lines = said.lines();
        let of = lines.find_map(|line| line.strip_prefix("stat::")?.strip_prefix(name))?;
        of.trim_start_matches(':').trim().parse().ok()
    };
    Some(FuzzOutcome {
        runs: number("number_of_executed_units")?,
        found: number("new_units_added")?,
    })
}

fn sentence(outcomes: &[(&str, FuzzOutcome)], seconds: u32) -> String {
    let inputs = outcomes
        .iter()
        .map(|(target, FuzzOutcome { runs, found })| {
            format!("{runs} of {target}, of which {found} reached something new")
        });
    let inputs: Vec<_> = inputs.collect();
    format!(
        "Every input kept every promise, in {seconds} s of each target: {}.",
        inputs.join("; ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_statistics_of_a_run_are_read_and_their_absence_is_noticed() {
        let said = "Done 7 runs\n\
                    stat::number_of_executed_units: 969026\n\
                    stat::average_exec_per_sec:     23634\n\
                    stat::new_units_added:          6391\n";
        let expected = FuzzOutcome {
            runs: 969_026,
            found: 6_391,
        };
        assert_eq!(outcome(said), Some(expected));
        assert_eq!(outcome("error: no such target"), None);
    }

    #[test]
    fn every_target_has_a_program_and_a_corpus() {
        let workspace = Workspace::find(None).unwrap();
        let folder = workspace.root().join("fuzz");
        let mut programs: Vec<_> = fs::read_dir(folder.join("fuzz_targets"))
            .unwrap()
            .map(|file| file.unwrap().path())
            .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
            .collect();
        programs.sort();
        assert_eq!(programs, TARGETS);
        for target in TARGETS {
            let corpus = fs::read_dir(folder.join("corpus").join(target)).unwrap();
            assert!(corpus.count() > 0, "{target}");
        }
    }
}
