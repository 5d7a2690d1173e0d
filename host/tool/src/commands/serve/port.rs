//! TCP port for one program at a time.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use palpate_cli::failure::Failure;
use palpate_cli::notice;

use super::{address_of, listen};
use crate::board::link::BUSY;

/// Time without any reading after which a program counts as gone.
const PATIENCE: Duration = Duration::from_secs(5);
/// Maximum number of command bytes read at once.
const CHUNK: usize = 4096;
/// Maximum number of bytes that wait for a program that does not read, in addition to the system's
/// buffer, like the buffer of a serial port's driver. Further bytes stay in the board, which drops
/// and counts them.
const WAITING: usize = 64 * 1024;

/// End of a frame; occurs nowhere else in it.
const DELIMITER: u8 = 0;
/// Maximum number of bytes before a program's first delimiter: no frame is longer than this.
const LONGEST_OPENING: usize = CHUNK;
/// Text that the first line of every HTTP request contains.
const HTTP: &[u8] = b" HTTP/";

/// The port with the connected program.
pub(super) struct Port {
    listener: TcpListener,
    program: Option<TcpStream>,
    /// Bytes of the program before its first delimiter; `None` afterwards.
    opening: Option<Vec<u8>>,
    /// Bytes that the program has not read yet.
    waiting: Vec<u8>,
}

impl Port {
    pub(super) fn listen(address: SocketAddr) -> Result<Self, Failure> {
        Ok(Self {
            listener: listen(address, "--listen")?,
            program: None,
            opening: None,
            waiting: Vec::new(),
        })
    }

    /// Address of the port.
    pub(super) fn address(&self) -> String {
        address_of(&self.listener)
    }

    /// Accepts a program, or rejects it. Returns whether a program is connected.
    pub(super) fn accept(&mut self) -> bool {
        // Returns here, so that the board sees its port closed before the next program opens it.
        if self.program.as_ref().is_some_and(is_gone) {
            self.program = None;
            return false;
        }
        // Only one program at a time; the present one may leave while this rejects another.
        if let Ok((mut stream, _)) = self.listener.accept() {
            if self
                .program
                .as_ref()
                .is_some_and(|program| !is_gone(program))
            {
                // Does not wait for a program that does not read.
                let _ = stream.set_write_timeout(Some(PATIENCE));
                let _ = stream.write_all(BUSY);
            } else if stream.set_nonblocking(true).is_ok() {
                let _ = stream.set_nodelay(true);
                self.waiting.clear();
                self.opening = Some(Vec::new());
                self.program = Some(stream);
            }
        }
        self.program.is_some()
    }

    /// Reads bytes from the program.
    pub(super) fn read(&mut self) -> Vec<u8> {
        let mut bytes = vec![0; CHUNK];
        let Some(program) = &mut self.program else {
            return Vec::new();
        };
        match program.read(&mut bytes) {
            Ok(0) => self.program = None,
            Ok(count) => {
                bytes.truncate(count);
                return self.checked(bytes);
            }
            Err(error) if is_later(&error) => {}
            Err(_) => self.program = None,
        }
        Vec::new()
    }

    /// Returns bytes for the board. Holds them back until the first delimiter, to reject HTTP: a
    /// web page can make a browser send a request to any port, with frames in its body.
    fn checked(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        let Some(mut opening) = self.opening.take() else {
            return bytes;
        };
        opening.extend(bytes);
        let end = opening.iter().position(|byte| *byte == DELIMITER);
        let before = opening.get(..end.unwrap_or(opening.len()));
        let is_http = before.is_some_and(|before| before.windows(HTTP.len()).any(|of| of == HTTP));
        if is_http || end.is_none() && opening.len() > LONGEST_OPENING {
            notice::say(
                "A program that sent HTTP, or no frames, was disconnected: see docs/protocol.md.",
            );
            self.program = None;
            return Vec::new();
        }
        if end.is_none() {
            self.opening = Some(opening);
            return Vec::new();
        }
        opening
    }

    /// Whether there is room for more bytes.
    pub(super) fn has_room(&self) -> bool {
        self.waiting.len() < WAITING
    }

    /// Sends bytes as far as the program reads them; keeps the rest.
    pub(super) fn write(&mut self, bytes: &[u8]) {
        let Some(program) = &mut self.program else {
            return;
        };
        self.waiting.extend(bytes);
        match program.write(&self.waiting) {
            Ok(count) => drop(self.waiting.drain(..count)),
            Err(error) if is_later(&error) => {}
            Err(_) => self.program = None,
        }
    }
}

/// Whether the program has closed the connection and all its bytes are read. A program that leaves
/// our bytes unread resets the connection.
fn is_gone(program: &TcpStream) -> bool {
    match program.peek(&mut [0]) {
        Ok(count) => count == 0,
        Err(error) => !is_later(&error),
    }
}

fn is_later(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waits for a condition: the system delivers with a delay.
    fn until(mut holds: impl FnMut() -> bool) {
        let held = (0..1_000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            holds()
        });
        assert!(held);
    }

    #[test]
    fn a_program_that_goes_makes_room_whatever_it_left_unread() {
        let mut port = Port::listen("127.0.0.1:0".parse().unwrap()).unwrap();
        for leaves_unread in [false, true] {
            let first = TcpStream::connect(port.address()).unwrap();
            until(|| port.accept());
            if leaves_unread {
                port.write(b"record");
                until(|| first.peek(&mut [0; 6]).is_ok_and(|count| count == 6));
            }
            drop(first);
            let mut next = TcpStream::connect(port.address()).unwrap();
            // The port is closed between the two programs, and the second receives no bytes of the
            // first.
            until(|| !port.accept());
            until(|| port.accept());
            port.write(b"hello");
            let mut said = [0; 5];
            next.read_exact(&mut said).unwrap();
            assert_eq!(&said, b"hello");
            drop(next);
            until(|| !port.accept());
        }
    }
}
