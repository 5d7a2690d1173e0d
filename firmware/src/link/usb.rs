//! Link over USB: one serial interface (CDC-ACM) with the same frames as the debug probe's link, and
//! [`ResetInterface`].

use heapless::spsc::{Consumer, Producer, Queue};
use palpate_node::link::{ByteSource, FrameQueue, FrameReceiver, FrameSender};
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{
    StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbDeviceState, UsbVidPid,
};
use usbd_serial::CdcAcmClass;

use super::reset_interface::ResetInterface;
use crate::board::usb::{self, Bus, Sent};

/// USB vendor and product id for tests and prototypes (pid.codes, 1209:0001), until the project has its
/// own.
const VENDOR_AND_PRODUCT: UsbVidPid = UsbVidPid(0x1209, 0x0001);
/// Upper limit of the current, in mA, that a Pico at 200 MHz with its converters takes from the cable;
/// the coil has its own supply.
const USB_CURRENT_MA: usize = 100;
/// Size in bytes of the largest packet of a bulk endpoint at full speed (USB 2.0, 5.8.3).
const PACKET: usize = 64;
/// Bytes of records that can wait for the PC: a twentieth of a second of the fullest stream, more than
/// the 30 ms for which an operating system may not poll a port.
const RECORDS: usize = 4096;
/// Bytes of commands that can wait for the instrument: several of the longest frames.
const COMMANDS: usize = 1024;

/// Buffers of the USB device, with static lifetime.
pub struct Memory {
    bus: Option<UsbBusAllocator<Bus>>,
    serial_number: [u8; SERIAL_NUMBER],
    records: FrameQueue<RECORDS>,
    commands: Queue<u8, COMMANDS>,
}

/// Number of hexadecimal digits in the serial number, which is the flash memory's unique number.
const SERIAL_NUMBER: usize = 16;

impl Memory {
    /// Creates empty buffers.
    pub const fn new() -> Self {
        Self {
            bus: None,
            serial_number: [0; SERIAL_NUMBER],
            records: FrameQueue::new(),
            commands: Queue::new(),
        }
    }
}

/// Received command bytes.
pub struct UsbCommands(Consumer<'static, u8>);

impl ByteSource for UsbCommands {
    fn read(&mut self) -> Option<u8> {
        let byte = self.0.dequeue();
        if byte.is_some() {
            // Bytes were taken from the queue, so packets that had no space may be received again.
            usb::unmask_packet_interrupt();
        }
        byte
    }
}

/// USB device, for the USB interrupt. Without the USB clock there is no device.
pub struct UsbLink {
    on_bus: Option<OnBus>,
    records: FrameReceiver<'static>,
    commands: Producer<'static, u8>,
}

/// Device and classes on the bus.
struct OnBus {
    device: UsbDevice<'static, Bus>,
    serial: CdcAcmClass<'static, Bus>,
    reset: ResetInterface,
}

/// Sets the device up. Call it once.
pub fn set_up(
    memory: &'static mut Memory,
    bus: Option<UsbBusAllocator<Bus>>,
    unit: u64,
) -> (FrameSender<'static>, UsbCommands, UsbLink) {
    let Memory {
        bus: place,
        serial_number,
        records,
        commands,
    } = memory;
    write_hexadecimal(unit, serial_number);
    let on_bus = bus.and_then(|bus| OnBus::new(place.insert(bus), serial_number));
    let (sender, records) = records.split();
    let (producer, consumer) = commands.split();
    let link = UsbLink {
        on_bus,
        records,
        commands: producer,
    };
    (sender, UsbCommands(consumer), link)
}

impl OnBus {
    fn new(bus: &'static UsbBusAllocator<Bus>, serial_number: &'static [u8]) -> Option<Self> {
        let serial = CdcAcmClass::new(bus, PACKET as u16);
        let reset = ResetInterface::new(bus);
        let strings = StringDescriptors::default()
            .manufacturer("palpate")
            .product("palpate tactile sensor")
            .serial_number(core::str::from_utf8(serial_number).ok()?);
        let device = UsbDeviceBuilder::new(bus, VENDOR_AND_PRODUCT)
            .composite_with_iads()
            .strings(&[strings])
            .ok()?
            .max_power(USB_CURRENT_MA)
            .ok()?
            .max_packet_size_0(PACKET as u8)
            .ok()?
            .build();
        Some(Self {
            device,
            serial,
            reset,
        })
    }

    /// Returns whether a PC has opened the port.
    fn is_open(&self) -> bool {
        self.device.state() == UsbDeviceState::Configured && self.serial.dtr()
    }

    fn poll(&mut self) {
        self.device.poll(&mut [&mut self.serial, &mut self.reset]);
    }

    /// Follows the last packet of records: sent, lost or still waiting.
    fn follow(&self, records: &mut FrameReceiver<'static>) {
        match self.device.bus().sent(self.serial.write_ep().address()) {
            Sent::Not => {}
            Sent::Taken => records.taken(),
            Sent::Lost => records.lost(),
        }
        // A suspended bus does not show whether the port is open.
        if self.device.state() != UsbDeviceState::Suspend {
            records.set_open(self.is_open());
        }
    }

    /// Sends waiting records; at the end of a USB frame they wait for the start of the next frame.
    fn send(&mut self, records: &mut FrameReceiver<'static>) {
        let Self { device, serial, .. } = self;
        device.bus().before_end_of_frame(|| {
            let mut packet = [0; PACKET];
            let Some(length) = records.next_packet(&mut packet) else {
                return;
            };
            let ready = packet.get(..length).unwrap_or_default();
            if serial.write_packet(ready).is_err() {
                records.lost();
            }
        });
    }
}

impl UsbLink {
    /// Handles bus events and sends waiting frames.
    pub fn poll(&mut self) {
        if let Some(on_bus) = &mut self.on_bus {
            on_bus.poll();
            on_bus.follow(&mut self.records);
            receive(&mut on_bus.serial, &mut self.commands);
            on_bus.send(&mut self.records);
        }
    }
}

/// Receives bytes. A packet without space stays in the controller, and its interrupt, which would repeat
/// endlessly, is disabled until there is space.
fn receive(serial: &mut CdcAcmClass<'static, Bus>, commands: &mut Producer<'static, u8>) {
    let mut packet = [0; PACKET];
    while commands.capacity() - commands.len() >= PACKET {
        let Ok(length) = serial.read_packet(&mut packet) else {
            return;
        };
        for &byte in packet.iter().take(length) {
            // The loop has checked that there is space for a whole packet.
            let _ = commands.enqueue(byte);
        }
    }
    usb::mask_packet_interrupt();
}

/// Writes a number in hexadecimal digits, most significant first.
fn write_hexadecimal(number: u64, digits: &mut [u8; SERIAL_NUMBER]) {
    let mut rest = number;
    for digit in digits.iter_mut().rev() {
        *digit = match (rest % 16) as u8 {
            low @ 0..=9 => b'0' + low,
            high => b'A' + (high - 10),
        };
        rest /= 16;
    }
}
