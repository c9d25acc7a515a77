//! Everything that outlasts a loss of power: images, the record of object 1010h, the version floor and wrong tags, the key. Each lies in two
//! slots of its own, so that a loss of power in any store leaves the old content or the new one.

use crate::flash::Flash;
use crate::images::SlotImages;
use joint_firmware::parameters::authentication::{KEY, Key};
use joint_firmware::parameters::slots::{Layout, PAGE, SlotError, Slots};
use std::path::Path;

/// Contents of slots, for their checksum; 1 are friction images.
const CONFIGURATION: u32 = 2;
const COUNTS: u32 = 3;
const KEY_KIND: u32 = 4;

/// Why there is no storage.
#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    /// A file.
    #[error(transparent)]
    File(#[from] std::io::Error),
    /// Slots.
    #[error("slots: {0}")]
    Slots(SlotError),
}

impl From<SlotError> for StorageError {
    fn from(error: SlotError) -> Self {
        Self::Slots(error)
    }
}

/// Bytes in two slots.
#[derive(Clone, Debug)]
struct Record {
    flash: Flash,
    slots: Slots,
}

impl Record {
    fn open(mut flash: Flash, kind: u32) -> Result<Self, SlotError> {
        // One page each: never refused.
        let layout = Layout::new(0, 1, kind).ok_or(SlotError::NoPrevious)?;
        let slots = Slots::open(&mut flash, layout)?;
        Ok(Self { flash, slots })
    }

    fn empty(kind: u32) -> Result<Self, SlotError> {
        Self::open(Flash::erased(2), kind)
    }

    fn load(&mut self) -> Option<Vec<u8>> {
        let mut buffer = vec![0; PAGE];
        let length = self.slots.load(&mut self.flash, &mut buffer).ok()??;
        buffer.truncate(length);
        Some(buffer)
    }

    fn is_damaged(&self) -> bool {
        self.slots.is_damaged()
    }

    fn store(&mut self, bytes: &[u8]) -> Result<(), SlotError> {
        self.slots.store(&mut self.flash, bytes)
    }
}

/// What a joint keeps. A clone is what a loss of power at that moment leaves.
#[derive(Clone, Debug)]
pub struct Storage {
    pub(crate) images: SlotImages,
    configuration: Record,
    counts: Record,
    key: Record,
}

impl Storage {
    /// Nothing stored, in memory.
    ///
    /// # Errors
    /// None in practice: an erased flash can be written.
    pub fn empty() -> Result<Self, SlotError> {
        Self::with(SlotImages::empty()?)
    }

    /// Nothing but images stored.
    ///
    /// # Errors
    /// None in practice: an erased flash can be written.
    pub fn with(images: SlotImages) -> Result<Self, SlotError> {
        let [configuration, counts, key] = [CONFIGURATION, COUNTS, KEY_KIND].map(Record::empty);
        Ok(Self { images, configuration: configuration?, counts: counts?, key: key? })
    }

    /// What a folder holds, one file for each content; all that is stored is in the files at once. The folder is made where there is none.
    ///
    /// # Errors
    /// Files that cannot be used.
    pub fn open(folder: &Path) -> Result<Self, StorageError> {
        std::fs::create_dir_all(folder)?;
        let flash = |name: &str| Flash::file(&folder.join(name), 2);
        Ok(Self {
            images: SlotImages::open(flash("images.bin")?)?,
            configuration: Record::open(flash("configuration.bin")?, CONFIGURATION)?,
            counts: Record::open(flash("counts.bin")?, COUNTS)?,
            key: Record::open(flash("key.bin")?, KEY_KIND)?,
        })
    }

    /// Makes an image the stored one, unless it is already; the one before can be rolled back to.
    ///
    /// # Errors
    /// An image that fits into no slot.
    pub fn store_image(&mut self, image: &[u8]) -> Result<(), SlotError> {
        if self.images.active().as_deref() == Some(image) { Ok(()) } else { self.images.store(image) }
    }

    /// The record of object 1010h.
    pub(crate) fn configuration(&mut self) -> Option<Vec<u8>> {
        self.configuration.load()
    }

    pub(crate) fn store_configuration(&mut self, record: &[u8]) -> Result<(), SlotError> {
        self.configuration.store(record)
    }

    /// Version floor and wrong tags, as far as they are kept.
    pub(crate) fn counts(&mut self) -> (u32, u16) {
        match self.counts.load().as_deref() {
            Some(&[a, b, c, d, low, high]) => (u32::from_le_bytes([a, b, c, d]), u16::from_le_bytes([low, high])),
            _ => (0, 0),
        }
    }

    pub(crate) fn store_counts(&mut self, floor: u32, failures: u16) -> Result<(), SlotError> {
        let [a, b, c, d] = floor.to_le_bytes();
        let [low, high] = failures.to_le_bytes();
        self.counts.store(&[a, b, c, d, low, high])
    }

    pub(crate) fn key(&mut self) -> Option<Key> {
        let bytes: [u8; KEY] = self.key.load()?.try_into().ok()?;
        Key::new(bytes).ok()
    }

    /// Whether there was a key that cannot be read any more: it is written once, so no other slot holds it.
    pub(crate) fn key_is_damaged(&mut self) -> bool {
        self.key.is_damaged() && self.key().is_none()
    }

    /// What of it is damaged: bits as of EMCY 6310h.
    pub(crate) fn damaged(&self) -> u8 {
        let parts = [self.images.is_damaged(), self.configuration.is_damaged(), self.key.is_damaged()];
        parts.into_iter().rev().fold(0, |bits, damaged| bits << 1 | u8::from(damaged))
    }

    pub(crate) fn store_key(&mut self, key: &Key) -> Result<(), SlotError> {
        self.key.store(&key.to_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_stored_in_a_folder_is_there_when_it_is_opened_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint 5");
        let mut storage = Storage::open(&path).unwrap();
        assert!(storage.configuration().is_none() && storage.key().is_none() && storage.counts() == (0, 0));
        let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
        storage.store_configuration(&[1, 2, 3]).unwrap();
        storage.store_counts(70_000, 3).unwrap();
        storage.store_counts(70_001, 4).unwrap();
        storage.store_key(&key).unwrap();
        let mut storage = Storage::open(&path).unwrap();
        assert_eq!((storage.configuration(), storage.counts()), (Some(vec![1, 2, 3]), (70_001, 4)));
        assert_eq!(storage.key().unwrap().to_bytes(), key.to_bytes());
    }

    #[test]
    fn a_bit_of_a_stored_key_that_flips_leaves_the_key_or_locks_and_never_opens() {
        let folder = tempfile::tempdir().unwrap();
        let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
        Storage::open(folder.path()).unwrap().store_key(&key).unwrap();
        let path = folder.path().join("key.bin");
        let whole = std::fs::read(&path).unwrap();
        let mut locked = 0;
        // The header, the key, and something of what is blank behind it.
        for bit in 0..8 * 80 {
            let mut damaged = whole.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(&path, &damaged).unwrap();
            // It stays so from start to start.
            for _ in 0..2 {
                let mut storage = Storage::open(folder.path()).unwrap();
                match storage.key() {
                    Some(found) => assert_eq!(found.to_bytes(), key.to_bytes(), "bit {bit}"),
                    None => assert!(storage.key_is_damaged() && storage.damaged() == 4, "bit {bit}"),
                }
                locked += u32::from(storage.key_is_damaged());
            }
        }
        assert!(locked >= 2 * 8 * 32, "{locked}");
        std::fs::write(&path, &whole).unwrap();
        assert!(Storage::open(folder.path()).unwrap().key().is_some());
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_said() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(matches!(Storage::open(&file.path().join("x")), Err(StorageError::File(_))));
    }
}
