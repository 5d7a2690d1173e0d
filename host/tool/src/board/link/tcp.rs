//! A board over TCP: the emulated board of another program, or the two channels of a debug probe's
//! server.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::thread::sleep;
use std::time::Duration;

use super::transport::{Clock, Transport};

/// Timeout of a connection.
const PATIENCE: Duration = Duration::from_secs(3);
/// Interval at which the tool polls a debug probe's server; the server itself polls every 10 ms.
const POLL: Duration = Duration::from_millis(1);
/// Maximum number of bytes read at once.
const CHUNK: usize = 16 * 1024;

/// Frames in both directions on one connection.
pub(super) struct Tcp {
    address: String,
    stream: TcpStream,
    clock: Clock,
}

impl Tcp {
    pub(super) fn open(address: &str) -> io::Result<Self> {
        Ok(Self {
            address: address.to_owned(),
            stream: connect(address)?,
            clock: Clock::start(),
        })
    }
}

impl Transport for Tcp {
    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.set_nonblocking(false)?;
        self.stream.write_all(bytes)
    }

    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>> {
        // A timeout of zero would mean no timeout.
        self.stream.set_nonblocking(wait.is_zero())?;
        if !wait.is_zero() {
            self.stream.set_read_timeout(Some(wait))?;
        }
        taken(&mut self.stream)
    }

    fn reopen(&mut self) -> io::Result<()> {
        self.stream = connect(&self.address)?;
        Ok(())
    }
}

/// The debug probe's servers for the board's RTT channels: records up, commands down.
pub(super) struct Probe {
    records: String,
    commands: String,
    streams: [TcpStream; 2],
    log: Vec<u8>,
    clock: Clock,
}

impl Probe {
    pub(super) fn open(records: &str, commands: &str) -> io::Result<Self> {
        Ok(Self {
            records: records.to_owned(),
            commands: commands.to_owned(),
            streams: both(records, commands)?,
            log: Vec::new(),
            clock: Clock::start(),
        })
    }
}

impl Transport for Probe {
    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let [_, commands] = &mut self.streams;
        commands.set_nonblocking(false)?;
        commands.write_all(bytes)
    }

    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>> {
        let end = self.clock.now() + wait;
        loop {
            let [records, commands] = &mut self.streams;
            // The other direction of the command channel carries the board's log.
            commands.set_nonblocking(true)?;
            self.log.extend(taken(commands)?);
            records.set_nonblocking(true)?;
            let bytes = taken(records)?;
            if !bytes.is_empty() || self.clock.now() >= end {
                return Ok(bytes);
            }
            sleep(POLL);
        }
    }

    fn take_log(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.log)
    }

    fn reopen(&mut self) -> io::Result<()> {
        self.streams = both(&self.records, &self.commands)?;
        Ok(())
    }
}

fn both(records: &str, commands: &str) -> io::Result<[TcpStream; 2]> {
    Ok([connect(records)?, connect(commands)?])
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(ErrorKind::InvalidInput, "no such host");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Returns the received bytes, possibly none.
fn taken(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; CHUNK];
    match stream.read(&mut bytes) {
        Ok(0) => Err(io::Error::new(
            ErrorKind::ConnectionReset,
            "the server has closed the connection",
        )),
        Ok(count) => {
            bytes.truncate(count);
            Ok(bytes)
        }
        Err(error) if is_later(&error) => Ok(Vec::new()),
        Err(error) => Err(error),
    }
}

fn is_later(error: &io::Error) -> bool {
    use ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}
