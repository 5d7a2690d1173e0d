//! Corruption of bytes in transit, and its effect on a decoder.

use std::fmt;

use palpate_wire::schema::Type;
use palpate_wire::{Command, CommandDecoder, Decoder, Message, Record, RecordDecoder};

use super::random::Random;
use super::{bytes_of, header, reference};

/// Results of many corrupted frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct CorruptionOutcome {
    /// Number of corrupted frames or groups of frames.
    pub(crate) damaged: u64,
    /// Number of accepted frames that were never sent.
    pub(crate) undetected: u64,
    /// Number of frames not received although sent after the damage, with one other frame between.
    pub(crate) out_of_step: u64,
    /// Number of refused frames.
    pub(crate) refused: u64,
    /// Number of corruptions by kind.
    pub(crate) kinds: [u64; DAMAGES.len()],
}

impl fmt::Display for CorruptionOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for ((name, _), count) in DAMAGES.iter().zip(self.kinds) {
            writeln!(f, "{name:<28} {count:>9}")?;
        }
        writeln!(f, "{:<28} {:>9}", "damaged", self.damaged)?;
        writeln!(f, "{:<28} {:>9}", "refused as bad frames", self.refused)?;
        writeln!(f, "{:<28} {:>9}", "undetected", self.undetected)?;
        write!(f, "{:<28} {:>9}", "out of step", self.out_of_step)
    }
}

/// Corrupts bytes; the second frame is for damage to two frames.
type Damage = fn(&mut Vec<u8>, &[u8], &mut Random);

/// All kinds of damage.
pub(crate) const DAMAGES: [(&str, Damage); 9] = [
    ("1 to 8 bits flipped", flip_bits),
    ("burst of up to 64 bits", burst),
    ("cut off at the end", cut_end),
    ("cut off at the start", cut_start),
    ("bytes missing within", cut_middle),
    ("bytes put in", put_in),
    ("two bytes exchanged", exchange),
    ("joined to the next frame", join),
    ("continued by another frame", splice),
];

#[allow(clippy::ptr_arg, reason = "others change the length")]
fn flip_bits(frame: &mut Vec<u8>, _: &[u8], random: &mut Random) {
    for _ in 0..=random.below(8) {
        let at = random.below(frame.len());
        frame[at] ^= 1 << random.below(8);
    }
}

#[allow(clippy::ptr_arg, reason = "others change the length")]
fn burst(frame: &mut Vec<u8>, _: &[u8], random: &mut Random) {
    let start = random.below(frame.len());
    for byte in frame[start..].iter_mut().take(1 + random.below(8)) {
        *byte = random.bits() as u8;
    }
}

fn cut_end(frame: &mut Vec<u8>, _: &[u8], random: &mut Random) {
    frame.truncate(random.below(frame.len()));
}

fn cut_start(frame: &mut Vec<u8>, _: &[u8], random: &mut Random) {
    frame.drain(..1 + random.below(frame.len() - 1));
}

fn cut_middle(frame: &mut Vec<u8>, _: &[u8], random: &mut Random) {
    let start = random.below(frame.len());
    let end = (start + 1 + random.below(8)).min(frame.len());
    frame.drain(start..end);
}

fn put_in(frame: &mut Vec<u8>, _: &[u8], random: &mut Random) {
    for _ in 0..=random.below(4) {
        frame.insert(random.below(frame.len()), random.bits() as u8);
    }
}

#[allow(clippy::ptr_arg, reason = "others change the length")]
fn exchange(frame: &mut Vec<u8>, _: &[u8], random: &mut Random) {
    let (a, b) = (random.below(frame.len()), random.below(frame.len()));
    frame.swap(a, b);
}

fn join(frame: &mut Vec<u8>, other: &[u8], _: &mut Random) {
    frame.pop();
    frame.extend(other);
}

fn splice(frame: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    frame.truncate(random.below(frame.len()));
    frame.extend(&other[random.below(other.len())..]);
}

/// Corrupts `count` frames of either direction.
pub(crate) fn run(count: u64, seed: u64) -> CorruptionOutcome {
    let mut outcome = CorruptionOutcome::default();
    let mut random = Random(seed);
    let mut records = RecordDecoder::new();
    let mut commands = CommandDecoder::new();
    while outcome.damaged < count {
        if random.once_in(4) {
            trial::<Command, _>(&mut commands, &mut random, &mut outcome);
        } else {
            trial::<Record, _>(&mut records, &mut random, &mut outcome);
        }
    }
    let counts = [records.counts(), commands.counts()];
    outcome.refused = counts
        .iter()
        .map(|counts| u64::from(counts.damaged()) + u64::from(counts.not_understood()))
        .sum();
    outcome
}

fn trial<M: Message + PartialEq, const N: usize>(
    decoder: &mut Decoder<M, N>,
    random: &mut Random,
    outcome: &mut CorruptionOutcome,
) {
    let sent: [Vec<u8>; 4] = std::array::from_fn(|_| any_frame::<M>(random));
    let [first, second, next, last] = &sent;
    let kind = random.below(DAMAGES.len());
    let mut bytes = first.clone();
    DAMAGES[kind].1(&mut bytes, second, random);
    if bytes == *first {
        return;
    }
    outcome.damaged += 1;
    outcome.kinds[kind] += 1;
    // Damage to the zero at the end of a frame may destroy the next frame, but not the last one.
    bytes.extend(next);
    bytes.extend(last);
    let mut received = Vec::new();
    for frame in decoder.frames(&bytes).flatten() {
        received.push(bytes_of(&frame));
    }
    outcome.undetected += received
        .iter()
        .filter(|frame| !sent.contains(frame))
        .count() as u64;
    outcome.out_of_step += u64::from(received.last() != Some(last));
}

/// Returns a frame of any kind with any content.
fn any_frame<M: Message>(random: &mut Random) -> Vec<u8> {
    let kind = &M::KINDS[random.below(M::KINDS.len())];
    let payload = kind
        .payload
        .map(|structure| reference::random(&Type::Structure(structure), random));
    let payload = reference::payload_bytes(payload.as_ref(), kind);
    let header = header(random.bits() as u32);
    reference::framed(&reference::content_bytes(&header, kind.number, &payload))
}
