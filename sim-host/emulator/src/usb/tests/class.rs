//! The classes of `usb-device` and `usbd-serial` on the emulated registers and host.

use std::sync::{Arc, Mutex};

use ldc161x_sim::Time;
use usb_device::bus::{PollResult, UsbBus, UsbBusAllocator};
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbVidPid};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{LangID, Result, UsbDirection, UsbError};
use usbd_serial::SerialPort;

use super::bench::{
    BUFFERS, CONTROL, ENABLE, INTERRUPTS, MAIN, MUXING, POWER, RESET, SETUP, STALL_ARM, STATUS,
    UsbTestBench,
};
use crate::usb::memory::buffer;
use crate::usb::{ControlOutcome, ControlTransfer, UsbState, check_descriptors};

#[derive(Clone, Copy)]
struct Endpoint {
    kind: EndpointType,
    largest: u16,
}

#[derive(Default)]
struct Inner {
    /// Endpoints by number and direction, in the order of the buffer control words.
    endpoints: [Option<Endpoint>; 32],
    /// Whether a setup packet has been reported and not yet read.
    has_setup: bool,
}

/// `usb-device`'s view of the registers.
struct Registers {
    bench: Arc<Mutex<UsbTestBench>>,
    inner: Mutex<Inner>,
}

fn index_of(address: EndpointAddress) -> u32 {
    2 * address.index() as u32 + u32::from(address.is_out())
}

/// Address of an endpoint's buffer.
fn buffer_of(index: u32) -> u32 {
    if index < 2 { 0x100 } else { 0x180 + 64 * index }
}

impl Registers {
    fn with<T>(&self, run: impl FnOnce(&mut UsbTestBench, &mut Inner) -> T) -> T {
        let mut bench = self.bench.lock().unwrap();
        run(&mut bench, &mut self.inner.lock().unwrap())
    }

    /// Makes a buffer ready to receive, with the PID opposite to that of the last packet.
    fn receive(bench: &mut UsbTestBench, index: u32, largest: u16) {
        let pid = !bench.half(index, 0) & buffer::DATA1;
        bench.arm(index, 0, pid | largest);
    }
}

impl UsbBus for Registers {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        kind: EndpointType,
        largest: u16,
        _interval: u8,
    ) -> Result<EndpointAddress> {
        self.with(|_, inner| {
            let mut all = (1..16).map(|number| EndpointAddress::from_parts(number, direction));
            let is_free = |it: &EndpointAddress| inner.endpoints[index_of(*it) as usize].is_none();
            let address = address.or_else(|| all.find(is_free));
            let address = address.ok_or(UsbError::EndpointOverflow)?;
            inner.endpoints[index_of(address) as usize] = Some(Endpoint { kind, largest });
            Ok(address)
        })
    }

    fn enable(&mut self) {
        self.with(|bench, _| {
            bench.write(MUXING, 0b1001);
            bench.write(POWER, 0b1100);
            bench.write(MAIN, 1);
            bench.write(ENABLE, 1 << 4 | 1 << 12 | 1 << 14 | 1 << 15 | 1 << 16);
            bench.write(CONTROL, 1 << 16 | 1 << 29);
        });
    }

    fn reset(&self) {
        self.with(|bench, inner| {
            bench.write(STATUS, RESET);
            bench.write(BUFFERS, u32::MAX);
            bench.write(0x00, 0);
            for (index, endpoint) in (0..).zip(inner.endpoints) {
                let Some(endpoint) = endpoint else { continue };
                // DATA1 stands for the last packet: the next one is DATA0.
                bench.set_word(0x80 + 4 * index, u32::from(buffer::DATA1));
                if index >= 2 {
                    let kind = if endpoint.kind == EndpointType::Bulk {
                        2
                    } else {
                        3
                    };
                    let control = 1 << 31 | 1 << 29 | kind << 26 | buffer_of(index);
                    bench.set_word(4 * index, control);
                    if index % 2 == 1 {
                        Self::receive(bench, index, endpoint.largest);
                    }
                }
            }
        });
    }

    fn set_device_address(&self, address: u8) {
        self.with(|bench, _| bench.write(0x00, address.into()));
    }

    fn write(&self, address: EndpointAddress, bytes: &[u8]) -> Result<usize> {
        let index = index_of(address);
        self.with(|bench, _| {
            if bench.half(index, 0) & buffer::AVAILABLE != 0 {
                return Err(UsbError::WouldBlock);
            }
            bench.set_bytes(buffer_of(index), bytes);
            let pid = !bench.half(index, 0) & buffer::DATA1;
            bench.arm(index, 0, buffer::FULL | pid | bytes.len() as u16);
            Ok(bytes.len())
        })
    }

    fn read(&self, address: EndpointAddress, bytes: &mut [u8]) -> Result<usize> {
        let index = index_of(address);
        self.with(|bench, inner| {
            if index == 1 && std::mem::take(&mut inner.has_setup) {
                let packet = bench.bytes(0, 8);
                bytes[..8].copy_from_slice(&packet);
                bench.write(STATUS, SETUP);
                bench.write(BUFFERS, 0b10);
                // The next packets in both directions are DATA1.
                let in_half = bench.half(0, 0) & !buffer::DATA1 & !buffer::AVAILABLE;
                bench.set_word(0x80, in_half.into());
                bench.set_word(0x84, 0);
                let has_data = packet[0] & 0x80 != 0 || packet[6..8] != [0, 0];
                if has_data {
                    Self::receive(bench, index, 64);
                }
                return Ok(8);
            }
            let half = bench.half(index, 0);
            if half & buffer::FULL == 0 {
                return Err(UsbError::WouldBlock);
            }
            let length = usize::from(half & buffer::LENGTH);
            if length > bytes.len() {
                return Err(UsbError::BufferOverflow);
            }
            let data = bench.bytes(buffer_of(index), length as u32);
            bytes[..length].copy_from_slice(&data);
            bench.write(BUFFERS, 1 << index);
            let largest = inner.endpoints[index as usize].unwrap().largest;
            bench.set_word(0x80 + 4 * index, u32::from(half & buffer::DATA1));
            if index != 1 || length == usize::from(largest) {
                Self::receive(bench, index, largest);
            }
            Ok(length)
        })
    }

    fn set_stalled(&self, address: EndpointAddress, stalled: bool) {
        let index = index_of(address);
        self.with(|bench, _| {
            if index < 2 {
                let armed = bench.read(STALL_ARM) & !(1 << index);
                bench.write(STALL_ARM, armed | u32::from(stalled) << index);
            }
            let half = bench.half(index, 0) & !buffer::STALL;
            let stall = if stalled { buffer::STALL } else { 0 };
            bench.set_word(0x80 + 4 * index, (half | stall).into());
        });
    }

    fn is_stalled(&self, address: EndpointAddress) -> bool {
        self.with(|bench, _| bench.half(index_of(address), 0) & buffer::STALL != 0)
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    fn poll(&self) -> PollResult {
        self.with(|bench, inner| {
            let raised = bench.read(INTERRUPTS);
            let done = bench.read(BUFFERS);
            if raised & 1 << 12 != 0 {
                return PollResult::Reset;
            }
            if done == 0 && raised & 1 << 16 == 0 {
                if raised & 1 << 14 != 0 {
                    bench.write(STATUS, 1 << 4);
                    let is_suspended = bench.read(STATUS) & 1 << 4 != 0;
                    if is_suspended {
                        return PollResult::Suspend;
                    }
                }
                if raised & 1 << 15 != 0 {
                    bench.write(STATUS, 1 << 11);
                    return PollResult::Resume;
                }
                return PollResult::None;
            }
            bench.write(BUFFERS, done & 0x5555_5555);
            inner.has_setup |= raised & 1 << 16 != 0;
            let of = |offset: u32| {
                let bits = (0..16).filter(|number| done >> (2 * number + offset) & 1 == 1);
                bits.fold(0, |bits, number| bits | 1_u16 << number)
            };
            PollResult::Data {
                ep_out: of(1),
                ep_in_complete: of(0),
                ep_setup: u16::from(raised & 1 << 16 != 0),
            }
        })
    }
}

/// A serial port that echoes.
struct Echo<'a> {
    device: UsbDevice<'a, Registers>,
    port: SerialPort<'a, Registers>,
    waiting: Vec<u8>,
}

impl Echo<'_> {
    fn poll(&mut self) {
        self.device.poll(&mut [&mut self.port]);
        let mut bytes = [0; 64];
        if self.waiting.is_empty()
            && let Ok(count) = self.port.read(&mut bytes)
        {
            self.waiting.extend(&bytes[..count]);
        }
        if !self.waiting.is_empty()
            && let Ok(count) = self.port.write(&self.waiting)
        {
            self.waiting.drain(..count);
        }
        self.port.flush().ok();
    }
}

/// Advances virtual time, and polls the device at its interrupts and every millisecond.
fn run(bench: &Mutex<UsbTestBench>, time: Time, echo: &mut Echo<'_>) {
    let end_ps = bench.lock().unwrap().now_ps + time.as_ps();
    loop {
        let is_raised = {
            let mut bench = bench.lock().unwrap();
            if bench.now_ps >= end_ps {
                return;
            }
            let slice_ps = bench.now_ps + 20_000_000;
            bench.usb_step(slice_ps.min(end_ps));
            bench.usb.line()
        };
        if is_raised || !echo.waiting.is_empty() {
            echo.poll();
        }
    }
}

impl UsbTestBench {
    fn usb_step(&mut self, end_ps: u64) {
        self.usb.service(self.now_ps);
        self.step(end_ps);
    }
}

/// Runs a test on a bench with the serial port of `usbd-serial`.
fn with_port(largest_control: u8, test: impl FnOnce(&Mutex<UsbTestBench>, &mut Echo<'_>)) {
    let bench = Arc::new(Mutex::new(UsbTestBench::new()));
    let registers = Registers {
        bench: Arc::clone(&bench),
        inner: Mutex::default(),
    };
    let allocator = UsbBusAllocator::new(registers);
    let port = SerialPort::new(&allocator);
    let strings = StringDescriptors::new(LangID::EN_US)
        .manufacturer("maker")
        .product("sensor")
        .serial_number("0123456789ABCDEF");
    let device = UsbDeviceBuilder::new(&allocator, UsbVidPid(0x1209, 1))
        .strings(&[strings])
        .unwrap()
        .composite_with_iads()
        .max_packet_size_0(largest_control)
        .unwrap()
        .build();
    let mut echo = Echo {
        device,
        port,
        waiting: Vec::new(),
    };
    // By the first poll, the allocator has enabled the bus.
    echo.poll();
    test(&bench, &mut echo);
}

/// Plugs the cable and waits for a configuration.
fn enumerate(bench: &Mutex<UsbTestBench>, echo: &mut Echo<'_>) {
    {
        let host = &mut bench.lock().unwrap().usb.host;
        host.plug();
        host.enumerate();
    }
    run(bench, Time::from_ms(300), echo);
    let bench = bench.lock().unwrap();
    let found = bench.usb.host.enumerated().unwrap();
    assert!(found.is_ok(), "{found:?}");
    assert_eq!(bench.usb.host.state(), UsbState::Configured);
}

#[test]
fn the_serial_port_of_usbd_serial_is_enumerated_and_keeps_the_rules() {
    for largest_control in [8, 16, 32, 64] {
        with_port(largest_control, |bench, echo| {
            enumerate(bench, echo);
            assert!(echo.port.dtr() && echo.port.rts());
            assert_eq!(echo.port.line_coding().data_rate(), 115_200);
            let bench = bench.lock().unwrap();
            let description = bench.usb.host.description().unwrap();
            assert_eq!(check_descriptors(description), []);
            assert_eq!(description.device[7], largest_control);
            assert_eq!(description.string(2).unwrap(), "sensor");
        });
    }
}

#[test]
fn bytes_through_usbd_serial_come_back_in_order() {
    with_port(64, |bench, echo| {
        enumerate(bench, echo);
        let sent: Vec<u8> = (0..5_000_u32).map(|index| (index * 11) as u8).collect();
        bench.lock().unwrap().usb.host.write(&sent);
        run(bench, Time::from_ms(100), echo);
        let mut bench = bench.lock().unwrap();
        let received = bench.usb.host.read();
        assert_eq!(received.len(), sent.len());
        assert_eq!(received, sent);
        assert_eq!(bench.usb.races(), 0);
    });
}

#[test]
fn usbd_serial_survives_resets_suspends_and_pulled_cables_in_mid_traffic() {
    with_port(64, |bench, echo| {
        enumerate(bench, echo);
        for round in 0..60_u64 {
            bench.lock().unwrap().usb.host.write(&[round as u8; 700]);
            run(bench, Time::from_us(137 * round), echo);
            {
                let host = &mut bench.lock().unwrap().usb.host;
                match round % 3 {
                    0 => host.reset(),
                    1 => host.suspend(),
                    _ => host.unplug(),
                }
            }
            run(bench, Time::from_ms(5), echo);
            {
                let host = &mut bench.lock().unwrap().usb.host;
                host.resume();
                host.plug();
            }
            run(bench, Time::from_ms(300), echo);
            let mut bench = bench.lock().unwrap();
            assert_eq!(
                bench.usb.host.state(),
                UsbState::Configured,
                "round {round}"
            );
            echo.waiting.clear();
            bench.usb.host.read();
        }
        bench.lock().unwrap().usb.host.write(b"still here");
        run(bench, Time::from_ms(5), echo);
        assert!(
            bench
                .lock()
                .unwrap()
                .usb
                .host
                .read()
                .ends_with(b"still here")
        );
    });
}

#[test]
fn usbd_serial_refuses_what_it_does_not_know_and_goes_on() {
    with_port(64, |bench, echo| {
        enumerate(bench, echo);
        let mut state = 1_u64;
        for _ in 0..500 {
            let mut setup = [0; 8];
            for byte in &mut setup {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                *byte = (state >> 56) as u8;
            }
            // Requests that the host itself acts on are left out, and so are long data.
            setup[0] |= 0x40;
            setup[7] = 0;
            let transfer = ControlTransfer {
                deadline: Time::from_ms(50),
                ..ControlTransfer::with_data(setup, &vec![7; setup[6].into()])
            };
            bench.lock().unwrap().usb.host.submit(transfer);
            run(bench, Time::from_ms(60), echo);
            let results = bench.lock().unwrap().usb.host.take_results();
            assert_eq!(results.len(), 1, "{setup:02x?}");
        }
        let status = ControlTransfer::new([0x80, 0, 0, 0, 0, 0, 2, 0]);
        bench.lock().unwrap().usb.host.submit(status);
        run(bench, Time::from_ms(10), echo);
        let results = bench.lock().unwrap().usb.host.take_results();
        assert_eq!(results[0].1, ControlOutcome::Done(vec![0, 0]));
    });
}
