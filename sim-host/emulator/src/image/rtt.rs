//! Host side of the debug probe's channels, which needs only memory accesses (SEGGER RTT: a control
//! block, and ring buffers for each direction).

use crate::rp2040::memory::Memory;

/// Size of a ring buffer's descriptor, bytes.
const RING: u32 = 24;
const UP_COUNT: u32 = 16;
const DOWN_COUNT: u32 = 20;
const RINGS: u32 = 24;

/// Address of the descriptor of a channel's ring buffer; `None` if the firmware has not set it up.
fn ring(memory: &Memory, block: u32, down: bool, channel: u32) -> Option<u32> {
    let is_ready = (0..)
        .zip(*b"SEGGER RTT")
        .all(|(offset, letter)| memory.byte(block + offset) == letter);
    let ups = memory.word(block + UP_COUNT);
    let count = if down {
        memory.word(block + DOWN_COUNT)
    } else {
        ups
    };
    let first = if down { ups } else { 0 };
    (is_ready && channel < count).then(|| block + RINGS + (first + channel) * RING)
}

struct Ring {
    at: u32,
    buffer: u32,
    size: u32,
    write: u32,
    read: u32,
}

impl Ring {
    fn find(memory: &Memory, block: u32, down: bool, channel: u32) -> Option<Self> {
        let at = ring(memory, block, down, channel)?;
        let ring = Self {
            at,
            buffer: memory.word(at + 4),
            size: memory.word(at + 8),
            write: memory.word(at + 12),
            read: memory.word(at + 16),
        };
        (ring.buffer != 0 && ring.size != 0).then_some(ring)
    }
}

/// Reads the bytes from the firmware that wait in a channel.
pub(crate) fn read(memory: &mut Memory, block: u32, channel: u32) -> Vec<u8> {
    let Some(ring) = Ring::find(memory, block, false, channel) else {
        return Vec::new();
    };
    let waiting = (ring.write + ring.size - ring.read) % ring.size;
    let bytes = (0..waiting)
        .map(|offset| memory.byte(ring.buffer + (ring.read + offset) % ring.size))
        .collect();
    memory.set_word(ring.at + 16, ring.write);
    bytes
}

/// Writes bytes to a channel of the firmware; returns how many fitted.
pub(crate) fn write(memory: &mut Memory, block: u32, channel: u32, bytes: &[u8]) -> usize {
    let Some(ring) = Ring::find(memory, block, true, channel) else {
        return 0;
    };
    let room = (ring.read + ring.size - ring.write - 1) % ring.size;
    let taken = bytes.len().min(room as usize);
    let mut write = ring.write;
    for &byte in bytes.iter().take(taken) {
        memory.set_byte(ring.buffer + write, byte);
        write = (write + 1) % ring.size;
    }
    memory.set_word(ring.at + 12, write);
    taken
}
