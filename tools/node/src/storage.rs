//! Storage that outlasts a loss of power: images, the record of object 1010h, what guards the joint. Each lies in two
//! slots of its own, as on a board, so that a loss of power in any store leaves the old content or the new one.

use crate::flash::Flash;
use crate::images::SlotImages;
use friction_compensation::parameters::fault_log::FaultLog;
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::slots::{Layout, PAGE, SlotError, Slots};
use std::path::Path;

/// Contents of slots, for their checksum; 1 are friction images.
const CONFIGURATION: u32 = 2;
const GUARD: u32 = 3;

/// Reason for which there is no storage.
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

    fn is_lost(&self) -> bool {
        self.slots.is_lost()
    }

    fn store(&mut self, bytes: &[u8]) -> Result<(), SlotError> {
        self.slots.store(&mut self.flash, bytes)
    }
}

/// Storage of a joint. A clone is what a loss of power at that moment leaves.
#[derive(Clone, Debug)]
pub struct Storage {
    pub(crate) images: SlotImages,
    configuration: Record,
    guard: Record,
    /// Pages of the log of faults.
    log: Flash,
}

impl Storage {
    /// Empty storage, in memory.
    ///
    /// # Errors
    /// None in practice: an erased flash can be written.
    pub fn empty() -> Result<Self, SlotError> {
        Self::with(SlotImages::empty()?)
    }

    /// Storage of nothing but images.
    ///
    /// # Errors
    /// None in practice: an erased flash can be written.
    pub fn with(images: SlotImages) -> Result<Self, SlotError> {
        let [configuration, guard] = [CONFIGURATION, GUARD].map(Record::empty);
        Ok(Self { images, configuration: configuration?, guard: guard?, log: Flash::erased(2) })
    }

    /// Storage in a folder, one file for each content; all that is stored is in the files at once. The folder is made
    /// where there is none.
    ///
    /// # Errors
    /// Files that cannot be used.
    pub fn open(folder: &Path) -> Result<Self, StorageError> {
        std::fs::create_dir_all(folder)?;
        let flash = |name: &str| Flash::file(&folder.join(name), 2);
        Ok(Self {
            images: SlotImages::open(flash("images.bin")?)?,
            configuration: Record::open(flash("configuration.bin")?, CONFIGURATION)?,
            guard: Record::open(flash("guard.bin")?, GUARD)?,
            log: flash("faults.bin")?,
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

    /// True where one was stored that is not there any more.
    pub(crate) fn is_configuration_lost(&self) -> bool {
        self.configuration.is_lost()
    }

    pub(crate) fn store_configuration(&mut self, record: &[u8]) -> Result<(), SlotError> {
        self.configuration.store(record)
    }

    /// The log of faults, after a power-up or another start.
    pub(crate) fn fault_log(&mut self, powered_up: bool) -> FaultLog {
        FaultLog::open(&mut self.log, 0, powered_up)
    }

    /// Pages of the log.
    pub(crate) fn log(&mut self) -> &mut Flash {
        &mut self.log
    }

    /// Guard of the joint. Where it is damaged the joint is locked, and that is kept, as a board does.
    pub(crate) fn guard(&mut self) -> Guard {
        let damaged = self.guard.is_damaged();
        let mut guard = Guard::decode(self.guard.load().as_deref());
        if damaged && !guard.locked {
            guard.locked = true;
            let _ = self.store_guard(&guard);
        }
        guard
    }

    pub(crate) fn store_guard(&mut self, guard: &Guard) -> Result<(), SlotError> {
        self.guard.store(&guard.encode())
    }

    /// Damaged ones of images and guard: bits as of EMCY 6310h.
    pub(crate) fn damaged(&self) -> u8 {
        let locked = Guard::decode(self.guard.clone().load().as_deref()).locked;
        u8::from(self.images.is_damaged()) | u8::from(self.guard.is_damaged() || locked) << 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use friction_compensation::parameters::authentication::Key;

    fn guard(floor: u32) -> Guard {
        let key = Key::new(std::array::from_fn(|i| i as u8)).unwrap();
        Guard { floor, failures: 3, key: Some(key), locked: false }
    }

    #[test]
    fn what_is_stored_in_a_folder_is_there_when_it_is_opened_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint 5");
        let mut storage = Storage::open(&path).unwrap();
        assert!(storage.configuration().is_none() && storage.guard().encode() == Guard::default().encode());
        storage.store_configuration(&[1, 2, 3]).unwrap();
        storage.store_guard(&guard(70_000)).unwrap();
        storage.store_guard(&guard(70_001)).unwrap();
        let mut storage = Storage::open(&path).unwrap();
        assert_eq!((storage.configuration(), storage.damaged()), (Some(vec![1, 2, 3]), 0));
        assert_eq!(storage.guard().encode(), guard(70_001).encode());
    }

    #[test]
    fn a_bit_of_what_guards_the_joint_that_flips_changes_nothing_or_locks_and_never_opens() {
        for records in [1, 2] {
            let folder = tempfile::tempdir().unwrap();
            let mut storage = Storage::open(folder.path()).unwrap();
            (0..records).for_each(|number| storage.store_guard(&guard(7 + number)).unwrap());
            let path = folder.path().join("guard.bin");
            let whole = std::fs::read(&path).unwrap();
            let mut locked = 0;
            // The header, the record, and something of what is blank behind it; in the page that holds the newest one.
            let newest = (records as usize + 1) % 2 * PAGE;
            for bit in 0..8 * 88 {
                let mut damaged = whole.clone();
                damaged[newest + bit / 8] ^= 1 << (bit % 8);
                std::fs::write(&path, &damaged).unwrap();
                // It stays so from start to start.
                for _ in 0..2 {
                    let mut storage = Storage::open(folder.path()).unwrap();
                    let found = storage.guard();
                    let same = found.encode() == guard(6 + records).encode();
                    assert!(same || found.locked && storage.damaged() == 4, "{records} records, bit {bit}: {found:?}");
                    // The key of the record before is the owner's, who can repair it.
                    assert!(same || found.key.is_some() == (records == 2), "{records} records, bit {bit}");
                    locked += u32::from(found.locked);
                }
            }
            assert!(locked >= 2 * 8 * 40, "{locked}");
            std::fs::write(&path, &whole).unwrap();
            assert!(!Storage::open(folder.path()).unwrap().guard().locked);
        }
    }

    #[test]
    fn an_image_that_is_damaged_at_any_byte_gives_way_to_the_one_before_and_is_told_at_every_start() {
        let folder = tempfile::tempdir().unwrap();
        let mut storage = Storage::open(folder.path()).unwrap();
        let [old, new] = [1, 2].map(|version| crate::SampleImage::constant(version, 0.25));
        for image in [&old, &new] {
            storage.store_image(image).unwrap();
        }
        let path = folder.path().join("images.bin");
        let whole = std::fs::read(&path).unwrap();
        let mut damaged = 0;
        // Header, marks and image, which is the second.
        for byte in 0..32 + new.len() {
            let mut bytes = whole.clone();
            bytes[PAGE + byte] ^= 0x10;
            std::fs::write(&path, &bytes).unwrap();
            for _ in 0..2 {
                let mut storage = Storage::open(folder.path()).unwrap();
                // The marks, of which there are several, may be.
                let marks = (8..32).contains(&byte);
                let expected = if marks { (Some(&new), 0) } else { (Some(&old), 1) };
                let found = (storage.images.active(), storage.damaged());
                assert_eq!((found.0.as_ref(), found.1), expected, "byte {byte}");
            }
            damaged += 1;
        }
        assert!(damaged > 100);
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_said() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(matches!(Storage::open(&file.path().join("x")), Err(StorageError::File(_))));
    }
}
