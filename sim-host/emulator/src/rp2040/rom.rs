//! The boot ROM: its tables and its functions for the flash and the boot loader (RP2040 datasheet
//! 2.8.2, 2.8.3), in Thumb code of this project.
//!
//! A function passes its arguments to a private register block of the emulator and polls until the
//! emulator has finished, so interrupts arrive meanwhile, as on the chip.

use std::sync::{Arc, OnceLock};

/// Bytes of the ROM (2.8).
pub(crate) const SIZE: u32 = 16 * 1024;

/// The private register block, at an address that is unused on the chip: four arguments, then the
/// number of the function, which reads 0 when the function has ended.
pub(crate) mod request {
    pub(crate) const BASE: u32 = 0x8000;
    pub(crate) const FUNCTION: u32 = 0x10;
}

/// Functions that the emulator runs, by their number in the private register block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RomFunction {
    ConnectInternalFlash,
    FlashExitXip,
    FlashRangeErase,
    FlashRangeProgram,
    FlashFlushCache,
    ResetToUsbBoot,
}

impl RomFunction {
    const ALL: [(Self, [u8; 2]); 6] = [
        (Self::ConnectInternalFlash, *b"IF"),
        (Self::FlashExitXip, *b"EX"),
        (Self::FlashRangeErase, *b"RE"),
        (Self::FlashRangeProgram, *b"RP"),
        (Self::FlashFlushCache, *b"FC"),
        (Self::ResetToUsbBoot, *b"UB"),
    ];

    /// Function of a written number.
    pub(crate) fn numbered(number: u32) -> Option<Self> {
        let mut all = (1..).zip(Self::ALL);
        all.find_map(|(its_number, (function, _))| (its_number == number).then_some(function))
    }
}

/// r0 = the entry with code r1 in the table at r0, or 0.
const TABLE_LOOKUP: [u16; 11] = [
    0x8802, // 1: ldrh r2, [r0]
    0x2A00, //    cmp  r2, #0
    0xD005, //    beq  2f
    0x8843, //    ldrh r3, [r0, #2]
    0x3004, //    adds r0, #4
    0x428A, //    cmp  r2, r1
    0xD1F8, //    bne  1b
    0x0018, //    movs r0, r3
    0x4770, //    bx   lr
    0x2000, // 2: movs r0, #0
    0x4770, //    bx   lr
];

/// Passes r0 to r3 and the number of a function to the emulator, and waits until the function ends.
const fn call(number: u16) -> [u16; 13] {
    [
        0xB530,          //    push {r4, r5, lr}
        0x2500 | number, //    movs r5, #number
        0x2401,          //    movs r4, #1
        0x03E4,          //    lsls r4, r4, #15     @ request::BASE
        0x6020,          //    str  r0, [r4, #0]
        0x6061,          //    str  r1, [r4, #4]
        0x60A2,          //    str  r2, [r4, #8]
        0x60E3,          //    str  r3, [r4, #12]
        0x6125,          //    str  r5, [r4, #16]   @ request::FUNCTION
        0x6925,          // 1: ldr  r5, [r4, #16]
        0x2D00,          //    cmp  r5, #0
        0xD1FC,          //    bne  1b
        0xBD30,          //    pop  {r4, r5, pc}
    ]
}

/// Initial stack of the ROM: the end of memory.
const STACK: u32 = 0x2004_2000;
/// Code for a processor that enters the ROM other than by a reset: an endless loop.
const DEAD: [u16; 2] = [
    0xBF30, // 1: wfi
    0xE7FD, //    b    1b
];
/// "Mu", the version of the tables, and that of the ROM (2.8.2): version 3, as in chips since 2021.
const MAGIC: [u8; 4] = [b'M', b'u', 1, 3];
/// Address of the pointers to the two tables and the lookup function (2.8.2).
const POINTERS: u32 = 0x14;
/// Start address of the ROM's code, after the pointers.
const CODE: u32 = 0x1C;
/// Copyright text in the data table of this ROM.
const COPYRIGHT: &[u8] = b"palpate-emulator\0";
const REVISION: [u8; 4] = [0; 4];

/// The contents of the ROM.
pub(crate) fn image() -> Arc<[u8]> {
    static IMAGE: OnceLock<Arc<[u8]>> = OnceLock::new();
    Arc::clone(IMAGE.get_or_init(|| Builder::new().build().into()))
}

struct Builder {
    bytes: Vec<u8>,
}

impl Builder {
    fn new() -> Self {
        Self {
            bytes: vec![0; CODE as usize],
        }
    }

    fn build(mut self) -> Vec<u8> {
        let dead = self.code(&DEAD);
        let lookup = self.code(&TABLE_LOOKUP);
        let copyright = self.data(COPYRIGHT);
        let revision = self.data(&REVISION);
        let functions = self.functions();
        let function_table = self.table(&functions);
        let data_table = self.table(&[(*b"GR", revision), (*b"CR", copyright)]);
        self.set(0, &STACK.to_le_bytes());
        for vector in 1..4 {
            self.set(4 * vector, &u32::from(dead).to_le_bytes());
        }
        self.set(0x10, &MAGIC);
        for (offset, pointer) in (POINTERS..)
            .step_by(2)
            .zip([function_table, data_table, lookup])
        {
            self.set(offset, &pointer.to_le_bytes());
        }
        self.bytes.resize(SIZE as usize, 0);
        self.bytes
    }

    fn functions(&mut self) -> Vec<([u8; 2], u16)> {
        let numbered = (1..).zip(RomFunction::ALL);
        numbered
            .map(|(number, (_, code))| (code, self.code(&call(number))))
            .collect()
    }

    /// Adds code; returns its address for a branch, with the Thumb bit.
    fn code(&mut self, words: &[u16]) -> u16 {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.data(&bytes) | 1
    }

    /// Adds bytes, aligned to four; returns their address.
    fn data(&mut self, bytes: &[u8]) -> u16 {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let address = self.bytes.len() as u16;
        self.bytes.extend_from_slice(bytes);
        address
    }

    /// Adds a table of codes and addresses, which ends with a code of 0.
    fn table(&mut self, entries: &[([u8; 2], u16)]) -> u16 {
        let mut bytes: Vec<u8> = entries
            .iter()
            .flat_map(|(code, address)| code.iter().copied().chain(address.to_le_bytes()))
            .collect();
        bytes.extend([0; 2]);
        self.data(&bytes)
    }

    fn set(&mut self, offset: u32, bytes: &[u8]) {
        for (place, byte) in self.bytes.iter_mut().skip(offset as usize).zip(bytes) {
            *place = *byte;
        }
    }
}
