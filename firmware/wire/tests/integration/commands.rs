//! Addressee of a command, and CRC of a configuration.

use crate::support::fixture::{commands, typical};
use crate::support::{bytes_of, content, unstuffed};
use palpate_wire::record::Hello;
use palpate_wire::{Command, Header, Message, configuration_crc, crc32};

#[test]
fn only_what_makes_nothing_less_safe_is_for_any_boot() {
    let harmless = ["identify", "disarm", "abort", "sensing_only"];
    for frame in commands() {
        let command = frame.message;
        let name = command.name();
        assert!(command.is_for(7, 7), "{name}");
        assert!(!command.is_for(7, 8), "{name}");
        let for_any = command.is_for(7, Header::ANY_BOOT);
        assert_eq!(for_any, harmless.contains(&name), "{name}");
    }
}

/// Compares the CRC with that over kind and payload of each command, cut out of its frame, and with the
/// number that the fixture's `hello` reports.
#[test]
fn the_configuration_is_its_commands_without_their_headers() {
    let mut setters = commands();
    setters.truncate(Command::KINDS.len());
    setters.retain(|frame| (0x90..0xA0).contains(&frame.message.kind()));
    let mut bytes = Vec::new();
    for frame in &setters {
        let kind = frame.message.kind();
        let body = unstuffed(&bytes_of(frame));
        let header = content(&frame.header, kind, &[]).len();
        bytes.push(kind);
        bytes.extend(&body[header..body.len() - 4]);
    }
    let setters: Vec<_> = setters.into_iter().map(|frame| frame.message).collect();
    assert_eq!(setters.len(), 13);
    let crc = configuration_crc(&setters);
    assert_eq!(crc, crc32(&bytes));
    assert_eq!(crc, typical::<Hello>("hello").configuration_crc);
    assert_ne!(crc, configuration_crc(setters.iter().rev()));
    assert_eq!(configuration_crc(&[] as &[Command]), 0);
}
