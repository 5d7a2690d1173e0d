//! Addressee of a command, and CRC of a configuration.

use crate::support::fixture::commands;
use crate::support::reference::crc32c;
use crate::support::specimens;
use palpate_wire::{Command, Header, Message, configuration_crc};

#[test]
fn only_what_makes_nothing_less_safe_is_for_any_boot() {
    let harmless = ["identify", "disarm", "abort", "sensing_only"];
    for command in specimens::commands() {
        let name = command.name();
        assert!(command.is_for(7, 7), "{name}");
        assert!(!command.is_for(7, 8), "{name}");
        let for_any = command.is_for(7, Header::ANY_BOOT);
        assert_eq!(for_any, harmless.contains(&name), "{name}");
    }
}

/// Kind and payload of each command, cut out of the fixture before COBS.
#[test]
fn the_configuration_is_its_commands_without_their_headers() {
    let setters: Vec<_> = specimens::commands()
        .into_iter()
        .filter(|command| (0x90..0xA0).contains(&command.kind()))
        .collect();
    let mut bytes = Vec::new();
    for command in &setters {
        let frame = commands()
            .into_iter()
            .find(|frame| frame.message == *command)
            .unwrap();
        let body = unstuffed(&crate::support::bytes_of(&frame));
        let empty = palpate_wire::Frame {
            header: frame.header,
            message: Command::Arm,
        };
        let header = unstuffed(&crate::support::bytes_of(&empty)).len() - 4;
        bytes.push(body[1]);
        bytes.extend(&body[header..body.len() - 4]);
    }
    assert_eq!(setters.len(), 13);
    assert_eq!(configuration_crc(&setters), crc32c(&bytes));
    assert_ne!(
        configuration_crc(&setters),
        configuration_crc(setters.iter().rev())
    );
    assert_eq!(configuration_crc(&[] as &[Command]), 0);
}

fn unstuffed(frame: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    let mut rest = &frame[..frame.len() - 1];
    while let [code, others @ ..] = rest {
        let (block, others) = others.split_at(usize::from(*code) - 1);
        body.extend(block);
        if *code < 255 && !others.is_empty() {
            body.push(0);
        }
        rest = others;
    }
    body
}
