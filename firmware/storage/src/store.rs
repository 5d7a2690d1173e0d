//! Opening, reading and erasing the storage.

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use palpate_wire::command::Settings;
use palpate_wire::{Command, Message};

use crate::area::Area;
use crate::item::Item;
use crate::reader::Reader;
use crate::save_state::Save;
use crate::scan::{Located, Survey};
use crate::seal::Sum;
use crate::{Contents, Error, knows, parts, settings};

/// Settings and calibration in a range of flash.
///
/// One operation runs at a time: [`next`](Self::next) reads the stored set, command by command;
/// [`begin`](Self::begin), [`put`](Self::put) and [`commit`](Self::commit) replace all of it.
///
/// Do not drop a future before it has ended: the flash would be left as after a power cut, and an error
/// would be lost. If the flash driver never waits, poll each future once.
#[derive(Debug)]
pub struct Store<S> {
    pub(crate) area: Area<S>,
    pub(crate) survey: Survey,
    pub(crate) reader: Reader,
    /// The set that [`Self::next`] reads.
    reading: Option<Located>,
    pub(crate) save: Option<Save>,
}

impl<S: NorFlash> Store<S> {
    /// Opens the storage in a range of flash; writes nothing. Addresses are those of the flash driver,
    /// in bytes. The range holds two slots of at least two sectors, half each, and every bit of it
    /// belongs to the storage. A word, the larger of `READ_SIZE` and `WRITE_SIZE`, may have 32 bytes;
    /// each item is padded to words, and with more than 8 bytes the largest calibration does not fit 64
    /// KiB.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] for an unusable range, and [`Error::Flash`]. The content of the flash is not an
    /// error: see [`contents`](Self::contents).
    pub async fn open(flash: S, range: Range<u32>) -> Result<Self, Error<S::Error>> {
        let mut area = Area::new(flash, &range)?;
        let survey = Survey::of(&mut area).await?;
        Ok(Self {
            area,
            survey,
            reader: Reader::new(),
            reading: survey.stored,
            save: None,
        })
    }

    /// Returns the content of the storage when it was opened, or when the last save or erasure ended.
    pub const fn contents(&self) -> Contents {
        self.survey.contents
    }

    /// Returns whether a save after the stored set was interrupted.
    pub const fn is_interrupted(&self) -> bool {
        self.survey.is_interrupted
    }

    /// Returns the flash.
    pub fn into_flash(self) -> S {
        self.area.into_flash()
    }

    /// Lets [`next`](Self::next) start again.
    pub fn rewind(&mut self) {
        self.reading = self.survey.stored;
        self.reader.rewind();
    }

    /// Lets [`next`](Self::next) read the set before the damaged one. Returns `false` if there is none.
    pub fn rewind_to_older(&mut self) -> bool {
        self.rewind();
        self.reading = self.survey.older;
        self.reading.is_some()
    }

    /// Returns the next command that sets the stored configuration: settings first, then the parts of
    /// the calibration in the order in which they must be set. `None` after the last, and without a
    /// stored set. A setting that is not stored has its value in `defaults`; if no setting is stored,
    /// there is no command for settings.
    ///
    /// # Errors
    ///
    /// [`Error::Damaged`] and [`Error::Newer`] if the stored set cannot be read, [`Error::Saving`]
    /// during a save, and [`Error::Flash`]. After [`Error::Invalid`] and [`Error::Unreadable`] the next
    /// call continues with the next command.
    pub async fn next(&mut self, defaults: &Settings) -> Result<Option<Command>, Error<S::Error>> {
        if self.save.is_some() {
            return Err(Error::Saving);
        }
        let Some(set) = self.reading else {
            return self.nothing_to_read();
        };
        while let Some(item) = self.reader.peek(&mut self.area, &set).await? {
            if !knows(item.key, item.version) {
                self.reader.advance();
            } else if item.key.number == settings::NUMBER {
                let settings = self.settings(&set, defaults).await?;
                return checked(Command::SetSettings(settings)).map(Some);
            } else {
                self.reader.advance();
                let command = parts::command(&item).ok_or_else(|| unreadable(&item))?;
                return checked(command).map(Some);
            }
        }
        Ok(None)
    }

    /// Returns why there is no set to read.
    fn nothing_to_read(&self) -> Result<Option<Command>, Error<S::Error>> {
        match self.survey.contents {
            Contents::Damaged { .. } => Err(Error::Damaged),
            Contents::Newer => Err(Error::Newer),
            Contents::Empty | Contents::Whole(_) => Ok(None),
        }
    }

    /// Collects the settings, one item each.
    async fn settings(
        &mut self,
        set: &Located,
        defaults: &Settings,
    ) -> Result<Settings, Error<S::Error>> {
        let mut settings = defaults.clone();
        let mut result = Ok(());
        while let Some(item) = self.reader.peek(&mut self.area, set).await?
            && item.key.number == settings::NUMBER
        {
            self.reader.advance();
            if settings::take(&mut settings, &item).is_none() {
                result = Err(unreadable(&item));
            }
        }
        result.map(|()| settings)
    }

    /// Erases the storage, including unreadable and unknown items. A power cut leaves all or nothing of
    /// it.
    ///
    /// # Errors
    ///
    /// [`Error::Flash`], [`Error::NotKept`] and [`Error::Exhausted`]. Ends a save in progress.
    pub async fn erase(&mut self) -> Result<(), Error<S::Error>> {
        self.save = None;
        let target = self.survey.target;
        let is_empty = self.survey.contents == Contents::Empty;
        self.area.clear(target).await?;
        if !is_empty {
            // Saves an empty set, which replaces the stored one atomically.
            let erased = self.next_generation()?;
            let nothing = Sum {
                erased,
                ..Sum::NOTHING
            };
            self.seal(target, erased, &nothing).await?;
        }
        if !is_empty || self.survey.stored.is_none() {
            self.area.clear(target.other()).await?;
        }
        self.survey_again().await?;
        match self.survey.contents {
            Contents::Empty => Ok(()),
            _ => Err(Error::NotKept),
        }
    }

    /// Reads the content of the flash again.
    pub(crate) async fn survey_again(&mut self) -> Result<(), Error<S::Error>> {
        self.survey = Survey::of(&mut self.area).await?;
        self.rewind();
        Ok(())
    }

    pub(crate) fn next_generation(&self) -> Result<u32, Error<S::Error>> {
        self.survey
            .generation
            .checked_add(1)
            .ok_or(Error::Exhausted)
    }
}

fn unreadable<E>(item: &Item) -> Error<E> {
    Error::Unreadable {
        number: item.key.number,
    }
}

fn checked<E>(command: Command) -> Result<Command, Error<E>> {
    command.validate().map_err(Error::Invalid)?;
    Ok(command)
}
