//! The device's descriptors, byte by byte. They are constants of the image, reviewed once by hand
//! against USB 2.0 chapter 9, its notice of change for associations (2003), USB 3.2 9.6.2 for BOS,
//! and CDC 1.2 with PSTN 1.2. Where one changes on purpose, review it again.

use palpate_emulator::usb::UsbDescription;

/// Number of the reset interface.
pub(crate) const RESET_INTERFACE: u8 = 2;

/// USB 2.10, which asks for a BOS descriptor. Class, subclass and protocol of a device with
/// associations. Packets of 64 bytes on endpoint 0. Vendor 1209, product 0001, release 0.10. Strings
/// of maker, product and serial number; one configuration.
const DEVICE: [u8; 18] = [
    18, 1, 0x10, 0x02, 0xEF, 2, 1, 64, 0x09, 0x12, 0x01, 0x00, 0x10, 0x00, 1, 2, 3, 1,
];

const CONFIGURATION: [u8; 84] = [
    // 84 bytes with all that follow, 3 interfaces, value 1, powered by the bus, 100 mA.
    9, 2, 84, 0, 3, 1, 0, 0x80, 50, //
    // Association of the interfaces 0 and 1: communications, abstract control model.
    8, 11, 0, 2, 2, 2, 0, 0, //
    // Interface 0, which controls the port: the same class, one endpoint.
    9, 4, 0, 0, 1, 2, 2, 0, 0, //
    // Header: CDC 1.10.
    5, 0x24, 0, 0x10, 0x01, //
    // Abstract control model. Bit 1 would announce line coding and line state. The port accepts
    // these requests without it, and PCs send them without it.
    4, 0x24, 2, 0, //
    // Union: interface 0 controls interface 1.
    5, 0x24, 6, 0, 1, //
    // Call management: none; the data are those of interface 1.
    5, 0x24, 1, 0, 1, //
    // Endpoint 1 IN: interrupt, 8 bytes, every 255 ms.
    7, 5, 0x81, 3, 8, 0, 255, //
    // Interface 1, the data: two endpoints.
    9, 4, 1, 0, 2, 10, 0, 0, 0, //
    // Endpoint 2 IN and endpoint 1 OUT: bulk, 64 bytes.
    7, 5, 0x82, 2, 64, 0, 0, //
    7, 5, 0x01, 2, 64, 0, 0, //
    // Interface 2, for resets as picotool asks for them: vendor-specific, 00, 01, with its name.
    9, 4, 2, 0, 0, 0xFF, 0, 1, 4,
];

/// One capability, the extension of USB 2.0, without link power management.
const BOS: [u8; 12] = [5, 15, 12, 0, 1, 7, 16, 2, 0, 0, 0, 0];

/// English of the United States.
const LANGUAGES: [u8; 4] = [4, 3, 0x09, 0x04];

/// The reviewed description of the board whose flash has this number.
pub(crate) fn reviewed(unit: u64) -> UsbDescription {
    let serial_number = format!("{unit:016X}");
    let texts = ["palpate", "palpate tactile sensor", &serial_number, "Reset"];
    UsbDescription {
        device: DEVICE.to_vec(),
        configuration: CONFIGURATION.to_vec(),
        bos: Some(BOS.to_vec()),
        languages: LANGUAGES.to_vec(),
        strings: (1..).zip(texts.map(string)).collect(),
        // A device without high speed refuses the request for a qualifier (USB 2.0 9.6.2).
        refused_qualifier: true,
    }
}

/// String descriptor of a text.
fn string(text: &str) -> Vec<u8> {
    let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    [vec![units.len() as u8 + 2, 3], units].concat()
}
