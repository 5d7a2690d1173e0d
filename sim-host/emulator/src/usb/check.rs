//! Checks descriptors against USB 2.0 chapter 9, the association (engineering change notice
//! of 2003) and CDC 1.2 with its subclass PSTN 1.2.

use std::fmt;

use super::description::{Interface, UsbDescription, class, descriptors, interfaces, kind};

/// A rule that a descriptor breaks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescriptorProblem {
    /// Source of the rule.
    pub source: &'static str,
    /// Description of the problem, with the descriptor.
    pub what: String,
}

impl fmt::Display for DescriptorProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.what, self.source)
    }
}

const DEVICE: &str = "USB 2.0 9.6.1";
const QUALIFIER: &str = "USB 2.0 9.6.2";
const CONFIGURATION: &str = "USB 2.0 9.6.3";
const INTERFACE: &str = "USB 2.0 9.6.5";
const ENDPOINT: &str = "USB 2.0 9.6.6";
const STRING: &str = "USB 2.0 9.6.7";
const ASSOCIATION: &str = "USB ECN Interface Association Descriptor";
const BOS: &str = "USB 3.2 9.6.2";
const CDC: &str = "CDC 1.2 5.2.3";
const CDC_DATA: &str = "CDC 1.2 3.4.2";
const ACM: &str = "PSTN 1.2 5.3";

/// Class, subclass and protocol of a device with associations.
const MULTI_INTERFACE: [u8; 3] = [0xEF, 2, 1];
/// Subtypes of functional descriptors (CDC 1.2 table 13, PSTN 1.2 5.3).
const HEADER: u8 = 0x00;
const CALL_MANAGEMENT: u8 = 0x01;
const ABSTRACT_CONTROL: u8 = 0x02;

/// Returns every rule that a description breaks, in the order of its descriptors.
#[must_use]
pub fn check_descriptors(description: &UsbDescription) -> Vec<DescriptorProblem> {
    let mut check = Check {
        problems: Vec::new(),
        description,
        interfaces: interfaces(&description.configuration),
    };
    check.device();
    check.configuration();
    check.interfaces();
    check.endpoints();
    check.associations();
    check.communications();
    check.strings();
    check.capabilities();
    check.problems
}

struct Check<'a> {
    problems: Vec<DescriptorProblem>,
    description: &'a UsbDescription,
    interfaces: Vec<Interface<'a>>,
}

impl Check<'_> {
    fn rule(&mut self, holds: bool, source: &'static str, what: impl Into<String>) {
        if !holds {
            self.problems.push(DescriptorProblem {
                source,
                what: what.into(),
            });
        }
    }

    // ---- chapter 9 ----

    fn device(&mut self) {
        let &[
            18,
            kind::DEVICE,
            version_low,
            version_high,
            class,
            subclass,
            protocol,
            packet,
            vendor_low,
            vendor_high,
            ..,
            configurations,
        ] = self.description.device.as_slice()
        else {
            self.rule(
                false,
                DEVICE,
                "the device descriptor has not 18 bytes of type 1",
            );
            return;
        };
        let version = u16::from_le_bytes([version_low, version_high]);
        let is_decimal = (0..4).all(|digit| version >> (4 * digit) & 0xF <= 9);
        self.rule(
            is_decimal && (0x0110..=0x0210).contains(&version),
            DEVICE,
            format!("bcdUSB is {version:#06x}: no version of a device at full speed"),
        );
        self.rule(
            matches!(packet, 8 | 16 | 32 | 64),
            DEVICE,
            format!("bMaxPacketSize0 is {packet}, not 8, 16, 32 or 64"),
        );
        self.rule(
            class != 0 || subclass == 0 && protocol == 0,
            DEVICE,
            "bDeviceSubClass and bDeviceProtocol have to be 0 where bDeviceClass is",
        );
        self.rule(
            vendor_low != 0 || vendor_high != 0,
            DEVICE,
            "idVendor is 0, which belongs to no vendor",
        );
        self.rule(
            configurations == 1,
            DEVICE,
            format!("bNumConfigurations is {configurations}; this host knows the first one alone"),
        );
        self.rule(
            self.description.refused_qualifier,
            QUALIFIER,
            "a device without high speed has to refuse the request for a device qualifier",
        );
    }

    fn configuration(&mut self) {
        let bytes = &self.description.configuration;
        let &[
            9,
            kind::CONFIGURATION,
            total_low,
            total_high,
            count,
            value,
            _,
            attributes,
            power,
            ..,
        ] = bytes.as_slice()
        else {
            self.rule(
                false,
                CONFIGURATION,
                "the configuration descriptor has not 9 bytes of type 2",
            );
            return;
        };
        let total = usize::from(u16::from_le_bytes([total_low, total_high]));
        let sum: usize = descriptors(bytes).map(<[u8]>::len).sum();
        let length = bytes.len();
        self.rule(
            total == length && sum == length,
            CONFIGURATION,
            format!(
                "wTotalLength is {total}, {length} bytes came, and the descriptors' lengths give {sum}"
            ),
        );
        let mut numbers: Vec<u8> = self.interfaces.iter().map(|it| it.number).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let expected: Vec<u8> = (0..count).collect();
        self.rule(
            numbers == expected,
            CONFIGURATION,
            format!("bNumInterfaces is {count}, but the interfaces have the numbers {numbers:?}"),
        );
        self.rule(
            value != 0,
            CONFIGURATION,
            "bConfigurationValue is 0, which means none",
        );
        self.rule(
            attributes & 0b1001_1111 == 0b1000_0000,
            CONFIGURATION,
            format!("bmAttributes is {attributes:#04x}: bit 7 has to be 1, bits 4 to 0 zero"),
        );
        self.rule(
            power <= 250,
            CONFIGURATION,
            format!("bMaxPower is {power}, above 250 for 500 mA (7.2.1)"),
        );
    }

    fn interfaces(&mut self) {
        let mut before: Option<(u8, u8)> = None;
        for index in 0..self.interfaces.len() {
            let it = &self.interfaces[index];
            let (number, alternate, count) = (it.number, it.alternate, it.endpoint_count);
            let found = it.endpoints.len();
            let (class, name) = (it.class, format!("interface {number}.{alternate}"));
            let follows = match before {
                Some((last, setting)) if last == number => alternate == setting + 1,
                _ => alternate == 0,
            };
            before = Some((number, alternate));
            self.rule(
                follows,
                INTERFACE,
                format!("{name}: settings begin with 0 and follow one another"),
            );
            self.rule(
                usize::from(count) == found,
                INTERFACE,
                format!("{name}: bNumEndpoints is {count}, but {found} endpoints follow"),
            );
            self.rule(
                class != 0,
                INTERFACE,
                format!("{name}: bInterfaceClass 0 is reserved"),
            );
        }
        let of_type = |wanted| move |it: &&[u8]| it.get(1) == Some(&wanted);
        let bytes = &self.description.configuration;
        let is_short = descriptors(bytes)
            .filter(of_type(kind::INTERFACE))
            .any(|it| it.len() != 9);
        self.rule(
            !is_short,
            INTERFACE,
            "an interface descriptor has not 9 bytes",
        );
    }

    fn endpoints(&mut self) {
        let mut owners: Vec<(u8, u8)> = Vec::new();
        for index in 0..self.interfaces.len() {
            let number = self.interfaces[index].number;
            for endpoint in self.interfaces[index].endpoints.clone() {
                self.endpoint(endpoint);
                let address = endpoint.get(2).copied().unwrap_or(0);
                let is_free = !owners.iter().any(|it| it.0 == address && it.1 != number);
                self.rule(
                    is_free,
                    ENDPOINT,
                    format!("endpoint {address:#04x} belongs to two interfaces"),
                );
                owners.push((address, number));
            }
        }
    }

    fn endpoint(&mut self, descriptor: &[u8]) {
        let &[7, _, address, attributes, low, high, interval] = descriptor else {
            self.rule(false, ENDPOINT, "an endpoint descriptor has not 7 bytes");
            return;
        };
        let name = format!("endpoint {address:#04x}");
        let largest = u16::from_le_bytes([low, high]);
        self.rule(
            address & 0x70 == 0 && address & 0xF != 0,
            ENDPOINT,
            format!("{name}: bEndpointAddress has reserved bits, or the number 0"),
        );
        let (is_size_right, is_interval_right) = match attributes & 0b11 {
            0 => (matches!(largest, 8 | 16 | 32 | 64), true),
            1 => (largest <= 1023, (1..=16).contains(&interval)),
            2 => (matches!(largest, 8 | 16 | 32 | 64), true),
            _ => (largest <= 64, interval != 0),
        };
        self.rule(
            is_size_right,
            ENDPOINT,
            format!("{name}: wMaxPacketSize {largest} is not one of its type at full speed (5.5.3 to 5.8.3)"),
        );
        self.rule(
            is_interval_right,
            ENDPOINT,
            format!("{name}: bInterval {interval} is not one of its type"),
        );
        self.rule(
            attributes & 0b11 == 1 || attributes & !0b11 == 0,
            ENDPOINT,
            format!("{name}: bmAttributes has reserved bits"),
        );
    }

    fn strings(&mut self) {
        let indices = self.description.string_indices();
        let languages = &self.description.languages;
        let are_languages = match languages.as_slice() {
            &[length, kind::STRING, ..] => {
                usize::from(length) == languages.len() && length >= 4 && length % 2 == 0
            }
            _ => indices.is_empty(),
        };
        self.rule(are_languages, STRING, "string 0 is no list of languages");
        for index in indices {
            let bytes = self
                .description
                .strings
                .get(&index)
                .cloned()
                .unwrap_or_default();
            let has_form = match bytes.as_slice() {
                &[length, kind::STRING, ..] => {
                    usize::from(length) == bytes.len() && length % 2 == 0
                }
                _ => false,
            };
            self.rule(
                has_form,
                STRING,
                format!("string {index} is referred to, but absent or of a wrong length"),
            );
            let units = bytes.get(2..).unwrap_or_default().chunks_exact(2);
            let units = units.map(|it| u16::from_le_bytes([it[0], it[1]]));
            let is_text = char::decode_utf16(units).all(|it| it.is_ok());
            self.rule(is_text, STRING, format!("string {index} is not UTF-16"));
        }
    }

    fn capabilities(&mut self) {
        let version = match self.description.device.get(2..4) {
            Some(&[low, high]) => u16::from_le_bytes([low, high]),
            _ => 0,
        };
        let Some(bos) = &self.description.bos else {
            self.rule(
                version < 0x0201,
                BOS,
                "bcdUSB is above 2.00, but there is no BOS descriptor",
            );
            return;
        };
        let holds = match bos.as_slice() {
            &[5, kind::BOS, low, high, count, ..] => {
                let total = usize::from(u16::from_le_bytes([low, high]));
                let parts: Vec<usize> = descriptors(bos).map(<[u8]>::len).collect();
                total == bos.len()
                    && parts.iter().sum::<usize>() == total
                    && parts.len() == usize::from(count) + 1
            }
            _ => false,
        };
        self.rule(
            holds,
            BOS,
            "lengths or bNumDeviceCaps of the BOS descriptor are wrong",
        );
    }

    // ---- associations ----

    fn associations(&mut self) {
        let bytes = &self.description.configuration;
        let mut next_free = 0;
        let mut behind = 0;
        let mut is_associated = false;
        for descriptor in descriptors(bytes) {
            match *descriptor {
                [_, kind::INTERFACE, number, ..] => behind = behind.max(number + 1),
                [length, kind::ASSOCIATION, ..] if length != 8 => {
                    self.rule(false, ASSOCIATION, "an association has not 8 bytes");
                }
                [_, kind::ASSOCIATION, first, count, class, subclass, ..] => {
                    is_associated = true;
                    let name = format!("association of interface {first}");
                    self.rule(
                        first >= behind && first >= next_free,
                        ASSOCIATION,
                        format!(
                            "{name}: it has to stand before its interfaces, and not to overlap"
                        ),
                    );
                    next_free = first.saturating_add(count);
                    let covers = (first..next_free).all(|it| self.has_interface(it));
                    self.rule(
                        count > 0 && covers,
                        ASSOCIATION,
                        format!("{name}: it covers interfaces that there are not"),
                    );
                    let of_first = self.interfaces.iter().find(|it| it.number == first);
                    let agrees =
                        of_first.is_some_and(|it| (it.class, it.subclass) == (class, subclass));
                    self.rule(
                        class != 0 && agrees,
                        ASSOCIATION,
                        format!("{name}: its function class is not that of its first interface"),
                    );
                }
                _ => {}
            }
        }
        self.needs_association(is_associated);
    }

    fn has_interface(&self, number: u8) -> bool {
        self.interfaces.iter().any(|it| it.number == number)
    }

    fn needs_association(&mut self, is_associated: bool) {
        let class = self.description.device.get(4..7);
        self.rule(
            !is_associated || class == Some(&MULTI_INTERFACE),
            ASSOCIATION,
            "a device with an association has the class EF/02/01",
        );
        let of_union = |it: &Interface<'_>| {
            let union = it.functional(class::UNION);
            1 + union.map_or(0, |union| union.len().saturating_sub(4))
        };
        let grouped: usize = self.communication_interfaces().map(of_union).sum();
        let count = self
            .interfaces
            .iter()
            .filter(|it| it.alternate == 0)
            .count();
        self.rule(
            is_associated || grouped == 0 || grouped == count,
            ASSOCIATION,
            "a serial port beside other functions needs an association",
        );
    }

    // ---- communications ----

    fn communication_interfaces(&self) -> impl Iterator<Item = &Interface<'_>> {
        let all = self.interfaces.iter();
        all.filter(|it| it.class == class::COMMUNICATIONS && it.alternate == 0)
    }

    fn communications(&mut self) {
        for index in 0..self.interfaces.len() {
            match self.interfaces[index].class {
                class::COMMUNICATIONS => self.communication(index),
                class::DATA => self.data(index),
                _ => {}
            }
        }
    }

    fn communication(&mut self, index: usize) {
        let it = &self.interfaces[index];
        let (number, subclass, protocol) = (it.number, it.subclass, it.protocol);
        let first = it.functionals.first().copied().unwrap_or_default().to_vec();
        let union = it.functional(class::UNION).map(<[u8]>::to_vec);
        let call = it.functional(CALL_MANAGEMENT).map(<[u8]>::to_vec);
        let control = it.functional(ABSTRACT_CONTROL).map(<[u8]>::to_vec);
        let notifies = it.endpoints.iter().all(|it| {
            it.get(2).is_some_and(|address| address & 0x80 != 0)
                && it.get(3).is_some_and(|attributes| attributes & 0b11 >= 2)
        });
        let name = format!("interface {number}");
        let is_header = matches!(*first, [5, _, HEADER, low, high] if matches!((low, high), (0x10 | 0x20, 0x01)));
        self.rule(
            is_header,
            CDC,
            format!("{name}: the first functional descriptor is no header of CDC 1.10 or 1.20"),
        );
        self.rule(
            notifies,
            CDC,
            format!("{name}: a notification endpoint is IN, and interrupt or bulk (3.4.1)"),
        );
        match union.as_deref() {
            Some([length, _, _, of, others @ ..]) => {
                let exist = others
                    .iter()
                    .all(|&it| it != number && self.has_interface(it));
                self.rule(
                    usize::from(*length) == 4 + others.len() && *of == number && !others.is_empty() && exist,
                    CDC,
                    format!("{name}: its union names other interfaces than itself and those that it controls"),
                );
            }
            _ => self.rule(false, CDC, format!("{name}: there is no union")),
        }
        if subclass == class::ABSTRACT_CONTROL {
            self.abstract_control(&name, call.as_deref(), control.as_deref());
            self.rule(
                matches!(protocol, 0..=6 | 0xFE | 0xFF),
                ACM,
                format!("{name}: bInterfaceProtocol {protocol} is reserved (CDC 1.2 table 5)"),
            );
        }
    }

    fn abstract_control(&mut self, name: &str, call: Option<&[u8]>, control: Option<&[u8]>) {
        let is_call = match call {
            Some(&[5, _, _, capabilities, data]) => {
                let is_data = |it: &Interface<'_>| it.number == data && it.class == class::DATA;
                let over_data = capabilities & 0b10 != 0;
                capabilities & !0b11 == 0 && (!over_data || self.interfaces.iter().any(is_data))
            }
            _ => false,
        };
        self.rule(
            is_call,
            ACM,
            format!("{name}: no call management descriptor of 5 bytes with an interface of data"),
        );
        self.rule(
            matches!(control, Some(&[4, _, _, capabilities]) if capabilities & 0xF0 == 0),
            ACM,
            format!("{name}: no abstract control descriptor of 4 bytes without reserved bits"),
        );
    }

    /// A setting without endpoints is allowed.
    fn data(&mut self, index: usize) {
        let it = &self.interfaces[index];
        let name = format!("interface {}", it.number);
        let of = |direction: u8| {
            let mut all = it.endpoints.iter();
            let found = all.find(|it| {
                it.get(2)
                    .is_some_and(|&address| address & 0x80 == direction)
            });
            found
                .and_then(|it| it.get(3))
                .map(|attributes| attributes & 0b11)
        };
        let is_pair = match (of(0x80), of(0)) {
            (Some(input), Some(output)) => input == output && matches!(input, 1 | 2),
            _ => it.endpoints.is_empty(),
        };
        let count = it.endpoints.len();
        let has_subclass = it.subclass != 0;
        self.rule(
            is_pair && count.is_multiple_of(2),
            CDC_DATA,
            format!("{name}: the endpoints of data are no pairs of bulk or isochronous ones"),
        );
        self.rule(
            !has_subclass,
            CDC,
            format!("{name}: the class of data has the subclass 0 (4.6)"),
        );
        let owned = self.communication_interfaces().any(|control| {
            let union = control.functional(class::UNION).unwrap_or_default();
            union
                .iter()
                .skip(4)
                .any(|&other| other == self.interfaces[index].number)
        });
        self.rule(owned, CDC, format!("{name}: no union controls it"));
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::usb::tests::device::{CONFIGURATION, DEVICE};

    fn good() -> UsbDescription {
        let text = |text: &str| {
            let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            [vec![units.len() as u8 + 2, kind::STRING], units].concat()
        };
        UsbDescription {
            device: DEVICE.to_vec(),
            configuration: CONFIGURATION.to_vec(),
            bos: None,
            languages: vec![4, 3, 9, 4],
            strings: BTreeMap::from([1, 2, 3, 4].map(|index| (index, text("text")))),
            refused_qualifier: true,
        }
    }

    fn sources(description: &UsbDescription) -> Vec<&'static str> {
        let problems = check_descriptors(description);
        problems.into_iter().map(|problem| problem.source).collect()
    }

    #[test]
    fn a_right_description_breaks_no_rule() {
        assert_eq!(check_descriptors(&good()), []);
    }

    /// Each case: a byte of the device descriptor, and the rule that it breaks.
    #[test]
    fn each_wrong_byte_of_the_device_is_found() {
        let wrong = [
            (0, 17, DEVICE_SOURCES),
            (3, 3, &[super::DEVICE, BOS][..]),
            (2, 0x0A, DEVICE_SOURCES),
            (7, 12, DEVICE_SOURCES),
            (17, 0, DEVICE_SOURCES),
            (4, 0, &[super::DEVICE, ASSOCIATION][..]),
            (5, 1, &[ASSOCIATION][..]),
            (14, 9, &[STRING][..]),
        ];
        for (at, value, expected) in wrong {
            let mut description = good();
            description.device[at] = value;
            let found = sources(&description);
            let is_found = expected.iter().all(|source| found.contains(source));
            assert!(is_found, "byte {at} = {value}: {found:?}");
        }
    }

    const DEVICE_SOURCES: &[&str] = &[super::DEVICE];

    /// Each case: a byte of the configuration, and the first rule that it breaks.
    #[test]
    fn each_wrong_byte_of_the_configuration_is_found() {
        let wrong = [
            (0, 8, super::CONFIGURATION),
            (2, 83, super::CONFIGURATION),
            (4, 2, super::CONFIGURATION),
            (5, 0, super::CONFIGURATION),
            (7, 0, super::CONFIGURATION),
            (7, 0x81, super::CONFIGURATION),
            (8, 251, super::CONFIGURATION),
            // Association.
            (11, 1, ASSOCIATION),
            (12, 4, ASSOCIATION),
            (13, 3, ASSOCIATION),
            // Control interface: setting, endpoints, class.
            (20, 1, INTERFACE),
            (21, 2, INTERFACE),
            (22, 0, INTERFACE),
            (24, 7, ACM),
            // Functional descriptors of the control interface.
            (28, 4, CDC),
            (29, 0x30, CDC),
            (33, 2, ACM),
            (34, 4, ACM),
            (39, 0x10, ACM),
            (43, 1, CDC),
            (44, 7, CDC),
            // Notification endpoint.
            (47, 0x80, ENDPOINT),
            (47, 0x01, CDC),
            (48, 0x13, ENDPOINT),
            (49, 65, ENDPOINT),
            (51, 0, ENDPOINT),
            // Data interface with its endpoints.
            (58, 1, CDC),
            (63, 0x02, CDC_DATA),
            (64, 3, ENDPOINT),
            (65, 60, ENDPOINT),
            (70, 0x81, ENDPOINT),
        ];
        for (at, value, expected) in wrong {
            let mut description = good();
            description.configuration[at] = value;
            let found = check_descriptors(&description);
            assert!(
                found.iter().any(|problem| problem.source == expected),
                "byte {at} = {value}: {found:?}"
            );
        }
    }

    #[test]
    fn strings_qualifier_and_capabilities_are_checked() {
        let mut description = good();
        description.strings.insert(2, Vec::new());
        assert_eq!(sources(&description), [STRING]);
        description = good();
        description.strings.insert(2, vec![4, 3, 0x00, 0xD8]);
        assert_eq!(sources(&description), [STRING]);
        description = good();
        description.languages = vec![2, 3];
        assert_eq!(sources(&description), [STRING]);
        description = good();
        description.refused_qualifier = false;
        assert_eq!(sources(&description), [QUALIFIER]);
        description = good();
        description.device[2] = 0x10;
        assert_eq!(sources(&description), [BOS]);
        description.bos = Some(vec![5, kind::BOS, 8, 0, 1, 3, 16, 2]);
        assert_eq!(sources(&description), [""; 0]);
        description.bos = Some(vec![5, kind::BOS, 8, 0, 2, 3, 16, 2]);
        assert_eq!(sources(&description), [BOS]);
    }

    #[test]
    fn a_serial_port_beside_another_function_needs_an_association() {
        let mut description = good();
        description.configuration.drain(9..17);
        description.configuration[2] -= 8;
        description.device[4..7].copy_from_slice(&[0, 0, 0]);
        assert_eq!(sources(&description), [ASSOCIATION]);
    }
}
