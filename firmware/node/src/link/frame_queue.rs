//! Frames that wait for a link that takes them in packets.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer, Queue};

use super::FrameSink;

/// A queue of frames, by their bytes. One task sends, another one receives.
///
/// While no PC is there it takes nothing. When one comes, what still waits from before is thrown away
/// and counted: a receiver begins with a whole frame of the present.
#[derive(Debug)]
pub struct FrameQueue<const N: usize> {
    bytes: Queue<u8, N>,
    state: State,
}

#[derive(Debug)]
struct State {
    is_open: AtomicBool,
    /// Frames thrown away; wraps. Counted by the receiver.
    discarded: AtomicU32,
}

impl<const N: usize> Default for FrameQueue<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> FrameQueue<N> {
    /// An empty queue, closed.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: Queue::new(),
            state: State {
                is_open: AtomicBool::new(false),
                discarded: AtomicU32::new(0),
            },
        }
    }

    /// The two ends.
    pub fn split(&mut self) -> (FrameSender<'_>, FrameReceiver<'_>) {
        let (producer, consumer) = self.bytes.split();
        let sender = FrameSender {
            bytes: producer,
            state: &self.state,
            discarded: 0,
        };
        let receiver = FrameReceiver {
            bytes: consumer,
            state: &self.state,
        };
        (sender, receiver)
    }
}

/// The end that frames go into.
pub struct FrameSender<'a> {
    bytes: Producer<'a, u8>,
    state: &'a State,
    /// What was counted already.
    discarded: u32,
}

impl FrameSender<'_> {
    /// Whether something waits for the receiver.
    #[must_use]
    pub fn has_frames(&self) -> bool {
        !self.bytes.is_empty()
    }
}

impl FrameSink for FrameSender<'_> {
    fn write(&mut self, frame: &[u8]) -> bool {
        let room = self.bytes.capacity() - self.bytes.len();
        if frame.len() > room {
            return false;
        }
        // There is room for every one.
        frame.iter().all(|&byte| self.bytes.enqueue(byte).is_ok())
    }

    fn is_open(&self) -> bool {
        self.state.is_open.load(Ordering::Relaxed)
    }

    fn take_discarded(&mut self) -> u32 {
        let discarded = self.state.discarded.load(Ordering::Relaxed);
        discarded.wrapping_sub(core::mem::replace(&mut self.discarded, discarded))
    }
}

/// The end that packets come out of.
pub struct FrameReceiver<'a> {
    bytes: Consumer<'a, u8>,
    state: &'a State,
}

impl FrameReceiver<'_> {
    /// A PC comes or goes. When one comes, what waited before is thrown away.
    pub fn set_open(&mut self, is_open: bool) {
        let was_open = self.state.is_open.load(Ordering::Relaxed);
        if is_open && !was_open {
            self.discard();
        }
        self.state.is_open.store(is_open, Ordering::Relaxed);
    }

    /// Throws away what waits. Each frame ends with the only zero in it; one of which a part has left
    /// counts as well.
    fn discard(&mut self) {
        let mut frames = 0_u32;
        while let Some(byte) = self.bytes.dequeue() {
            frames += u32::from(byte == 0);
        }
        let discarded = self.state.discarded.load(Ordering::Relaxed);
        let discarded = discarded.wrapping_add(frames);
        self.state.discarded.store(discarded, Ordering::Relaxed);
    }

    /// Whether nothing waits.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.bytes.ready()
    }

    /// Takes what waits into a packet, and says how much there is in it.
    pub fn fill(&mut self, packet: &mut [u8]) -> usize {
        let mut length = 0;
        for (slot, byte) in packet
            .iter_mut()
            .zip(core::iter::from_fn(|| self.bytes.dequeue()))
        {
            *slot = byte;
            length += 1;
        }
        length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [u8; 4] = [3, 7, 7, 0];

    #[test]
    fn what_has_no_room_is_refused_whole() {
        let mut queue = FrameQueue::<16>::new();
        let (mut sender, mut receiver) = queue.split();
        receiver.set_open(true);
        // A queue of 16 holds 15.
        assert_eq!(
            [(); 4].map(|()| sender.write(&FRAME)),
            [true, true, true, false]
        );
        let mut packet = [0xFF; 64];
        assert_eq!(receiver.fill(&mut packet), 12);
        assert_eq!(packet[..12], [FRAME; 3].concat());
        assert!(receiver.is_empty());
        assert_eq!(sender.take_discarded(), 0);
    }

    #[test]
    fn what_waited_before_a_pc_came_is_thrown_away_and_counted() {
        let mut queue = FrameQueue::<64>::new();
        let (mut sender, mut receiver) = queue.split();
        assert!(!sender.is_open());
        receiver.set_open(true);
        assert!(sender.write(&FRAME) && sender.write(&FRAME) && sender.write(&FRAME));
        // Half of the first frame has left.
        assert_eq!(receiver.fill(&mut [0; 2]), 2);
        receiver.set_open(true);
        assert_eq!(sender.take_discarded(), 0, "it was there all along");
        receiver.set_open(false);
        receiver.set_open(true);
        assert_eq!((sender.take_discarded(), sender.take_discarded()), (3, 0));
        assert!(receiver.is_empty());
        assert!(sender.write(&FRAME));
        assert_eq!(receiver.fill(&mut [0; 64]), 4);
    }
}
