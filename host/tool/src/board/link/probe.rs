//! A board behind a debug probe: the RTT channels in its memory, through probe-rs.

use std::io;
use std::thread::sleep;
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_cli::finding::Finding;
use probe_rs::flashing::DownloadOptions;
use probe_rs::probe::DebugProbeSelector;
use probe_rs::probe::list::Lister;
use probe_rs::rtt::{Rtt, ScanRegion, try_attach_to_rtt};
use probe_rs::{Permissions, Session};

use super::transport::{Clock, Transport};

/// Name of the chip in probe-rs.
const CHIP: &str = "RP2040";
/// The core that runs the firmware.
const CORE: usize = 0;
/// Channels of the firmware: log and records to the PC, commands from it.
const LOG: usize = 0;
const RECORDS: usize = 1;
const COMMANDS: usize = 0;
/// Memory of the chip that is searched for the RTT channels.
const MEMORY: std::ops::Range<u64> = 0x2000_0000..0x2004_2000;
/// Start of the flash.
const FLASH: u64 = 0x1000_0000;
/// Longest wait until the RTT channels are found: the firmware copies itself to memory within 20
/// ms.
const START: Duration = Duration::from_secs(2);
/// Longest wait for space in the command channel.
const ROOM: Duration = Duration::from_secs(2);
/// Poll interval of the channels.
const POLL: Duration = Duration::from_millis(1);
/// Maximum number of bytes read at once.
const CHUNK: usize = 4 * 1024;

/// The channels of a board.
pub(super) struct DebugProbe {
    selector: Option<String>,
    channels: Channels,
    log: Vec<u8>,
    clock: Clock,
}

struct Channels {
    session: Session,
    rtt: Rtt,
}

impl DebugProbe {
    /// Attaches to the running board behind the named probe, or behind the only one.
    pub(super) fn open(selector: Option<&str>) -> io::Result<Self> {
        Ok(Self {
            selector: selector.map(str::to_owned),
            channels: Channels::open(selector)?,
            log: Vec::new(),
            clock: Clock::start(),
        })
    }
}

impl Transport for DebugProbe {
    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn write(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        let end = self.clock.now() + ROOM;
        loop {
            let written = self.channels.write(bytes)?;
            bytes = bytes.get(written..).unwrap_or_default();
            if bytes.is_empty() {
                return Ok(());
            }
            if self.clock.now() >= end {
                return Err(io::Error::new(
                    io::ErrorKind::TimedOut,
                    "the board takes no commands",
                ));
            }
            sleep(POLL);
        }
    }

    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>> {
        let end = self.clock.now() + wait;
        loop {
            self.log.extend(self.channels.read(LOG)?);
            let records = self.channels.read(RECORDS)?;
            if !records.is_empty() || self.clock.now() >= end {
                return Ok(records);
            }
            sleep(POLL);
        }
    }

    fn take_log(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.log)
    }

    fn reopen(&mut self) -> io::Result<()> {
        self.channels = Channels::open(self.selector.as_deref())?;
        Ok(())
    }
}

impl Channels {
    fn open(selector: Option<&str>) -> io::Result<Self> {
        let mut session = attach(selector)?;
        let mut core = session.core(CORE).map_err(io::Error::other)?;
        let region = ScanRegion::range(MEMORY);
        let rtt = try_attach_to_rtt(&mut core, START, &region).map_err(io::Error::other)?;
        drop(core);
        Ok(Self { session, rtt })
    }

    fn read(&mut self, channel: usize) -> io::Result<Vec<u8>> {
        let mut core = self.session.core(CORE).map_err(io::Error::other)?;
        let channel = self.rtt.up_channel(channel).ok_or_else(no_channel)?;
        let mut bytes = vec![0; CHUNK];
        let count = channel.read(&mut core, &mut bytes);
        bytes.truncate(count.map_err(io::Error::other)?);
        Ok(bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut core = self.session.core(CORE).map_err(io::Error::other)?;
        let channel = self.rtt.down_channel(COMMANDS).ok_or_else(no_channel)?;
        channel.write(&mut core, bytes).map_err(io::Error::other)
    }
}

fn no_channel() -> io::Error {
    io::Error::other(
        "the board has no channels for records and commands: flash the firmware of palpate",
    )
}

/// Attaches to the chip behind the named probe, or behind the only one.
fn attach(selector: Option<&str>) -> io::Result<Session> {
    let lister = Lister::new();
    let selector = match selector {
        Some(name) => name
            .parse::<DebugProbeSelector>()
            .map_err(io::Error::other)?,
        None => match lister.list_all().as_slice() {
            [only] => only.into(),
            [] => {
                let none =
                    "no debug probe is plugged in, or this user has no permission to open it";
                return Err(io::Error::new(io::ErrorKind::NotFound, none));
            }
            several => {
                let names: Vec<_> = several.iter().map(ToString::to_string).collect();
                let several = format!("several debug probes are plugged in: {}", names.join("; "));
                return Err(io::Error::other(several));
            }
        },
    };
    let probe = lister.open(selector).map_err(io::Error::other)?;
    let session = probe.attach(CHIP, Permissions::default());
    session.map_err(io::Error::other)
}

/// Connects to the board behind a probe. Returns its name and the transport.
///
/// # Errors
/// If there is no probe, or no firmware with channels.
pub(super) fn reach(selector: Option<&str>) -> Result<(String, Box<dyn Transport>), Failure> {
    let probe = DebugProbe::open(selector).map_err(|error| unreached(&error))?;
    let name = selector.map_or_else(|| "the probe".to_owned(), |name| format!("probe {name}"));
    Ok((name, Box::new(probe)))
}

/// Writes firmware to the start of the flash through a probe, verifies it and starts it. Erases
/// only the sectors of the firmware.
///
/// # Errors
/// If there is no probe or no board, or the flash refuses it.
pub(super) fn flash(selector: Option<&str>, firmware: &[u8]) -> Result<(), Failure> {
    write(selector, firmware).map_err(|error| unreached(&error))
}

fn write(selector: Option<&str>, firmware: &[u8]) -> io::Result<()> {
    let mut session = attach(selector)?;
    let mut loader = session.target().flash_loader();
    let added = loader.add_data(FLASH, firmware);
    added.map_err(io::Error::other)?;
    let mut options = DownloadOptions::new();
    options.verify = true;
    let written = loader.commit(&mut session, options);
    written.map_err(io::Error::other)?;
    let mut core = session.core(CORE).map_err(io::Error::other)?;
    core.reset().map_err(io::Error::other)
}

fn unreached(error: &io::Error) -> Failure {
    Failure::Unconnected(Finding::new(
        "unreachable",
        format!("the debug probe: {}", causes(error)),
        "Check its cable, SWCLK, SWDIO and ground, and the board's power. On Linux, \
         https://probe.rs/docs/getting-started/probe-setup says how a user gets access to a probe",
    ))
}

/// Formats an error with its causes.
fn causes(error: &io::Error) -> String {
    let first = error.get_ref().map(|error| error as &dyn std::error::Error);
    let chain = std::iter::successors(first, |error| error.source());
    let texts: Vec<_> = chain.map(ToString::to_string).collect();
    match texts.is_empty() {
        true => error.to_string(),
        false => texts.join(": "),
    }
}
