//! Object 2215h: who owns the joint, and what its owner may do; the task.
//!
//! A joint without a key belongs to nobody and takes everything. With one, whatever changes what it can do to its
//! surroundings wants a session, which the key opens
//! ([`authentication`](friction_compensation::parameters::authentication)). The first key, and the end of a key that is
//! lost, want somebody at the joint: its button is pressed, or, where it has none, its supply has just come and no
//! master has started it since.

use super::field::OwnerField;
use super::settings::Setting;
use crate::joint::configuration::Configuration;
use canopen_node::Abort;
use friction_compensation::parameters::authentication::{CHALLENGE, Challenge, KEY, Key, Purpose, TAG};
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::image::Target;

/// Presence of sessions and of the rotation of keys in this program. With the feature `little-room` a chip's program
/// has none: its board has a button, and who presses it is taken for the owner. On the host nothing changes.
pub const SESSIONS: bool = !cfg!(all(feature = "little-room", target_os = "none"));
/// Duration of a session after what was last written in it, ms.
pub const SESSION: u64 = 60_000;
/// Longest life of a session from its opening, ms, whatever is written in it: while it is open it serves
/// everybody, who must not keep it open for good. An owner whose work takes longer opens the next one with a new
/// response.
pub const LIFE: u64 = 600_000;
/// Time after its supply has come in which a joint without a button takes its client for somebody who is there, ms.
pub const POWER_UP: u64 = 60_000;
/// Number that makes a joint forget its key, where somebody is present: "back".
pub const FORGET: u32 = u32::from_le_bytes(*b"back");
/// Longest upload: a masked key and its response.
pub(super) const UPLOAD: usize = if SESSIONS { KEY + TAG } else { KEY };

/// Settings that anybody may lower below what the owner set, as far as off; where there is a button, it is for that,
/// too.
const BOXED: [Setting; 5] =
    [Setting::Request, Setting::CompensationGain, Setting::Clamp, Setting::Slew, Setting::Adaptation];
/// Number of settings that are remembered as the owner set them.
const OWNED: usize = if SESSIONS { BOXED.len() } else { 0 };

/// Change of ownership that is to be kept.
#[derive(Clone, Debug)]
pub(super) enum Change {
    /// Another key, or the first.
    Key(Key),
    /// No key any more.
    Forgotten,
    /// Repaired guard: what was damaged is kept anew with the key that was left.
    Repaired,
}

/// State of the joint when an upload ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Joint whose challenge it is.
    pub(super) target: Target,
    pub(super) now: u64,
    /// `true` if somebody is at the joint.
    pub(super) present: bool,
    /// The flash can be written.
    pub(super) writable: bool,
}

/// The owner's key and session.
#[derive(Debug)]
pub struct Ownership {
    key: Option<Key>,
    locked: bool,
    challenge: [Option<[u8; CHALLENGE]>; SESSIONS as usize],
    /// End of the session, ms.
    end: u64,
    /// Latest end that it can have, ms.
    latest: u64,
    upload: Option<(OwnerField, usize)>,
    bytes: [u8; UPLOAD],
    /// Settings as the owner left them.
    owned: [u32; OWNED],
}

impl Ownership {
    /// Ownership from what was kept.
    pub fn new(guard: &Guard) -> Self {
        Self {
            key: guard.key.clone(),
            locked: guard.locked,
            challenge: [None; SESSIONS as usize],
            end: 0,
            latest: 0,
            upload: None,
            bytes: [0; UPLOAD],
            owned: [0; OWNED],
        }
    }

    /// The key, once there is one.
    pub(super) fn key(&self) -> Option<&Key> {
        self.key.as_ref()
    }

    /// Returns `true` if what was kept is damaged.
    pub(super) fn is_locked(&self) -> bool {
        self.locked
    }

    fn is_owned(&self) -> bool {
        self.locked || self.key.is_some()
    }

    /// Guard to be kept, with a floor and a count of failures.
    pub(super) fn guard(&self, floor: u32, failures: u16) -> Guard {
        Guard { floor, failures, key: self.key.clone(), locked: self.locked }
    }

    /// The settings are as the owner wants them.
    pub(super) fn note(&mut self, configuration: &Configuration) {
        for (owned, setting) in self.owned.iter_mut().zip(BOXED) {
            *owned = setting.get(configuration);
        }
    }

    /// Returns `true` if what changes what the joint can do may be written at `now` (ms).
    pub(super) fn is_open(&self, now: u64) -> bool {
        !self.is_owned() || SESSIONS && now < self.end
    }

    /// A session that is open lasts on.
    pub(super) fn prolong(&mut self, now: u64) {
        if SESSIONS && self.is_owned() {
            self.end = (now + SESSION).min(self.latest);
        }
    }

    /// Returns `true` if a setting that acts at once asks for no more compensation than the owner set, which is open to
    /// all. The numbers compare as the settings do: each is a choice that rises, or a REAL32, whose bits rise from 0 on
    /// and are larger for what is negative.
    pub(super) fn is_lowered(&self, setting: Setting, number: u32) -> bool {
        BOXED.iter().zip(&self.owned).any(|(one, owned)| *one == setting && number <= *owned)
    }

    /// Remaining time of the session, ms.
    fn left(&self, now: u64) -> u32 {
        if self.is_owned() { self.end.saturating_sub(now) as u32 } else { 0 }
    }

    /// Value of an object; `present` where somebody is at the joint.
    pub(super) fn get(&self, field: OwnerField, present: bool, now: u64) -> u32 {
        match field {
            OwnerField::KeyPresent => self.is_owned().into(),
            OwnerField::KeyNumber => self.key.as_ref().map_or(0, Key::id),
            OwnerField::Session => self.left(now),
            OwnerField::Presence => present.into(),
            OwnerField::Challenge | OwnerField::Response | OwnerField::Key | OwnerField::Forget => 0,
        }
    }

    /// Ends the session, and forgets what is under way.
    pub(super) fn close(&mut self) {
        self.end = 0;
        self.abandon();
    }

    /// The challenge of the next response; `draw` gives another one once it is used up, or nothing.
    pub(super) fn challenge(&mut self, draw: impl FnOnce() -> Option<[u8; CHALLENGE]>) -> Option<[u8; CHALLENGE]> {
        let challenge = self.challenge.first_mut()?;
        if challenge.is_none() {
            *challenge = draw();
        }
        *challenge
    }

    /// An upload begins: of a key or a response.
    pub(super) fn open(&mut self, field: OwnerField) -> Result<(), Abort> {
        match field {
            OwnerField::Key | OwnerField::Response => {
                self.upload = Some((field, 0));
                Ok(())
            }
            _ => Err(Abort::READ_ONLY),
        }
    }

    /// Returns `true` if an upload is for this.
    pub(super) fn is_receiving(&self) -> bool {
        self.upload.is_some()
    }

    pub(super) fn append(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        let Some((_, length)) = &mut self.upload else { return Err(Abort::GENERAL) };
        let end = length.saturating_add(bytes.len());
        let place = self.bytes.get_mut(*length..end).ok_or(Abort::TOO_LONG)?;
        place.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte);
        *length = end;
        Ok(())
    }

    pub(super) fn abandon(&mut self) {
        self.upload = None;
        self.bytes = [0; UPLOAD];
    }

    /// The upload is whole: what is to be kept, and then to be [taken](Self::take).
    pub(super) fn finish(&mut self, place: &Place) -> Result<Option<Change>, Wrong> {
        let upload = self.upload.take();
        let bytes = core::mem::replace(&mut self.bytes, [0; UPLOAD]);
        let (first, second) = bytes.split_first_chunk::<KEY>().ok_or(Wrong::Abort(Abort::GENERAL))?;
        match upload {
            Some((OwnerField::Key, KEY)) => self.first_key(*first, place).map_err(Wrong::Abort),
            Some((OwnerField::Response, TAG)) if SESSIONS => self.respond(first, place),
            Some((OwnerField::Key, length)) if SESSIONS && length == UPLOAD => self.rotate(first, second, place),
            Some(_) => Err(Wrong::Abort(Abort::TOO_SHORT)),
            None => Ok(None),
        }
    }

    /// The first key comes as it is: whoever gives it is there.
    fn first_key(&self, bytes: [u8; KEY], place: &Place) -> Result<Option<Change>, Abort> {
        if self.is_owned() || !place.present {
            return Err(Abort::LOCAL_CONTROL);
        }
        let key = Key::new(bytes).map_err(|_| Abort::VALUE)?;
        if place.writable { Ok(Some(Change::Key(key))) } else { Err(Abort::DEVICE_STATE) }
    }

    /// The challenge that a response may answer, once.
    fn answered(&self, place: &Place) -> Result<(&Key, Challenge), Wrong> {
        let key = self.key.as_ref().ok_or(Wrong::Abort(Abort::LOCAL_CONTROL))?;
        let random = self.challenge.first().copied().flatten().ok_or(Wrong::Response)?;
        Ok((key, Challenge { product: place.target.product, serial: place.target.serial, random }))
    }

    fn respond(&mut self, response: &[u8; TAG], place: &Place) -> Result<Option<Change>, Wrong> {
        let (key, challenge) = self.answered(place)?;
        let opens = key.accepts(Purpose::Session, &challenge, &[], response);
        let forgets = key.accepts(Purpose::TakeBack, &challenge, &[], response);
        if !opens && !forgets {
            return Err(Wrong::Response);
        }
        if (forgets || self.locked) && !place.writable {
            return Err(Wrong::Abort(Abort::DEVICE_STATE));
        }
        self.challenge = [None; SESSIONS as usize];
        if opens {
            self.latest = place.now + LIFE;
            self.prolong(place.now);
        }
        Ok(match (forgets, self.locked) {
            (true, _) => Some(Change::Forgotten),
            (false, true) => Some(Change::Repaired),
            (false, false) => None,
        })
    }

    fn rotate(&mut self, masked: &[u8; KEY], response: &[u8], place: &Place) -> Result<Option<Change>, Wrong> {
        let (key, challenge) = self.answered(place)?;
        let right = response.first_chunk().is_some_and(|tag| key.accepts(Purpose::Rotate, &challenge, masked, tag));
        if !right {
            return Err(Wrong::Response);
        }
        if !place.writable {
            return Err(Wrong::Abort(Abort::DEVICE_STATE));
        }
        let new = Key::new(key.mask(&challenge, masked)).map_err(|_| Wrong::Abort(Abort::VALUE))?;
        self.challenge = [None; SESSIONS as usize];
        Ok(Some(Change::Key(new)))
    }

    /// Change by which the joint forgets its key, or what is damaged of it is repaired, if whoever is present may have
    /// that.
    pub(super) fn forget(&self, number: u32, place: &Place) -> Result<Change, Abort> {
        match number {
            FORGET if !place.present => Err(Abort::LOCAL_CONTROL),
            FORGET if !place.writable => Err(Abort::DEVICE_STATE),
            FORGET => Ok(Change::Forgotten),
            _ => Err(Abort::VALUE),
        }
    }

    /// Guard to be kept of a change.
    pub(super) fn changed(&self, change: &Change, floor: u32, failures: u16) -> Guard {
        match change {
            Change::Key(key) => Guard { floor, failures, key: Some(key.clone()), locked: false },
            Change::Forgotten => Guard::default(),
            Change::Repaired => Guard { locked: false, ..self.guard(floor, failures) },
        }
    }

    /// A change that is kept.
    pub(super) fn take(&mut self, guard: Guard) {
        (self.key, self.locked) = (guard.key, guard.locked);
    }
}

/// Reason for which an upload is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wrong {
    /// Wrong response to the challenge: to be counted.
    Response,
    /// Another reason.
    Abort(Abort),
}
