//! DMA: channels that copy the ADC's results to memory (RP2040 datasheet 2.5).

const CHANNELS: usize = 12;
/// Value of TREQ_SEL for the ADC's FIFO.
const ADC: u32 = 36;
const ENABLE: u32 = 1;
/// Bits of CTRL. Only transfers of half-words to incrementing addresses in a ring are modelled.
const HALF_WORDS: u32 = 0b01 << 2;
const SIZE: u32 = 0b11 << 2;
const READS_GO_ON: u32 = 1 << 4;
const WRITES_GO_ON: u32 = 1 << 5;
const RING_OF_WRITES: u32 = 1 << 10;
/// Address of the ADC's FIFO register, the only modelled source.
const FIFO: u32 = 0x4004_C00C;

#[derive(Clone, Copy, Debug, Default)]
struct DmaChannel {
    read: u32,
    write: u32,
    /// Number of transfers left; a trigger reloads it from `count`.
    left: u32,
    count: u32,
    control: u32,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Dma {
    channels: [DmaChannel; CHANNELS],
}

impl Dma {
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        let channel = self.channels.get(offset as usize / 0x40)?;
        Some(match offset % 0x40 {
            0x00 => channel.read,
            0x04 => channel.write,
            0x08 => channel.left,
            0x0C | 0x10 => channel.control | u32::from(channel.left > 0) << 24,
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        let channel = self.channels.get_mut(offset as usize / 0x40)?;
        match offset % 0x40 {
            0x00 => channel.read = value,
            0x04 => channel.write = value,
            0x08 => channel.count = value,
            0x0C | 0x10 => {
                let required = HALF_WORDS | WRITES_GO_ON | RING_OF_WRITES | ENABLE | ADC << 15;
                let checked = SIZE | READS_GO_ON | WRITES_GO_ON | RING_OF_WRITES | 0x3F << 15 | 1;
                if value & checked != required || channel.read != FIFO {
                    return None;
                }
                channel.control = value & 0x7F_FFFF;
                if offset % 0x40 == 0x0C {
                    channel.left = channel.count;
                }
            }
            _ => return None,
        }
        Some(())
    }

    /// Address for the next result; `None` if no channel waits for one.
    pub(crate) fn next(&mut self) -> Option<u32> {
        self.skip(1)
    }

    /// Advances the waiting channel by `results` results; returns the address for the last one.
    pub(crate) fn skip(&mut self, results: u32) -> Option<u32> {
        let index = self
            .channels
            .iter()
            .position(|channel| channel.left > 0 && channel.control & ENABLE != 0)?;
        let channel = self.channels.get_mut(index)?;
        let ring = 1_u32 << (channel.control >> 6 & 0xF);
        let at =
            |write: u32, on: u32| write & !(ring - 1) | (write.wrapping_add(2 * on)) & (ring - 1);
        let last = at(channel.write, results - 1);
        channel.write = at(channel.write, results);
        channel.left = channel.left.saturating_sub(results);
        let chained = (channel.control >> 11 & 0xF) as usize;
        if channel.left == 0
            && chained != index
            && let Some(next) = self.channels.get_mut(chained)
        {
            next.left = next.count;
        }
        Some(last)
    }
}
