//! DPSRAM: the memory that processor and USB controller share (RP2040 datasheet 4.1.2.5).

/// Size of the shared memory, bytes.
pub(crate) const SIZE: usize = 4096;
/// Number of endpoints, each direction counted: IN of endpoint 0, OUT of endpoint 0, IN of endpoint
/// 1, ...
pub(crate) const ENDPOINTS: usize = 32;
/// Offset of the setup packet.
const SETUP: usize = 0;
/// Offset of the control words of endpoint 1 and higher.
const ENDPOINT_CONTROL: usize = 0x08;
/// Offset of the buffer control words.
const BUFFER_CONTROL: usize = 0x80;
/// Offset of the buffers.
const BUFFERS: usize = 0x100;
/// One period of clk_usb, ps: the other bits of a half of a buffer control word must be written
/// this long before AVAILABLE (4.1.2.5.1).
const SETTLING_PS: u64 = 1_000_000 / 48;

/// Bits of the lower half of a buffer control word; the upper half is for a second buffer, which is
/// not modelled (4.1.2.5.3).
pub(crate) mod buffer {
    pub(crate) const LENGTH: u16 = 0x3FF;
    pub(crate) const AVAILABLE: u16 = 1 << 10;
    /// Stalls the endpoint.
    pub(crate) const STALL: u16 = 1 << 11;
    pub(crate) const DATA1: u16 = 1 << 13;
    pub(crate) const LAST: u16 = 1 << 14;
    pub(crate) const FULL: u16 = 1 << 15;
}

/// Lower half of a buffer control word, as the controller reads it.
#[derive(Clone, Copy, Debug, Default)]
struct Half {
    seen: u16,
    /// The half's bits other than AVAILABLE, before their last change; `changed_ps` is the time of
    /// that change.
    before: u16,
    changed_ps: Option<u64>,
    /// Time at which the half was last made available.
    armed_ps: Option<u64>,
}

/// The shared memory.
///
/// If a half is made available together with a change of its other bits, or less than a period of
/// clk_usb after it, the controller may read the old bits. Here it always does, until the half is
/// written again: the worst case of the datasheet.
#[derive(Clone, Debug)]
pub(crate) struct PacketMemory {
    bytes: [u8; SIZE],
    halves: [Half; ENDPOINTS],
    /// Number of writes by the processor to the control word of a buffer that stayed available.
    rewritten: u32,
}

impl PacketMemory {
    pub(crate) const fn new() -> Self {
        let half = Half {
            seen: 0,
            before: 0,
            changed_ps: None,
            armed_ps: None,
        };
        Self {
            bytes: [0; SIZE],
            halves: [half; ENDPOINTS],
            rewritten: 0,
        }
    }

    /// Number of writes by the processor to the control word of a buffer that stayed available. The
    /// controller may take the buffer between the processor's read and its write, which then undoes
    /// the controller's change (4.1.2.5.1).
    pub(crate) const fn rewritten(&self) -> u32 {
        self.rewritten
    }

    /// Word at an offset; `None` outside.
    pub(crate) fn word(&self, offset: usize) -> Option<u32> {
        let bytes = self.bytes.get(offset..offset + 4)?;
        bytes.try_into().ok().map(u32::from_le_bytes)
    }

    /// Write of one, two or four bytes by the processor.
    pub(crate) fn write(&mut self, offset: usize, value: &[u8], now_ps: u64) -> Option<()> {
        let place = offset..offset + value.len();
        let old = self.bytes.get(place.clone())?.to_vec();
        let halves = (place.start & !1..place.end).step_by(2);
        let before: Vec<_> = halves.clone().map(|at| self.half_word(at)).collect();
        self.bytes.get_mut(place)?.copy_from_slice(value);
        let stays_available = |(at, before): (usize, &u16)| {
            let both = before & self.half_word(at);
            endpoint_of(at).is_some() && both & buffer::AVAILABLE != 0
        };
        let pairs = halves.clone().zip(&before);
        self.rewritten += pairs.filter(|pair| stays_available(*pair)).count() as u32;
        if old != value {
            for (at, before) in halves.zip(before) {
                self.show(at, before, now_ps);
            }
        }
        Some(())
    }

    /// Makes a half of a buffer control word visible to the controller.
    fn show(&mut self, at: usize, old: u16, now_ps: u64) {
        let new = self.half_word(at);
        let Some(half) = endpoint_of(at).and_then(|index| self.halves.get_mut(index)) else {
            return;
        };
        if (new ^ old) & !buffer::AVAILABLE != 0 {
            half.before = old & !buffer::AVAILABLE;
            half.changed_ps = Some(now_ps);
        }
        if new & !old & buffer::AVAILABLE != 0 {
            half.armed_ps = Some(now_ps);
        }
        let too_soon = half
            .changed_ps
            .is_some_and(|changed| now_ps - changed < SETTLING_PS);
        let races = too_soon && new & !old & buffer::AVAILABLE != 0;
        half.seen = if races {
            half.before | new & buffer::AVAILABLE
        } else {
            new
        };
    }

    fn half_word(&self, at: usize) -> u16 {
        let byte = |at: usize| self.bytes.get(at).copied().unwrap_or(0);
        u16::from_le_bytes([byte(at), byte(at + 1)])
    }

    /// Control word of an endpoint; `None` for endpoint 0, whose settings are in SIE_CTRL.
    pub(crate) fn endpoint_control(&self, index: usize) -> Option<u32> {
        self.word(ENDPOINT_CONTROL + 4 * index.checked_sub(2)?)
    }

    /// The lower half of a buffer control word, as the controller reads it.
    pub(crate) fn half(&self, index: usize) -> u16 {
        self.halves.get(index).map_or(0, |half| half.seen)
    }

    /// Time at which an endpoint's buffer was last made available.
    pub(crate) fn armed_ps(&self, index: usize) -> Option<u64> {
        self.halves.get(index)?.armed_ps
    }

    /// Write of a lower half by the controller.
    pub(crate) fn set_half(&mut self, index: usize, value: u16) {
        self.store(BUFFER_CONTROL + 4 * index, &value.to_le_bytes());
        if let Some(half) = self.halves.get_mut(index) {
            half.seen = value;
        }
    }

    /// Bytes of a buffer; `None` outside.
    pub(crate) fn load(&self, at: usize, length: usize) -> Option<Vec<u8>> {
        self.bytes.get(at..at + length).map(<[u8]>::to_vec)
    }

    /// Write of bytes by the controller; no effect outside.
    pub(crate) fn store(&mut self, at: usize, value: &[u8]) {
        if let Some(bytes) = self.bytes.get_mut(at..at + value.len()) {
            bytes.copy_from_slice(value);
        }
    }

    /// Write of the setup packet by the controller.
    pub(crate) fn store_setup(&mut self, packet: &[u8; 8]) {
        self.store(SETUP, packet);
    }
}

/// Endpoint whose buffer control word has its lower half at an offset.
fn endpoint_of(at: usize) -> Option<usize> {
    let is_lower = (BUFFER_CONTROL..BUFFERS).contains(&at) && at.is_multiple_of(4);
    is_lower.then(|| (at - BUFFER_CONTROL) / 4)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUT_0: usize = BUFFER_CONTROL + 4;

    #[test]
    fn a_half_made_available_too_soon_is_seen_with_the_rest_of_before() {
        let rest = buffer::DATA1 | 64;
        for (apart_ps, seen) in [(SETTLING_PS - 1, 8), (SETTLING_PS, rest)] {
            let mut memory = PacketMemory::new();
            for (value, at_ps) in [
                (8, 0),
                (rest, 1_000_000),
                (rest | buffer::AVAILABLE, 1_000_000 + apart_ps),
            ] {
                memory.write(OUT_0, &value.to_le_bytes(), at_ps).unwrap();
            }
            assert_eq!(memory.half(1), seen | buffer::AVAILABLE, "{apart_ps} ps");
            // The processor reads back its own writes.
            assert_eq!(memory.half_word(OUT_0), rest | buffer::AVAILABLE);
        }
    }
}
