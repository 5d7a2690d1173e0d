//! Events at a board, encoded as bytes: random campaigns and fuzzers use the same encoding.
//!
//! Any bytes are a script. A move starts with a byte: the lowest three bits give its kind, the next
//! two the run that a frame addresses, and the highest the link. A length of one byte precedes a
//! payload. Missing bytes at the end count as 0 or as empty.

use palpate_procedure::Link;

use super::frame::Damage;

/// One event of a script.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Move {
    /// Raw bytes arrive.
    Raw(Link, Vec<u8>),
    /// A command arrives; it is valid if its payload is valid.
    Command(Link, Addressee, u8, Vec<u8>),
    /// A command arrives, damaged in transmission.
    Damaged(Link, Addressee, u8, Vec<u8>, Damage),
    /// Milliseconds pass.
    Run(u8),
    /// The object presses the sensor: 255 is the deepest press, 0 lifts it.
    Press(u8),
    /// A user sets a calibration that matches the sensor.
    Calibrate(Link),
}

/// Run of the board, from one boot to the next, that a frame addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Addressee {
    /// The present run.
    Present,
    /// Any run.
    Any,
    /// The next run.
    Next,
    /// A run that never comes.
    None,
}

impl Addressee {
    const ALL: [Self; 4] = [Self::Present, Self::Any, Self::Next, Self::None];
}

/// Reads a script to its end.
#[must_use]
pub fn read(script: &[u8]) -> Vec<Move> {
    let mut reader = Reader(script);
    let mut moves = Vec::new();
    while !reader.0.is_empty() {
        moves.push(reader.next());
    }
    moves
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    fn bytes(&mut self) -> Vec<u8> {
        let length = usize::from(self.byte()).min(self.0.len());
        let (bytes, rest) = self.0.split_at(length);
        self.0 = rest;
        bytes.to_vec()
    }

    fn next(&mut self) -> Move {
        let first = self.byte();
        let link = if first & 0x80 == 0 {
            Link::Probe
        } else {
            Link::Usb
        };
        let addressee = Addressee::ALL[usize::from(first >> 3 & 0b11)];
        match first & 0b111 {
            0 => Move::Raw(link, self.bytes()),
            1 => {
                let damage = Damage {
                    kind: self.byte(),
                    at: self.byte(),
                    with: self.byte(),
                };
                Move::Damaged(link, addressee, self.byte(), self.bytes(), damage)
            }
            2 | 3 => Move::Run(self.byte()),
            4 => Move::Press(self.byte()),
            5 => Move::Calibrate(link),
            _ => Move::Command(link, addressee, self.byte(), self.bytes()),
        }
    }
}

/// Encodes a move for [`read`].
pub fn write(of: &Move, to: &mut Vec<u8>) {
    match of {
        Move::Raw(link, bytes) => {
            to.push(first(0, *link, Addressee::Present));
            long(bytes, to);
        }
        Move::Damaged(link, addressee, kind, payload, damage) => {
            to.push(first(1, *link, *addressee));
            to.extend([damage.kind, damage.at, damage.with, *kind]);
            long(payload, to);
        }
        Move::Run(ms) => to.extend([2, *ms]),
        Move::Press(part) => to.extend([4, *part]),
        Move::Calibrate(link) => to.push(first(5, *link, Addressee::Present)),
        Move::Command(link, addressee, kind, payload) => {
            to.push(first(6, *link, *addressee));
            to.push(*kind);
            long(payload, to);
        }
    }
}

fn first(of: u8, link: Link, addressee: Addressee) -> u8 {
    of | (addressee as u8) << 3 | u8::from(link == Link::Usb) << 7
}

/// Writes a length byte and at most 255 bytes.
fn long(bytes: &[u8], to: &mut Vec<u8>) {
    let bytes = bytes.get(..255).unwrap_or(bytes);
    to.push(bytes.len() as u8);
    to.extend(bytes);
}
