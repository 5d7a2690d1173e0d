//! Saving: replaces the stored set atomically.

use embedded_storage_async::nor_flash::NorFlash;
use palpate_wire::{Command, ConfigurationCrc, Message};

use crate::area::Slot;
use crate::item::{Item, Key};
use crate::save_state::Save;
use crate::scan::Scan;
use crate::seal::{Seal, SealCopy, Sum};
use crate::{Contents, Error, Store, parts, settings};

impl<S: NorFlash> Store<S> {
    /// Begins a save, which replaces the stored set except for items that this firmware does not know.
    /// Does not access the flash. Abandons a save in progress.
    ///
    /// # Errors
    ///
    /// [`Error::Newer`] if a later firmware stored a set in another format, which would be lost.
    /// [`Error::Exhausted`].
    pub fn begin(&mut self) -> Result<(), Error<S::Error>> {
        self.abandon();
        if self.survey.contents == Contents::Newer {
            return Err(Error::Newer);
        }
        self.save = Some(Save {
            slot: self.survey.target,
            generation: self.next_generation()?,
            stored: self.survey.stored,
            items: 0,
            digest: 0,
            is_writing: false,
            last: None,
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
    /// [`configuration_crc`](palpate_wire::configuration_crc). Writes nothing as long as all items equal
    /// the stored ones. At the first difference it erases the sectors of the save before the stored one,
    /// and writes all items so far.
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

    /// Completes a save, which makes it the stored set as a whole. Returns `true` if that changed the
    /// stored set.
    ///
    /// # Errors
    ///
    /// [`Error::NotBegun`], [`Error::NotKept`], [`Error::Full`], [`Error::Flash`] and
    /// [`Error::Damaged`]. The previous set remains, unless the flash fails after the seal was written:
    /// [`contents`](Self::contents) then returns the stored set or, after [`Error::Flash`], opening the
    /// storage again does.
    pub async fn commit(&mut self) -> Result<bool, Error<S::Error>> {
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
        if save.last.is_some_and(|last| last >= item.key) {
            return Err(Error::OutOfOrder { kind });
        }
        self.pass_up_to(item.key).await?;
        let stored = self.stored_item().await?;
        let is_stored = stored.as_ref() == Some(&item);
        if !is_stored {
            self.write_from_here().await?;
        }
        if stored.is_some_and(|stored| stored.key == item.key) {
            self.reader.advance();
        }
        if let Some(save) = &mut self.save {
            save.last = Some(item.key);
        }
        self.append(&item).await
    }

    async fn commit_all(&mut self) -> Result<bool, Error<S::Error>> {
        self.pass_up_to(Key::LAST).await?;
        let save = self.save.as_ref().ok_or(Error::NotBegun)?;
        if !save.is_writing && !matches!(self.survey.contents, Contents::Damaged { .. }) {
            return Ok(false);
        }
        self.write_from_here().await?;
        let save = self.save.as_ref().ok_or(Error::NotBegun)?;
        let (slot, generation) = (save.slot, save.generation);
        let sum = save.sum(save.configuration_crc.value());
        if !Scan::of(&mut self.area, slot)
            .await?
            .holds(generation, &sum)
        {
            return Err(Error::NotKept);
        }
        self.seal(slot, generation, &sum).await?;
        self.survey_again().await?;
        let is_kept = self.survey.stored.is_some_and(|set| set.sum == sum);
        is_kept.then_some(true).ok_or(Error::NotKept)
    }

    /// Writes a seal after the items of a slot, and a copy in the other slot. From the first copy on,
    /// the save is the stored set.
    pub(crate) async fn seal(
        &mut self,
        slot: Slot,
        generation: u32,
        sum: &Sum,
    ) -> Result<(), Error<S::Error>> {
        for copy in [SealCopy::Own(0), SealCopy::Own(1)] {
            let item = Seal::item(sum, copy);
            self.area.append(slot, generation, &item).await?;
        }
        let seal_of_other_slot = Seal::item(sum, SealCopy::OtherSlot);
        match self
            .area
            .append(slot.other(), generation, &seal_of_other_slot)
            .await
        {
            Err(Error::Flash(error)) => Err(Error::Flash(error)),
            // A copy that does not fit into the other slot, which may be damaged or full, is omitted:
            // two copies are in the save's own slot.
            _ => Ok(()),
        }
    }

    /// Returns the next item of the stored set.
    async fn stored_item(&mut self) -> Result<Option<Item>, Error<S::Error>> {
        match self.save.as_ref().and_then(|save| save.stored) {
            Some(set) => self.reader.peek(&mut self.area, &set).await,
            None => Ok(None),
        }
    }

    /// Passes the stored items before a key: keeps those that remain, drops the others.
    async fn pass_up_to(&mut self, key: Key) -> Result<(), Error<S::Error>> {
        while let Some(stored) = self.stored_item().await?
            && stored.key < key
        {
            let keeps = self.save.as_ref().is_some_and(|it| it.keeps(&stored, key));
            if keeps {
                self.reader.advance();
                self.append(&stored).await?;
            } else {
                self.write_from_here().await?;
                self.reader.advance();
            }
        }
        Ok(())
    }

    /// Starts writing, since the new set differs from the stored one from the next item on. Writes the
    /// items that both have in common first.
    async fn write_from_here(&mut self) -> Result<(), Error<S::Error>> {
        let save = self.save.as_mut().ok_or(Error::NotBegun)?;
        if core::mem::replace(&mut save.is_writing, true) {
            return Ok(());
        }
        let (slot, generation, common) = (save.slot, save.generation, save.items);
        self.area.clear(slot).await?;
        self.reader.rewind();
        for _ in 0..common {
            let item = self.stored_item().await?.ok_or(Error::Damaged)?;
            self.area.append(slot, generation, &item).await?;
            self.reader.advance();
        }
        Ok(())
    }

    /// Adds an item to the new set.
    async fn append(&mut self, item: &Item) -> Result<(), Error<S::Error>> {
        let save = self.save.as_mut().ok_or(Error::NotBegun)?;
        save.items = save.items.checked_add(1).ok_or(Error::Full)?;
        save.digest = item.digest(save.digest);
        if save.is_writing {
            let (slot, generation) = (save.slot, save.generation);
            self.area.append(slot, generation, item).await?;
        }
        Ok(())
    }
}
