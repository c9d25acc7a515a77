//! The two slots of friction images: what they hold, and the friction model that comes of it.

use crate::flash::Flash;
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::Summary;
use friction_compensation::parameters::authentication::STAGING;
use friction_compensation::parameters::image::{Image, MAX_LENGTH};
use friction_compensation::parameters::slots::{Layout, Slot, SlotError, Slots};
use joint_firmware::objects::StoredImages;

/// Content of the slots, for their checksum: friction images.
const KIND: u32 = 1;

/// Slots in a flash of their own.
#[derive(Clone, Debug)]
pub struct SlotImages {
    flash: Flash,
    slots: Slots,
}

impl SlotImages {
    /// Content of a flash, as found at a start.
    ///
    /// # Errors
    /// A flash that cannot be written.
    pub fn open(mut flash: Flash) -> Result<Self, SlotError> {
        // One page each: never refused.
        let layout = Layout::new(0, 1, KIND).ok_or(SlotError::NoPrevious)?;
        let slots = Slots::open(&mut flash, layout)?;
        Ok(Self { flash, slots })
    }

    /// Returns `true` if a slot was whole once and is not any more.
    #[must_use]
    pub fn is_damaged(&self) -> bool {
        self.slots.is_damaged()
    }

    /// Empty slots.
    ///
    /// # Errors
    /// None in practice: an erased flash can be written.
    pub fn empty() -> Result<Self, SlotError> {
        Self::open(Flash::erased(2))
    }

    /// The flash, for the next start.
    #[must_use]
    pub fn flash(&self) -> &Flash {
        &self.flash
    }

    /// Content of the slots.
    pub fn stored(&mut self) -> StoredImages {
        let (active, previous) = (self.slots.active(), self.slots.previous());
        StoredImages { active: self.summary(active), previous: self.summary(previous) }
    }

    fn summary(&mut self, slot: Option<Slot>) -> Option<(Summary, Slot)> {
        let slot = slot?;
        Some((Image::summary(&self.bytes(slot)?).ok()?, slot))
    }

    fn bytes(&mut self, slot: Slot) -> Option<Vec<u8>> {
        let mut buffer = vec![0; MAX_LENGTH];
        let length = self.slots.copy(&mut self.flash, slot, &mut buffer).ok()?;
        buffer.truncate(length);
        Some(buffer)
    }

    /// Bytes of the image in use; none where there is none.
    pub fn active(&mut self) -> Option<Vec<u8>> {
        let slot = self.slots.active()?;
        self.bytes(slot)
    }

    /// Stores an image.
    ///
    /// # Errors
    /// Refusals of the slots; the content in use is then untouched.
    pub fn store(&mut self, image: &[u8]) -> Result<(), SlotError> {
        self.slots.store(&mut self.flash, image)
    }

    /// Makes the previous image the one in use.
    ///
    /// # Errors
    /// There is none; what the flash refuses.
    pub fn roll_back(&mut self, buffer: &mut [u8; STAGING]) -> Result<(), SlotError> {
        self.slots.roll_back(&mut self.flash, buffer)
    }

    /// The friction model of the image in use, for a control loop of `rate` Hz.
    pub fn model(&mut self, rate: u32) -> Option<FrictionModel> {
        model(&self.active()?, rate)
    }
}

/// The friction model of an image's bytes; none where they are no image.
pub fn model(image: &[u8], rate: u32) -> Option<FrictionModel> {
    Some(FrictionModel::new(&Image::decode(image).ok()?.friction, rate))
}
