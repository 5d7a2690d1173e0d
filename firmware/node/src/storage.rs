//! The storage: carries out what the procedure orders, by [`palpate_storage`].
//!
//! It runs beside everything else and below it, and does a little at a time.

use embedded_storage_async::nor_flash::NorFlash;
use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_procedure::storage::{StorageFailure, StorageOrder, StorageReport, Stored};
use palpate_storage::{Contents, Error, Store};
use palpate_wire::Command;
use palpate_wire::code::StorageState;
use palpate_wire::command::CalibrationIdentity;

/// Keeps settings and calibration in a range of flash.
#[derive(Debug)]
pub struct StorageTask<F> {
    /// The flash, before it was looked at.
    flash: Option<F>,
    /// From the first order on; nothing if the flash cannot be used.
    store: Option<Store<F>>,
    /// Which calibration is stored, as far as it was read.
    identity: Option<CalibrationIdentity>,
    /// That of a save.
    put: Option<CalibrationIdentity>,
    is_loading: bool,
}

impl<F: NorFlash> StorageTask<F> {
    /// A storage that takes all of a flash, or of what stands for one. Looks at nothing yet.
    pub const fn new(flash: F) -> Self {
        Self {
            flash: Some(flash),
            store: None,
            identity: None,
            put: None,
            is_loading: false,
        }
    }

    /// Whether something of the last order is still to be reported.
    pub const fn is_going(&self) -> bool {
        self.is_loading
    }

    /// Goes on: with an order, if there is one, or with what is still to be reported of the last.
    /// Called again for as long as it reports something.
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
                self.begin()
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

    /// The next command of a load.
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

    /// The next command that is stored. The identity that passes by is kept.
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

    fn begin(&mut self) -> Result<(), StorageFailure> {
        let store = self.store.as_mut().ok_or(StorageFailure::Absent)?;
        store.begin().map_err(failure)
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
            Some(Contents::Damaged { .. }) => nothing(StorageState::Damaged),
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

/// What the storage failed of, as the procedure has it.
fn failure<E>(error: Error<E>) -> StorageFailure {
    match error {
        Error::Damaged | Error::Newer | Error::Unreadable { .. } | Error::Invalid(_) => {
            StorageFailure::Damaged
        }
        Error::Range => StorageFailure::Absent,
        _ => StorageFailure::Flash,
    }
}
