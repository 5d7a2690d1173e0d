//! Arguments of `palpate live`.

use clap::Args;

use crate::board::link::Watched;

/// Default port.
const PORT: u16 = 7162;

/// Show a board as a page in the browser
///
/// Stiffness with its interval, deformation, force, contact, frequency, current, temperature, losses and
/// faults, plots of the last seconds, and the line of the last train of ramps; arms and disarms, and
/// calibrates the emulated board.
#[derive(Args)]
#[command(after_help = "\
Prints the page's address. Only browsers of this computer reach it, and only with the token that is in \
the address; it stays the same from one start to the next. --open gives the browser a file that \
redirects there, so that no list of processes shows the token; a browser that cannot read the file \
needs the printed address. Ctrl-C ends it, and disarms a board that was armed here. The tool waits for \
a board that is unplugged or restarts.

Examples:
  palpate live
  palpate live --board emulated --load 1.5 --arm --open
  palpate live --board press.mcap")]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(super) watched: Watched,
    /// Port of the page; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = PORT)]
    pub(super) port: u16,
    /// Open the page in the browser
    #[arg(long)]
    pub(super) open: bool,
    /// Print the address as JSON
    #[arg(long)]
    pub(super) json: bool,
}
