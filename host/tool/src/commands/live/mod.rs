//! `palpate live`: a board in the browser.
//!
//! Only the board's thread uses the link ([`session`]); the page's server runs in another thread
//! ([`server`]). A few channels connect them, none of which waits ([`feed`]).

mod access;
mod arguments;
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
pub(crate) use arguments::Arguments;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use serde::Serialize;
use session::LiveSession;

use crate::interrupt::Interrupt;

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
