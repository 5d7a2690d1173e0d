//! Steps: their order, their execution, and the message of a failed step.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};

use crate::process::{Invocation, Workspace};
use crate::setup::Need;

/// One part of the gate.
#[derive(Debug)]
pub(crate) struct Step {
    /// Short name, the argument of `--only`.
    pub(crate) name: &'static str,
    /// What the step checks, for the summary.
    pub(crate) purpose: &'static str,
    pub(crate) needs: Vec<Need>,
    pub(crate) action: Action,
    /// Remedy after a failure.
    pub(crate) remedy: &'static str,
}

#[derive(Debug)]
pub(crate) enum Action {
    /// Commands, one after the other.
    Commands(Vec<Invocation>),
    /// A check of this program, which returns its result in one line.
    Check(fn(&Workspace) -> Result<String>),
}

impl Step {
    /// Runs the step to its end or its first error, which includes a remedy.
    fn run(&self, workspace: &Workspace) -> Result<(), String> {
        for need in &self.needs {
            // This error has its own remedy; the step's remedy is for its findings.
            need.provide(workspace)
                .map_err(|cause| format!("  cause: {cause:#}"))?;
        }
        self.act(workspace)
            .map_err(|cause| format!("  cause: {cause:#}\n  what to do: {}", self.remedy))
    }

    fn act(&self, workspace: &Workspace) -> Result<()> {
        match &self.action {
            Action::Commands(invocations) => invocations
                .iter()
                .try_for_each(|invocation| workspace.run(invocation)),
            Action::Check(check) => check(workspace).map(|finding| println!("    {finding}")),
        }
    }
}

/// A passed step, with its duration.
struct Passed {
    name: &'static str,
    took: Duration,
}

/// Runs the steps in order, prints a summary, and stops at the first failure.
pub(crate) fn run_all(workspace: &Workspace, steps: &[Step]) -> Result<()> {
    println!("toolchain: {}", workspace.compiler()?);
    let mut passed = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        println!(
            "\n==> [{}/{}] {}: {}",
            index + 1,
            steps.len(),
            step.name,
            step.purpose
        );
        let start = Instant::now();
        let outcome = step.run(workspace);
        let took = start.elapsed();
        if let Err(explanation) = outcome {
            println!("    failed after {}", seconds(took));
            print!("\n{}", summary(&passed, steps.len()));
            bail!(
                "the step `{0}` failed\n{explanation}\n  this step alone: cargo xtask ci --only {0}",
                step.name
            );
        }
        println!("    passed in {}", seconds(took));
        passed.push(Passed {
            name: step.name,
            took,
        });
    }
    print!("\n{}", summary(&passed, steps.len()));
    Ok(())
}

/// Selects the steps of the given names, in the order of the gate.
pub(crate) fn select(steps: Vec<Step>, names: &[String]) -> Result<Vec<Step>> {
    for name in names {
        if !steps.iter().any(|step| step.name == name) {
            let known: Vec<_> = steps.iter().map(|step| step.name).collect();
            bail!(
                "there is no step `{name}`; the steps are {}",
                known.join(", ")
            );
        }
    }
    Ok(steps
        .into_iter()
        .filter(|step| names.iter().any(|name| name == step.name))
        .collect())
}

/// Each passed step with its time, and the number of steps that have not passed.
fn summary(passed: &[Passed], all: usize) -> String {
    let mut text = String::new();
    let mut total = Duration::ZERO;
    for step in passed {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {:<12} {:>9}", step.name, seconds(step.took));
        total += step.took;
    }
    let _ = writeln!(
        text,
        "{} of {all} steps passed in {}",
        passed.len(),
        seconds(total)
    );
    text
}

fn seconds(duration: Duration) -> String {
    format!("{:.1} s", duration.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup;
    use anyhow::anyhow;

    fn step(name: &'static str, check: fn(&Workspace) -> Result<String>) -> Step {
        Step {
            name,
            purpose: "try something",
            needs: Vec::new(),
            action: Action::Check(check),
            remedy: "fix it",
        }
    }

    fn pass(_: &Workspace) -> Result<String> {
        Ok("all is well".to_owned())
    }

    fn fail(_: &Workspace) -> Result<String> {
        Err(anyhow!("a planted defect"))
    }

    fn never(_: &Workspace) -> Result<String> {
        panic!("a step ran after a failed one")
    }

    #[test]
    fn the_first_failure_ends_the_run_with_cause_and_remedy() {
        let workspace = Workspace::find(None).unwrap();
        let steps = [step("one", pass), step("two", fail), step("three", never)];
        let message = run_all(&workspace, &steps).unwrap_err().to_string();
        assert!(message.contains("`two`"), "{message}");
        assert!(message.contains("cause: a planted defect"), "{message}");
        assert!(message.contains("what to do: fix it"), "{message}");
    }

    #[test]
    fn a_missing_tool_fails_its_step_with_its_own_remedy() {
        let workspace = Workspace::find(None).unwrap();
        let mut needy = step("needy", never);
        needy.needs = vec![Need::Tool(&setup::ABSENT)];
        let message = run_all(&workspace, &[needy]).unwrap_err().to_string();
        assert!(message.contains("is not installed"), "{message}");
        assert!(!message.contains("fix it"), "{message}");
    }

    #[test]
    fn a_failing_command_fails_its_step() {
        let workspace = Workspace::find(None).unwrap();
        let mut failing = step("command", pass);
        failing.action = Action::Commands(vec![
            Invocation::new("rustc", &["--version"]),
            Invocation::new("rustc", &["--palpate-no-such-option"]),
        ]);
        assert!(run_all(&workspace, &[failing]).is_err());
    }

    #[test]
    fn the_summary_counts_what_has_passed_against_all() {
        let passed = [Passed {
            name: "fmt",
            took: Duration::from_millis(1_500),
        }];
        let text = summary(&passed, 3);
        assert!(text.contains("fmt"), "{text}");
        assert!(text.ends_with("1 of 3 steps passed in 1.5 s\n"), "{text}");
    }

    #[test]
    fn steps_are_selected_by_name_and_a_wrong_name_is_an_error() {
        let steps = || vec![step("one", pass), step("two", pass)];
        let selected = select(steps(), &["two".to_owned()]).unwrap();
        assert_eq!(selected.len(), 1);
        assert_eq!(selected[0].name, "two");
        let message = select(steps(), &["tow".to_owned()])
            .unwrap_err()
            .to_string();
        assert!(message.contains("one, two"), "{message}");
    }
}
