//! A small hand-written device: a serial port whose data endpoints are left to the test.

use std::collections::VecDeque;

use super::bench::{
    BUFFERS, ENABLE, INTERRUPTS, Program, RESET, SETUP, STALL_ARM, STATUS, UsbTestBench,
};
use crate::usb::memory::buffer;

const DEVICE: [u8; 18] = [
    18, 1, 0x00, 0x02, 0xEF, 2, 1, 64, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 0, 0, 0, 1,
];

/// Control interface with its union, data interface with its two endpoints.
const CONFIGURATION: [u8; 46] = [
    9, 2, 46, 0, 2, 1, 0, 0x80, 50, //
    9, 4, 0, 0, 0, 2, 2, 0, 0, //
    5, 0x24, 6, 0, 1, //
    9, 4, 1, 0, 2, 10, 0, 0, 0, //
    7, 5, 0x82, 2, 64, 0, 0, //
    7, 5, 0x02, 2, 64, 0, 0, //
];

/// Indices of endpoint 2: IN, OUT.
pub(super) const INPUT: u32 = 4;
pub(super) const OUTPUT: u32 = 5;
/// Offsets of the buffers of endpoint 2: IN, OUT.
pub(super) const INPUT_BUFFER: u32 = 0x200;
const OUTPUT_BUFFER: u32 = 0x280;

#[derive(Default)]
pub(super) struct Device {
    /// Next packets of endpoint 0.
    answer: VecDeque<Vec<u8>>,
    address: Option<u8>,
    in_data1: bool,
}

impl Device {
    /// Enables the handled interrupts.
    pub(super) fn listen(bench: &mut UsbTestBench) {
        bench.write(ENABLE, 1 << 4 | 1 << 12 | 1 << 16);
    }

    fn setup(&mut self, bench: &mut UsbTestBench) {
        let packet: [u8; 8] = bench.bytes(0, 8).try_into().unwrap();
        bench.write(STATUS, SETUP);
        bench.write(BUFFERS, 0b11);
        self.in_data1 = true;
        let length = usize::from(packet[6]);
        // Arms endpoint 0 OUT for the host's data or status.
        if length > 0 {
            bench.arm(1, buffer::DATA1 | 64);
        }
        if packet[0] & 0x80 == 0 && length > 0 {
            return;
        }
        match self.response(packet, bench) {
            Some(data) => {
                let data = &data[..data.len().min(length)];
                self.answer = data.chunks(64).map(<[u8]>::to_vec).collect();
                if data.is_empty() {
                    self.answer.push_back(Vec::new());
                }
                self.send(bench);
            }
            None => stall(bench),
        }
    }

    fn response(&mut self, packet: [u8; 8], bench: &mut UsbTestBench) -> Option<Vec<u8>> {
        match (packet[0], packet[1], packet[3]) {
            (0x80, 6, 1) => Some(DEVICE.to_vec()),
            (0x80, 6, 2) => Some(CONFIGURATION.to_vec()),
            (0, 5, _) => {
                self.address = Some(packet[2]);
                Some(Vec::new())
            }
            (0, 9, _) => {
                configure(bench);
                Some(Vec::new())
            }
            (0x21, 0x22, _) => Some(Vec::new()),
            _ => None,
        }
    }

    fn send(&mut self, bench: &mut UsbTestBench) {
        if let Some(packet) = self.answer.pop_front() {
            bench.set_bytes(0x100, &packet);
            let pid = if self.in_data1 { buffer::DATA1 } else { 0 };
            bench.arm(0, buffer::FULL | pid | packet.len() as u16);
            self.in_data1 = !self.in_data1;
        }
    }

    fn buffers(&mut self, bench: &mut UsbTestBench) {
        let done = bench.read(BUFFERS);
        bench.write(BUFFERS, done);
        if done & 1 != 0 {
            if let Some(address) = self.address.take() {
                bench.write(0x00, u32::from(address));
            }
            self.send(bench);
        }
        // The data of a request are in one packet.
        if done & 2 != 0 && bench.half(1) & buffer::LENGTH > 0 {
            self.answer.push_back(Vec::new());
            self.send(bench);
        }
    }
}

fn reset(bench: &mut UsbTestBench) {
    bench.write(STATUS, RESET);
    bench.write(BUFFERS, u32::MAX);
    bench.write(0x00, 0);
    for index in 0..6 {
        bench.set_word(0x80 + 4 * index, 0);
    }
}

fn configure(bench: &mut UsbTestBench) {
    for (index, at) in [(INPUT, INPUT_BUFFER), (OUTPUT, OUTPUT_BUFFER)] {
        bench.set_word(0x08 + 4 * (index - 2), 1 << 31 | 1 << 29 | 2 << 26 | at);
    }
}

/// Stalls endpoint 0 in both directions.
fn stall(bench: &mut UsbTestBench) {
    bench.write(STALL_ARM, 0b11);
    for index in [0, 1] {
        bench.set_word(0x80 + 4 * index, u32::from(buffer::STALL));
    }
}

impl Program for Device {
    fn interrupted(&mut self, bench: &mut UsbTestBench) {
        let interrupts = bench.read(INTERRUPTS);
        if interrupts & 1 << 12 != 0 {
            reset(bench);
        }
        if interrupts & 1 << 16 != 0 {
            self.setup(bench);
        } else if interrupts & 1 << 4 != 0 {
            self.buffers(bench);
        }
    }
}
