//! The life of an image on the joint, as a state machine; task or host.
//!
//! ```text
//! Empty -> Staged -> Verified -> Shadow, Trial -> Storing -> Committed -> Active
//!                        ^____________|
//!                      time is over, heartbeat lost
//! ```
//!
//! It touches neither flash nor control step: it says what to do ([`Action`]) and is told how that went
//! ([`LifeCycle::finished`]). Time is passed in, in milliseconds of a clock that does not wrap (u64). The bytes of an
//! upload lie in a buffer of the caller's that nobody else writes; what was verified is compared by its checksum before
//! it is run or stored.
//!
//! Versions: with a key, an image older than the floor is refused. Storing an image whose tag was right raises the
//! floor to its version; the same version may come again, but whoever stores one that is [not
//! newer](LifeCycle::is_newer) takes back what an owner may have rolled back from, and the caller asks for more
//! than a tag. Rolling back goes to the stored previous image alone, whatever its version, and leaves the floor.
//! Without a key there is no floor, or an image of version FFFFFFFFh from anybody would be the last one for good.
//!
//! The image in use is not stored again: a commit of it raises the floor as any, and has the stored one swapped
//! in.
//!
//! A key that is damaged locks: no image is taken, tried or rolled back.

mod refusal;
mod states;
#[cfg(test)]
mod tests;
mod verification;

use super::authentication::{Key, STAGING};
use super::certificate;
use super::image::Target;
use super::slots::SlotError;
pub use refusal::Refusal;
pub use states::{Command, State};
pub use verification::Verified;

/// Longest trial, ms: an hour.
pub const MAX_TRIAL_MS: u32 = 3_600_000;

/// Checksum of what was verified. Not the CRC that an image ends with: over an image and its own CRC that one is the
/// same for all of them.
const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISCSI);

/// Mode of an image that runs from RAM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Computed, without effect on the torque.
    Shadow,
    /// In use.
    Trial,
}

/// Next action of the caller. But for [`Action::Nothing`], it tells by [`LifeCycle::finished`] how that went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// No action.
    Nothing,
    /// Prepare the first `length` bytes of the staging buffer and swap them in between two control steps.
    Run {
        /// Mode in which it runs.
        mode: Mode,
        /// Bytes of the image.
        length: usize,
    },
    /// Swap the stored image in again, or none where there is none.
    Revert,
    /// Store the first `length` bytes of the staging buffer in the slots, once [`LifeCycle::floor`] is kept.
    Store {
        /// Bytes of the image.
        length: usize,
    },
    /// Roll the slots back. The staging buffer may be used for it.
    RollBack,
    /// Swap the image of the newest slot in.
    Activate,
}

/// Reason for which a trial ended by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Its time was over.
    Time,
    /// The heartbeat of whoever asked for it was lost.
    Heartbeat,
}

/// State of the joint at this instant.
#[derive(Clone, Copy, Debug)]
pub struct Conditions<'a> {
    /// Time, ms.
    pub now: u64,
    /// The motor is, or may be, under current, or turns so fast that it cannot be left alone while a page is erased.
    pub armed: bool,
    /// Code and parameters lie in one bank: writing stops the program.
    pub single_bank: bool,
    /// The key, once there is one.
    pub key: Option<&'a Key>,
    /// The stored key is damaged.
    pub locked: bool,
    /// The verified image is the one in use, as it is stored ([`LifeCycle::is_verified`]).
    pub is_stored: bool,
    /// Limit of the joint's torque, Q16.16 Nm: no image that can exceed it is verified, runs or is stored.
    pub torque: u32,
}

/// Results of verification.
#[derive(Clone, Copy, Debug)]
struct Checked {
    verified: Verified,
    /// Checksum of the upload's bytes.
    checksum: u32,
    /// Number of the key that the tag was checked with.
    key: Option<u32>,
}

/// The state machine.
#[derive(Clone, Debug)]
pub struct LifeCycle {
    /// Joint that images have to be for: one states the same or 0, any.
    target: Target,
    state: State,
    /// Action that the caller has been told to do and has not finished, with the state to go back to.
    pending: Option<(Action, State)>,
    /// Bytes in the staging buffer.
    length: usize,
    announced: Option<usize>,
    verified: Option<Checked>,
    /// End of the trial, ms.
    end: u64,
    trial_time: u32,
    ending: Option<Ending>,
    floor: u32,
    failures: u16,
    result: Option<Refusal>,
}

impl LifeCycle {
    /// Life cycle at start: nothing is staged.
    ///
    /// `target`: identity of the joint. `floor`: as it was kept. `failures`: the kept count of wrong tags.
    pub const fn new(target: Target, floor: u32, failures: u16) -> Self {
        Self {
            target,
            state: State::Empty,
            pending: None,
            length: 0,
            announced: None,
            verified: None,
            end: 0,
            trial_time: 0,
            ending: None,
            floor,
            failures,
            result: None,
        }
    }

    /// State of the image.
    pub const fn state(&self) -> State {
        self.state
    }

    /// The reason of the last refusal; none after a success.
    pub const fn result(&self) -> Option<Refusal> {
        self.result
    }

    /// Findings about the staged image, from verification on.
    pub fn verified(&self) -> Option<Verified> {
        self.verified.map(|checked| checked.verified)
    }

    /// Bytes staged.
    pub const fn length(&self) -> usize {
        self.length
    }

    /// Joint that images have to be for.
    pub const fn target(&self) -> Target {
        self.target
    }

    /// Highest version with a right tag that was to be stored. To be kept when it has risen, before the image is
    /// stored.
    pub const fn floor(&self) -> u32 {
        self.floor
    }

    /// Goes back to the floor before, because the risen one could not be kept.
    pub const fn restore_floor(&mut self, floor: u32) {
        self.floor = floor;
    }

    /// Lowest version that is taken by a joint with a key, or without: that one has no floor.
    pub const fn lowest(&self, has_key: bool) -> u32 {
        if has_key { self.floor } else { 0 }
    }

    /// Returns `true` if the verified image, where there is one, is newer than every one whose tag was right and
    /// that was to be stored.
    pub fn is_newer(&self) -> bool {
        self.verified.is_none_or(|checked| checked.verified.version > self.floor)
    }

    /// Returns `true` if the verified image has this checksum of a stored one.
    pub fn is_verified(&self, stored: Option<u32>) -> bool {
        self.verified.is_some_and(|checked| stored == Some(checked.verified.checksum))
    }

    /// Wrong tags so far.
    pub const fn failures(&self) -> u16 {
        self.failures
    }

    /// Counts what somebody without the key has tried.
    pub const fn count_failure(&mut self) {
        self.failures = self.failures.saturating_add(1);
    }

    /// Forgets floor and wrong tags, with the key that they belong to.
    pub const fn forget_owner(&mut self) {
        (self.floor, self.failures) = (0, 0);
    }

    /// Remaining time of a trial or shadow, ms; 0 outside.
    pub fn trial_left(&self, now: u64) -> u32 {
        match self.state {
            State::Shadow | State::Trial => u32::try_from(self.end.saturating_sub(now)).unwrap_or(u32::MAX),
            _ => 0,
        }
    }

    /// Reason for which the last trial ended by itself; none while one runs, or where a command ended it.
    pub const fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// Time of the trials that follow, ms; 0 before it was set.
    pub const fn trial_time(&self) -> u32 {
        self.trial_time
    }

    /// Sets the time of trials that follow, 1 to [`MAX_TRIAL_MS`] ms.
    pub fn set_trial_time(&mut self, time: u32) -> Result<(), Refusal> {
        let result = if (1..=MAX_TRIAL_MS).contains(&time) {
            self.trial_time = time;
            Ok(())
        } else {
            Err(Refusal::TrialTime { time })
        };
        self.note(result)
    }

    /// An upload begins, of `announced` bytes where the client has said so. What was staged is forgotten.
    pub fn begin(&mut self, announced: Option<usize>) -> Result<(), Refusal> {
        let result = match announced {
            Some(length) if length > STAGING => Err(Refusal::UploadTooLong { length, room: STAGING }),
            _ => self.upload_possible(),
        };
        if result.is_ok() {
            self.forget();
            self.announced = announced;
        }
        self.note(result)
    }

    /// The next piece of an upload, into the staging buffer.
    pub fn receive(&mut self, staging: &mut [u8; STAGING], piece: &[u8]) -> Result<(), Refusal> {
        let result = self.upload_possible().and_then(|()| {
            let end = self.length.saturating_add(piece.len());
            let place =
                staging.get_mut(self.length..end).ok_or(Refusal::UploadTooLong { length: end, room: STAGING })?;
            for (place, byte) in place.iter_mut().zip(piece) {
                *place = *byte;
            }
            self.length = end;
            self.verified = None;
            self.state = State::Staged;
            Ok(())
        });
        self.note(result)
    }

    /// Carries a command out, as far as it does not touch flash or control step; the caller does the rest.
    pub fn command(
        &mut self,
        command: Command,
        staging: &[u8; STAGING],
        conditions: &Conditions,
    ) -> Result<Action, Refusal> {
        let result = match self.pending {
            Some(_) => Err(Refusal::Busy),
            None if conditions.locked && command != Command::Discard => Err(Refusal::KeyDamaged),
            None => match command {
                Command::Verify => self.verify(staging, conditions),
                Command::Shadow => self.run(Mode::Shadow, staging, conditions),
                Command::Trial => self.run(Mode::Trial, staging, conditions),
                Command::Commit => self.commit(staging, conditions),
                Command::RollBack => self.roll_back(conditions),
                Command::Discard => Ok(self.discard()),
            },
        };
        self.note(result)
    }

    /// [`LifeCycle::command`], by the command's number.
    pub fn command_number(
        &mut self,
        number: u8,
        staging: &[u8; STAGING],
        conditions: &Conditions,
    ) -> Result<Action, Refusal> {
        match Command::from_number(number) {
            Ok(command) => self.command(command, staging, conditions),
            Err(refusal) => self.note(Err(refusal)),
        }
    }

    /// Ends a trial whose time is over or whose client is gone; to be called often.
    pub fn tick(&mut self, now: u64, heartbeat_lost: bool) -> Action {
        if self.pending.is_some() || !matches!(self.state, State::Shadow | State::Trial) {
            return Action::Nothing;
        }
        let ending = if heartbeat_lost {
            Ending::Heartbeat
        } else if now >= self.end {
            Ending::Time
        } else {
            return Action::Nothing;
        };
        self.ending = Some(ending);
        self.revert(State::Verified)
    }

    /// Takes the outcome of what [`LifeCycle::command`], [`LifeCycle::tick`] or this function asked for; returns what
    /// is to be done then.
    pub fn finished(&mut self, outcome: Result<(), SlotError>) -> Action {
        let Some((action, before)) = self.pending.take() else { return Action::Nothing };
        let next = match (action, outcome) {
            (Action::Store { .. }, Ok(())) => {
                self.state = State::Committed;
                Action::Activate
            }
            // The buffer may have served the roll back: nothing is staged any more, whatever came of it.
            (Action::RollBack, outcome) => {
                self.forget();
                match outcome {
                    Ok(()) => {
                        self.state = State::Committed;
                        Action::Activate
                    }
                    Err(error) => {
                        self.result = Some(error.into());
                        Action::Nothing
                    }
                }
            }
            (Action::Store { .. }, Err(error)) => {
                self.state = before;
                self.result = Some(error.into());
                Action::Nothing
            }
            (Action::Activate, Ok(())) => {
                self.forget();
                self.state = State::Active;
                Action::Nothing
            }
            // The stored image is the newest all the same; it is asked for until the control step takes it.
            (Action::Activate | Action::Revert, Err(_)) => action,
            (Action::Run { .. }, Err(_)) => {
                // A trial that was to follow a shadow: what runs is not known, the stored image is.
                self.result = Some(Refusal::NotRun);
                self.state = State::Verified;
                Action::Revert
            }
            (Action::Run { .. } | Action::Revert | Action::Nothing, _) => Action::Nothing,
        };
        if next != Action::Nothing {
            self.pending = Some((next, self.state));
        }
        next
    }

    fn note<T>(&mut self, result: Result<T, Refusal>) -> Result<T, Refusal> {
        self.result = result.as_ref().err().copied();
        result
    }

    fn forget(&mut self) {
        self.state = State::Empty;
        self.length = 0;
        self.announced = None;
        self.verified = None;
    }

    fn begin_action(&mut self, action: Action, before: State) -> Action {
        self.pending = Some((action, before));
        action
    }

    fn upload_possible(&self) -> Result<(), Refusal> {
        match (self.pending, self.state) {
            (Some(_), _) => Err(Refusal::Busy),
            (None, State::Empty | State::Staged | State::Verified | State::Active) => Ok(()),
            (None, state) => Err(Refusal::State { command: None, state }),
        }
    }

    fn verify(&mut self, staging: &[u8; STAGING], conditions: &Conditions) -> Result<Action, Refusal> {
        if !matches!(self.state, State::Staged | State::Verified) {
            return Err(Refusal::State { command: Some(Command::Verify), state: self.state });
        }
        self.state = State::Staged;
        self.verified = None;
        let length = self.length;
        if let Some(announced) = self.announced.filter(|announced| *announced != length) {
            return Err(Refusal::UploadLength { length, announced });
        }
        let upload = staging.get(..length).ok_or(Refusal::UploadTooLong { length, room: STAGING })?;
        if !verification::authentic(upload, conditions.key)? {
            self.count_failure();
            return Err(Refusal::TagWrong { failures: self.failures });
        }
        let floor = self.lowest(conditions.key.is_some());
        let verified = verification::verify(upload, self.target, conditions.torque, floor)?;
        self.verified = Some(Checked { verified, checksum: CRC.checksum(upload), key: conditions.key.map(Key::id) });
        self.state = State::Verified;
        Ok(Action::Nothing)
    }

    /// The verified image, if the staging buffer still holds it, and the joint has got neither a key nor a lower limit
    /// of its torque since.
    fn unchanged(
        &self,
        command: Command,
        staging: &[u8; STAGING],
        conditions: &Conditions,
    ) -> Result<Verified, Refusal> {
        let refused = Refusal::State { command: Some(command), state: self.state };
        let (true, Some(Checked { verified, checksum, key })) =
            (matches!(self.state, State::Verified | State::Shadow | State::Trial), &self.verified)
        else {
            return Err(refused);
        };
        let (bound, limit) = (verified.certificate.output, conditions.torque);
        if bound > limit {
            return Err(Refusal::Certificate(certificate::Refusal::Output { bound, limit }));
        }
        let upload = staging.get(..self.length).ok_or(refused)?;
        if CRC.checksum(upload) != *checksum {
            return Err(Refusal::Changed);
        }
        if *key != conditions.key.map(Key::id) {
            return Err(Refusal::TagMissing);
        }
        Ok(*verified)
    }

    fn run(&mut self, mode: Mode, staging: &[u8; STAGING], conditions: &Conditions) -> Result<Action, Refusal> {
        let (command, state) = match mode {
            Mode::Shadow => (Command::Shadow, State::Shadow),
            Mode::Trial => (Command::Trial, State::Trial),
        };
        let Verified { length, .. } = self.unchanged(command, staging, conditions)?;
        if self.trial_time == 0 {
            return Err(Refusal::TrialTime { time: 0 });
        }
        let before = self.state;
        self.end = conditions.now.saturating_add(self.trial_time.into());
        self.ending = None;
        self.state = state;
        Ok(self.begin_action(Action::Run { mode, length }, before))
    }

    fn commit(&mut self, staging: &[u8; STAGING], conditions: &Conditions) -> Result<Action, Refusal> {
        let Verified { length, version, .. } = self.unchanged(Command::Commit, staging, conditions)?;
        if conditions.single_bank && conditions.armed {
            return Err(Refusal::Armed { command: Command::Commit });
        }
        if conditions.key.is_some() {
            self.floor = self.floor.max(version);
        }
        if conditions.is_stored {
            self.forget();
            return Ok(self.revert(State::Active));
        }
        let before = self.state;
        self.state = State::Storing;
        Ok(self.begin_action(Action::Store { length }, before))
    }

    fn roll_back(&mut self, conditions: &Conditions) -> Result<Action, Refusal> {
        if matches!(self.state, State::Shadow | State::Trial) {
            return Err(Refusal::State { command: Some(Command::RollBack), state: self.state });
        }
        if conditions.single_bank && conditions.armed {
            return Err(Refusal::Armed { command: Command::RollBack });
        }
        let before = self.state;
        self.state = State::Storing;
        Ok(self.begin_action(Action::RollBack, before))
    }

    fn discard(&mut self) -> Action {
        let before = self.state;
        self.forget();
        self.ending = None;
        match before {
            State::Shadow | State::Trial => self.revert(State::Empty),
            State::Active => {
                // No image is staged that could be forgotten.
                self.state = State::Active;
                Action::Nothing
            }
            _ => Action::Nothing,
        }
    }

    fn revert(&mut self, state: State) -> Action {
        self.state = state;
        self.begin_action(Action::Revert, state)
    }
}
