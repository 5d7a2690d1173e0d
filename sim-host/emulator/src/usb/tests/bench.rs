//! A test bench of controller and host, with register accesses of a driver.

use ldc161x_sim::Time;

use crate::usb::Usb;
use crate::usb::memory::buffer;

pub(super) const MAIN: u32 = 0x40;
pub(super) const CONTROL: u32 = 0x4C;
pub(super) const STATUS: u32 = 0x50;
pub(super) const BUFFERS: u32 = 0x58;
pub(super) const STALL_ARM: u32 = 0x68;
pub(super) const MUXING: u32 = 0x74;
pub(super) const POWER: u32 = 0x78;
pub(super) const RAW: u32 = 0x8C;
pub(super) const ENABLE: u32 = 0x90;
pub(super) const INTERRUPTS: u32 = 0x98;

pub(super) const SETUP: u32 = 1 << 17;
pub(super) const RESET: u32 = 1 << 19;

/// Duration of a processor access in these tests: longer than a period of clk_usb.
const ACCESS_PS: u64 = 30_000;

/// A program on the processor, called while the interrupt line is high.
pub(super) trait Program {
    fn interrupted(&mut self, bench: &mut UsbTestBench);
}

pub(super) struct Idle;

impl Program for Idle {
    fn interrupted(&mut self, _: &mut UsbTestBench) {}
}

pub(super) struct UsbTestBench {
    pub(super) usb: Usb,
    pub(super) now_ps: u64,
}

impl UsbTestBench {
    pub(super) fn new() -> Self {
        let mut usb = Usb::new();
        usb.controller.can_hang = false;
        Self { usb, now_ps: 0 }
    }

    /// A bench with a device whose pull-up is on.
    pub(super) fn attached() -> Self {
        let mut bench = Self::new();
        bench.write(MUXING, 0b1001);
        bench.write(POWER, 0b1100);
        bench.write(MAIN, 1);
        bench.write(CONTROL, 1 << 29 | 1 << 16);
        bench
    }

    pub(super) fn read(&mut self, register: u32) -> u32 {
        self.now_ps += ACCESS_PS;
        self.usb.read(register).unwrap()
    }

    pub(super) fn write(&mut self, register: u32, value: u32) {
        self.now_ps += ACCESS_PS;
        self.usb.write(0, register, value, self.now_ps).unwrap();
    }

    pub(super) fn bytes(&self, at: u32, length: u32) -> Vec<u8> {
        let byte = |at: u32| self.usb.read_memory(at & !3).unwrap() >> (8 * (at & 3));
        (at..at + length).map(|at| byte(at) as u8).collect()
    }

    pub(super) fn set_bytes(&mut self, at: u32, bytes: &[u8]) {
        for (at, byte) in (at..).zip(bytes) {
            self.now_ps += ACCESS_PS;
            self.usb.write_memory(at, &[*byte], self.now_ps).unwrap();
        }
    }

    pub(super) fn set_word(&mut self, at: u32, word: u32) {
        self.now_ps += ACCESS_PS;
        let bytes = word.to_le_bytes();
        self.usb.write_memory(at, &bytes, self.now_ps).unwrap();
    }

    /// Lower half of the buffer control word of the endpoint `index`.
    pub(super) fn half(&self, index: u32) -> u16 {
        self.usb.read_memory(0x80 + 4 * index).unwrap() as u16
    }

    /// Writes the bits of a buffer control word except AVAILABLE, and then with AVAILABLE.
    pub(super) fn arm(&mut self, index: u32, rest: u16) {
        for value in [rest, rest | buffer::AVAILABLE] {
            self.set_word(0x80 + 4 * index, value.into());
        }
    }

    /// Advances to the next event or to `end_ps`.
    pub(super) fn step(&mut self, end_ps: u64) {
        let next_ps = self.usb.next_event().unwrap_or(u64::MAX);
        self.now_ps = self.now_ps.max(next_ps.min(end_ps));
        assert_eq!(self.usb.service(self.now_ps), None);
    }

    pub(super) fn run(&mut self, time: Time, program: &mut impl Program) {
        let end_ps = self.now_ps + time.as_ps();
        self.usb.service(self.now_ps);
        while self.now_ps < end_ps {
            self.step(end_ps);
            if self.usb.line() {
                program.interrupted(self);
            }
        }
    }

    pub(super) fn run_until(
        &mut self,
        program: &mut impl Program,
        mut is_true: impl FnMut(&Self) -> bool,
    ) {
        let end_ps = self.now_ps + Time::from_ms(10_000).as_ps();
        self.usb.service(self.now_ps);
        while !is_true(self) {
            assert!(self.now_ps < end_ps, "it never became true");
            self.step(end_ps);
            if self.usb.line() {
                program.interrupted(self);
            }
        }
    }
}
