//! Descriptors of a device, and the functions that a host finds in them.

use std::collections::BTreeMap;

/// Types of descriptors (USB 2.0 table 9-5; CDC 1.2 table 12; USB 3.2 9.6.2 for BOS).
pub(super) mod kind {
    pub(in crate::usb) const DEVICE: u8 = 1;
    pub(in crate::usb) const CONFIGURATION: u8 = 2;
    pub(in crate::usb) const STRING: u8 = 3;
    pub(in crate::usb) const INTERFACE: u8 = 4;
    pub(in crate::usb) const ENDPOINT: u8 = 5;
    pub(in crate::usb) const QUALIFIER: u8 = 6;
    pub(in crate::usb) const ASSOCIATION: u8 = 11;
    pub(in crate::usb) const BOS: u8 = 15;
    pub(in crate::usb) const CLASS_INTERFACE: u8 = 0x24;
}

/// Classes of interfaces (CDC 1.2 tables 2 to 6).
mod class {
    pub(super) const COMMUNICATIONS: u8 = 0x02;
    /// Subclass: abstract control model.
    pub(super) const ABSTRACT_CONTROL: u8 = 0x02;
    /// Functional descriptor: union.
    pub(super) const UNION: u8 = 0x06;
}

/// Descriptors that a device returned to a host, byte by byte.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UsbDescription {
    /// The device descriptor (USB 2.0 9.6.1).
    pub device: Vec<u8>,
    /// Configuration descriptor with all of its subordinate descriptors (9.6.3).
    pub configuration: Vec<u8>,
    /// BOS descriptor of the capabilities, for a device of USB 2.1 (USB 3.2 9.6.2).
    pub bos: Option<Vec<u8>>,
    /// Descriptor of the languages; empty without strings (9.6.7).
    pub languages: Vec<u8>,
    /// String descriptors that other descriptors refer to, by index, in the first language; empty
    /// where the device refused.
    pub strings: BTreeMap<u8, Vec<u8>>,
    /// Whether the device refused a device qualifier, as required without high speed (9.6.2).
    pub refused_qualifier: bool,
}

/// An endpoint of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct UsbEndpoint {
    /// bEndpointAddress: the number, and bit 7 for IN.
    pub(super) address: u8,
    /// Largest packet, bytes.
    pub(super) largest_packet: u16,
    /// Poll interval of an interrupt endpoint, frames.
    pub(super) interval: u8,
}

/// A serial port of a device (CDC, abstract control model).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CdcFunction {
    /// Interface for class requests.
    pub(super) control_interface: u8,
    /// Notification endpoint.
    pub(super) notification: Option<UsbEndpoint>,
    /// Endpoint for data from the device.
    pub(super) input: UsbEndpoint,
    /// Endpoint for data to the device.
    pub(super) output: UsbEndpoint,
}

impl UsbDescription {
    /// The first serial port.
    pub(super) fn cdc(&self) -> Option<CdcFunction> {
        let interfaces = interfaces(&self.configuration);
        let control = interfaces.iter().find(|it| {
            it.class == class::COMMUNICATIONS && it.subclass == class::ABSTRACT_CONTROL
        })?;
        let union = control.functional(class::UNION)?;
        let data_interface = union.get(4).copied()?;
        let has_data =
            |it: &&Interface<'_>| it.number == data_interface && !it.endpoints.is_empty();
        let data = interfaces.iter().find(has_data)?;
        let of = |direction: u8| {
            let mut all = data.endpoints.iter().filter_map(|it| endpoint(it));
            all.find(|it| it.address & 0x80 == direction)
        };
        Some(CdcFunction {
            control_interface: control.number,
            notification: control.endpoints.first().and_then(|it| endpoint(it)),
            input: of(0x80)?,
            output: of(0)?,
        })
    }

    /// String of an index; `None` if there is none.
    #[must_use]
    pub fn string(&self, index: u8) -> Option<String> {
        let units = self.strings.get(&index)?.get(2..)?.chunks_exact(2);
        let units: Vec<u16> = units.map(|it| u16::from_le_bytes([it[0], it[1]])).collect();
        (!units.is_empty()).then(|| String::from_utf16_lossy(&units))
    }

    /// Indices of the strings that device, interfaces and associations refer to.
    pub(super) fn string_indices(&self) -> Vec<u8> {
        let of_device = [14, 15, 16].map(|at| self.device.get(at).copied());
        let of_others = descriptors(&self.configuration).map(|it| match it.get(1).copied() {
            Some(kind::CONFIGURATION) => it.get(6).copied(),
            Some(kind::INTERFACE) => it.get(8).copied(),
            Some(kind::ASSOCIATION) => it.get(7).copied(),
            _ => None,
        });
        let all = of_device.into_iter().chain(of_others).flatten();
        let mut indices: Vec<u8> = all.filter(|&index| index != 0).collect();
        indices.sort_unstable();
        indices.dedup();
        indices
    }
}

/// An interface with its descriptors, up to the next one.
struct Interface<'a> {
    number: u8,
    class: u8,
    subclass: u8,
    functionals: Vec<&'a [u8]>,
    endpoints: Vec<&'a [u8]>,
}

impl<'a> Interface<'a> {
    /// Functional descriptor of a subtype.
    fn functional(&self, subtype: u8) -> Option<&'a [u8]> {
        let mut all = self.functionals.iter();
        all.find(|it| it.get(2) == Some(&subtype)).copied()
    }
}

/// Iterates over the descriptors, while their lengths are valid.
fn descriptors(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let length = usize::from(*bytes.first()?);
        if length < 2 {
            return None;
        }
        let (descriptor, rest) = bytes.split_at_checked(length)?;
        bytes = rest;
        Some(descriptor)
    })
}

/// Interfaces of a configuration in order, with each alternate setting separate.
fn interfaces(configuration: &[u8]) -> Vec<Interface<'_>> {
    let mut interfaces: Vec<Interface<'_>> = Vec::new();
    for descriptor in descriptors(configuration) {
        match (descriptor, interfaces.last_mut()) {
            (&[_, kind::INTERFACE, number, _, _, class, subclass, ..], _) => {
                interfaces.push(Interface {
                    number,
                    class,
                    subclass,
                    functionals: Vec::new(),
                    endpoints: Vec::new(),
                });
            }
            ([_, kind::CLASS_INTERFACE, ..], Some(interface)) => {
                interface.functionals.push(descriptor);
            }
            ([_, kind::ENDPOINT, ..], Some(interface)) => interface.endpoints.push(descriptor),
            _ => {}
        }
    }
    interfaces
}

fn endpoint(descriptor: &[u8]) -> Option<UsbEndpoint> {
    match *descriptor {
        [_, _, address, _, low, high, interval, ..] => Some(UsbEndpoint {
            address,
            largest_packet: u16::from_le_bytes([low, high]) & 0x7FF,
            interval,
        }),
        _ => None,
    }
}
