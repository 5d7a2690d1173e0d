//! Debug probes in a tool built without them.

use palpate_cli::failure::Failure;

use super::transport::Transport;

/// Refuses a connection.
pub(super) fn reach(_: Option<&str>) -> Result<(String, Box<dyn Transport>), Failure> {
    Err(without())
}

/// Refuses to flash.
pub(super) fn flash(_: Option<&str>, _: &[u8]) -> Result<(), Failure> {
    Err(without())
}

fn without() -> Failure {
    Failure::Argument(
        "this tool is built without debug probes: install it with `cargo install --path host/tool --locked \
         --features probe`, or use a probe's server, as docs/bring-up.md says"
            .to_owned(),
    )
}
