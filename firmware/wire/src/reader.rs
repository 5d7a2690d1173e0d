//! From bytes to values.

/// Reads the values of a payload, one after the other.
///
/// What the bytes do not hold - they end early, or are none that the type allows - is remembered,
/// and nothing is read any more: so there is no error to hand on at every field.
#[derive(Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
    failed: bool,
}

/// Bits that a byte of a varint carries.
const VARINT_BITS: u32 = 7;

impl<'a> Reader<'a> {
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            failed: false,
        }
    }

    /// Whether all that was asked for was there.
    pub(crate) const fn is_sound(&self) -> bool {
        !self.failed
    }

    /// What has not been read.
    pub(crate) const fn rest(&self) -> &'a [u8] {
        self.rest
    }

    fn fail(&mut self) {
        self.failed = true;
        self.rest = &[];
    }

    fn take(&mut self, length: usize) -> &'a [u8] {
        match self.rest.split_at_checked(length) {
            Some((taken, rest)) => {
                self.rest = rest;
                taken
            }
            None => {
                self.fail();
                &[]
            }
        }
    }

    /// So many bytes; zeros if there are not as many.
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let taken = self.take(N);
        <[u8; N]>::try_from(taken).unwrap_or([0; N])
    }

    #[inline(never)]
    pub(crate) fn byte(&mut self) -> u8 {
        let [byte] = self.bytes();
        byte
    }

    #[inline(never)]
    pub(crate) fn float(&mut self) -> f32 {
        f32::from_le_bytes(self.bytes())
    }

    #[inline(never)]
    pub(crate) fn double(&mut self) -> f64 {
        f64::from_le_bytes(self.bytes())
    }

    /// A varint: seven bits a byte, the least significant first, the eighth for another byte that
    /// follows. As postcard has it: as many bytes as `bits` can need, and no bit beyond those.
    #[inline(never)]
    pub(crate) fn integer(&mut self, bits: u32) -> u64 {
        let mut value = 0;
        for place in (0..bits).step_by(VARINT_BITS as usize) {
            let byte = self.byte();
            let part = u64::from(byte & 0x7F);
            if part.checked_shr(bits - place).unwrap_or(0) > 0 {
                break;
            }
            value |= part << place;
            if byte & 0x80 == 0 {
                return value;
            }
        }
        self.fail();
        0
    }

    #[inline(never)]
    pub(crate) fn flag(&mut self) -> bool {
        match self.byte() {
            0 => false,
            1 => true,
            _ => {
                self.fail();
                false
            }
        }
    }

    /// A length of at most `capacity`, which is below 128: one byte.
    #[inline(never)]
    pub(crate) fn length(&mut self, capacity: usize) -> usize {
        let length = usize::from(self.byte());
        if length > capacity {
            self.fail();
            return 0;
        }
        length
    }

    pub(crate) fn text(&mut self, length: usize) -> &'a str {
        let taken = self.take(length);
        core::str::from_utf8(taken).unwrap_or_else(|_| {
            self.fail();
            ""
        })
    }
}
