//! Command frames, right and wrong.

use palpate_wire::{Command, Header, Message, VERSION, crc32, encode};

/// A frame by its parts, each of which may be wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// The run to which it is addressed.
    pub boot_id: u32,
    /// Its number.
    pub sequence: u32,
    /// Kind of the command.
    pub kind: u8,
    /// What follows the header.
    pub payload: Vec<u8>,
}

impl Parts {
    /// The frame, sound as far as its payload is.
    #[must_use]
    pub fn frame(&self) -> Vec<u8> {
        stuffed(&self.checked())
    }

    /// The frame before it is stuffed: version, kind, header, payload and CRC-32.
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
    // Version, kind and four numbers of a byte each before it; the CRC-32 after it.
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
        // A distance of 255 ends a run that no zero follows.
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

/// The content of a sound frame of fewer than 255 bytes.
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

/// What happens to a frame on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Which of [`DAMAGES`].
    pub kind: u8,
    /// Where, as a part of 256 of the frame.
    pub at: u8,
    /// With what.
    pub with: u8,
}

/// Number of kinds of damage.
pub const DAMAGES: u8 = 9;

impl Damage {
    /// The bytes that arrive of a frame.
    #[must_use]
    pub fn done_to(self, parts: &Parts) -> Vec<u8> {
        let mut checked = parts.checked();
        let mut frame = stuffed(&checked);
        let at = self.place(frame.len());
        match self.kind % DAMAGES {
            0 => invert(&mut frame, at, 1 << (self.with % 8)),
            // Cut off, the zero at its end apart.
            1 => drop(frame.drain(at..frame.len() - 1)),
            // Cut off, and joined to what follows.
            2 => frame.truncate(at),
            3 => frame.insert(at, self.with),
            4 => drop(frame.remove(at)),
            5 => frame.insert(at, 0),
            // Changed before it was stuffed, so that nothing but the CRC-32 finds it.
            6 => {
                let at = self.place(checked.len());
                invert(&mut checked, at, self.with | 1);
                frame = stuffed(&checked);
            }
            // Longer than any, by up to three frames.
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
