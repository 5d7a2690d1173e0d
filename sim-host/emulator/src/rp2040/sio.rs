//! SIO: the processor's own registers (RP2040 datasheet 2.3.1). GPIO is in [`crate::rp2040::gpio`].

/// CPUID, spinlocks and the divider.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sio {
    locks: u32,
    divider: Divider,
}

#[derive(Clone, Debug, Default)]
struct Divider {
    dividend: u32,
    divisor: u32,
    quotient: u32,
    remainder: u32,
    dirty: bool,
}

impl Divider {
    fn divide(&mut self, signed: bool) {
        let (dividend, divisor) = (self.dividend, self.divisor);
        self.dirty = true;
        (self.quotient, self.remainder) = if signed {
            let (a, b) = (dividend as i32, divisor as i32);
            match b {
                // 2.3.1.5: division by zero returns a quotient of minus or plus one.
                0 => (if a < 0 { 1 } else { u32::MAX }, dividend),
                _ => (a.wrapping_div(b) as u32, a.wrapping_rem(b) as u32),
            }
        } else {
            match divisor {
                0 => (u32::MAX, dividend),
                _ => (dividend / divisor, dividend % divisor),
            }
        };
    }
}

impl Sio {
    pub(crate) fn read(&mut self, offset: u32) -> Option<u32> {
        let divider = &mut self.divider;
        Some(match offset {
            0x000 => 0,
            0x05C => self.locks,
            0x060 | 0x068 => divider.dividend,
            0x064 | 0x06C => divider.divisor,
            0x070 => {
                divider.dirty = false;
                divider.quotient
            }
            0x074 => divider.remainder,
            // A division takes 8 cycles. No instruction sequence that stores both operands and
            // loads CSR is faster: here the result is always ready.
            0x078 => 1 | u32::from(divider.dirty) << 1,
            0x100..=0x17C => {
                let bit = 1 << ((offset - 0x100) / 4);
                let free = self.locks & bit == 0;
                self.locks |= bit;
                if free { bit } else { 0 }
            }
            _ => return None,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        let divider = &mut self.divider;
        match offset {
            0x060 | 0x068 => divider.dividend = value,
            0x064 | 0x06C => divider.divisor = value,
            0x070 => divider.quotient = value,
            0x074 => divider.remainder = value,
            0x100..=0x17C => self.locks &= !(1 << ((offset - 0x100) / 4)),
            _ => return None,
        }
        match offset {
            0x060 | 0x064 => divider.divide(false),
            0x068 | 0x06C => divider.divide(true),
            _ => {}
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_divides_with_and_without_sign() {
        let mut sio = Sio::default();
        sio.write(0x060, 100).unwrap();
        sio.write(0x064, 7).unwrap();
        assert_eq!((sio.read(0x074), sio.read(0x070)), (Some(2), Some(14)));
        sio.write(0x068, -100_i32 as u32).unwrap();
        sio.write(0x06C, 7).unwrap();
        assert_eq!(sio.read(0x070), Some(-14_i32 as u32));
        sio.write(0x06C, 0).unwrap();
        assert_eq!(sio.read(0x070), Some(1));
    }

    #[test]
    fn a_lock_is_given_once() {
        let mut sio = Sio::default();
        assert_eq!(sio.read(0x17C), Some(1 << 31));
        assert_eq!(sio.read(0x17C), Some(0));
        sio.write(0x17C, 0).unwrap();
        assert_eq!(sio.read(0x17C), Some(1 << 31));
    }
}
