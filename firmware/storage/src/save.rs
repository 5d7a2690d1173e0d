//! Saving: replaces the stored set atomically.

use core::fmt;

use embedded_storage_async::nor_flash::NorFlash;
use palpate_wire::{Command, ConfigurationCrc, Message};

use crate::area::Located;
use crate::area::{Area, Slot};
use crate::item::{Item, Key};
use crate::scan::Scan;
use crate::seal::{self, Sum};
use crate::{Contents, Error, Store, knows, parts, settings};

impl<S: NorFlash> Store<S> {
    /// Begins a save, which replaces the stored set except for items that this firmware does not know.
    /// Erases the other slot, with the set before the stored one. Abandons a save in progress.
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
        let save = Save {
            slot: self.survey.target,
            generation: self.next_generation()?,
            stored: self.survey.stored,
            items: 0,
            last: None,
            put: None,
            configuration_crc: ConfigurationCrc::new(),
        };
        self.area.clear(save.slot).await?;
        self.save = Some(save);
        Ok(())
    }

    /// Abandons a save in progress; the stored set remains.
    pub fn abandon(&mut self) {
        self.save = None;
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
        let mut save = self.save.take().ok_or(Error::NotBegun)?;
        command.validate().map_err(Error::Invalid)?;
        save.configuration_crc.add(command);
        let kind = command.kind();
        if let Command::SetSettings(settings) = command {
            for number in settings::FIELDS {
                let item = settings::item(settings, *number);
                save.put(&mut self.area, item, kind).await?;
            }
        } else {
            save.put(&mut self.area, parts::item(command), kind).await?;
        }
        self.save = Some(save);
        Ok(())
    }

    /// Completes a save, which makes it the stored set as a whole.
    ///
    /// # Errors
    ///
    /// [`Error::NotBegun`], [`Error::NotKept`], [`Error::Full`], [`Error::Flash`] and
    /// [`Error::Damaged`]. The previous set remains, unless the flash fails after the seal was written:
    /// [`contents`](Self::contents) then returns which set is stored. After [`Error::Flash`], open the
    /// storage again to find out.
    pub async fn commit(&mut self) -> Result<(), Error<S::Error>> {
        let mut save = self.save.take().ok_or(Error::NotBegun)?;
        save.keep_up_to(&mut self.area, Key::LAST).await?;
        let sum = Sum {
            items: save.items,
            configuration_crc: save.configuration_crc.value(),
            erased: save.stored.map_or(0, |set| set.sum.erased),
        };
        let written = Scan::of(&mut self.area, save.slot).await?;
        if !written.holds(save.generation, sum.items) {
            return Err(Error::NotKept);
        }
        self.seal(save.slot, save.generation, &sum).await?;
        self.copy_seal(save.slot.other(), save.generation, &sum)
            .await?;
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
        let seal = sum.seal(seal::OF_THIS_SLOT);
        self.area.append(slot, generation, &seal).await
    }

    /// Writes a copy of the seal in the slot without the save. Without the copy, a save whose seal is
    /// lost would look like an interrupted one, and the set before it like the stored one.
    async fn copy_seal(
        &mut self,
        slot: Slot,
        generation: u32,
        sum: &Sum,
    ) -> Result<(), Error<S::Error>> {
        if self.survey.stored.is_none() {
            self.area.clear(slot).await?;
        }
        let seal = sum.seal(seal::OF_OTHER_SLOT);
        match self.area.append(slot, generation, &seal).await {
            Err(Error::Flash(error)) => Err(Error::Flash(error)),
            // The save is stored even if the set before it leaves no space for the copy.
            _ => Ok(()),
        }
    }
}

/// Save in progress.
pub(crate) struct Save {
    slot: Slot,
    generation: u32,
    /// The stored set that is replaced.
    stored: Option<Located>,
    /// Number of items so far; `last` is the key of the last one.
    items: u16,
    last: Option<Key>,
    /// Key of the last item that the caller has put.
    put: Option<Key>,
    configuration_crc: ConfigurationCrc,
}

impl fmt::Debug for Save {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Save").finish_non_exhaustive()
    }
}

impl Save {
    /// Adds an item of a command; `None` if the command sets nothing to be stored.
    async fn put<S: NorFlash>(
        &mut self,
        area: &mut Area<S>,
        item: Option<Item>,
        kind: u8,
    ) -> Result<(), Error<S::Error>> {
        let item = item.ok_or(Error::NotASetter { kind })?;
        if self.put >= Some(item.key) {
            return Err(Error::OutOfOrder { kind });
        }
        self.keep_up_to(area, item.key).await?;
        self.put = Some(item.key);
        self.append(area, &item).await
    }

    /// Copies the stored items before `key` that this firmware does not know, one in each pass.
    async fn keep_up_to<S: NorFlash>(
        &mut self,
        area: &mut Area<S>,
        key: Key,
    ) -> Result<(), Error<S::Error>> {
        let Some(set) = self.stored.filter(|set| set.unknown > 0) else {
            return Ok(());
        };
        loop {
            let mut next = None;
            let mut take = |item: Item| {
                next = self.keeps(&item, key).then_some(item);
                next.is_none()
            };
            area.read_set(&set, &mut take).await?;
            match next {
                Some(item) => self.append(area, &item).await?,
                None => return Ok(()),
            }
        }
    }

    /// Returns whether the save keeps a stored item next, before the key `next`: if this firmware does
    /// not know the item and the save does not replace it.
    fn keeps(&self, stored: &Item, next: Key) -> bool {
        let is_replaced = |key: Key| key.is_of_one_part(stored.key);
        let is_between = self.last < Some(stored.key) && stored.key < next;
        is_between
            && !knows(stored.key, stored.version)
            && !is_replaced(next)
            && !self.put.is_some_and(is_replaced)
    }

    async fn append<S: NorFlash>(
        &mut self,
        area: &mut Area<S>,
        item: &Item,
    ) -> Result<(), Error<S::Error>> {
        self.items = self.items.checked_add(1).ok_or(Error::Full)?;
        self.last = Some(item.key);
        area.append(self.slot, self.generation, item).await
    }
}
