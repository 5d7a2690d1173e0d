//! A board's USB serial port.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{SerialPort, SerialPortType, UsbPortInfo};

use super::transport::{Clock, Transport};

/// The board's USB identifiers: the test pair of pid.codes (docs/protocol.md).
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;
/// Its name among those that share the pair.
const NAME: &str = "palpate";
/// A USB serial port has no rate; one has to be named.
const BAUD: u32 = 115_200;
/// Bytes that are taken at once: what a full-speed port brings in 10 ms.
const CHUNK: usize = 16 * 1024;
/// How long a write may take: a board that runs takes its bytes within milliseconds.
const WRITE: Duration = Duration::from_secs(2);

/// A serial port that belongs to a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Port {
    /// Where it is: `/dev/ttyACM0`, `COM5`.
    pub(crate) path: String,
    /// The board's serial number, by USB.
    pub(crate) serial_number: Option<String>,
}

/// The serial ports of all boards that are plugged in.
pub(crate) fn ports() -> io::Result<Vec<Port>> {
    // Where there is no such folder, as in some containers, the list of ports panics.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Ok(Vec::new());
    }
    let ports = serialport::available_ports()?.into_iter();
    let boards = ports.filter_map(|port| match port.port_type {
        SerialPortType::UsbPort(usb) if is_board(&usb) => Some(Port {
            path: port.port_name,
            serial_number: usb.serial_number,
        }),
        _ => None,
    });
    Ok(boards.collect())
}

fn is_board(usb: &UsbPortInfo) -> bool {
    // Windows shows its driver's name for the product.
    let is_named = usb
        .product
        .as_deref()
        .is_none_or(|name| cfg!(windows) || name.to_lowercase().contains(NAME));
    (usb.vid, usb.pid) == (VENDOR, PRODUCT) && is_named
}

/// The port, open for this program alone.
pub(super) struct Serial {
    path: String,
    port: Box<dyn SerialPort>,
    clock: Clock,
}

impl Serial {
    pub(super) fn open(path: &str) -> io::Result<Self> {
        Ok(Self {
            path: path.to_owned(),
            port: open(path)?,
            clock: Clock::start(),
        })
    }
}

impl Transport for Serial {
    fn now(&self) -> Duration {
        self.clock.now()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.set_timeout(WRITE)?;
        self.port.write_all(bytes)
    }

    fn read(&mut self, wait: Duration) -> io::Result<Vec<u8>> {
        self.port.set_timeout(wait)?;
        let mut bytes = vec![0; CHUNK];
        match self.port.read(&mut bytes) {
            Ok(0) => Err(ErrorKind::ConnectionReset.into()),
            Ok(count) => {
                bytes.truncate(count);
                Ok(bytes)
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                Ok(Vec::new())
            }
            Err(error) => Err(error),
        }
    }

    fn reopen(&mut self) -> io::Result<()> {
        self.port = open(&self.path)?;
        Ok(())
    }
}

fn open(path: &str) -> io::Result<Box<dyn SerialPort>> {
    let mut port = serialport::new(path, BAUD).timeout(WRITE).open()?;
    // The board sends as long as the port is open, which this line tells it (CDC PSTN 1.2, 6.3.12).
    port.write_data_terminal_ready(true)?;
    Ok(port)
}
