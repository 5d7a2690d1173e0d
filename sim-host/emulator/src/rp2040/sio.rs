//! SIO: the processor's own registers (RP2040 datasheet 2.3.1). GPIO is in [`crate::rp2040::gpio`].

/// CPUID and spinlocks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sio {
    locks: u32,
}

impl Sio {
    pub(crate) fn read(&mut self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x000 => 0,
            0x05C => self.locks,
            0x100..=0x17C => {
                let bit = 1 << ((offset - 0x100) / 4);
                let free = self.locks & bit == 0;
                self.locks |= bit;
                if free { bit } else { 0 }
            }
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, _: u32) -> Option<()> {
        matches!(offset, 0x100..=0x17C).then(|| {
            self.locks &= !(1 << ((offset - 0x100) / 4));
        })
    }
}
