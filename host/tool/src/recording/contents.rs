//! What a recording contains, counted.

use std::collections::{BTreeMap, HashMap};

use palpate_wire::Message;
use palpate_wire::loss::{Account, Tally};
use serde::Serialize;

use super::date::NS_PER_S;
use super::{Entry, Note, Recorded};

/// What a recording contains.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    account: Account,
    /// Boots in the order of their first frames.
    boots: Vec<Tally>,
    /// Where each stands there, by its number.
    places: HashMap<u32, usize>,
    /// Arrival of the first frame and of the last, ns since 1970.
    span_ns: Option<(u64, u64)>,
    kinds: BTreeMap<&'static str, u64>,
    notes: Vec<Note>,
}

/// What is missing of a boot of the board, from its first frame in the recording to its last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct BootLosses {
    /// The boot.
    pub boot_id: u32,
    /// Frames that the board had produced before.
    pub before_first: u64,
    /// Frames that arrived.
    pub received: u64,
    /// Frames that did not.
    pub missing: u64,
    /// Of the missing ones.
    pub dropped_by_device: u64,
    /// Of the missing ones; absent where the board's count contradicts the numbers of its frames.
    pub lost_on_the_way: Option<u64>,
    /// Frames that came twice.
    pub duplicates: u64,
    /// Frames that came too late to be distinguished from repeated ones.
    pub stale: u64,
}

impl BootLosses {
    /// The same as a sentence.
    pub fn sentence(&self) -> String {
        let start = format!("boot {:08x}: {} records", self.boot_id, self.received);
        if self.missing == 0 {
            return format!("{start}, none is missing");
        }
        let lost = self.lost_on_the_way;
        let lost = lost.map_or("an unknown number".to_owned(), |lost| lost.to_string());
        format!(
            "{start}, {} are missing: the board dropped {}, {lost} were lost on the way",
            self.missing, self.dropped_by_device
        )
    }
}

impl From<&Tally> for BootLosses {
    fn from(tally: &Tally) -> Self {
        Self {
            boot_id: tally.boot_id(),
            before_first: tally.before_first(),
            received: tally.received(),
            missing: tally.missing(),
            dropped_by_device: tally.dropped_by_device(),
            lost_on_the_way: tally.lost_on_the_way(),
            duplicates: tally.duplicates(),
            stale: tally.stale(),
        }
    }
}

impl Contents {
    /// Counts what comes next.
    pub fn enter(&mut self, entry: &Entry) {
        match entry {
            Entry::Frame(recorded) => self.enter_frame(recorded),
            Entry::Note(note) => self.notes.push(note.clone()),
            Entry::Log(_) => {}
        }
    }

    /// The same of a frame.
    pub fn enter_frame(&mut self, recorded: &Recorded) {
        let frame = &recorded.frame;
        *self.kinds.entry(frame.message.name()).or_default() += 1;
        let (first_ns, _) = self.span_ns.unwrap_or((recorded.host_ns, 0));
        self.span_ns = Some((first_ns, recorded.host_ns));
        self.account.take(&frame.header);
        let tallies = [self.account.current(), self.account.previous()];
        let mut tallies = tallies.into_iter().flatten();
        let Some(tally) = tallies.find(|tally| tally.boot_id() == frame.header.boot_id) else {
            return;
        };
        let place = *self
            .places
            .entry(tally.boot_id())
            .or_insert(self.boots.len());
        match self.boots.get_mut(place) {
            Some(boot) => *boot = *tally,
            None => self.boots.push(*tally),
        }
    }

    /// Records, by kinds.
    pub const fn kinds(&self) -> &BTreeMap<&'static str, u64> {
        &self.kinds
    }

    /// All records.
    pub fn frames(&self) -> u64 {
        self.kinds.values().sum()
    }

    /// What is missing, boot by boot.
    pub fn boots(&self) -> Vec<BootLosses> {
        self.boots.iter().map(BootLosses::from).collect()
    }

    /// When the first record arrived, ns since 1970.
    pub fn began_ns(&self) -> Option<u64> {
        self.span_ns.map(|(first_ns, _)| first_ns)
    }

    /// From the first record's arrival to the last one's, s.
    pub fn duration_s(&self) -> f64 {
        let (first_ns, last_ns) = self.span_ns.unwrap_or_default();
        last_ns.saturating_sub(first_ns) as f64 / NS_PER_S as f64
    }

    /// The notes of a name.
    pub fn notes(&self, name: &str) -> impl Iterator<Item = &Note> {
        self.notes.iter().filter(move |note| note.name == name)
    }
}
