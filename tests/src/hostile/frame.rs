//! Command frames, valid and invalid.

use palpate_wire::{Command, Header, Message, VERSION, crc32, encode};

/// Parts of a frame, each of which may be wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// Boot id of the addressed run.
    pub boot_id: u32,
    /// Sequence number.
    pub sequence: u32,
    /// Kind of the command.
    pub kind: u8,
    /// Bytes after the header.
    pub payload: Vec<u8>,
}

impl Parts {
    /// The frame; valid if its payload is.
    #[must_use]
    pub fn frame(&self) -> Vec<u8> {
        stuffed(&self.checked())
    }

    /// The frame before stuffing: version, kind, header, payload and CRC-32.
    #[must_use]
    pub fn checked(&self) -> Vec<u8> {
        let mut content = vec![VERSION, self.kind];
        for number in [self.boot_id, self.sequence, 0, 0] {
            varint(number, &mut content);
        }
        content.extend(&self.payload);
        content.extend(crc32(&content).to_le_bytes());
        content
    }
}

/// The payload of a command.
#[must_use]
pub fn payload(command: &Command) -> Vec<u8> {
    let header = Header {
        boot_id: 0,
        sequence: 0,
        time_us: 0,
        dropped: 0,
    };
    let mut buffer = [0; Command::MAX_FRAME];
    let frame = encode(&header, command, &mut buffer).unwrap_or_default();
    let content = unstuffed(frame);
    // Before the payload are version, kind and four one-byte numbers; after it the CRC-32.
    let end = content.len().saturating_sub(4);
    content.get(6..end).unwrap_or_default().to_vec()
}

/// A number in postcard's encoding: seven bits a byte, the lowest first.
pub fn varint(mut number: u32, to: &mut Vec<u8>) {
    while number > 0x7F {
        to.push(number as u8 | 0x80);
        number >>= 7;
    }
    to.push(number as u8);
}

/// Stuffs a frame by COBS and ends it with a zero.
#[must_use]
pub fn stuffed(content: &[u8]) -> Vec<u8> {
    let mut frame = Vec::new();
    for block in content.split(|&byte| byte == 0) {
        let mut rest = block;
        // A code of 255 ends a run that no zero follows.
        while rest.len() >= 254 {
            let (run, others) = rest.split_at(254);
            frame.push(255);
            frame.extend(run);
            rest = others;
        }
        frame.push(rest.len() as u8 + 1);
        frame.extend(rest);
    }
    frame.push(0);
    frame
}

/// The content of a valid frame of fewer than 255 bytes.
fn unstuffed(frame: &[u8]) -> Vec<u8> {
    let mut content = Vec::new();
    let mut rest = frame;
    while let Some((&distance, others)) = rest.split_first().filter(|(distance, _)| **distance > 0)
    {
        let (run, others) = others.split_at(others.len().min(usize::from(distance) - 1));
        content.extend(run);
        content.push(0);
        rest = others;
    }
    content.pop();
    content
}

/// Damage to a frame in transmission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Kind of the damage, below [`DAMAGES`].
    pub kind: u8,
    /// Location, as a 256th part of the frame.
    pub at: u8,
    /// Data of the damage.
    pub with: u8,
}

/// Number of kinds of damage.
pub const DAMAGES: u8 = 9;

impl Damage {
    /// Bytes that arrive.
    #[must_use]
    pub fn done_to(self, parts: &Parts) -> Vec<u8> {
        let mut checked = parts.checked();
        let mut frame = stuffed(&checked);
        let at = self.place(frame.len());
        match self.kind % DAMAGES {
            0 => invert(&mut frame, at, 1 << (self.with % 8)),
            // Truncated, with its final zero kept.
            1 => drop(frame.drain(at..frame.len() - 1)),
            // Truncated, and joined to the next frame.
            2 => frame.truncate(at),
            3 => frame.insert(at, self.with),
            4 => drop(frame.remove(at)),
            5 => frame.insert(at, 0),
            // Changed before stuffing, so that only the CRC-32 detects it.
            6 => {
                let at = self.place(checked.len());
                invert(&mut checked, at, self.with | 1);
                frame = stuffed(&checked);
            }
            // Longer than any valid frame, by up to three frames.
            7 => {
                let filling = Parts {
                    payload: [parts.payload.as_slice(), &[self.with; 300]].concat(),
                    ..parts.clone()
                };
                frame = filling.frame();
            }
            _ => frame.extend(frame.clone()),
        }
        frame
    }

    fn place(self, length: usize) -> usize {
        usize::from(self.at) * length / 256
    }
}

fn invert(bytes: &mut [u8], at: usize, bits: u8) {
    if let Some(byte) = bytes.get_mut(at) {
        *byte ^= bits;
    }
}
