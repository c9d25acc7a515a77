//! Storage of the board in flash: friction images, the stored record of objects, the key with what guards it. Thread
//! mode.
//!
//! | pages from the end | kind | content |
//! |---|---|---|
//! | 8, 7 | | log of faults, where the program has one ([`FaultLog`]) |
//! | 6, 5 | 1 | friction image |
//! | 4, 3 | 2 | record of object 1010h ([`Stored`](joint_firmware::objects::Stored)) |
//! | 2, 1 | 3 | what guards the joint ([`Guard`]) |

use crate::board::faults;
use crate::board::flash::Parameters;
use friction_compensation::parameters::Summary;
use friction_compensation::parameters::authentication::STAGING;
use friction_compensation::parameters::fault_log::{FaultLog, LoggedFault};
use friction_compensation::parameters::guard::{GUARD, Guard};
use friction_compensation::parameters::image::Image;
use friction_compensation::parameters::slots::{Layout, Slot, SlotError, Slots, WriteError};
use joint_firmware::objects::StoredImages;
use joint_firmware::objects::fault_log::LOGS;
use joint_firmware::reset_record::LastReset;

/// The pairs of slots.
pub struct Store {
    flash: Parameters,
    images: Slots,
    records: Slots,
    guards: Slots,
    log: [FaultLog; LOGS as usize],
}

/// Two pages from page `first` on.
const fn layout(first: usize, kind: u32) -> Layout {
    match Layout::new(first, 1, kind) {
        Some(layout) => layout,
        None => panic!("a slot has at least one page"),
    }
}
/// Page of the log.
const LOG: usize = 0;
/// First page of the slots, which lie at the end.
const SLOTS: usize = 2 * LOGS as usize;
const IMAGES: Layout = layout(SLOTS, 1);
const RECORDS: Layout = layout(SLOTS + 2, 2);
const GUARDS: Layout = layout(SLOTS + 4, 3);

impl Store {
    /// Finds out what the pages hold, and decides what a loss of power left undecided.
    pub fn open(mut flash: Parameters) -> Result<Self, WriteError> {
        let images = Slots::open(&mut flash, IMAGES)?;
        let records = Slots::open(&mut flash, RECORDS)?;
        let guards = Slots::open(&mut flash, GUARDS)?;
        let log = core::array::from_fn(|_| {
            let powered_up = faults::last_reset().causes & LastReset::POWER != 0;
            FaultLog::open(&mut flash, LOG, powered_up)
        });
        Ok(Self { flash, images, records, guards, log })
    }

    /// Content of the image slots.
    pub fn stored_images(&mut self) -> StoredImages {
        let (active, previous) = (self.images.active(), self.images.previous());
        StoredImages { active: self.summary(active), previous: self.summary(previous) }
    }

    fn summary(&mut self, slot: Option<Slot>) -> Option<(Summary, Slot)> {
        let slot = slot.filter(|slot| self.images.is_whole(&mut self.flash, *slot))?;
        let bytes = self.flash.bytes().get(self.images.range(slot)?)?;
        Some((Image::summary(bytes).ok()?, slot))
    }

    /// The image in use; none where there is none, or it has been damaged.
    pub fn image(&mut self) -> Option<&[u8]> {
        let slot = self.images.usable(&mut self.flash).ok()??;
        self.flash.bytes().get(self.images.range(slot)?)
    }

    /// `length` bytes of the image in use from `offset` on; none where there are not so many. The image carries its own
    /// checksum.
    pub fn piece_of_image(&self, offset: usize, length: usize) -> Option<&[u8]> {
        let image = self.flash.bytes().get(self.images.range(self.images.active()?)?)?;
        image.get(offset..offset.checked_add(length)?)
    }

    /// Stores an image.
    pub fn store_image(&mut self, image: &[u8]) -> Result<(), SlotError> {
        self.images.store(&mut self.flash, image)
    }

    /// Makes the previous image the one in use; `buffer` is overwritten.
    pub fn roll_back(&mut self, buffer: &mut [u8; STAGING]) -> Result<(), SlotError> {
        self.images.roll_back(&mut self.flash, buffer)
    }

    /// True where a record was stored that is not there any more. After [`Store::find_record`].
    pub fn is_record_lost(&self) -> bool {
        self.records.is_lost()
    }

    /// Finds the record at the start: one that is damaged gives way to what was stored before.
    pub fn find_record(&mut self) {
        // If the flash refuses the mark that the record is damaged, it is found so again.
        let _ = self.records.usable(&mut self.flash);
    }

    /// The stored record as it is since then; none where there is none.
    pub fn record(&self) -> Option<&[u8]> {
        self.flash.bytes().get(self.records.range(self.records.active()?)?)
    }

    /// Stores a record.
    pub fn store_record(&mut self, record: &[u8]) -> Result<(), SlotError> {
        self.records.store(&mut self.flash, record)
    }

    /// Guard of the joint. Where it is damaged the joint is locked, and that is kept with the key that is left: the
    /// slot that is damaged is given up, and may have held a higher floor, or a key.
    pub fn guard(&mut self) -> Guard {
        let mut bytes = [0; GUARD];
        let mut guard = match self.guards.load(&mut self.flash, &mut bytes) {
            Ok(length) => Guard::decode(length.and_then(|length| bytes.get(..length))),
            Err(_) => Guard::decode(Some(&[])),
        };
        if self.guards.is_damaged() && !guard.locked {
            guard.locked = true;
            // If it cannot be written it is found damaged again.
            let _ = self.keep(&guard);
        }
        guard
    }

    /// True where an image is damaged.
    pub fn has_damaged_image(&self) -> bool {
        self.images.is_damaged()
    }

    /// Appends a fault to the log: error code, number, and time since the start, s.
    pub fn log_fault(&mut self, code: u16, fault: u8, time: u32) -> bool {
        let Self { flash, log, .. } = self;
        log.iter_mut().all(|log| log.append(flash, code, fault, time).is_ok())
    }

    /// Has the log count this power-up.
    pub fn count_power_up(&mut self) {
        let Self { flash, log, .. } = self;
        for log in log {
            // If the flash refuses it the next fault tries again.
            let _ = log.keep_power_up(flash);
        }
    }

    /// The log's newest faults, the newest first.
    pub fn logged_faults(&self) -> impl Iterator<Item = LoggedFault> {
        self.log.iter().flat_map(FaultLog::newest).copied()
    }

    /// Number of power-ups.
    pub fn power_ups(&self) -> u32 {
        self.log.first().map_or(0, FaultLog::power_ups)
    }

    /// Keeps what guards the joint.
    pub fn keep(&mut self, guard: &Guard) -> Result<(), SlotError> {
        self.guards.store(&mut self.flash, &guard.encode())
    }
}
