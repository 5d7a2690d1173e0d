//! Queue of frames for a link that sends packets.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use super::FrameSink;

/// Byte queue of frames. One task sends, another one receives.
///
/// Without a PC the queue accepts no frame. When a PC opens the link, frames that still wait are
/// discarded and counted, so that a receiver starts with a whole, recent frame.
#[derive(Debug)]
pub struct FrameQueue<const N: usize> {
    bytes: [AtomicU8; N],
    state: State,
}

#[derive(Debug)]
struct State {
    /// Number of bytes written so far, and of bytes read; both wrap. The sender changes the first, the
    /// receiver the second.
    written: AtomicU32,
    read: AtomicU32,
    is_open: AtomicBool,
    /// Number of discarded frames; wraps. The receiver counts them.
    discarded: AtomicU32,
}

impl State {
    /// Number of waiting bytes.
    fn waiting(&self) -> usize {
        let written = self.written.load(Ordering::Acquire);
        written.wrapping_sub(self.read.load(Ordering::Acquire)) as usize
    }
}

/// Returns the bytes from a position on, in two parts: up to the end of the queue, and those before.
fn parts(bytes: &[AtomicU8], position: u32) -> [&[AtomicU8]; 2] {
    // The length is a power of two.
    let index = position as usize & bytes.len().wrapping_sub(1);
    let (before, after) = bytes.split_at_checked(index).unwrap_or((bytes, &[]));
    [after, before]
}

impl<const N: usize> Default for FrameQueue<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> FrameQueue<N> {
    /// Creates an empty, closed queue. `N` must be a power of two.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two()) };
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            state: State {
                written: AtomicU32::new(0),
                read: AtomicU32::new(0),
                is_open: AtomicBool::new(false),
                discarded: AtomicU32::new(0),
            },
        }
    }

    /// Returns both ends.
    pub const fn split(&mut self) -> (FrameSender<'_>, FrameReceiver<'_>) {
        let Self { bytes, state } = self;
        let sender = FrameSender {
            bytes,
            state,
            discarded: 0,
        };
        let receiver = FrameReceiver {
            bytes,
            state,
            on_its_way: None,
            is_unfinished: false,
            is_within_frame: false,
            ends_frame: false,
        };
        (sender, receiver)
    }
}

/// Sender of frames.
pub struct FrameSender<'a> {
    bytes: &'a [AtomicU8],
    state: &'a State,
    /// Number of discarded frames already reported.
    discarded: u32,
}

impl FrameSender<'_> {
    /// Returns whether frames wait for the receiver.
    #[must_use]
    pub fn has_frames(&self) -> bool {
        self.state.waiting() > 0
    }
}

impl FrameSink for FrameSender<'_> {
    fn write(&mut self, frame: &[u8]) -> bool {
        if frame.len() > self.bytes.len().saturating_sub(self.state.waiting()) {
            return false;
        }
        let written = self.state.written.load(Ordering::Relaxed);
        let mut rest = frame;
        for part in parts(self.bytes, written) {
            let (now, later) = rest.split_at_checked(part.len()).unwrap_or((rest, &[]));
            for (slot, &byte) in part.iter().zip(now) {
                slot.store(byte, Ordering::Relaxed);
            }
            rest = later;
        }
        let written = written.wrapping_add(frame.len() as u32);
        self.state.written.store(written, Ordering::Release);
        true
    }

    fn is_open(&self) -> bool {
        self.state.is_open.load(Ordering::Relaxed)
    }

    fn take_discarded(&mut self) -> u32 {
        let discarded = self.state.discarded.load(Ordering::Relaxed);
        discarded.wrapping_sub(core::mem::replace(&mut self.discarded, discarded))
    }
}

/// Receiver of packets, one at a time: the next packet is made after the PC has taken the last one.
pub struct FrameReceiver<'a> {
    bytes: &'a [AtomicU8],
    state: &'a State,
    /// Number of frames that end in the packet in transit, if there is one.
    on_its_way: Option<u32>,
    /// The last packet was full: a PC waits for more until a shorter one comes (USB 2.0, 5.8.3).
    is_unfinished: bool,
    /// The last packet ended within a frame.
    is_within_frame: bool,
    /// The next packet must end the frame within which the last packet ended: the rest of that frame was
    /// discarded.
    ends_frame: bool,
}

impl FrameReceiver<'_> {
    /// Opens or closes the queue. Opening it discards the frames that waited before.
    pub fn set_open(&mut self, is_open: bool) {
        let was_open = self.is_open();
        if is_open && !was_open {
            self.discard();
            self.ends_frame = self.is_within_frame;
        }
        self.state.is_open.store(is_open, Ordering::Relaxed);
    }

    fn is_open(&self) -> bool {
        self.state.is_open.load(Ordering::Relaxed)
    }

    /// Moves waiting bytes into a buffer; returns how many.
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let length = self.state.waiting().min(buffer.len());
        let read = self.state.read.load(Ordering::Relaxed);
        let mut rest = buffer.get_mut(..length).unwrap_or_default();
        for part in parts(self.bytes, read) {
            let part = part.get(..rest.len()).unwrap_or(part);
            for (byte, slot) in rest.iter_mut().zip(part) {
                *byte = slot.load(Ordering::Relaxed);
            }
            rest = rest.get_mut(part.len()..).unwrap_or_default();
        }
        let read = read.wrapping_add(length as u32);
        self.state.read.store(read, Ordering::Release);
        length
    }

    /// Discards waiting frames. Each frame ends with its only zero byte; a frame that was partly sent
    /// counts as well.
    fn discard(&mut self) {
        let mut frames = 0;
        let mut buffer = [0; 16];
        loop {
            let length = self.read(&mut buffer);
            frames += ends(buffer.get(..length).unwrap_or_default());
            if length == 0 {
                break;
            }
        }
        self.count_discarded(frames);
    }

    fn count_discarded(&self, frames: u32) {
        let discarded = self.state.discarded.load(Ordering::Relaxed);
        let discarded = discarded.wrapping_add(frames);
        self.state.discarded.store(discarded, Ordering::Relaxed);
    }

    /// Returns whether the queue is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.state.waiting() == 0
    }

    /// Fills the next packet and returns its length, if the PC has taken the last one and there is data
    /// to send. The packet is then in transit until [`taken`](Self::taken) or [`lost`](Self::lost).
    pub fn next_packet(&mut self, packet: &mut [u8]) -> Option<usize> {
        let is_needed = !self.is_empty() || self.is_unfinished || self.ends_frame;
        if self.on_its_way.is_some() || !self.is_open() || !is_needed {
            return None;
        }
        // The end of a frame whose rest was discarded is not counted: that frame was counted as discarded.
        let end = usize::from(core::mem::take(&mut self.ends_frame));
        packet.iter_mut().take(end).for_each(|byte| *byte = 0);
        let length = end + self.read(packet.get_mut(end..).unwrap_or_default());
        let frames = packet.get(end..length).unwrap_or_default();
        self.on_its_way = Some(ends(frames));
        self.is_unfinished = length == packet.len();
        if let Some(&last) = packet.get(..length).and_then(<[u8]>::last) {
            self.is_within_frame = last != 0;
        }
        Some(length)
    }

    /// Records that the PC has taken the packet.
    pub fn taken(&mut self) {
        self.on_its_way = None;
    }

    /// Records that a bus reset has discarded the packet, and counts its frames as discarded.
    pub fn lost(&mut self) {
        let frames = self.on_its_way.take().unwrap_or(0);
        self.is_unfinished = false;
        self.count_discarded(frames);
    }
}

/// Number of frames that end in some bytes.
fn ends(bytes: &[u8]) -> u32 {
    bytes.iter().map(|&byte| u32::from(byte == 0)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [u8; 4] = [3, 7, 7, 0];

    /// Returns the next packet as a reading PC receives it.
    fn packet(receiver: &mut FrameReceiver<'_>, length: usize) -> Option<Vec<u8>> {
        let mut packet = vec![0xFF; length];
        let length = receiver.next_packet(&mut packet)?;
        receiver.taken();
        packet.truncate(length);
        Some(packet)
    }

    #[test]
    fn what_has_no_room_is_refused_whole() {
        let mut queue = FrameQueue::<16>::new();
        let (mut sender, mut receiver) = queue.split();
        receiver.set_open(true);
        for length in 1..=4 {
            // Each round begins elsewhere in the queue.
            let frame = FRAME.get(4 - length..).unwrap();
            let fits = 16 / length;
            assert!((0..fits).all(|_| sender.write(frame)));
            assert!(!sender.write(&FRAME));
            assert_eq!(packet(&mut receiver, 64).unwrap(), frame.repeat(fits));
        }
        assert!(receiver.is_empty());
        assert_eq!(packet(&mut receiver, 64), None);
        assert_eq!(sender.take_discarded(), 0);
    }

    #[test]
    fn a_packet_goes_after_the_last_one_was_taken_and_a_full_one_is_followed_by_a_shorter() {
        let mut queue = FrameQueue::<64>::new();
        let (mut sender, mut receiver) = queue.split();
        receiver.set_open(true);
        assert!(sender.write(&FRAME) && sender.write(&FRAME));
        let mut bytes = [0xFF; 4];
        assert_eq!(receiver.next_packet(&mut bytes), Some(4));
        assert_eq!(receiver.next_packet(&mut bytes), None);
        receiver.taken();
        assert_eq!(packet(&mut receiver, 4).unwrap(), FRAME);
        assert_eq!(packet(&mut receiver, 4).unwrap(), []);
        assert_eq!(packet(&mut receiver, 4), None);
    }

    #[test]
    fn what_waited_before_a_pc_came_is_thrown_away_and_counted() {
        let mut queue = FrameQueue::<64>::new();
        let (mut sender, mut receiver) = queue.split();
        assert!(!sender.is_open());
        receiver.set_open(true);
        assert!(sender.write(&FRAME) && sender.write(&FRAME) && sender.write(&FRAME));
        // Half of the first frame was sent.
        assert_eq!(packet(&mut receiver, 2).unwrap(), FRAME[..2]);
        receiver.set_open(true);
        assert_eq!(sender.take_discarded(), 0, "it was there all along");
        receiver.set_open(false);
        assert_eq!(packet(&mut receiver, 64), None, "no PC is there");
        receiver.set_open(true);
        assert_eq!((sender.take_discarded(), sender.take_discarded()), (3, 0));
        assert!(receiver.is_empty());
        assert!(sender.write(&FRAME));
        // A zero ends the half frame before the first whole frame.
        assert_eq!(
            packet(&mut receiver, 64).unwrap(),
            [&[0], &FRAME[..]].concat()
        );
    }

    #[test]
    fn a_packet_that_a_reset_took_away_is_counted_and_one_that_was_taken_is_not() {
        let mut queue = FrameQueue::<64>::new();
        let (mut sender, mut receiver) = queue.split();
        receiver.set_open(true);
        assert!(sender.write(&FRAME) && sender.write(&FRAME) && sender.write(&FRAME));
        assert_eq!(packet(&mut receiver, 6).unwrap().len(), 6);
        // This packet has the rest of the second frame and a part of the third.
        assert_eq!(receiver.next_packet(&mut [0; 4]), Some(4));
        receiver.lost();
        receiver.lost();
        assert_eq!(sender.take_discarded(), 1);
        receiver.set_open(false);
        receiver.set_open(true);
        assert_eq!(sender.take_discarded(), 1, "the third");
        // The zero before the next frame is not part of that frame.
        assert_eq!(receiver.next_packet(&mut [0; 4]), Some(1));
        receiver.lost();
        assert_eq!(sender.take_discarded(), 0);
    }
}
