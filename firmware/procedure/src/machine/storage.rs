//! Control of the storage: one operation at a time, order by order.
//!
//! While the storage is busy, no setting or drive is allowed, so the stored and the active configuration
//! agree and the bridge stays off.

use palpate_model::units::Second;
use palpate_wire::Record;
use palpate_wire::code::{FaultCode, Location, Outcome, StorageAction, StorageState};
use palpate_wire::command::CurrentCorrection;
use palpate_wire::record;

use super::state::{Storage, Work};
use super::{Out, Procedure};
use crate::action::Action;
use crate::board::MOST_CRASHES;
use crate::configuration::Cursor;
use crate::event::Failure;
use crate::list::gathered;
use crate::storage::{StorageFailure, StorageOrder, StorageReport};
use crate::time::{Duration, between, in_seconds, seconds};

/// Time limit of a storage operation. The largest save programs 70 KiB at 3 ms per page and erases 16
/// sectors at 0.4 s (W25Q16JV datasheet, 9.6, maximum times): 7.3 s; before it the bridge must rest for
/// 0.2 s.
const LONGEST: Duration = Duration::from_ticks(15_000_000);

/// Time limit of the load at start-up, which only reads and takes a tenth of this limit.
const LONGEST_AT_START: Duration = Duration::from_ticks(1_000_000);

impl Procedure {
    /// Starts loading the stored configuration before all other work. After a streak of crashes, which
    /// the configuration may have caused, the storage is only inspected.
    pub(super) fn begin_storage(&mut self, out: &mut Out<'_>) {
        let (action, order) = if self.board.crashes >= MOST_CRASHES {
            (StorageAction::Inspect, StorageOrder::Inspect)
        } else {
            (StorageAction::Load, StorageOrder::Load)
        };
        self.begin_work(action, order, out);
    }

    pub(super) fn store(&mut self, out: &mut Out<'_>) -> Outcome {
        if let Err(outcome) = self.may_use_storage() {
            return outcome;
        }
        if !self.check_all(out) {
            return Outcome::Faulted;
        }
        let stored = &self.storage.stored;
        let is_sound = matches!(stored.state, StorageState::Whole | StorageState::Empty);
        let order = if is_sound && stored.configuration_crc == self.configuration.crc() {
            // The active configuration is stored already; writing it again would only wear the flash.
            StorageOrder::Inspect
        } else {
            StorageOrder::Begin
        };
        self.begin_work(StorageAction::Store, order, out);
        Outcome::Accepted
    }

    pub(super) fn load(&mut self, out: &mut Out<'_>) -> Outcome {
        if let Err(outcome) = self.may_use_storage() {
            return outcome;
        }
        if self.storage.stored.state != StorageState::Whole {
            return Outcome::NothingStored;
        }
        self.begin_work(StorageAction::Load, StorageOrder::Load, out);
        Outcome::Accepted
    }

    pub(super) fn erase(&mut self, out: &mut Out<'_>) -> Outcome {
        if let Err(outcome) = self.may_use_storage() {
            return outcome;
        }
        self.begin_work(StorageAction::Erase, StorageOrder::Erase, out);
        Outcome::Accepted
    }

    fn may_use_storage(&self) -> Result<(), Outcome> {
        if self.armed {
            return Err(Outcome::Armed);
        }
        if self.is_occupied() || self.phase.activity().drives() {
            return Err(Outcome::Busy);
        }
        match self.storage.stored.state {
            StorageState::Unavailable => Err(Outcome::NoStorage),
            _ => Ok(()),
        }
    }

    fn begin_work(&mut self, action: StorageAction, order: StorageOrder, out: &mut Out<'_>) {
        self.storage.work = Some(Work {
            action,
            since: out.now,
            put: Cursor::default(),
            has_items: false,
        });
        out.push(Action::Storage(order));
    }

    /// Returns whether flash can be read: it is not being erased or programmed, and no operation that
    /// might do so was abandoned. Code that sets the configuration, drives the coil or computes an
    /// estimate may be in flash (`firmware/build.rs`).
    pub(super) const fn can_read_flash(&self) -> bool {
        !(self.storage.is_at_work() || self.storage.is_abandoned)
    }

    /// Handles a report of the storage. Reports of an abandoned operation are ignored.
    pub(super) fn storage_reported(&mut self, report: &StorageReport, out: &mut Out<'_>) {
        let Some(work) = &mut self.storage.work else {
            return;
        };
        match report {
            StorageReport::Ready => {
                let order = match self.configuration.next_command(&mut work.put) {
                    Some(command) => StorageOrder::Put(command),
                    None => StorageOrder::Commit,
                };
                out.push(Action::Storage(order));
            }
            StorageReport::Item(command) => {
                if !core::mem::replace(&mut work.has_items, true) {
                    self.configuration.reset(&self.board);
                    self.storage.refused = 0;
                }
                let outcome = self.configuration.set(command, &self.board);
                if outcome != Some(Outcome::Accepted.into()) {
                    self.storage.refused = self.storage.refused.saturating_add(1);
                }
            }
            StorageReport::Done { failure, stored } => {
                let Work { action, since, .. } = *work;
                let has_loaded = work.has_items;
                self.storage.work = None;
                self.storage.stored = stored.clone();
                if has_loaded {
                    self.loaded(*failure, out);
                }
                let took = seconds(since, out.now);
                if !self.greeted {
                    self.greet(out);
                }
                let record = self.storage_record(action, failure.is_none(), took);
                out.record(Record::Storage(record));
                if let Some(failure) = failure {
                    self.storage_failed(*failure, out);
                }
            }
        }
    }

    /// Applies a loaded configuration and discards all state that depends on the previous one. If a part
    /// could not be read, applies the default configuration.
    fn loaded(&mut self, failure: Option<StorageFailure>, out: &mut Out<'_>) {
        if failure.is_some() {
            self.configuration.reset(&self.board);
        }
        self.follow_heat();
        let correction = self.configuration.current_correction().cloned();
        let correction = correction.unwrap_or_else(no_correction);
        out.push(Action::CorrectCurrent(correction));
        self.begin_baseline();
        if self.greeted {
            self.configure_sensors(out);
            self.next_status = self.status_after(out.now);
            self.sense_anew(out);
        }
    }

    fn storage_failed(&mut self, failure: StorageFailure, out: &mut Out<'_>) {
        let code = match failure {
            StorageFailure::Damaged => FaultCode::StorageDamaged,
            StorageFailure::Flash => FaultCode::StorageFailed,
            // A board without storage keeps working.
            StorageFailure::Absent => return,
        };
        let state = self.storage.stored.state.number();
        let failure = Failure {
            value: Some(state.into()),
            ..Failure::new(code, Location::Storage)
        };
        self.fail(failure, out);
    }

    /// Abandons an operation that does not end; the storage gets no further order.
    pub(super) fn watch_storage(&mut self, out: &mut Out<'_>) {
        let Some(Work { since, .. }) = self.storage.work else {
            return;
        };
        let takes = between(since, out.now);
        let longest = if self.greeted {
            LONGEST
        } else {
            LONGEST_AT_START
        };
        if takes <= longest {
            return;
        }
        self.storage = Storage {
            is_abandoned: true,
            ..Storage::new()
        };
        if !self.greeted {
            self.greet(out);
        }
        let failure = Failure {
            value: Some(in_seconds(takes).0),
            limit: Some(in_seconds(longest).0),
            ..Failure::new(FaultCode::Overrun, Location::Storage)
        };
        self.fail(failure, out);
    }

    pub(super) fn storage_record(
        &self,
        action: StorageAction,
        succeeded: bool,
        took: Second,
    ) -> record::Storage {
        let Storage {
            stored, refused, ..
        } = &self.storage;
        let identity = stored.identity.as_ref();
        record::Storage {
            action,
            succeeded,
            state: stored.state,
            generation: stored.generation,
            stored_crc: stored.configuration_crc,
            in_force_crc: self.configuration.crc(),
            items: stored.items,
            unknown_items: stored.unknown_items,
            refused_items: *refused,
            calibration_id: identity.map(|of| of.id),
            calibrated_at_s: identity.map(|of| of.calibrated_at_s),
            calibrated_at_c: identity.map(|of| of.calibrated_at_c),
            calibration_hash: identity.map(|of| of.hash),
            took_s: took.0,
        }
    }
}

/// Correction that leaves every current unchanged.
fn no_correction() -> CurrentCorrection {
    CurrentCorrection {
        greatest_a: 1.0,
        changes_a: gathered([0.0; 2].into_iter()),
    }
}
