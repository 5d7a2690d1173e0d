//! Storage: carries out the procedure's orders with [`palpate_storage`].
//!
//! It runs at the lowest priority and works in small steps.

use embedded_storage_async::nor_flash::NorFlash;
use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_procedure::storage::{StorageFailure, StorageOrder, StorageReport, Stored};
use palpate_storage::{Contents, Error, Store};
use palpate_wire::Command;
use palpate_wire::code::StorageState;
use palpate_wire::command::CalibrationIdentity;

/// Storage of settings and calibration in a range of flash.
#[derive(Debug)]
pub struct StorageTask<F> {
    /// The flash, before it is opened.
    flash: Option<F>,
    /// The opened store, from the first order on; `None` if the flash cannot be used.
    store: Option<Store<F>>,
    /// Identity of the stored calibration, as far as it was read.
    identity: Option<CalibrationIdentity>,
    /// Identity of the calibration that is being saved.
    put: Option<CalibrationIdentity>,
    is_loading: bool,
}

impl<F: NorFlash> StorageTask<F> {
    /// Creates a storage that uses all of a flash, real or simulated. Does not read it yet.
    pub const fn new(flash: F) -> Self {
        Self {
            flash: Some(flash),
            store: None,
            identity: None,
            put: None,
            is_loading: false,
        }
    }

    /// Returns whether a part of the last order is still to be reported.
    pub const fn is_going(&self) -> bool {
        self.is_loading
    }

    /// Works on a new order or, without one, on the rest of the last one. Call it again for as long as
    /// it returns a report.
    pub async fn work(&mut self, order: Option<StorageOrder>) -> Option<StorageReport> {
        self.open().await;
        let Some(order) = order else {
            return self.go_on().await;
        };
        let result = match order {
            StorageOrder::Load => {
                self.is_loading = true;
                self.identity = None;
                self.rewind();
                return self.go_on().await;
            }
            StorageOrder::Begin => {
                self.put = None;
                self.begin().await
            }
            StorageOrder::Put(command) => self.put(&command).await,
            StorageOrder::Inspect => return Some(self.inspect().await),
            StorageOrder::Commit => return Some(self.commit().await),
            StorageOrder::Erase => return Some(self.erase().await),
        };
        Some(match result {
            Ok(()) => StorageReport::Ready,
            Err(failure) => self.done(Some(failure)),
        })
    }

    async fn open(&mut self) {
        if let Some(flash) = self.flash.take() {
            let end = flash.capacity();
            if let Ok(end) = u32::try_from(end) {
                self.store = Store::open(flash, 0..end).await.ok();
            }
        }
    }

    fn rewind(&mut self) {
        if let Some(store) = &mut self.store {
            store.rewind();
        }
    }

    /// Reports the next command of a load.
    async fn go_on(&mut self) -> Option<StorageReport> {
        if !self.is_loading {
            return None;
        }
        Some(match self.next().await {
            Ok(Some(command)) => StorageReport::Item(command),
            Ok(None) => {
                self.is_loading = false;
                self.done(None)
            }
            Err(failure) => {
                self.is_loading = false;
                self.done(Some(failure))
            }
        })
    }

    /// Returns the next stored command. Keeps the calibration identity when it is read.
    async fn next(&mut self) -> Result<Option<Command>, StorageFailure> {
        let store = self.store.as_mut().ok_or(StorageFailure::Absent)?;
        let next = store.next(&DEFAULT_SETTINGS).await.map_err(failure)?;
        if let Some(Command::SetCalibrationIdentity(identity)) = &next {
            self.identity = Some(identity.clone());
        }
        Ok(next)
    }

    async fn inspect(&mut self) -> StorageReport {
        self.identity = None;
        self.rewind();
        loop {
            match self.next().await {
                Ok(Some(_)) => {}
                Ok(None) => return self.done(None),
                Err(failure) => return self.done(Some(failure)),
            }
        }
    }

    async fn begin(&mut self) -> Result<(), StorageFailure> {
        let store = self.store.as_mut().ok_or(StorageFailure::Absent)?;
        store.begin().await.map_err(failure)
    }

    async fn put(&mut self, command: &Command) -> Result<(), StorageFailure> {
        if let Command::SetCalibrationIdentity(identity) = command {
            self.put = Some(identity.clone());
        }
        let store = self.store.as_mut().ok_or(StorageFailure::Absent)?;
        store.put(command).await.map_err(failure)
    }

    async fn commit(&mut self) -> StorageReport {
        let result = match &mut self.store {
            Some(store) => store.commit().await.map_err(failure),
            None => Err(StorageFailure::Absent),
        };
        if result.is_ok() {
            self.identity = self.put.take();
        }
        self.done(result.err())
    }

    async fn erase(&mut self) -> StorageReport {
        let result = match &mut self.store {
            Some(store) => store.erase().await.map_err(failure),
            None => Err(StorageFailure::Absent),
        };
        if result.is_ok() {
            self.identity = None;
        }
        self.done(result.err())
    }

    fn done(&self, failure: Option<StorageFailure>) -> StorageReport {
        let contents = self.store.as_ref().map(Store::contents);
        let stored = match contents {
            Some(Contents::Whole(set)) => Stored {
                state: StorageState::Whole,
                generation: set.generation,
                configuration_crc: set.configuration_crc,
                items: set.items,
                unknown_items: set.unknown_items,
                identity: self.identity.clone(),
            },
            Some(Contents::Empty) => nothing(StorageState::Empty),
            Some(Contents::Damaged) => nothing(StorageState::Damaged),
            Some(Contents::Newer) => nothing(StorageState::Newer),
            None => Stored::UNAVAILABLE,
        };
        StorageReport::Done { failure, stored }
    }
}

const fn nothing(state: StorageState) -> Stored {
    Stored {
        state,
        ..Stored::UNAVAILABLE
    }
}

/// Converts an error of the storage to the procedure's failure.
fn failure<E>(error: Error<E>) -> StorageFailure {
    match error {
        Error::Damaged | Error::Newer | Error::Unreadable { .. } | Error::Invalid(_) => {
            StorageFailure::Damaged
        }
        Error::Range => StorageFailure::Absent,
        _ => StorageFailure::Flash,
    }
}
