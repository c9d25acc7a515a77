//! Objects 2210h to 2214h: the image life cycle as a client sees it; the task.
//!
//! A command that is accepted is answered at once; flash and control step are for the program to do afterwards
//! ([`Images::take_action`], [`Images::finished`]), and the client polls the state.

use super::emergency::{Emergency, of_refusal};
use super::field::{ImageField, StoredField, Which};
use super::ownership::Ownership;
use crate::joint::fault::Faults;
use canopen_node::Abort;
use friction_compensation::parameters::Summary;
use friction_compensation::parameters::authentication::STAGING;
use friction_compensation::parameters::life_cycle::{Action, Conditions, Ending, LifeCycle, Refusal, State};
use friction_compensation::parameters::slots::{Slot, SlotError};

/// Content of the slots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StoredImages {
    /// Image in use, with the slot that it lies in.
    pub active: Option<(Summary, Slot)>,
    /// Image that a roll back would make active.
    pub previous: Option<(Summary, Slot)>,
}

/// State of the joint while an object is written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circumstances {
    pub(super) now: u64,
    pub(super) armed: bool,
    pub(super) single_bank: bool,
    /// Limit of the joint's torque, Q16.16 Nm.
    pub(super) torque: u32,
}

/// Life cycle, staging buffer and owner.
#[derive(Debug)]
pub struct Images<'a> {
    staging: &'a mut [u8; STAGING],
    life: LifeCycle,
    /// Owner with whose key tags are checked.
    pub(super) owner: Ownership,
    stored: StoredImages,
    action: Action,
    uploads: bool,
    /// Checksum of the image that is being read.
    reading: Option<u32>,
}

impl<'a> Images<'a> {
    /// Images from what was found at start.
    pub fn new(staging: &'a mut [u8; STAGING], life: LifeCycle, owner: Ownership, stored: StoredImages) -> Self {
        Self { staging, life, owner, stored, action: Action::Nothing, uploads: false, reading: None }
    }

    /// Restarts as [`Images::new`], with the owner that there is.
    pub(super) fn restart(&mut self, life: LifeCycle, stored: StoredImages) {
        (self.life, self.stored) = (life, stored);
        (self.action, self.uploads, self.reading) = (Action::Nothing, false, None);
        self.owner.close();
    }

    pub(super) fn state(&self) -> u8 {
        // A joint that starts with an image in use has nothing staged, too.
        match self.life.state() {
            State::Empty if self.stored.active.is_some() => State::Active as u8,
            state => state as u8,
        }
    }

    pub(super) fn life(&self) -> &LifeCycle {
        &self.life
    }

    pub(super) fn version(&self) -> u32 {
        self.stored.active.map_or(0, |(summary, _)| summary.version)
    }

    pub(super) fn set_stored(&mut self, stored: StoredImages) {
        self.stored = stored;
    }

    pub(super) fn staging(&mut self) -> &mut [u8; STAGING] {
        self.staging
    }

    pub(super) fn tick(&mut self, now: u64, heartbeat_lost: bool) {
        self.demand(|life| life.tick(now, heartbeat_lost));
    }

    pub(super) fn take_action(&mut self) -> Action {
        core::mem::replace(&mut self.action, Action::Nothing)
    }

    /// Takes the outcome of an action; returns what is to be reported of it.
    pub(super) fn finished(&mut self, outcome: Result<(), SlotError>, latched: Faults) -> Option<Emergency> {
        self.demand(|life| life.finished(outcome));
        outcome.err().map(|error| of_refusal(error.into(), latched))
    }

    fn demand(&mut self, ask: impl FnOnce(&mut LifeCycle) -> Action) {
        let action = ask(&mut self.life);
        if action != Action::Nothing {
            self.action = action;
        }
    }

    /// The value of an object that has one.
    pub(super) fn get(&self, field: ImageField, now: u64) -> u32 {
        match field {
            ImageField::Staging | ImageField::Active | ImageField::Command => 0,
            ImageField::Result => self.life.result().map_or(0, |refusal| refusal.code().into()),
            ImageField::Length => self.life.length() as u32,
            ImageField::Checksum => self.checksum(),
            ImageField::TrialLeft => self.life.trial_left(now),
            ImageField::TrialTime => self.life.trial_time(),
            ImageField::Ending => match self.life.ending() {
                None => 0,
                Some(Ending::Time) => 1,
                Some(Ending::Heartbeat) => 2,
            },
            ImageField::Stored(which, part) => self.stored_part(which, part),
            ImageField::Floor => self.life.lowest(self.owner.key().is_some()),
            ImageField::Failures => self.life.failures().into(),
        }
    }

    fn stored_part(&self, which: Which, part: StoredField) -> u32 {
        let image = match which {
            Which::Active => self.stored.active,
            Which::Previous => self.stored.previous,
        };
        let Some((summary, slot)) = image else { return 0 };
        match part {
            StoredField::Version => summary.version,
            StoredField::Checksum => summary.checksum,
            StoredField::Model => 1 + u32::from(summary.network),
            StoredField::Slot => match slot {
                Slot::First => 1,
                Slot::Second => 2,
            },
            StoredField::Created => u32::try_from(summary.created).unwrap_or(u32::MAX),
        }
    }

    fn checksum(&self) -> u32 {
        const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);
        CRC.checksum(self.staging.get(..self.life.length()).unwrap_or_default())
    }

    fn stored_checksum(&self) -> Option<u32> {
        self.stored.active.map(|(summary, _)| summary.checksum)
    }

    /// Returns `true` if the verified image is the one in use as it is stored: a commit writes nothing.
    pub(super) fn is_stored(&self) -> bool {
        self.life.is_verified(self.stored_checksum())
    }

    /// Carries a command out as far as the life cycle does; `is_stored` as of [`Images::is_stored`].
    pub(super) fn command(&mut self, number: u8, is_stored: bool, circumstances: Circumstances) -> Result<(), Refusal> {
        let Circumstances { now, armed, single_bank, torque } = circumstances;
        let (key, locked) = (self.owner.key(), self.owner.is_locked());
        let conditions = Conditions { now, armed, single_bank, key, locked, is_stored, torque };
        let action = self.life.command_number(number, self.staging, &conditions)?;
        if action != Action::Nothing {
            self.action = action;
        }
        Ok(())
    }

    pub(super) fn set_trial_time(&mut self, time: u32) -> Result<(), Refusal> {
        self.life.set_trial_time(time)
    }

    pub(super) fn open(&mut self, length: Option<u32>) -> Result<(), Refusal> {
        self.life.begin(length.map(|length| length as usize))?;
        self.uploads = true;
        Ok(())
    }

    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        if self.uploads { Ok(self.life.receive(self.staging, bytes)?) } else { Err(Failure::Abort(Abort::GENERAL)) }
    }

    /// The upload is over. What has arrived of an image stays where it is, also where it is not whole: its length tells
    /// that, and verification would say so.
    pub(super) fn end(&mut self) {
        self.uploads = false;
    }

    /// The key has been taken back, and with it what it guarded.
    pub(super) fn forget_owner(&mut self) {
        self.life.forget_owner();
    }

    /// The floor that has risen could not be kept.
    pub(super) fn restore_floor(&mut self, floor: u32) {
        self.life.restore_floor(floor);
    }

    pub(super) fn count_failure(&mut self) {
        self.life.count_failure();
    }

    /// Bytes of what is staged; false where less is staged than is asked for.
    pub(super) fn read_staged(&self, offset: u32, out: &mut [u8]) -> bool {
        let staged = self.staging.get(..self.life.length()).unwrap_or_default();
        super::history::copy(staged, offset, out)
    }

    /// Bytes of the stored image in use.
    pub(super) fn active_length(&self) -> u32 {
        self.stored.active.map_or(0, |(summary, _)| summary.length)
    }

    /// Returns `true` if the bytes from `offset` on are of the image whose first bytes were read.
    pub(super) fn is_same_image(&mut self, offset: u32) -> bool {
        let now = self.stored_checksum();
        if offset == 0 {
            self.reading = now;
        }
        self.reading == now
    }
}

/// Reason for which an upload is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Failure {
    /// Refusal by the life cycle.
    Refused(Refusal),
    /// Abort for another reason.
    Abort(Abort),
}

impl From<Refusal> for Failure {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

/// The abort code of a refusal.
pub(super) const fn abort(refusal: Refusal) -> Abort {
    match refusal {
        Refusal::UploadTooLong { .. } => Abort::TOO_LONG,
        Refusal::UnknownCommand { .. } | Refusal::TrialTime { .. } => Abort::VALUE,
        Refusal::State { .. } | Refusal::Busy | Refusal::Armed { .. } => Abort::DEVICE_STATE,
        Refusal::TagMissing | Refusal::TagWrong { .. } | Refusal::KeyDamaged => Abort::LOCAL_CONTROL,
        Refusal::Slots(_) => Abort::HARDWARE,
        _ => Abort::STORE,
    }
}
