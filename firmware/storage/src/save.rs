//! Saving: replaces the stored set atomically.

use core::fmt;

use embedded_storage_async::nor_flash::NorFlash;
use palpate_wire::{Command, ConfigurationCrc, Message};

use crate::area::Slot;
use crate::item::{Item, Key};
use crate::scan::{Located, Scan};
use crate::seal::{self, Sum};
use crate::{Contents, Error, Store, knows, parts, settings};

/// Save in progress.
pub(crate) struct Save {
    slot: Slot,
    generation: u32,
    /// The stored set that is replaced.
    stored: Option<Located>,
    /// Number of items so far, and key of the last one.
    items: u16,
    last: Option<Key>,
    /// Key of the last item that the caller has put.
    put: Option<Key>,
    configuration_crc: ConfigurationCrc,
}

impl fmt::Debug for Save {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Save")
            .field("generation", &self.generation)
            .field("items", &self.items)
            .finish_non_exhaustive()
    }
}

impl Save {
    /// Returns whether a stored item that the caller did not put is the next of the save, before a key: if
    /// this firmware does not know it and the save does not replace it.
    fn keeps(&self, stored: &Item, next: Key) -> bool {
        let is_replaced = |key: Key| key.is_of_one_part(stored.key);
        let is_between = self.last < Some(stored.key) && stored.key < next;
        is_between
            && !knows(stored.key, stored.version)
            && !is_replaced(next)
            && !self.put.is_some_and(is_replaced)
    }
}

impl<S: NorFlash> Store<S> {
    /// Begins a save, which replaces the stored set except for items that this firmware does not know.
    /// Erases the save before the stored one. Abandons a save in progress.
    ///
    /// # Errors
    ///
    /// [`Error::Newer`] if a later firmware stored a set in another format, which would be lost.
    /// [`Error::Exhausted`] and [`Error::Flash`].
    pub async fn begin(&mut self) -> Result<(), Error<S::Error>> {
        self.abandon();
        if self.survey.contents == Contents::Newer {
            return Err(Error::Newer);
        }
        let generation = self.next_generation()?;
        self.area.clear(self.survey.target).await?;
        self.save = Some(Save {
            slot: self.survey.target,
            generation,
            stored: self.survey.stored,
            items: 0,
            last: None,
            put: None,
            configuration_crc: ConfigurationCrc::new(),
        });
        Ok(())
    }

    /// Abandons a save in progress; the stored set remains.
    pub fn abandon(&mut self) {
        self.save = None;
        self.rewind();
    }

    /// Adds a command: settings first, then the parts in the order of
    /// [`configuration_crc`](palpate_wire::configuration_crc).
    ///
    /// # Errors
    ///
    /// [`Error::NotBegun`], [`Error::NotASetter`], [`Error::Invalid`], [`Error::OutOfOrder`],
    /// [`Error::Full`], [`Error::Flash`], and [`Error::Damaged`] if the flash has changed since it was
    /// opened. Each of them ends the save; the stored set remains.
    pub async fn put(&mut self, command: &Command) -> Result<(), Error<S::Error>> {
        let result = self.put_all(command).await;
        if result.is_err() {
            self.abandon();
        }
        result
    }

    /// Completes a save, which makes it the stored set as a whole.
    ///
    /// # Errors
    ///
    /// [`Error::NotBegun`], [`Error::NotKept`], [`Error::Full`], [`Error::Flash`] and
    /// [`Error::Damaged`]. The previous set remains, unless the flash fails after the seal was written:
    /// [`contents`](Self::contents) then returns the stored set or, after [`Error::Flash`], opening the
    /// storage again does.
    pub async fn commit(&mut self) -> Result<(), Error<S::Error>> {
        let result = self.commit_all().await;
        self.abandon();
        result
    }

    async fn put_all(&mut self, command: &Command) -> Result<(), Error<S::Error>> {
        let save = self.save.as_mut().ok_or(Error::NotBegun)?;
        command.validate().map_err(Error::Invalid)?;
        save.configuration_crc.add(command);
        let kind = command.kind();
        let Command::SetSettings(settings) = command else {
            let item = parts::item(command).ok_or(Error::NotASetter { kind })?;
            return self.put_item(item, kind).await;
        };
        for number in settings::FIELDS {
            let item = settings::item(settings, *number).ok_or(Error::NotASetter { kind })?;
            self.put_item(item, kind).await?;
        }
        Ok(())
    }

    async fn put_item(&mut self, item: Item, kind: u8) -> Result<(), Error<S::Error>> {
        let save = self.save.as_mut().ok_or(Error::NotBegun)?;
        if save.put >= Some(item.key) {
            return Err(Error::OutOfOrder { kind });
        }
        self.keep_up_to(item.key).await?;
        self.append(&item).await?;
        if let Some(save) = &mut self.save {
            save.put = Some(item.key);
        }
        Ok(())
    }

    async fn commit_all(&mut self) -> Result<(), Error<S::Error>> {
        self.keep_up_to(Key::LAST).await?;
        let save = self.save.as_ref().ok_or(Error::NotBegun)?;
        let (slot, generation) = (save.slot, save.generation);
        let sum = Sum {
            items: save.items,
            configuration_crc: save.configuration_crc.value(),
            erased: save.stored.map_or(0, |set| set.sum.erased),
        };
        let written = Scan::of(&mut self.area, slot).await?;
        if !written.holds(generation, sum.items) {
            return Err(Error::NotKept);
        }
        self.seal(slot, generation, &sum).await?;
        self.copy_seal(slot.other(), generation, &sum).await?;
        self.survey_again().await?;
        let is_kept = self.survey.stored.is_some_and(|set| set.sum == sum);
        is_kept.then_some(()).ok_or(Error::NotKept)
    }

    /// Writes a seal after the items of a slot. From here on, the save is the stored set.
    pub(crate) async fn seal(
        &mut self,
        slot: Slot,
        generation: u32,
        sum: &Sum,
    ) -> Result<(), Error<S::Error>> {
        let seal = sum.seal(seal::OF_THIS_SLOT).bytes(generation);
        self.area.append(slot, generation, &seal).await
    }

    /// Writes a copy of the seal in the slot without the save. Without it a save whose seal is lost would
    /// look like one that was interrupted, and the set before it like the stored one.
    async fn copy_seal(
        &mut self,
        slot: Slot,
        generation: u32,
        sum: &Sum,
    ) -> Result<(), Error<S::Error>> {
        if self.survey.stored.is_none() {
            self.area.clear(slot).await?;
        }
        let seal = sum.seal(seal::OF_OTHER_SLOT).bytes(generation);
        match self.area.append(slot, generation, &seal).await {
            Err(Error::Flash(error)) => Err(Error::Flash(error)),
            // The save is stored even if the set before it leaves no space for the copy.
            _ => Ok(()),
        }
    }

    /// Keeps the stored items before a key that this firmware does not know, one in each pass.
    async fn keep_up_to(&mut self, key: Key) -> Result<(), Error<S::Error>> {
        loop {
            let save = self.save.as_ref().ok_or(Error::NotBegun)?;
            let Some(set) = save.stored.filter(|set| set.unknown > 0) else {
                return Ok(());
            };
            let mut next = None;
            let mut take = |item: Item| {
                next = save.keeps(&item, key).then_some(item);
                next.is_none()
            };
            self.area.read_set(&set, &mut take).await?;
            match next {
                Some(item) => self.append(&item).await?,
                None => return Ok(()),
            }
        }
    }

    /// Adds an item to the new set.
    async fn append(&mut self, item: &Item) -> Result<(), Error<S::Error>> {
        let save = self.save.as_mut().ok_or(Error::NotBegun)?;
        save.items = save.items.checked_add(1).ok_or(Error::Full)?;
        save.last = Some(item.key);
        let (slot, generation) = (save.slot, save.generation);
        let bytes = item.bytes(generation);
        self.area.append(slot, generation, &bytes).await
    }
}
