//! The storage on a flash with any content.
//!
//! A script is a list of steps; the byte before each step selects its kind.

use core::cell::Cell;
use core::pin::pin;
use core::task::{Context, Poll, Waker};
use std::rc::Rc;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_sim::native::Flash;
use palpate_storage::{Contents, Error, Store};
use palpate_wire::{Command, Message};

use super::reader::Reader;
use crate::hostile::configuration;

/// Largest number of steps that run; a fuzzer's scripts may be of any length.
const STEPS: usize = 64;
/// Number of operations after which a call counts as endless: 64 for every word of the area. A save
/// into an area filled with one byte, `filled-after-a-save` of the corpus, takes less than a quarter.
const PATIENCE: u64 = 64 * 0x1_0000 / 4;
/// Value of `cut` that means no power cut.
const NO_CUT: u8 = 255;

/// Checks the storage's promises on a script.
pub(super) fn run(script: &[u8]) -> Result<(), String> {
    let mut reader = Reader(script);
    let mut bench = StorageBench {
        flash: Flash::new(),
        saved: Vec::new(),
        patience: Rc::default(),
    };
    for _ in 0..STEPS {
        if reader.0.is_empty() {
            break;
        }
        bench.step(&mut reader)?;
    }
    bench.read()?;
    bench.can_be_used_again()
}

/// A flash, and the configurations stored in it.
struct StorageBench {
    flash: Flash,
    /// Every configuration that a save has started to store.
    saved: Vec<Vec<Command>>,
    /// Operations left until a call counts as endless.
    patience: Rc<Cell<u64>>,
}

impl StorageBench {
    fn step(&mut self, reader: &mut Reader<'_>) -> Result<(), String> {
        match reader.byte() % 8 {
            0 | 1 => {
                let (place, bytes) = (reader.number(), reader.bytes());
                self.change(place.into(), |to| {
                    for (to, byte) in to.iter_mut().zip(bytes) {
                        *to = *byte;
                    }
                });
            }
            2 => {
                let (place, length) = (reader.number(), usize::from(reader.number()));
                let byte = reader.byte();
                self.change(place.into(), |to| {
                    to.iter_mut().take(length).for_each(|to| *to = byte);
                });
            }
            3 => {
                let (from, to) = (reader.byte(), reader.byte());
                self.copy_sector(usize::from(from) % 16, usize::from(to) % 16);
            }
            4 => self.read()?,
            5 => {
                let count = usize::from(reader.byte());
                self.save(count, reader.byte())?;
            }
            6 => {
                let cut = reader.byte();
                self.open(cut)?.map_or(Ok(()), |mut store| {
                    bearable(self.call(store.erase())?).map(drop)
                })?;
            }
            _ => self.put_out_of_order(reader.bytes())?,
        }
        Ok(())
    }

    /// Runs a call and returns its result; the call must end without waiting.
    fn call<T>(&self, future: impl Future<Output = T>) -> Result<T, String> {
        self.patience.set(PATIENCE);
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(done) => Ok(done),
            Poll::Pending => Err("the storage waits for nothing".to_owned()),
        }
    }

    fn change(&mut self, place: usize, change: impl FnOnce(&mut [u8])) {
        self.flash
            .with_bytes(|bytes| bytes.get_mut(place..).map(change));
    }

    fn copy_sector(&mut self, from: usize, to: usize) {
        let sector = <Flash as NorFlash>::ERASE_SIZE;
        self.flash
            .with_bytes(|bytes| bytes.copy_within(from * sector..(from + 1) * sector, to * sector));
    }

    /// Opens the storage; `None` if the power fails meanwhile.
    fn open(&self, cut: u8) -> Result<Option<Store<Meter>>, String> {
        let meter = Meter {
            flash: self.flash.clone(),
            patience: Rc::clone(&self.patience),
            power: (cut != NO_CUT).then_some(cut),
            has_changed: false,
        };
        bearable(self.call(Store::open(meter, 0..0x1_0000))?)
    }

    /// Checks that a complete configuration is one of the saved ones, and that reading changes
    /// nothing.
    fn read(&mut self) -> Result<(), String> {
        let Some(mut store) = self.open(NO_CUT)? else {
            return Ok(());
        };
        let mut commands = Vec::new();
        while let Some(Some(command)) = bearable(self.call(store.next(&DEFAULT_SETTINGS))?)? {
            if let Err(invalid) = command.validate() {
                return Err(format!("a command out of its limits is read: {invalid:?}"));
            }
            commands.push(command);
        }
        let contents = store.contents();
        if matches!(contents, Contents::Whole(_)) && !self.saved.contains(&commands) {
            return Err(format!("{contents:?}, which was never saved: {commands:?}"));
        }
        if store.into_flash().has_changed {
            return Err("to read has changed the flash".to_owned());
        }
        Ok(())
    }

    /// Saves a part of a configuration; the power may fail after `cut` changes.
    fn save(&mut self, count: usize, cut: u8) -> Result<(), String> {
        let all = configuration();
        let commands = all.get(..count % (all.len() + 1)).unwrap_or_default();
        let Some(mut store) = self.open(cut)? else {
            return Ok(());
        };
        self.saved.push(commands.to_vec());
        if bearable(self.call(store.begin())?)?.is_none() {
            return Ok(());
        }
        for command in commands {
            if bearable(self.call(store.put(command))?)?.is_none() {
                return Ok(());
            }
        }
        bearable(self.call(store.commit())?).map(drop)
    }

    /// Sends commands in any order; the storage refuses most of them.
    fn put_out_of_order(&mut self, order: &[u8]) -> Result<(), String> {
        let all = configuration();
        let Some(mut store) = self.open(NO_CUT)? else {
            return Ok(());
        };
        let mut put = Vec::new();
        for &of in order {
            let command = all.get(usize::from(of) % (all.len() + 1));
            let done = match command {
                Some(command) => self.call(store.put(command))?,
                None => {
                    put.clear();
                    self.call(store.begin())?
                }
            };
            let done = bearable(done)?.is_some();
            if let Some(command) = command.filter(|_| done) {
                put.push(command.clone());
            }
        }
        self.saved.push(put);
        bearable(self.call(store.commit())?).map(drop)
    }

    /// Checks that a storage with any content can be erased, and used after that.
    fn can_be_used_again(&mut self) -> Result<(), String> {
        let Some(mut store) = self.open(NO_CUT)? else {
            return Err("it cannot be opened".to_owned());
        };
        match self.call(store.erase())? {
            Ok(()) => {}
            // The storage ends for good before its save numbers wrap.
            Err(Error::Exhausted) => return Ok(()),
            Err(error) => return Err(format!("it cannot be erased: {error}")),
        }
        if store.contents() != Contents::Empty {
            return Err(format!("{:?} after it was erased", store.contents()));
        }
        drop(store);
        self.save(usize::MAX, NO_CUT)?;
        let store = self.open(NO_CUT)?;
        let contents = store.map(|store| store.contents());
        let is_whole = matches!(contents, Some(Contents::Whole(_)));
        if !is_whole {
            return Err(format!("{contents:?} after a save"));
        }
        self.read()
    }
}

/// Maps a permitted error to `None`; any other error is a defect.
fn bearable<T>(result: Result<T, Error<Failure>>) -> Result<Option<T>, String> {
    match result {
        Ok(result) => Ok(Some(result)),
        Err(error @ (Error::Flash(Failure::Endless | Failure::Misused) | Error::Range)) => {
            Err(error.to_string())
        }
        Err(_) => Ok(None),
    }
}

/// A flash that counts operations, and whose power can fail.
struct Meter {
    flash: Flash,
    /// Operations left until a call counts as endless.
    patience: Rc<Cell<u64>>,
    /// Changes left until the power fails.
    power: Option<u8>,
    has_changed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Failure {
    /// More operations than any call may take.
    Endless,
    /// An address outside of the flash.
    Misused,
    PowerCut,
}

impl NorFlashError for Failure {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Meter {
    fn count(&mut self) -> Result<(), Failure> {
        let left = self.patience.get().checked_sub(1);
        self.patience.set(left.ok_or(Failure::Endless)?);
        match self.power {
            Some(0) => Err(Failure::PowerCut),
            _ => Ok(()),
        }
    }

    fn count_change(&mut self) -> Result<(), Failure> {
        self.count()?;
        self.has_changed = true;
        self.power = self.power.map(|left| left - 1);
        Ok(())
    }
}

impl ErrorType for Meter {
    type Error = Failure;
}

impl ReadNorFlash for Meter {
    const READ_SIZE: usize = Flash::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        self.count()?;
        let read = self.flash.read(offset, bytes).await;
        read.map_err(|_| Failure::Misused)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for Meter {
    const WRITE_SIZE: usize = Flash::WRITE_SIZE;
    const ERASE_SIZE: usize = Flash::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        self.count_change()?;
        let erased = self.flash.erase(from, to).await;
        erased.map_err(|_| Failure::Misused)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        self.count_change()?;
        let written = self.flash.write(offset, bytes).await;
        written.map_err(|_| Failure::Misused)
    }
}
