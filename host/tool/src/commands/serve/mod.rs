//! `palpate serve-emulated`: the emulated board at a TCP port, at the pace of real time.

mod port;
mod rig;

use std::net::{SocketAddr, TcpListener};
use std::thread;
use std::time::Duration;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_cli::quantity;
use palpate_sim::Time;
use port::Port;
use rig::RigPort;

use crate::board::emulated::{self, Pace, PluggedBoard};

/// Default address.
const ADDRESS: &str = "127.0.0.1:7161";
/// Virtual time between two polls of the port: the poll interval of a PC's USB.
const SLICE: Time = Time::from_ms(1);
/// Sleeps shorter than this are left out: most systems wake a thread with a delay of up to this
/// time.
const LEAST_SLEEP: Duration = Duration::from_millis(1);

/// Offer the emulated board's USB port on a TCP port, at the pace of real time
#[derive(Args)]
#[command(after_help = "\
Bytes are those of the board's serial port: frames both ways, see docs/protocol.md. A program that \
connects opens the port; a second one gets a line of text that says so, and is disconnected. \
It ends with Ctrl-C, or after --for.

Examples:
  palpate serve-emulated --press 1.5 &
  palpate watch --board tcp:127.0.0.1:7161")]
pub(crate) struct Arguments {
    /// Where it listens
    #[arg(long, value_name = "ADDRESS:PORT", default_value = ADDRESS)]
    listen: SocketAddr,
    /// Allow an address that other machines reach: any program there may drive the coil, and nothing is
    /// encrypted
    #[arg(long)]
    allow_remote: bool,
    /// Press a spring of this multiple of the sensing layer's nominal stiffness, again and again:
    /// 5 s pressed, 8 s lifted
    #[arg(long, value_name = "RATIO", value_parser = quantity::load, allow_negative_numbers = true)]
    press: Option<f64>,
    /// Offer the simulated bench's load cell and stage here, for `palpate calibrate sensor`
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "press")]
    rig: Option<SocketAddr>,
    /// End after so many seconds
    #[arg(long = "for", value_name = "SECONDS", value_parser = quantity::duration, allow_negative_numbers = true)]
    duration: Option<Duration>,
    #[command(flatten)]
    emulated: emulated::Arguments,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    for address in [Some(arguments.listen), arguments.rig]
        .into_iter()
        .flatten()
    {
        if !address.ip().is_loopback() && !arguments.allow_remote {
            return Err(Failure::Argument(format!(
                "{address} can be reached from other machines, and any program there can drive the \
                 coil: listen on 127.0.0.1, or add --allow-remote"
            )));
        }
    }
    let mut served = arguments.emulated.load()?.plug(arguments.press)?;
    // A program that connects does not have to wait for the start.
    served.start()?;
    let mut port = Port::listen(arguments.listen)?;
    notice::say(format_args!("the emulated board is at {}", port.address()));
    let mut rig = match arguments.rig {
        Some(address) => {
            let (_, plant) = arguments.emulated.stack_and_plant()?;
            let rig = RigPort::listen(address, plant)?;
            notice::say(format_args!(
                "the gauges of its bench are at {}",
                rig.address()
            ));
            Some(rig)
        }
        None => None,
    };
    let end = arguments.duration;
    let end = end.map(|duration| Time::from_secs_f64(duration.as_secs_f64()));
    serve(&mut served, &mut port, rig.as_mut(), end)
}

/// Listens at an address, which an argument names. A call of the listener does not wait.
fn listen(address: SocketAddr, argument: &str) -> Result<TcpListener, Failure> {
    let listening = TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        Ok(listener)
    });
    listening.map_err(|error| {
        Failure::Refused(format!(
            "{address} cannot be listened on: {error}; name another with {argument}"
        ))
    })
}

/// Address of a port; with port 0 the system chose the number.
fn address_of(listener: &TcpListener) -> String {
    let address = listener.local_addr();
    address.map_or_else(|_| "an unknown address".to_owned(), |of| of.to_string())
}

fn serve(
    served: &mut PluggedBoard,
    port: &mut Port,
    mut rig: Option<&mut RigPort>,
    end: Option<Time>,
) -> Result<(), Failure> {
    let mut pace = Pace::new();
    while end.is_none_or(|end| served.now() < end) {
        served.set_open(port.accept());
        served.write(&port.read());
        served.set_reading(port.has_room());
        served.advance(SLICE)?;
        port.write(&served.read());
        if let Some(rig) = &mut rig {
            rig.serve(served)?;
        }
        let ahead = pace.ahead(served.now());
        if ahead >= LEAST_SLEEP {
            thread::sleep(ahead);
        }
        if let Some(warning) = pace.warning() {
            notice::say(warning);
        }
    }
    Ok(())
}
