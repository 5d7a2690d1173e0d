//! A small hand-written device: a serial port that echoes.

use std::collections::VecDeque;

use super::bench::{
    BUFFERS, ENABLE, INTERRUPTS, Program, RESET, SETUP, STALL_ARM, STATUS, UsbTestBench,
};
use crate::usb::memory::buffer;

pub(crate) const DEVICE: [u8; 18] = [
    18, 1, 0x00, 0x02, 0xEF, 2, 1, 64, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 3, 1,
];

/// Association, control interface with its four functional descriptors and a notification endpoint,
/// data interface with its two endpoints, a vendor-specific interface.
pub(crate) const CONFIGURATION: [u8; 84] = [
    9, 2, 84, 0, 3, 1, 0, 0x80, 50, //
    8, 11, 0, 2, 2, 2, 0, 0, //
    9, 4, 0, 0, 1, 2, 2, 0, 4, //
    5, 0x24, 0, 0x20, 0x01, //
    5, 0x24, 1, 0, 1, //
    4, 0x24, 2, 2, //
    5, 0x24, 6, 0, 1, //
    7, 5, 0x81, 3, 8, 0, 16, //
    9, 4, 1, 0, 2, 10, 0, 0, 0, //
    7, 5, 0x82, 2, 64, 0, 0, //
    7, 5, 0x02, 2, 64, 0, 0, //
    9, 4, 2, 0, 0, 0xFF, 0, 0, 0, //
];

/// Index of endpoint 2's IN; below, of its OUT.
pub(super) const INPUT: u32 = 4;
pub(super) const OUTPUT: u32 = 5;
/// Offset of the buffer of endpoint 2's IN; below, of its OUT.
pub(super) const INPUT_BUFFER: u32 = 0x200;
pub(super) const OUTPUT_BUFFER: u32 = 0x280;

fn string(index: u8) -> Option<Vec<u8>> {
    let text = match index {
        0 => return Some(vec![4, 3, 0x09, 0x04]),
        1 => "maker",
        2 => "sensor",
        3 => "1",
        4 => "port",
        _ => return None,
    };
    let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    Some([vec![units.len() as u8 + 2, 3], units].concat())
}

/// Handling of the data endpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Data {
    /// Echoes all data.
    Echo,
    /// Leaves the data endpoints to the test.
    Untouched,
}

pub(super) struct Device {
    data: Data,
    /// Next packets of endpoint 0.
    answer: VecDeque<Vec<u8>>,
    address: Option<u8>,
    in_data1: bool,
    /// Whether the next packet of the IN data endpoint is DATA1; below, of the OUT data endpoint.
    input_data1: bool,
    output_data1: bool,
    pub(super) resets: u32,
    pub(super) setups: Vec<[u8; 8]>,
    pub(super) received: Vec<u8>,
    /// Data received in data stages.
    pub(super) control_data: Vec<u8>,
    /// bRequest of the request that the device never answers.
    pub(super) deaf_to: Option<u8>,
    left_of_data: usize,
}

impl Device {
    pub(super) fn new(data: Data) -> Self {
        Self {
            data,
            answer: VecDeque::new(),
            address: None,
            in_data1: false,
            input_data1: false,
            output_data1: false,
            resets: 0,
            setups: Vec::new(),
            received: Vec::new(),
            control_data: Vec::new(),
            deaf_to: None,
            left_of_data: 0,
        }
    }

    /// Enables the handled interrupts.
    pub(super) fn listen(bench: &mut UsbTestBench) {
        bench.write(ENABLE, 1 << 4 | 1 << 12 | 1 << 16);
    }

    fn reset(&mut self, bench: &mut UsbTestBench) {
        bench.write(STATUS, RESET);
        bench.write(BUFFERS, u32::MAX);
        bench.write(0x00, 0);
        for index in 0..6 {
            bench.set_word(0x80 + 4 * index, 0);
        }
        self.resets += 1;
    }

    fn setup(&mut self, bench: &mut UsbTestBench) {
        let packet: [u8; 8] = bench.bytes(0, 8).try_into().unwrap();
        bench.write(STATUS, SETUP);
        bench.write(BUFFERS, 0b11);
        self.setups.push(packet);
        self.answer.clear();
        self.in_data1 = true;
        let length = u16::from_le_bytes([packet[6], packet[7]]);
        if self.deaf_to == Some(packet[1]) {
            return;
        }
        if packet[0] & 0x80 == 0 && length > 0 {
            self.left_of_data = usize::from(length);
            bench.arm(1, 0, buffer::DATA1 | 64);
            return;
        }
        match self.response(packet, bench) {
            Some(data) => {
                let data = &data[..data.len().min(usize::from(length))];
                self.answer = data.chunks(64).map(<[u8]>::to_vec).collect();
                let is_whole = data.len() % 64 == 0 && data.len() < usize::from(length);
                if data.is_empty() || is_whole {
                    self.answer.push_back(Vec::new());
                }
                self.send(bench);
                if length > 0 {
                    bench.arm(1, 0, buffer::DATA1 | 64);
                }
            }
            None => stall(bench),
        }
    }

    fn response(&mut self, packet: [u8; 8], bench: &mut UsbTestBench) -> Option<Vec<u8>> {
        match (packet[0], packet[1], packet[3]) {
            (0x80, 6, 1) => Some(DEVICE.to_vec()),
            (0x80, 6, 2) => Some(CONFIGURATION.to_vec()),
            (0x80, 6, 3) => string(packet[2]),
            (0, 5, _) => {
                self.address = Some(packet[2]);
                Some(Vec::new())
            }
            (0, 9, _) => {
                self.configure(bench);
                Some(Vec::new())
            }
            (0x21, 0x22, _) => Some(Vec::new()),
            // Vendor request: returns `packet[2]` bytes.
            (0xC0, 1, _) => Some((0..packet[2]).collect()),
            _ => None,
        }
    }

    fn configure(&mut self, bench: &mut UsbTestBench) {
        let settings = |buffer: u32| 1 << 31 | 1 << 29 | 2 << 26 | buffer;
        bench.set_word(0x08 + 4 * (INPUT - 2), settings(INPUT_BUFFER));
        bench.set_word(0x08 + 4 * (OUTPUT - 2), settings(OUTPUT_BUFFER));
        bench.set_word(0x08, 1 << 31 | 3 << 26 | 0x180);
        self.input_data1 = false;
        self.output_data1 = false;
        if self.data == Data::Echo {
            bench.arm(OUTPUT, 0, 64);
        }
    }

    fn send(&mut self, bench: &mut UsbTestBench) {
        if let Some(packet) = self.answer.pop_front() {
            bench.set_bytes(0x100, &packet);
            let pid = if self.in_data1 { buffer::DATA1 } else { 0 };
            bench.arm(0, 0, buffer::FULL | pid | packet.len() as u16);
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
        if done & 2 != 0 {
            let length = bench.half(1, 0) & buffer::LENGTH;
            self.control_data.extend(bench.bytes(0x100, length.into()));
            self.left_of_data -= usize::from(length).min(self.left_of_data);
            if self.left_of_data > 0 {
                let pid = !bench.half(1, 0) & buffer::DATA1;
                bench.arm(1, 0, pid | 64);
            } else if length > 0 {
                self.answer.push_back(Vec::new());
                self.send(bench);
            }
        }
        if done >> OUTPUT & 1 == 1 && self.data == Data::Echo {
            self.echo(bench);
        }
    }

    fn echo(&mut self, bench: &mut UsbTestBench) {
        let length = bench.half(OUTPUT, 0) & buffer::LENGTH;
        let data = bench.bytes(OUTPUT_BUFFER, length.into());
        self.received.extend(&data);
        bench.set_bytes(INPUT_BUFFER, &data);
        let pid = |data1: bool| if data1 { buffer::DATA1 } else { 0 };
        bench.arm(INPUT, 0, buffer::FULL | pid(self.input_data1) | length);
        self.input_data1 = !self.input_data1;
        self.output_data1 = !self.output_data1;
        bench.arm(OUTPUT, 0, pid(self.output_data1) | 64);
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
            self.reset(bench);
        }
        if interrupts & 1 << 16 != 0 {
            self.setup(bench);
        } else if interrupts & 1 << 4 != 0 {
            self.buffers(bench);
        }
    }
}
