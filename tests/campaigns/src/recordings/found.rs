//! Content of a recording that another process has written.

use std::path::Path;

use palpate::recording::{Contents, Entry, Reader};
use palpate_cli::failure::Failure;
use palpate_wire::Record;
use palpate_wire::record::Sample;

/// Content of a recording's file.
#[derive(Default)]
pub(super) struct RecordingContents {
    pub(super) contents: Contents,
    pub(super) samples: u64,
    /// Number of missing scans that the samples report.
    pub(super) missed: u64,
    /// Arrival of the last record, ns since 1970.
    pub(super) last_ns: Option<u64>,
}

impl RecordingContents {
    /// Number of records missing between the first and the last.
    pub(super) fn missing(&self) -> u64 {
        self.contents.boots().iter().map(|boot| boot.missing).sum()
    }

    fn sample(&mut self, sample: &Sample) {
        self.samples += 1;
        // Losses before the first record do not belong to this recording.
        if self.samples > 1 {
            self.missed += u64::from(sample.missed);
        }
    }
}

/// Reads a file as far as possible.
pub(super) fn read(file: &Path) -> Result<RecordingContents, Failure> {
    let mut found = RecordingContents::default();
    for entry in &mut Reader::open(file)? {
        found.contents.enter(&entry);
        if let Entry::Frame(recorded) = &entry {
            found.last_ns = Some(recorded.host_ns);
            if let Record::Sample(sample) = &recorded.frame.message {
                found.sample(sample);
            }
        }
    }
    Ok(found)
}
