//! A joint that belongs to somebody: sessions by challenge and response, and its key given, replaced and taken back;
//! host.
//!
//! A session is opened by what first needs it, and ended with the last copy of the joint: while it is open it serves
//! whoever sends on the bus.

use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::session::Owner;
use super::value::Value;
use bus::client::{Abort, ClientError};
use friction_compensation::parameters::authentication::{CHALLENGE, Challenge, Key, Purpose};
use joint_firmware::objects::field::{Field, OwnerField};
use joint_firmware::objects::ownership::FORGET;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

impl RemoteJoint {
    /// The same joint, with its owner's key for what needs a session.
    #[must_use]
    pub fn owned_by(mut self, key: Key) -> Self {
        self.owner = Some(Arc::new(Owner { key, node: self.node().clone(), opened: AtomicBool::new(false) }));
        self
    }

    /// Writes an object of an index: in a session where the joint wants one and its key is there.
    pub fn download(&self, index: u16, sub_index: u8, bytes: &[u8]) -> Result<(), RemoteError> {
        let attempt = || self.node().download(index, sub_index, bytes);
        match attempt() {
            Err(error @ ClientError::Aborted { abort: Abort::LOCAL_CONTROL, .. }) => {
                if !self.open_session(&error)? {
                    return Err(error.into());
                }
                Ok(attempt()?)
            }
            result => Ok(result?),
        }
    }

    /// Opens a session where that is what a refusal asks for; false where it is not.
    fn open_session(&self, refusal: &ClientError) -> Result<bool, RemoteError> {
        // If these cannot be read, the refusal says more.
        let raw = |field| self.raw(Field::Owner(field)).map_err(|_| RemoteError::from(refusal.clone()));
        if raw(OwnerField::KeyPresent)? == 0 || raw(OwnerField::Session)? != 0 {
            return Ok(false);
        }
        let number = raw(OwnerField::KeyNumber)? as u32;
        let refused = |problem| Err(RemoteError::Owned { node: self.id(), number, problem });
        let Some(owner) = &self.owner else {
            return refused("--key FILE, or JOINTCTL_KEY, opens a session for it".into());
        };
        if owner.key.id() != number {
            return refused(format!("the file has key {:08x}", owner.key.id()));
        }
        self.respond(&owner.key, Purpose::Session)?;
        owner.opened.store(true, Ordering::Relaxed);
        Ok(true)
    }

    fn challenge(&self) -> Result<Challenge, RemoteError> {
        let Entry { object, .. } = Entry::of(Field::Owner(OwnerField::Challenge));
        let bytes = self.node().upload(object.index, object.sub_index).map_err(|error| match error {
            ClientError::Aborted { abort: Abort::DEVICE_STATE, .. } => {
                let problem = "it draws no random numbers for a session: press its button meanwhile, where it has one";
                RemoteError::Image { node: self.id(), problem: problem.into() }
            }
            error => error.into(),
        })?;
        let random: [u8; CHALLENGE] = bytes.try_into().map_err(|bytes: Vec<u8>| {
            let problem = format!("its challenge has {} bytes, must be {CHALLENGE}", bytes.len());
            RemoteError::Image { node: self.id(), problem }
        })?;
        let number = |sub_index| self.node().number(0x1018, sub_index).map(u32::from_le_bytes);
        Ok(Challenge { product: number(2)?, serial: number(4)?, random })
    }

    fn respond(&self, key: &Key, purpose: Purpose) -> Result<(), RemoteError> {
        let response = key.respond(purpose, &self.challenge()?, &[]);
        self.write(Entry::of(Field::Owner(OwnerField::Response)), &Value::Bytes(response.to_vec()))
    }

    fn key_number(&self) -> Result<Option<u32>, RemoteError> {
        let raw = |field| self.raw(Field::Owner(field));
        let present = raw(OwnerField::KeyPresent)? != 0;
        Ok(if present { Some(raw(OwnerField::KeyNumber)? as u32) } else { None })
    }

    fn require_presence(&self) -> Result<(), RemoteError> {
        if self.raw(Field::Owner(OwnerField::Presence))? != 0 {
            return Ok(());
        }
        let problem =
            "nobody is at it: press its button meanwhile, or, where it has none, switch its supply off and on and \
            do this within a minute, before a master starts it"
                .into();
        Err(RemoteError::Image { node: self.id(), problem })
    }

    /// Gives a joint that belongs to nobody its first key. Somebody has to be at it.
    pub fn give_key(&self, key: &Key) -> Result<(), RemoteError> {
        if let Some(number) = self.key_number()? {
            let problem = format!(
                "it has key {number:08x} already: `jointctl key rotate` replaces it, `key forget` takes it back"
            );
            return Err(RemoteError::Image { node: self.id(), problem });
        }
        self.require_presence()?;
        self.write(Entry::of(Field::Owner(OwnerField::Key)), &Value::Bytes(key.to_bytes().to_vec()))
    }

    /// Replaces the key of a joint by another one, which goes over the bus masked.
    pub fn rotate_key(&self, old: &Key, new: &Key) -> Result<(), RemoteError> {
        self.require_key(old)?;
        let challenge = self.challenge()?;
        let masked = old.mask(&challenge, &new.to_bytes());
        let response = old.respond(Purpose::Rotate, &challenge, &masked);
        self.write(Entry::of(Field::Owner(OwnerField::Key)), &Value::Bytes([masked, response].concat()))
    }

    /// Has a joint forget its key: by the key, or without one where somebody is at it. It belongs to nobody then.
    pub fn forget_key(&self, key: Option<&Key>) -> Result<(), RemoteError> {
        match key {
            Some(key) => {
                self.require_key(key)?;
                self.respond(key, Purpose::TakeBack)
            }
            None => {
                self.require_presence()?;
                self.write_raw(Field::Owner(OwnerField::Forget), FORGET.into())
            }
        }
    }

    fn require_key(&self, key: &Key) -> Result<(), RemoteError> {
        let problem = match self.key_number()? {
            Some(number) if number == key.id() => return Ok(()),
            Some(number) => format!("it has key {number:08x}, the file key {:08x}", key.id()),
            None => "it has no key".into(),
        };
        Err(RemoteError::Image { node: self.id(), problem })
    }
}
