//! Value and error detection of the CRC-32.

use palpate_wire::{MAX_HEADER, Message, Record, crc32};

/// The check value of CRC-32/ISCSI, and the examples of RFC 3720, appendix B.4.
#[test]
fn it_gives_the_published_values() {
    assert_eq!(crc32(b""), 0);
    assert_eq!(crc32(b"123456789"), 0xE306_9283);
    assert_eq!(crc32(&[0x00; 32]), 0x8A91_36AA);
    assert_eq!(crc32(&[0xFF; 32]), 0x62A8_AB43);
    let increasing: [u8; 32] = std::array::from_fn(|index| index as u8);
    assert_eq!(crc32(&increasing), 0x46DD_794E);
    let decreasing: [u8; 32] = std::array::from_fn(|index| 31 - index as u8);
    assert_eq!(crc32(&decreasing), 0x113F_DB5C);
}

/// Returns the effect of each single bit error on the check, in content or CRC-32 of the longest frame.
fn syndromes() -> Vec<u32> {
    let length = MAX_HEADER + Record::MAX_PAYLOAD;
    let silent = crc32(&vec![0; length]);
    let content = (0..length * 8).map(|bit| {
        let mut bytes = vec![0; length];
        bytes[bit / 8] = 1 << (bit % 8);
        crc32(&bytes) ^ silent
    });
    content.chain((0..32).map(|bit| 1 << bit)).collect()
}

/// A CRC is linear: an error is undetected if the syndromes of its bits add up to zero. The sum of one,
/// three or five is not zero, since each syndrome has an odd number of ones. The sum of two or four is
/// not zero, since no two pairs of bits have the same sum.
#[test]
fn it_finds_every_error_of_up_to_five_bits_in_the_longest_frame() {
    let syndromes = syndromes();
    assert!(syndromes.iter().all(|one| one.count_ones() % 2 == 1));
    let mut sums = Vec::new();
    for (index, one) in syndromes.iter().enumerate() {
        sums.extend(syndromes[..index].iter().map(|other| one ^ other));
    }
    assert_eq!(sums.len(), syndromes.len() * (syndromes.len() - 1) / 2);
    sums.sort_unstable();
    assert_ne!(sums[0], 0);
    assert!(sums.windows(2).all(|pair| pair[0] != pair[1]));
}
