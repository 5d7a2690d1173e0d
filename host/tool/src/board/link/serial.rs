//! A board's USB serial port.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{SerialPort, SerialPortType, UsbPortInfo};

use super::transport::{Clock, Transport};

/// The board's USB identifiers: the test pair of pid.codes (docs/protocol.md).
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;
/// USB product name of the board, which distinguishes it from devices with the same identifiers.
const NAME: &str = "palpate";
/// A USB serial port ignores the baud rate, but the library needs one.
const BAUD: u32 = 115_200;
/// Maximum number of bytes read at once: as many as a full-speed port carries in 10 ms.
const CHUNK: usize = 16 * 1024;
/// Timeout of a write: a running board accepts its bytes within milliseconds.
const WRITE: Duration = Duration::from_secs(2);

/// A serial port that belongs to a board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Port {
    /// Path: `/dev/ttyACM0`, `COM5`.
    pub(crate) path: String,
    /// Serial number of the board from USB.
    pub(crate) serial_number: Option<String>,
}

/// Lists the serial ports of all connected boards.
pub(crate) fn ports() -> io::Result<Vec<Port>> {
    // Without this folder, as in some containers, the port listing panics.
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
    // Windows shows its driver's name as the product.
    let is_named = usb
        .product
        .as_deref()
        .is_none_or(|name| cfg!(windows) || name.to_lowercase().contains(NAME));
    (usb.vid, usb.pid) == (VENDOR, PRODUCT) && is_named
}

/// The open port, exclusive to this program.
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
    // DTR tells the board that the port is open, so that it sends (CDC PSTN 1.2, 6.3.12).
    port.write_data_terminal_ready(true)?;
    Ok(port)
}
