//! `palpate rig-gauge`: program of a gauge whose bench `palpate serve-emulated --rig` simulates.
//!
//! Forwards lines in both directions, so that a calibration cannot tell it from the program of a
//! real gauge.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::thread;

use clap::{Args, ValueEnum};
use palpate_cli::failure::Failure;

/// Print the readings of a gauge of the simulated bench, as the program of a real gauge does
#[derive(Args)]
pub(crate) struct Arguments {
    /// Which gauge
    gauge: Gauge,
    /// Where the simulated bench is
    #[arg(long, value_name = "ADDRESS:PORT")]
    at: String,
}

#[derive(Clone, Copy, ValueEnum)]
enum Gauge {
    Force,
    Stage,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let at = &arguments.at;
    let gone = |error: io::Error| Failure::Lost(format!("{at}: {error}"));
    let mut bench = TcpStream::connect(at).map_err(gone)?;
    bench.set_nodelay(true).map_err(gone)?;
    let name = match arguments.gauge {
        Gauge::Force => "force",
        Gauge::Stage => "stage",
    };
    writeln!(bench, "{name}").map_err(gone)?;
    let commands = bench.try_clone().map_err(gone)?;
    thread::spawn(move || pass_on(io::stdin().lock(), commands));
    pass_on(bench, io::stdout().lock()).map_err(gone)?;
    Err(Failure::Lost(format!("{at}: the bench is gone")))
}

/// Forwards bytes until the end of the input.
fn pass_on(mut from: impl Read, mut to: impl Write) -> io::Result<()> {
    let mut bytes = [0; 1024];
    loop {
        let count = from.read(&mut bytes)?;
        if count == 0 {
            return Ok(());
        }
        to.write_all(bytes.get(..count).unwrap_or_default())?;
        to.flush()?;
    }
}
