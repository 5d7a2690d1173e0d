//! Random damage and deliberate changes of files and messages.

/// Random numbers from a seed (SplitMix64, Steele, Lea and Flood 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// A number from 0 to below `end`, or 0.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.word() % end.max(1) as u64) as usize
    }

    pub(crate) fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    pub(crate) fn bytes(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| self.word() as u8).collect()
    }
}

/// Replacements of a number.
const NUMBERS: [&str; 12] = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e-308",
    "-1",
    "0",
    "0x10",
    "1,5",
    "1e9",
    "99999999999999999999",
];
/// Insertions into a text.
const PIECES: [&str; 8] = [
    "\u{1b}[2J",
    "\0",
    "\u{feff}",
    "\u{202e}",
    "\"",
    "[[",
    "\r",
    "\n\n",
];

/// Applies up to three changes to a file.
pub(crate) fn mutant(random: &mut Random, sound: &[u8], is_text: bool) -> Vec<u8> {
    let mut bytes = sound.to_vec();
    for _ in 0..=random.below(3) {
        if is_text && random.below(3) > 0 {
            let text = String::from_utf8_lossy(&bytes).into_owned();
            bytes = changed_text(random, &text);
        } else {
            change(random, &mut bytes);
        }
    }
    bytes
}

fn change(random: &mut Random, bytes: &mut Vec<u8>) {
    let at = random.below(bytes.len());
    let end = (at + 1 + random.below(64)).min(bytes.len());
    match random.below(7) {
        0 if !bytes.is_empty() => bytes[at] ^= 1 << random.below(8),
        1 if !bytes.is_empty() => bytes[at] = random.word() as u8,
        2 => drop(bytes.drain(at..end)),
        3 => {
            let again = bytes[at..end].to_vec();
            drop(bytes.splice(at..at, again));
        }
        4 => bytes.truncate(at),
        5 => {
            let length = random.below(40);
            drop(bytes.splice(at..at, random.bytes(length)));
        }
        _ => bytes[at..end].fill(random.one_of(&[0x00, 0xFF])),
    }
}

fn changed_text(random: &mut Random, text: &str) -> Vec<u8> {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let (at, other) = (random.below(lines.len()), random.below(lines.len()));
    if lines.is_empty() {
        return text.into();
    }
    match random.below(9) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(other, lines[at].clone()),
        2 => lines.swap(at, other),
        3 => lines[at] = with_other_number(random, &lines[at]),
        4 => lines[at].push_str(random.one_of(&PIECES)),
        5 => lines[at] = random.one_of(&["a", "[", "{", "9", "\""]).repeat(100_000),
        6 => return text.replace('\n', "\r\n").into(),
        7 => return text.encode_utf16().flat_map(u16::to_le_bytes).collect(),
        _ => return text.replace(',', ";").into(),
    }
    lines.join("\n").into()
}

/// Replaces one of the numbers of a line.
fn with_other_number(random: &mut Random, line: &str) -> String {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e');
    let mut words: Vec<&str> = line.split_inclusive(|c| !is_part(c)).collect();
    let numbers: Vec<usize> = (0..words.len())
        .filter(|&at| words[at].starts_with(|c: char| c.is_ascii_digit()))
        .collect();
    if !numbers.is_empty() {
        let at = random.one_of(&numbers);
        let end = words[at].find(|c| !is_part(c)).unwrap_or(words[at].len());
        let changed = format!("{}{}", random.one_of(&NUMBERS), &words[at][end..]);
        words[at] = &changed;
        return words.concat();
    }
    line.to_owned()
}
