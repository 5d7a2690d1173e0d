//! Board arguments of `watch` and `live`.

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::quantity;
use palpate_wire::Command;

use super::{Arguments, Link, Run};

/// Which board is watched, and what is pressed upon it.
#[derive(Args)]
// Skipped: the group would have the name of the verb's own arguments, which clap refuses.
#[group(skip)]
pub(crate) struct Watched {
    #[command(flatten)]
    pub(crate) link: Arguments,
    /// Press a spring of this multiple of the sensing layer's stiffness upon the emulated board, again and
    /// again
    #[arg(long, value_name = "RATIO", value_parser = quantity::load, allow_negative_numbers = true)]
    pub(crate) load: Option<f64>,
    /// Arm the board, and measure at every contact: the coil is driven
    #[arg(long)]
    pub(crate) arm: bool,
}

impl Watched {
    /// Connects, and arms the board if requested. An emulated board runs at the pace of real time.
    pub(crate) fn open(&self) -> Result<Link, Failure> {
        let mut link = self.link.open_pressed(Run::AtRealPace, self.load)?;
        if self.arm {
            link.send_accepted(&Command::Arm)?;
        }
        Ok(link)
    }
}
