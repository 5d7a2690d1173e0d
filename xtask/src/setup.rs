//! Prerequisites of the checks besides stable Rust: microcontroller targets, four tools, and a
//! nightly toolchain for the fuzzer. A release needs two more tools.

use anyhow::{Context, Result, anyhow, bail};

use crate::members::ARM_TARGETS;
use crate::process::{Invocation, Workspace};

/// A tool from the registry that runs as a separate program.
#[derive(Debug)]
pub(crate) struct Tool {
    /// Package in the registry.
    package: &'static str,
    /// Installed version, so that a new release cannot make an old commit fail.
    version: &'static str,
    /// Features that replace the default ones, if those take long to build.
    features: Option<&'static str>,
    /// A command that succeeds if the tool is installed.
    probe: &'static [&'static str],
}

/// Checks licences, sources and banned crates.
pub(crate) const CARGO_DENY: Tool = Tool {
    package: "cargo-deny",
    version: "0.20.2",
    features: None,
    probe: &["cargo", "deny", "--version"],
};

/// Checks the spelling.
pub(crate) const TYPOS: Tool = Tool {
    package: "typos-cli",
    version: "1.52.0",
    features: None,
    probe: &["typos", "--version"],
};

/// Builds the book; installed without its server and file watching, which the gate does not need.
pub(crate) const MDBOOK: Tool = Tool {
    package: "mdbook",
    version: "0.5.4",
    features: Some("search"),
    probe: &["mdbook", "--version"],
};

/// Runs the fuzzer.
pub(crate) const CARGO_FUZZ: Tool = Tool {
    package: "cargo-fuzz",
    version: "0.13.2",
    features: None,
    probe: &["cargo", "fuzz", "--version"],
};

/// Lists the licences of all contents of a release, with their texts.
pub(crate) const CARGO_ABOUT: Tool = Tool {
    package: "cargo-about",
    version: "0.9.3",
    features: Some("cli"),
    probe: &["cargo", "about", "--version"],
};

/// Writes the bills of materials of a release.
pub(crate) const CARGO_CYCLONEDX: Tool = Tool {
    package: "cargo-cyclonedx",
    version: "0.5.9",
    features: None,
    probe: &["cargo", "cyclonedx", "--version"],
};

/// Toolchain of the fuzzer, which needs unstable compiler options.
pub(crate) const NIGHTLY: &str = "nightly";

/// A tool that is not installed anywhere, for tests.
#[cfg(test)]
pub(crate) const ABSENT: Tool = Tool {
    package: "palpate-no-such-tool",
    version: "1.2.3",
    features: None,
    probe: &["palpate-no-such-tool", "--version"],
};

/// Every tool that the checks use.
const TOOLS: &[&Tool] = &[&CARGO_DENY, &CARGO_FUZZ, &MDBOOK, &TYPOS];
/// Tools of `cargo xtask release`, which no check runs.
const RELEASE_TOOLS: &[&Tool] = &[&CARGO_ABOUT, &CARGO_CYCLONEDX];

/// Settings for the build of a tool: the tool runs for seconds, and full optimisation takes
/// minutes.
const QUICK_BUILD: &[(&str, &str)] = &[
    ("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "16"),
    ("CARGO_PROFILE_RELEASE_LTO", "off"),
    ("CARGO_PROFILE_RELEASE_OPT_LEVEL", "1"),
];

/// Prerequisite of a step.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Need {
    /// The standard library of a target.
    Target(&'static str),
    Tool(&'static Tool),
    Nightly,
}

impl Need {
    /// Makes sure that the prerequisite is installed. A missing target is added; a tool takes
    /// minutes to build and is never installed unasked.
    pub(crate) fn provide(self, workspace: &Workspace) -> Result<()> {
        match self {
            Self::Target(target) => add_target(workspace, target),
            Self::Tool(tool) if tool.is_installed(workspace) => Ok(()),
            Self::Tool(tool) => Err(tool.missing()),
            Self::Nightly if has_nightly(workspace) => Ok(()),
            Self::Nightly => Err(anyhow!(
                "there is no nightly toolchain; install it with `{}`, or everything at once with \
                 `cargo xtask setup`",
                install_nightly()
            )),
        }
    }
}

impl Tool {
    /// Command that installs the tool.
    fn install(&self) -> Invocation {
        let package = format!("{}@{}", self.package, self.version);
        let mut arguments = vec!["install", "--locked", &package];
        if let Some(features) = self.features {
            arguments.extend(["--no-default-features", "--features", features]);
        }
        Invocation::cargo(&arguments)
    }

    /// Whether any version is installed.
    fn is_installed(&self, workspace: &Workspace) -> bool {
        self.probe
            .split_first()
            .is_some_and(|(program, arguments)| {
                workspace.succeeds(&Invocation::new(program, arguments))
            })
    }

    /// Error for a missing tool.
    fn missing(&self) -> anyhow::Error {
        anyhow!(
            "the tool {} is not installed; install it with `{}`, or everything at once with \
             `cargo xtask setup`, to which `--release` adds what a release needs",
            self.package,
            self.install()
        )
    }
}

/// Adds every missing target and installs every missing tool; those of a release only on request.
pub(crate) fn install_everything(workspace: &Workspace, for_release: bool) -> Result<()> {
    for target in ARM_TARGETS {
        add_target(workspace, target)?;
        println!("target {target}: ready");
    }
    let for_release = if for_release { RELEASE_TOOLS } else { &[] };
    for tool in TOOLS.iter().chain(for_release) {
        if !tool.is_installed(workspace) {
            println!("{}: not installed, building it", tool.package);
            let quick = |install: Invocation, (name, value)| install.with_env(name, value);
            let install = QUICK_BUILD.iter().copied().fold(tool.install(), quick);
            workspace
                .run(&install)
                .with_context(|| format!("{} could not be installed", tool.package))?;
        }
        println!("{}: ready", tool.package);
    }
    if !has_nightly(workspace) {
        workspace
            .run(&install_nightly())
            .context("the nightly toolchain could not be installed; the step `fuzz` needs it")?;
    }
    println!("toolchain {NIGHTLY}: ready");
    Ok(())
}

fn has_nightly(workspace: &Workspace) -> bool {
    workspace.succeeds(&Invocation::new(
        "rustup",
        &["run", NIGHTLY, "cargo", "--version"],
    ))
}

fn install_nightly() -> Invocation {
    let arguments = ["toolchain", "install", NIGHTLY, "--profile", "minimal"];
    Invocation::new("rustup", &arguments)
}

/// Adds a target through rustup if the toolchain lacks it.
fn add_target(workspace: &Workspace, target: &str) -> Result<()> {
    if has_target(workspace, target)? {
        return Ok(());
    }
    println!("    the toolchain lacks the target {target}: adding it");
    let add = Invocation::new("rustup", &["target", "add", target]);
    workspace.run(&add).with_context(|| {
        format!(
            "the target {target} is not installed and could not be added; with a network, run \
             `{add}`; where that is not offered for your version of Rust, run `rustup override set {}` \
             before it; without rustup, install your distribution's package for it",
            env!("CARGO_PKG_RUST_VERSION")
        )
    })?;
    if !has_target(workspace, target)? {
        bail!(
            "`{add}` succeeded, but the toolchain in use still lacks {target}; check with \
             `rustup show` that rustup's toolchain is the one on PATH"
        );
    }
    Ok(())
}

/// Whether the active toolchain has the core library of a target.
fn has_target(workspace: &Workspace, target: &str) -> Result<bool> {
    let query = Invocation::new("rustc", &["--print", "target-libdir", "--target", target]);
    let folder = workspace.output(&query)?;
    let Ok(entries) = std::fs::read_dir(folder.trim()) else {
        return Ok(false);
    };
    Ok(entries
        .flatten()
        .any(|entry| entry.file_name().to_string_lossy().starts_with("libcore-")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_tool_is_an_error_with_the_command_that_installs_it() {
        let workspace = Workspace::find(None).unwrap();
        let error = Need::Tool(&ABSENT).provide(&workspace).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains("`cargo install --locked palpate-no-such-tool@1.2.3`"),
            "{message}"
        );
    }

    #[test]
    fn the_host_has_its_own_core_library_and_a_rare_target_does_not() {
        let workspace = Workspace::find(None).unwrap();
        let host = workspace
            .output(&Invocation::new("rustc", &["--print", "host-tuple"]))
            .unwrap();
        assert!(has_target(&workspace, host.trim()).unwrap());
        assert!(!has_target(&workspace, "avr-none").unwrap());
    }
}
