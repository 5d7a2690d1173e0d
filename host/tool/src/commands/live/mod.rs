//! `palpate live`: a board in the browser.
//!
//! Only the board's thread uses the link ([`session`]); the page's server runs in another thread
//! ([`server`]). A few channels connect them, none of which waits ([`feed`]).

mod access;
mod assets;
mod calibration;
mod envelope;
mod feed;
mod measurements;
mod server;
mod session;
mod state;
mod view;

use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};

use access::Access;
use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use serde::Serialize;
use session::LiveSession;

use crate::board::link::Watched;
use crate::interrupt::Interrupt;

/// Default port.
const PORT: u16 = 7162;

/// Show a board as a page in the browser
///
/// Stiffness with its interval, deformation, force, contact, frequency, current, temperature, losses and
/// faults, plots of the last seconds, and the line of the last train of ramps; arms and disarms, and
/// calibrates the emulated board.
#[derive(Args)]
#[command(after_help = "\
Prints the page's address. Only browsers of this computer reach it, and only with the token that is in the \
address; it stays the same from one start to the next. --open hands the browser a file that leads there, so \
that no list of processes shows the token; a browser that may not read the file is given the address. Ctrl-C \
ends it, and disarms a board that was armed here. A board that is unplugged or starts anew is waited for.

Examples:
  palpate live
  palpate live --board emulated --load 1.5 --arm --open
  palpate live --board press.mcap")]
pub(crate) struct Arguments {
    #[command(flatten)]
    watched: Watched,
    /// Port of the page; 0 for any that is free
    #[arg(long, value_name = "PORT", default_value_t = PORT)]
    port: u16,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
    /// Print the address as JSON
    #[arg(long)]
    json: bool,
}

/// A line of the JSON output.
#[derive(Serialize)]
struct Served {
    url: String,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let listener = listen(arguments.port)?;
    let access = Access::to(listener.local_addr()?)?;
    let link = arguments.watched.open()?;
    let interrupt = Interrupt::catch()?;
    let (feed, desk) = feed::between();
    let url = access.url();
    let shortcut = arguments
        .open
        .then(|| access.write_shortcut())
        .transpose()?;
    server::start(listener, access, desk, interrupt.clone())?;
    print(&url, arguments.json)?;
    if let Some(shortcut) = shortcut
        && let Err(error) = open::that_detached(shortcut)
    {
        notice::say(format_args!(
            "The browser does not open ({error}): open the address in it."
        ));
    }
    LiveSession::new(link, arguments, feed).run(&interrupt)
}

/// Listens on a port of this computer, which other computers cannot reach.
fn listen(port: u16) -> Result<TcpListener, Failure> {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    TcpListener::bind(address).map_err(|error| {
        Failure::Refused(format!(
            "{address} cannot be listened on: {error}; name another port with --port"
        ))
    })
}

fn print(url: &str, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        let url = url.to_owned();
        writeln!(out, "{}", serde_json::to_string(&Served { url })?)?;
    } else {
        writeln!(out, "The board is at {url}")?;
    }
    Ok(out.flush()?)
}
