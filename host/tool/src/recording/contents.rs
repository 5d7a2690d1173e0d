//! Counted contents of a recording.

use std::collections::{BTreeMap, HashMap};

use palpate_wire::Message;
use palpate_wire::loss::{Account, Tally};
use serde::Serialize;

use super::date::NS_PER_S;
use super::{Entry, Note, Recorded};

/// Contents of a recording.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    account: Account,
    /// Boots in the order of their first frames.
    boots: Vec<Tally>,
    /// Index of each boot in `boots`, by its id.
    places: HashMap<u32, usize>,
    /// Arrival of the first and the last frame, ns since 1970.
    span_ns: Option<(u64, u64)>,
    kinds: BTreeMap<&'static str, u64>,
    notes: Vec<Note>,
}

/// Missing frames of a boot of the board, from its first recorded frame to its last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct BootLosses {
    /// Boot id.
    pub boot_id: u32,
    /// Frames that the board had produced before the first recorded one.
    pub before_first: u64,
    /// Received frames.
    pub received: u64,
    /// Missing frames.
    pub missing: u64,
    /// Missing frames that the board dropped.
    pub dropped_by_device: u64,
    /// Missing frames that were lost on the link; `None` where the board's count contradicts its
    /// sequence numbers.
    pub lost_on_the_way: Option<u64>,
    /// Frames received twice.
    pub duplicates: u64,
    /// Frames that arrived too late to tell them from duplicates.
    pub stale: u64,
}

impl BootLosses {
    /// Describes the losses in a sentence.
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
    /// Counts an entry.
    pub fn enter(&mut self, entry: &Entry) {
        match entry {
            Entry::Frame(recorded) => self.enter_frame(recorded),
            Entry::Note(note) => self.notes.push(note.clone()),
            Entry::Log(_) => {}
        }
    }

    /// Counts a frame.
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

    /// Number of records by kind.
    pub const fn kinds(&self) -> &BTreeMap<&'static str, u64> {
        &self.kinds
    }

    /// Number of all records.
    pub fn frames(&self) -> u64 {
        self.kinds.values().sum()
    }

    /// Losses of each boot.
    pub fn boots(&self) -> Vec<BootLosses> {
        self.boots.iter().map(BootLosses::from).collect()
    }

    /// Arrival of the first record, ns since 1970.
    pub fn began_ns(&self) -> Option<u64> {
        self.span_ns.map(|(first_ns, _)| first_ns)
    }

    /// Time from the first to the last arrival, s.
    pub fn duration_s(&self) -> f64 {
        let (first_ns, last_ns) = self.span_ns.unwrap_or_default();
        last_ns.saturating_sub(first_ns) as f64 / NS_PER_S as f64
    }

    /// The notes with a name.
    pub fn notes(&self, name: &str) -> impl Iterator<Item = &Note> {
        self.notes.iter().filter(move |note| note.name == name)
    }
}
