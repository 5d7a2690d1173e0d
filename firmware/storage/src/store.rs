//! Opening, reading and erasing the storage.

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use palpate_wire::command::Settings;
use palpate_wire::{Command, Message};

use crate::area::Area;
use crate::item::Item;
use crate::save::Save;
use crate::scan::Survey;
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
    /// Number of items that [`Self::next`] has passed.
    passed: u16,
    pub(crate) save: Option<Save>,
}

impl<S: NorFlash> Store<S> {
    /// Opens the storage in a range of flash; writes nothing. Addresses are those of the flash driver,
    /// in bytes. The range holds two slots of whole sectors, half each, and every bit of it belongs to the
    /// storage. A word, the larger of `READ_SIZE` and `WRITE_SIZE`, may have 32 bytes; each item is padded
    /// to words.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] for an unusable range, and [`Error::Flash`]. The content of the flash is not an
    /// error: see [`contents`](Self::contents).
    pub async fn open(flash: S, range: Range<u32>) -> Result<Self, Error<S::Error>> {
        let mut area = Area::new(flash, &range)?;
        Ok(Self {
            survey: Survey::of(&mut area).await?,
            area,
            passed: 0,
            save: None,
        })
    }

    /// Returns the content of the storage when it was opened, or when the last save or erasure ended.
    pub const fn contents(&self) -> Contents {
        self.survey.contents
    }

    /// Returns the flash.
    pub fn into_flash(self) -> S {
        self.area.into_flash()
    }

    /// Lets [`next`](Self::next) start again.
    pub const fn rewind(&mut self) {
        self.passed = 0;
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
        let Some(set) = self.survey.stored else {
            return match self.survey.contents {
                Contents::Newer => Err(Error::Newer),
                Contents::Empty => Ok(None),
                Contents::Damaged | Contents::Whole(_) => Err(Error::Damaged),
            };
        };
        let mut search = Search {
            before: self.passed,
            passed: 0,
            found: None,
        };
        let mut take = |item| search.goes_on(&item, defaults);
        self.area.read_set(&set, &mut take).await?;
        self.passed = search.passed;
        let Some((number, command)) = search.found else {
            return Ok(None);
        };
        let command = command.ok_or(Error::Unreadable { number })?;
        command.validate().map_err(Error::Invalid)?;
        Ok(Some(command))
    }

    /// Erases the storage, including unreadable and unknown items. After a power cut, either all or none
    /// of it is erased.
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
                ..Sum::default()
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

/// Search for the next command in one pass over a set.
struct Search {
    /// Number of items that earlier searches have passed.
    before: u16,
    /// Number of items so far.
    passed: u16,
    /// Number of the command's kind, and the command; `None` if an item of it is unreadable.
    found: Option<(u8, Option<Command>)>,
}

impl Search {
    /// Takes an item. Returns `false` once the command is complete.
    fn goes_on(&mut self, item: &Item, defaults: &Settings) -> bool {
        let number = item.key.number;
        let is_of_settings = number == settings::NUMBER;
        if self.found.is_some() && !is_of_settings {
            return false;
        }
        self.passed = self.passed.saturating_add(1);
        if self.passed <= self.before || !knows(item.key, item.version) {
            return true;
        }
        if !is_of_settings {
            self.found = Some((number, parts::command(item)));
            return false;
        }
        let start = || (number, Some(Command::SetSettings(defaults.clone())));
        let (_, command) = self.found.get_or_insert_with(start);
        if let Some(Command::SetSettings(settings)) = command
            && settings::take(settings, item).is_none()
        {
            *command = None;
        }
        true
    }
}
