//! Interrupts: pending and allowed ones (ARMv6-M architecture, B1.5 and B3.4).

use std::iter;

/// Number of the HardFault exception.
pub(crate) const HARD_FAULT: u32 = 3;
/// Exception number of interrupt 0.
const FIRST: u32 = 16;

/// Numbers of the interrupts in a mask, in order.
fn numbers(mut mask: u32) -> impl Iterator<Item = u32> {
    iter::from_fn(move || {
        let number = mask.trailing_zeros();
        mask &= mask.wrapping_sub(1);
        (number < 32).then_some(number)
    })
}

/// The nested vectored interrupt controller of one core.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interrupts {
    pending: u32,
    enabled: u32,
    priority: [u8; 32],
    /// Levels of the interrupt lines as driven by the peripherals.
    lines: u32,
}

impl Interrupts {
    /// Sets the lines' levels. A rising line becomes pending; a line that stays high becomes
    /// pending again when its handler has ended.
    pub(crate) fn drive(&mut self, lines: u32, active: u64) {
        let rising = lines & !self.lines;
        let in_handler = (active >> FIRST) as u32;
        self.pending |= rising | (lines & !in_handler);
        self.lines = lines;
    }

    /// Whether an enabled interrupt is pending, whatever its priority; this also ends a WFI.
    #[inline]
    pub(crate) fn any(&self) -> bool {
        self.pending & self.enabled != 0
    }

    /// Enabled interrupts that are pending.
    pub(crate) const fn pending(&self) -> u32 {
        self.pending & self.enabled
    }

    /// Takes the exception to enter now, given the active ones, and clears its pending state.
    pub(crate) fn take(&mut self, active: u64) -> Option<u32> {
        let number =
            numbers(self.pending()).min_by_key(|&number| self.priority[number as usize])?;
        let priority = i16::from(self.priority[number as usize]);
        if priority >= self.execution_priority(active) {
            return None;
        }
        self.pending &= !(1 << number);
        Some(FIRST + number)
    }

    /// Priority of the running code; a smaller number is more urgent.
    fn execution_priority(&self, active: u64) -> i16 {
        if active & 0b1111 != 0 {
            return -1;
        }
        if active >> 4 & 0xFFF != 0 {
            return 0;
        }
        numbers((active >> FIRST) as u32)
            .map(|number| i16::from(self.priority[number as usize]))
            .min()
            .unwrap_or(i16::MAX)
    }

    /// Reads a register by its offset from 0xE000E000.
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x100 | 0x180 => self.enabled,
            0x200 | 0x280 => self.pending,
            0x400..=0x41C => {
                let first = (offset - 0x400) as usize;
                let bytes = self.priority.get(first..first + 4)?;
                u32::from_le_bytes(bytes.try_into().ok()?)
            }
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x100 => self.enabled |= value,
            0x180 => self.enabled &= !value,
            0x200 => self.pending |= value,
            // A line that is still high is pending again at once.
            0x280 => self.pending = self.pending & !value | self.lines,
            0x400..=0x41C => {
                let first = (offset - 0x400) as usize;
                let bytes = self.priority.get_mut(first..first + 4)?;
                bytes.copy_from_slice(&(value & 0xC0C0_C0C0).to_le_bytes());
            }
            _ => return None,
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controller() -> Interrupts {
        let mut interrupts = Interrupts::default();
        interrupts.write(0x100, u32::MAX).unwrap();
        interrupts.write(0x400, 0x4080_00C0).unwrap();
        interrupts
    }

    #[test]
    fn nothing_preempts_a_hard_fault() {
        let mut interrupts = controller();
        interrupts.drive(0b10, 0);
        assert_eq!(interrupts.take(1 << HARD_FAULT), None);
    }
}
