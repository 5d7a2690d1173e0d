//! Child processes: the one place that decides their directory and environment.
//!
//! `cargo xtask` is itself run by `cargo run`, often through rustup, and both set variables in the
//! environment: `CARGO` and `RUSTUP_TOOLCHAIN` name the outer toolchain, and `CARGO_PKG_*` and
//! similar ones describe the xtask package. A child that inherits them may use another toolchain
//! than that of `rust-toolchain.toml`, or mix two of them, so [`Workspace::command`] removes them.
//! Variables that the user may have set stay: `CARGO_HOME`, `CARGO_TARGET_DIR`, `RUSTFLAGS`,
//! `RUSTC_WRAPPER`, registry and network settings.
//!
//! Therefore `cargo +NAME xtask ...` does not affect the children: `--toolchain NAME` does.

use std::env;
use std::fmt;
use std::io::{self, BufRead, BufReader, PipeWriter};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde_json::Value;

/// The checkout in which the children run, and the toolchain they use.
#[derive(Debug)]
pub(crate) struct Workspace {
    root: PathBuf,
    toolchain: Option<String>,
}

impl Workspace {
    /// The workspace of this program.
    ///
    /// Found at run time, not at compile time, so that a checkout may be moved.
    pub(crate) fn find(toolchain: Option<String>) -> Result<Self> {
        let package = env::var_os("CARGO_MANIFEST_DIR").context(
            "the environment variable CARGO_MANIFEST_DIR is not set, so the workspace is unknown; \
             start this program as `cargo xtask`",
        )?;
        let root = Path::new(&package)
            .parent()
            .context("the xtask package has no parent folder; it belongs into the workspace")?;
        Ok(Self {
            root: root.to_path_buf(),
            toolchain,
        })
    }

    /// The folder of the workspace's `Cargo.toml`.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// A copy of the workspace, with the same toolchain.
    pub(crate) fn copied_to(&self, root: PathBuf) -> Self {
        Self {
            root,
            toolchain: self.toolchain.clone(),
        }
    }

    /// A child process in the workspace's folder, with a cleaned environment.
    pub(crate) fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.current_dir(&self.root);
        for (name, _) in env::vars_os() {
            if name.to_str().is_some_and(describes_the_parent) {
                command.env_remove(name);
            }
        }
        if let Some(toolchain) = &self.toolchain {
            command.env("RUSTUP_TOOLCHAIN", toolchain);
        }
        command
    }

    /// Runs a command silently and returns its standard output.
    pub(crate) fn output(&self, invocation: &Invocation) -> Result<String> {
        let output = invocation
            .command(self)
            .output()
            .with_context(|| invocation.cannot_start())?;
        if !output.status.success() {
            let message = String::from_utf8_lossy(&output.stderr);
            bail!("`{invocation}` failed ({}): {message}", output.status);
        }
        String::from_utf8(output.stdout)
            .with_context(|| format!("`{invocation}` printed text that is not UTF-8"))
    }

    /// Runs a cargo build with JSON messages; returns the program's path. Its other output goes to
    /// standard error at once: a build takes minutes, and may wait for another one.
    pub(crate) fn build(&self, invocation: &Invocation) -> Result<PathBuf> {
        let output = invocation
            .command(self)
            .stderr(Stdio::inherit())
            .output()
            .with_context(|| invocation.cannot_start())?;
        if !output.status.success() {
            bail!("`{invocation}` failed ({})", output.status);
        }
        executable(&String::from_utf8_lossy(&output.stdout))
            .with_context(|| format!("`{invocation}` named no program"))
    }

    /// Runs a command with its output on the terminal.
    pub(crate) fn run(&self, invocation: &Invocation) -> Result<()> {
        println!("    $ {invocation}");
        let status = invocation
            .command(self)
            .status()
            .with_context(|| invocation.cannot_start())?;
        if !status.success() {
            bail!("`{invocation}` failed ({status})");
        }
        Ok(())
    }

    /// Runs a command, shows the lines of one of its streams as they come, and returns them.
    pub(crate) fn observe(
        &self,
        invocation: &Invocation,
        stream: fn(&mut Command, PipeWriter) -> &mut Command,
    ) -> Result<String> {
        println!("    $ {invocation}");
        let unreadable = || format!("the output of `{invocation}` could not be read");
        let (reader, writer) = io::pipe().with_context(unreadable)?;
        let mut command = invocation.command(self);
        let started = stream(&mut command, writer).spawn();
        let mut child = started.with_context(|| invocation.cannot_start())?;
        // The loop ends only when the pipe's write end is closed, which `command` holds.
        drop(command);
        let mut printed = String::new();
        for line in BufReader::new(reader).lines() {
            let line = line.with_context(unreadable)?;
            println!("{line}");
            printed.push_str(&line);
            printed.push('\n');
        }
        let status = child.wait().with_context(unreadable)?;
        if !status.success() {
            bail!("`{invocation}` failed ({status})");
        }
        Ok(printed)
    }

    /// Whether a command starts and succeeds; its output is discarded.
    pub(crate) fn succeeds(&self, invocation: &Invocation) -> bool {
        invocation
            .command(self)
            .output()
            .is_ok_and(|output| output.status.success())
    }

    /// Version of the compiler that the children use.
    pub(crate) fn compiler(&self) -> Result<String> {
        let version = self.output(&Invocation::new("rustc", &["--version"]))?;
        Ok(version.trim().to_owned())
    }
}

/// Path of the executable in cargo's messages.
fn executable(messages: &str) -> Option<PathBuf> {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .filter(|message| message["reason"] == "compiler-artifact")
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
}

/// Whether a variable describes the cargo that runs xtask, rather than the user's settings.
fn describes_the_parent(name: &str) -> bool {
    const NAMES: &[&str] = &[
        "CARGO",
        "CARGO_BIN_NAME",
        "CARGO_CRATE_NAME",
        "CARGO_MANIFEST_DIR",
        "CARGO_MANIFEST_PATH",
        "CARGO_PRIMARY_PACKAGE",
        "OUT_DIR",
        "RUSTC",
        "RUSTDOC",
        "RUSTUP_TOOLCHAIN",
    ];
    NAMES.contains(&name) || name.starts_with("CARGO_PKG_")
}

/// A command line as data, shown to the user before it runs and in every error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Invocation {
    program: String,
    arguments: Vec<String>,
    environment: Vec<(&'static str, String)>,
}

impl Invocation {
    /// A program with arguments.
    pub(crate) fn new(program: &str, arguments: &[&str]) -> Self {
        Self {
            program: program.to_owned(),
            arguments: arguments.iter().map(|&text| text.to_owned()).collect(),
            environment: Vec::new(),
        }
    }

    /// `cargo` with arguments.
    pub(crate) fn cargo(arguments: &[&str]) -> Self {
        Self::new("cargo", arguments)
    }

    /// Adds a variable to the command's environment.
    pub(crate) fn with_env(mut self, name: &'static str, value: &str) -> Self {
        self.environment.push((name, value.to_owned()));
        self
    }

    /// The process, ready to be started.
    pub(crate) fn command(&self, workspace: &Workspace) -> Command {
        let mut command = workspace.command(&self.program);
        command.args(&self.arguments);
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
        command
    }

    /// Message for a program that does not start.
    pub(crate) fn cannot_start(&self) -> String {
        let program = &self.program;
        format!("`{self}` could not be started; check that `{program}` is installed and on PATH")
    }
}

impl fmt::Display for Invocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, value) in &self.environment {
            write!(f, "{name}={} ", quoted(value))?;
        }
        f.write_str(&self.program)?;
        for argument in &self.arguments {
            write!(f, " {}", quoted(argument))?;
        }
        Ok(())
    }
}

/// An argument, quoted as on a command line.
fn quoted(argument: &str) -> String {
    if argument.is_empty() || argument.contains(char::is_whitespace) {
        format!("\"{argument}\"")
    } else {
        argument.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Change of an environment variable by a command: `None` when the command inherits the
    /// variable.
    fn change(command: &Command, name: &str) -> Option<Option<String>> {
        command
            .get_envs()
            .find(|(key, _)| *key == name)
            .map(|(_, value)| value.map(|value| value.to_string_lossy().into_owned()))
    }

    #[test]
    fn the_parents_toolchain_is_removed_and_the_users_settings_stay() {
        for name in ["CARGO", "RUSTC", "RUSTUP_TOOLCHAIN", "CARGO_PKG_VERSION"] {
            assert!(describes_the_parent(name), "{name} reaches the children");
        }
        for name in ["CARGO_HOME", "CARGO_TARGET_DIR", "RUSTFLAGS", "PATH"] {
            assert!(!describes_the_parent(name), "{name} is lost");
        }
    }

    #[test]
    fn a_child_does_not_see_the_variables_of_the_cargo_that_runs_this_test() {
        let workspace = Workspace::find(None).unwrap();
        let command = workspace.command("cargo");
        assert_eq!(change(&command, "CARGO_PKG_NAME"), Some(None));
        assert_eq!(change(&command, "CARGO_MANIFEST_DIR"), Some(None));
        assert_eq!(change(&command, "PATH"), None);
    }

    #[test]
    fn a_toolchain_asked_for_reaches_the_children() {
        let workspace = Workspace::find(Some("1.95.0".to_owned())).unwrap();
        let asked = Some(Some("1.95.0".to_owned()));
        assert_eq!(
            change(&workspace.command("cargo"), "RUSTUP_TOOLCHAIN"),
            asked
        );
    }

    #[test]
    fn a_command_is_shown_as_it_would_be_typed() {
        let invocation = Invocation::cargo(&["doc", "--no-deps"]).with_env("FLAGS", "-D warnings");
        assert_eq!(
            invocation.to_string(),
            "FLAGS=\"-D warnings\" cargo doc --no-deps"
        );
    }

    #[test]
    fn a_missing_program_is_named_with_what_to_do() {
        let workspace = Workspace::find(None).unwrap();
        let missing = Invocation::new("palpate-no-such-program", &[]);
        let error = workspace.run(&missing).unwrap_err().to_string();
        assert!(error.contains("palpate-no-such-program"), "{error}");
        assert!(error.contains("installed"), "{error}");
    }

    #[test]
    fn a_failing_command_is_an_error() {
        let workspace = Workspace::find(None).unwrap();
        let failing = Invocation::new("rustc", &["--palpate-no-such-option"]);
        assert!(workspace.run(&failing).is_err());
        assert!(workspace.output(&failing).is_err());
        assert!(!workspace.succeeds(&failing));
    }
}
