//! The friction model in shadow: prepared by the task of the bus, computed every millisecond by the one above it.
//!
//! It lies where the next configuration will be prepared, of which a joint in service needs none: 2 KiB of SRAM that
//! the smaller chip does not have twice. Whoever prepares a configuration takes the shadow away first, and has it
//! prepared again afterwards.

use super::shared::Offering;
use core::mem::MaybeUninit;
use core::ptr::{addr_of_mut, null_mut};
use core::sync::atomic::{AtomicPtr, Ordering};
use friction_compensation::friction::FrictionModel;
use friction_compensation::friction::regime::Memory;
use friction_compensation::parameters::image::Image;
use friction_compensation::quantity::Torque;
use joint_firmware::joint::{Active, Telemetry, shadow};

/// Evaluations a second, Hz.
const RATE: u32 = 1_000;

/// The model, in a place that is the preparer's; null where there is none. The task that reads it interrupts the one
/// that writes it and never the other way round: once this is null, nobody uses the model.
static MODEL: AtomicPtr<FrictionModel> = AtomicPtr::new(null_mut());

/// Takes the model away. To be called before anything is prepared in the place.
pub fn withdraw() {
    MODEL.store(null_mut(), Ordering::Release);
}

/// Returns `true` if there is a model.
pub fn runs() -> bool {
    !MODEL.load(Ordering::Acquire).is_null()
}

/// Prepares the model of an image's bytes; false where there is no place for it, because the control step has not taken
/// yet what it was offered, or where the bytes are no image.
pub fn prepare(active: &mut Offering<Active>, image: &[u8]) -> bool {
    withdraw();
    let Some(place) = active.spare().map(MaybeUninit::as_mut_ptr) else { return false };
    // SAFETY: the place is the preparer's, and what is in it has no meaning until something is prepared. One of its
    // fields is written as a whole and lent from then on; the reference here ends before it is.
    let model = unsafe {
        addr_of_mut!((*place).friction).write(None);
        &mut (*place).friction
    };
    Image::prepare(image, RATE, model);
    let Some(model) = model else { return false };
    MODEL.store(model, Ordering::Release);
    true
}

/// Torque that the model would add; none where there is no model. 1,000 times a second, by one task.
pub fn torque(memory: &mut Memory, telemetry: &Telemetry) -> Option<Torque> {
    // SAFETY: not null, it was prepared, and is withdrawn before it changes; the task that does so waits while this one
    // runs.
    let model = unsafe { MODEL.load(Ordering::Acquire).as_ref() };
    if model.is_none() {
        *memory = Memory::default();
    }
    Some(shadow::torque(model?, memory, telemetry))
}
