//! Images and the owner, as the dictionary writes them; the task.

use super::Objects;
use crate::objects::field::{ImageField, OwnerField};
use crate::objects::ownership::{Change, POWER_UP, Place, SESSIONS, Wrong};
use crate::objects::program::Program;
use crate::reset_record::LastReset;
use canopen_node::Abort;
use friction_compensation::parameters::life_cycle::Command;
use friction_compensation::parameters::slots::SlotError;

impl<P: Program> Objects<'_, P> {
    #[inline(never)]
    pub(super) fn write_image(&mut self, field: ImageField, number: u32) -> Result<(), Abort> {
        let is = |command: Command| matches!(field, ImageField::Command) && number == command as u32;
        let is_stored = self.images.is_stored();
        let (rolls_back, stores) = (is(Command::RollBack), is(Command::Commit) && !is_stored);
        // What is not newer may be what its owner has rolled back from.
        if rolls_back || stores && !self.images.life().is_newer() {
            self.authorise()?;
        }
        // Both write a page of flash, and may write what guards the joint.
        let writes = rolls_back || stores;
        if writes && self.stores.left() == 0 {
            return Err(Abort::DEVICE_STATE);
        }
        let (floor, failures) = (self.images.life().floor(), self.images.life().failures());
        let result = match field {
            ImageField::Command => self.images.command(number as u8, is_stored, self.circumstances()),
            ImageField::TrialTime => self.images.set_trial_time(number),
            _ => return Err(Abort::READ_ONLY),
        };
        if matches!(field, ImageField::Command) {
            self.heartbeat_lost = false;
        }
        let (risen, counted) = (self.images.life().floor() != floor, self.is_counted(failures));
        let kept = if risen || counted { self.keep() } else { Ok(()) };
        if let (true, Err(error)) = (risen, kept) {
            // The image comes after its floor, or not at all, also when it comes again.
            self.images.restore_floor(floor);
            let _ = self.images.take_action();
            let _ = self.images.finished(Err(error), self.observed.latched);
        }
        self.publish();
        result.map_err(|refusal| self.refuse(refusal))?;
        if writes {
            self.take_store();
        }
        kept.map_err(|error| self.refuse(error.into()))
    }

    fn keep(&mut self) -> Result<(), SlotError> {
        let life = self.images.life();
        self.program.keep(&self.images.owner.guard(life.floor(), life.failures()))
    }

    /// Returns `true` if one more failure is to be kept: whoever sends wrong tags on and on must not wear the flash
    /// out.
    fn is_counted(&self, before: u16) -> bool {
        let count = self.images.life().failures();
        count != before && count.is_power_of_two() && self.is_writable()
    }

    pub(super) fn is_writable(&self) -> bool {
        !(self.single_bank && self.needs_control())
    }

    /// Returns `true` if somebody is at the joint: at its button, or at its supply while no master runs it. A reset
    /// over the bus is no power-up.
    pub(super) fn is_present(&self) -> bool {
        let new =
            || self.now < POWER_UP && !self.was_started && self.program.last_reset().causes & LastReset::POWER != 0;
        self.program.button().unwrap_or_else(new)
    }

    /// Returns `true` if the owner's session is open, without which nothing may change what the joint can do;
    /// where there are none, if somebody is at the joint.
    pub(super) fn is_authorised(&self) -> bool {
        self.images.owner.is_open(self.now) || !SESSIONS && self.is_present()
    }

    /// Checks for that; the session lasts on.
    pub(super) fn authorise(&mut self) -> Result<(), Abort> {
        if !self.is_authorised() {
            return Err(Abort::LOCAL_CONTROL);
        }
        self.images.owner.prolong(self.now);
        Ok(())
    }

    fn place(&self) -> Place {
        let target = self.images.life().target();
        Place { target, now: self.now, present: self.is_present(), writable: self.is_writable() }
    }

    /// Keeps what is to become of the owner, and takes it then.
    #[inline(never)]
    fn change_owner(&mut self, change: &Change) -> Result<(), Abort> {
        let life = self.images.life();
        let guard = self.images.owner.changed(change, life.floor(), life.failures());
        self.program.keep(&guard).map_err(|error| self.refuse(error.into()))?;
        self.images.owner.take(guard);
        match change {
            Change::Key(_) => self.images.owner.note(&self.configuration),
            Change::Forgotten => self.images.forget_owner(),
            Change::Repaired => {}
        }
        Ok(())
    }

    pub(super) fn finish_owner(&mut self) -> Result<(), Abort> {
        let (place, before) = (self.place(), self.images.life().failures());
        match self.images.owner.finish(&place) {
            Ok(Some(change)) => self.change_owner(&change),
            Ok(None) => Ok(()),
            Err(Wrong::Abort(abort)) => Err(abort),
            Err(Wrong::Response) => {
                self.images.count_failure();
                if self.is_counted(before) {
                    self.keep().map_err(|error| self.refuse(error.into()))?;
                }
                Err(Abort::LOCAL_CONTROL)
            }
        }
    }

    pub(super) fn write_owner(&mut self, field: OwnerField, number: u32) -> Result<(), Abort> {
        match field {
            OwnerField::Session if number == 0 => {
                self.images.owner.close();
                Ok(())
            }
            OwnerField::Session => Err(Abort::VALUE),
            OwnerField::Forget => {
                let change = self.images.owner.forget(number, &self.place())?;
                self.change_owner(&change)
            }
            _ => Err(Abort::READ_ONLY),
        }
    }
}
