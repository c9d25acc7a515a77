//! The configuration as the dictionary writes it: taken by the control step, and stored; the task.

use super::Objects;
use crate::joint::configuration::Configuration;
use crate::objects::emergency::over;
use crate::objects::number::to_i32;
use crate::objects::ownership::SESSIONS;
use crate::objects::program::{NotConfigured, Program};
use crate::objects::refused::Refused;
use crate::objects::settings::Setting;
use crate::objects::stored::{Part, RECORD, Update};
use canopen_node::{Abort, COUNTER_AND_DATE};

impl<P: Program> Objects<'_, P> {
    /// Has the control step take a configuration. Functions of their own, here and below, because the stack has to bear
    /// their copies of records: not beside the proof of an image.
    #[inline(never)]
    pub(super) fn configure(&mut self, configuration: &Configuration) -> Result<(), Abort> {
        match self.program.configure(configuration) {
            Ok(()) => {
                self.refused = Refused::default();
                self.changed |= COUNTER_AND_DATE && self.configuration != *configuration;
                self.configuration = *configuration;
                self.shared.rate(configuration);
                Ok(())
            }
            Err(NotConfigured::Refused(error)) => {
                self.refused = Refused::by(&error);
                Err(Abort::VALUE)
            }
            Err(NotConfigured::Busy) => {
                self.refused = Refused::busy();
                Err(Abort::DEVICE_STATE)
            }
        }
    }

    #[inline(never)]
    pub(super) fn command_configuration(&mut self, command: u32) -> Result<(), Abort> {
        match command {
            1 if self.armed() => Err(Abort::DEVICE_STATE),
            1 => {
                self.authorise()?;
                let staged = self.staged;
                self.configure(&staged)
            }
            2 => {
                self.changed |= COUNTER_AND_DATE && self.staged != self.configuration;
                self.staged = self.configuration;
                self.refused = Refused::default();
                Ok(())
            }
            _ => Err(Abort::VALUE),
        }
    }

    #[inline(never)]
    pub(super) fn write_at_once(&mut self, setting: Setting, number: u32) -> Result<(), Abort> {
        if !self.images.owner.is_lowered(setting, number) {
            self.authorise()?;
        }
        let mut configuration = self.configuration;
        if !setting.set(&mut configuration, number) {
            return Err(Abort::VALUE);
        }
        self.configure(&configuration)?;
        // Whoever lowers something without being the owner does not keep the session open by it.
        if SESSIONS && self.is_authorised() {
            self.images.owner.note(&configuration);
        }
        self.staged.compensation = configuration.compensation;
        self.staged.load = configuration.load;
        self.staged.stops = configuration.stops;
        Ok(())
    }

    /// Takes a setting of the configuration in use in millionths, by the rules of all of them: the motor is off, and it
    /// goes with the others.
    #[inline(never)]
    pub(super) fn write_limit(&mut self, setting: Setting, micro: i32) -> Result<(), Abort> {
        self.authorise()?;
        if self.armed() {
            return Err(Abort::DEVICE_STATE);
        }
        // A number that has more digits keeps them where it is written back.
        if to_i32(1e6 * f32::from_bits(setting.get(&self.configuration))) == micro {
            return Ok(());
        }
        let number = (1e-6 * micro as f32).to_bits();
        let mut configuration = self.configuration;
        if !setting.set(&mut configuration, number) {
            return Err(Abort::VALUE);
        }
        self.configure(&configuration)?;
        // Other staged settings stay staged.
        let _ = setting.set(&mut self.staged, number);
        Ok(())
    }

    /// Takes one of the writes that are left; false where there is none.
    pub(super) fn take_store(&mut self) -> bool {
        let some = self.stores.take();
        self.program.note_stores_left(self.stores.left());
        some
    }

    /// A function of its own: the record is more than 1 KiB of stack.
    #[inline(never)]
    pub(super) fn store_record(&mut self, update: &Update) -> Result<(), Abort> {
        if !self.is_writable() {
            return Err(Abort::DEVICE_STATE);
        }
        let locked = self.shared.is_locked();
        // A node id, or communication alone, brings no configuration back.
        let lost = locked && matches!(update.application, Part::Kept);
        let mut record = [0; RECORD];
        let length = self.program.record(|before| update.encode(before, lost, &mut record)).ok_or(Abort::MEMORY)?;
        let record = record.get(..length).ok_or(Abort::MEMORY)?;
        if !locked && self.program.record(|before| before == Some(record)) {
            return Ok(());
        }
        if !self.take_store() {
            return Err(Abort::DEVICE_STATE);
        }
        self.program.store(record).map_err(|error| self.refuse(error.into()))?;
        if locked && !lost {
            self.shared.lock(false);
            self.report(over(self.observed.latched));
        }
        Ok(())
    }
}
