//! A recording on a disk that becomes full: a small file system in memory, in its own name space.

use std::env;
use std::process::Command;

use palpate_cli::failure::Failure;

use super::found;
use super::part::Part;
use crate::tool::{TOOL, Tool};

/// Script that makes the file system, records there until it is full, and keeps the result.
const SCRIPT: &str = "mkdir \"$1/small\" && mount -t tmpfs -o size=1m tmpfs \"$1/small\" || exit 99
\"$0\" \"$3\" record \"$1/small/full.mcap\" --board emulated --state \"$1/full.flash\" --image \"$2\" --for 60; code=$?
cp \"$1/small/full.mcap.partial\" \"$1/left.mcap\" && exit $code";
/// Exit code of the script if such a file system is not available.
const NO_FILE_SYSTEM: i32 = 99;

pub(super) fn run(tool: &Tool) -> Result<Part, Failure> {
    let output = Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c", SCRIPT])
        .arg(env::current_exe()?)
        .arg(tool.path(""))
        .args([tool.image().as_str(), TOOL])
        .output()
        .map_err(|error| Failure::Refused(format!("unshare (util-linux): {error}")))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let left = tool.path("left.mcap");
    if output.status.code() == Some(NO_FILE_SYSTEM) || !left.exists() {
        return Err(Failure::Refused(format!(
            "no small disk can be made for a recording: {}",
            said.trim()
        )));
    }
    let found = found::read(&left)?;
    let says_why = said.contains("the disk is full");
    let is_good =
        output.status.code() == Some(1) && says_why && found.samples > 0 && found.missing() == 0;
    let text = format!(
        "On a full disk of 1 MiB a recording ended with exit code {} and {}the cause; of its {} records {} are missing.",
        output.status.code().unwrap_or(-1),
        if says_why { "" } else { "without " },
        found.contents.frames(),
        found.missing()
    );
    Ok(Part {
        text,
        failed: (!is_good).then(|| "a full disk was not handled as promised".to_owned()),
    })
}
