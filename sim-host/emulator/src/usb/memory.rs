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

/// Bits of either half of a buffer control word (4.1.2.5.3).
pub(crate) mod buffer {
    pub(crate) const LENGTH: u16 = 0x3FF;
    pub(crate) const AVAILABLE: u16 = 1 << 10;
    /// Stalls the endpoint; in the lower half only.
    pub(crate) const STALL: u16 = 1 << 11;
    /// Makes the first buffer the next one; in the lower half only.
    pub(crate) const RESET: u16 = 1 << 12;
    pub(crate) const DATA1: u16 = 1 << 13;
    pub(crate) const LAST: u16 = 1 << 14;
    pub(crate) const FULL: u16 = 1 << 15;
}

/// One half of a buffer control word, as the controller reads it.
#[derive(Clone, Copy, Debug, Default)]
struct Half {
    seen: u16,
    /// The half's bits other than AVAILABLE before their last change; below, the time of that
    /// change.
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
    halves: [[Half; 2]; ENDPOINTS],
    races: u32,
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
            halves: [[half; 2]; ENDPOINTS],
            races: 0,
        }
    }

    /// Number of times that a half was made available too soon after a change of its other bits.
    #[cfg(test)]
    pub(crate) const fn races(&self) -> u32 {
        self.races
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
        let Some((index, which)) = place_of_half(at) else {
            return;
        };
        let Some(half) = self.halves.get_mut(index).and_then(|it| it.get_mut(which)) else {
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
        self.races += u32::from(races);
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

    /// A half of a buffer control word, as the controller reads it.
    pub(crate) fn half(&self, index: usize, which: usize) -> u16 {
        let half = self.halves.get(index).and_then(|it| it.get(which));
        half.map_or(0, |half| half.seen)
    }

    /// Time at which a half was last made available.
    pub(crate) fn armed_ps(&self, index: usize, which: usize) -> Option<u64> {
        self.halves.get(index)?.get(which)?.armed_ps
    }

    /// Write of a half by the controller.
    pub(crate) fn set_half(&mut self, index: usize, which: usize, value: u16) {
        let at = BUFFER_CONTROL + 4 * index + 2 * which;
        self.store(at, &value.to_le_bytes());
        if let Some(half) = self.halves.get_mut(index).and_then(|it| it.get_mut(which)) {
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

/// Endpoint and half of the buffer control word at an offset.
const fn place_of_half(at: usize) -> Option<(usize, usize)> {
    if at < BUFFER_CONTROL || at >= BUFFERS {
        return None;
    }
    Some(((at - BUFFER_CONTROL) / 4, at / 2 % 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUT_0: usize = BUFFER_CONTROL + 4;

    fn write(memory: &mut PacketMemory, value: u16, now_ps: u64) {
        memory.write(OUT_0, &value.to_le_bytes(), now_ps).unwrap();
    }

    #[test]
    fn bytes_half_words_and_words_share_the_memory() {
        let mut memory = PacketMemory::new();
        memory
            .write(0x100, &0x4433_2211_u32.to_le_bytes(), 0)
            .unwrap();
        memory.write(0x101, &[0xAA], 0).unwrap();
        memory.write(0x102, &0xCCBB_u16.to_le_bytes(), 0).unwrap();
        assert_eq!(memory.word(0x100), Some(0xCCBB_AA11));
        assert_eq!(memory.write(SIZE, &[0], 0), None);
        assert_eq!(memory.word(SIZE - 2), None);
    }

    #[test]
    fn a_half_made_available_a_period_after_its_rest_is_seen_whole() {
        let mut memory = PacketMemory::new();
        let rest = buffer::DATA1 | 64;
        write(&mut memory, rest, 1_000_000);
        write(
            &mut memory,
            rest | buffer::AVAILABLE,
            1_000_000 + SETTLING_PS,
        );
        assert_eq!(memory.half(1, 0), rest | buffer::AVAILABLE);
        assert_eq!(memory.races(), 0);
    }

    #[test]
    fn a_half_made_available_too_soon_is_seen_with_the_rest_of_before() {
        let rest = buffer::DATA1 | 64;
        for apart_ps in [0, SETTLING_PS - 1] {
            let mut memory = PacketMemory::new();
            write(&mut memory, 8, 0);
            if apart_ps > 0 {
                write(&mut memory, rest, 1_000_000);
            }
            write(&mut memory, rest | buffer::AVAILABLE, 1_000_000 + apart_ps);
            assert_eq!(memory.half(1, 0), 8 | buffer::AVAILABLE, "{apart_ps} ps");
            assert_eq!(memory.races(), 1);
            // The processor reads back its own writes.
            assert_eq!(memory.half_word(OUT_0), rest | buffer::AVAILABLE);
        }
    }
}
