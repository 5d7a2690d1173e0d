//! The storage: opening, reading, erasing.

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use palpate_wire::command::Settings;
use palpate_wire::{Command, Message};

use crate::area::Area;
use crate::item::Item;
use crate::reader::Reader;
use crate::save::Save;
use crate::scan::{Located, Survey};
use crate::seal::Sum;
use crate::{Error, knows, parts, settings};

/// A whole set of items.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Set {
    /// Number of the save, counted from 1 since all was erased. A save that was cut off or found
    /// nothing to change does not count.
    pub generation: u32,
    /// Items: one for each setting, and one for each part of the calibration or chunk of it.
    pub items: u16,
    /// Of these, items that this firmware does not know. A save keeps them.
    pub unknown_items: u16,
    /// [`configuration_crc`](palpate_wire::configuration_crc) over the commands that were saved.
    pub configuration_crc: u32,
}

/// What is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// Nothing.
    Empty,
    /// A set, every bit of which is as it was saved.
    Whole(Set),
    /// Something that is not what was saved.
    Damaged {
        /// The set that was saved before it, if that is whole: not what was stored last. See
        /// [`Store::rewind_to_older`].
        older: Option<Set>,
    },
    /// A set in a format that this firmware does not know.
    Newer,
}

/// Settings and calibration in a range of flash.
///
/// One thing is done at a time: [`next`](Self::next) reads what is stored, command by command;
/// [`begin`](Self::begin), [`put`](Self::put) and [`commit`](Self::commit) replace all of it.
///
/// None of the futures may be dropped before it has ended: the flash would be left as by a power
/// cut, and an error would be lost. Where the flash driver never waits, poll them once.
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
    /// Looks at what a range of the flash holds; writes nothing. Addresses are those of the flash
    /// driver, in bytes. The range is two slots of two sectors at least, half each, and every bit
    /// of it belongs to the storage. A word, the larger of `READ_SIZE` and `WRITE_SIZE`, may have 32
    /// bytes; each item is padded to words, and with more than 8 bytes the largest calibration does
    /// not fit 64 KiB.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] for a range that cannot be used, and [`Error::Flash`]. What the flash
    /// contains is no error: see [`contents`](Self::contents).
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

    /// What was stored when the storage was opened, or the last save or erasure ended.
    pub const fn contents(&self) -> Contents {
        self.survey.contents
    }

    /// Whether a save was begun after what is stored, and cut off.
    pub const fn is_interrupted(&self) -> bool {
        self.survey.is_interrupted
    }

    /// Gives the flash back.
    pub fn into_flash(self) -> S {
        self.area.into_flash()
    }

    /// Makes [`next`](Self::next) begin anew.
    pub fn rewind(&mut self) {
        self.reading = self.survey.stored;
        self.reader.rewind();
    }

    /// Makes [`next`](Self::next) read the set that was saved before the one that is damaged. False
    /// if there is none.
    pub fn rewind_to_older(&mut self) -> bool {
        self.rewind();
        self.reading = self.survey.older;
        self.reading.is_some()
    }

    /// The next of the commands that set what is stored: settings first, then the parts of the
    /// calibration in the order in which they have to be set. `None` behind the last, and where
    /// nothing is stored. A setting that is not stored has the value that it has in `defaults`;
    /// where none is stored, there is no command for settings.
    ///
    /// # Errors
    ///
    /// [`Error::Damaged`] and [`Error::Newer`] if what is stored cannot be read, [`Error::Saving`]
    /// during a save, and [`Error::Flash`]. After [`Error::Invalid`] and [`Error::Unreadable`] the
    /// next call goes on with the next command.
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

    /// Why there is no set to read.
    fn nothing_to_read(&self) -> Result<Option<Command>, Error<S::Error>> {
        match self.survey.contents {
            Contents::Damaged { .. } => Err(Error::Damaged),
            Contents::Newer => Err(Error::Newer),
            Contents::Empty | Contents::Whole(_) => Ok(None),
        }
    }

    /// Gathers the settings, one item for each.
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

    /// Erases all that is stored, also what cannot be read and what this firmware does not know. A
    /// power cut leaves all or nothing of it.
    ///
    /// # Errors
    ///
    /// [`Error::Flash`], [`Error::NotKept`] and [`Error::Exhausted`]. It ends a save that was begun.
    pub async fn erase(&mut self) -> Result<(), Error<S::Error>> {
        self.save = None;
        let target = self.survey.target;
        let is_empty = self.survey.contents == Contents::Empty;
        self.area.clear(target).await?;
        if !is_empty {
            // A set of nothing replaces what is stored at one stroke.
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
        self.look_anew().await?;
        match self.survey.contents {
            Contents::Empty => Ok(()),
            _ => Err(Error::NotKept),
        }
    }

    /// Takes from the flash what is stored now.
    pub(crate) async fn look_anew(&mut self) -> Result<(), Error<S::Error>> {
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
