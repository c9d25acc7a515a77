//! The life of a parameter image on a joint, from upload to roll back; host.
//!
//! Nothing is half done: what is in use changes by a commit or a roll back alone, which the joint does whole or not at
//! all; a trial and a shadow end by themselves. Every upload is compared with what the joint says it received, and
//! every commit is read back.

use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::refusal::{Attempt, image_state};
use super::value::Value;
use bus::client::ClientError;
use bus::client::sdo::Method;
use canopen_node::Abort;
use friction_compensation::parameters::authentication::{STAGING, split};
use friction_compensation::parameters::life_cycle::{Command, State};
use identification::progress::Progress;
use joint_firmware::objects::field::{Actual, Field, ImageField, StoredField, Which};
use std::time::{Duration, Instant};

/// Longest time of storing: two pages erased and written take less than a tenth of it.
const STORING: Duration = Duration::from_secs(5);
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Use of an uploaded image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Use {
    /// Verification: it waits then.
    Verify,
    /// Computed beside the one in use, without effect, for a time, s.
    Shadow(f64),
    /// Trial for a time, s; then the stored one is in use again.
    Trial(f64),
    /// Stored and in use.
    Commit,
}

/// An image that is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredImage {
    /// Version.
    pub version: u32,
    /// Its checksum.
    pub checksum: u32,
    /// `true` if it has a network.
    pub network: bool,
    /// 1 or 2.
    pub slot: u8,
    /// Time since 1970-01-01 UTC, s; 0 where it is not stated.
    pub created: u32,
}

/// State of the images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageStatus {
    /// State of the image that is staged; [`State::Active`] where none is and one is in use.
    pub state: State,
    /// Remaining time of a trial or shadow, s; 0 outside.
    pub left: f64,
    /// Stored and in use, but for a trial.
    pub active: Option<StoredImage>,
    /// Image that a roll back would make active.
    pub previous: Option<StoredImage>,
}

impl RemoteJoint {
    /// State of a staged image.
    pub fn image_state(&self) -> Result<State, RemoteError> {
        let number = self.raw(Field::Actual(Actual::ImageState))?;
        image_state(number as u8).ok_or_else(|| {
            let problem = format!("{number} is no state of the image life cycle that this program knows");
            RemoteError::Image { node: self.id(), problem }
        })
    }

    /// State of the images.
    pub fn image_status(&self) -> Result<ImageStatus, RemoteError> {
        Ok(ImageStatus {
            state: self.image_state()?,
            left: self.number(Field::Image(ImageField::TrialLeft))?,
            active: self.stored_image(Which::Active)?,
            previous: self.stored_image(Which::Previous)?,
        })
    }

    fn stored_image(&self, which: Which) -> Result<Option<StoredImage>, RemoteError> {
        let raw = |part| self.raw(Field::Image(ImageField::Stored(which, part)));
        let version = match which {
            Which::Active => self.raw(Field::Actual(Actual::ImageVersion))?,
            Which::Previous => raw(StoredField::Version)?,
        };
        let slot = raw(StoredField::Slot)? as u8;
        if slot == 0 {
            return Ok(None);
        }
        Ok(Some(StoredImage {
            version: version as u32,
            checksum: raw(StoredField::Checksum)? as u32,
            network: raw(StoredField::Model)? == 2,
            slot,
            created: raw(StoredField::Created)? as u32,
        }))
    }

    /// A command of the life cycle; a refusal with its reason.
    fn image_command(&self, command: Command, upload: &[u8]) -> Result<(), RemoteError> {
        let Entry { object, .. } = Entry::of(Field::Image(ImageField::Command));
        let (index, sub_index, number) = (object.index, object.sub_index, [command as u8]);
        let sent = match command {
            Command::RollBack => self.download(index, sub_index, &number),
            Command::Commit => self.commit(index, sub_index),
            _ => self.node().download(index, sub_index, &number).map_err(RemoteError::from),
        };
        sent.map_err(|error| self.explain(error, Attempt { command: Some(command), upload }))
    }

    /// A commit is refused for the image's sake, with a reason, or because the image is not newer than the floor
    /// and so the owner's to store.
    fn commit(&self, index: u16, sub_index: u8) -> Result<(), RemoteError> {
        let number = [Command::Commit as u8];
        match self.node().download(index, sub_index, &number) {
            Err(ClientError::Aborted { abort: Abort::LOCAL_CONTROL, .. })
                if self.raw(Field::Image(ImageField::Result))? == 0 =>
            {
                let floor = self.raw(Field::Image(ImageField::Floor))?;
                self.download(index, sub_index, &number).map_err(|error| match error {
                    RemoteError::Owned { node, number, problem } => {
                        let problem = format!("the image is not newer than version {floor}; {problem}");
                        RemoteError::Owned { node, number, problem }
                    }
                    error => error,
                })
            }
            sent => Ok(sent?),
        }
    }

    fn explain(&self, error: RemoteError, attempt: Attempt) -> RemoteError {
        match error {
            // Before its first byte: the joint has no result of it.
            RemoteError::Client(ClientError::Aborted { abort: Abort::TOO_LONG, .. }) => {
                return attempt.refused(self, 0x0101);
            }
            RemoteError::Client(ClientError::Aborted { .. }) => {}
            _ => return error,
        }
        match self.raw(Field::Image(ImageField::Result)) {
            Ok(code) if code != 0 => attempt.refused(self, code as u16),
            _ => error,
        }
    }

    /// Brings an image, and its tag where there is one, into the joint, and on as far as is asked for.
    pub fn upload_image(&self, upload: &[u8], usage: Use, progress: &dyn Progress) -> Result<ImageStatus, RemoteError> {
        // Errors that can be foreseen are found before the first byte.
        self.check_use(usage)?;
        if upload.is_empty() || upload.len() > STAGING {
            let problem = format!("the image has {} bytes, must be 1 to {STAGING}", upload.len());
            return Err(RemoteError::Image { node: self.id(), problem });
        }
        progress.stage(&format!("upload {} bytes", upload.len()));
        self.stage(upload)?;
        progress.stage("verify");
        self.image_command(Command::Verify, upload)?;
        self.use_image(upload, usage, progress)
    }

    fn check_use(&self, usage: Use) -> Result<(), RemoteError> {
        match usage {
            Use::Verify => Ok(()),
            Use::Shadow(seconds) | Use::Trial(seconds) => {
                let time = Entry::of(Field::Image(ImageField::TrialTime));
                time.encode(&Value::Real(seconds)).map(drop)
            }
            Use::Commit => self.require_off("storing an image"),
        }
    }

    /// Takes the image that this program uploaded and that the joint verified a step further, from shadow to trial say,
    /// without sending it again. Whose image is staged no object tells: the checksum of the staged bytes is the
    /// same for all whole images without a tag, because their own is part of them.
    pub fn use_image(&self, upload: &[u8], usage: Use, progress: &dyn Progress) -> Result<ImageStatus, RemoteError> {
        self.check_use(usage)?;
        match usage {
            Use::Verify => {}
            Use::Shadow(seconds) | Use::Trial(seconds) => {
                let (command, name) = match usage {
                    Use::Shadow(_) => (Command::Shadow, "shadow"),
                    _ => (Command::Trial, "trial"),
                };
                progress.stage(name);
                self.write(Entry::of(Field::Image(ImageField::TrialTime)), &Value::Real(seconds))?;
                self.image_command(command, upload)?;
            }
            Use::Commit => {
                progress.stage("store");
                self.image_command(Command::Commit, upload)?;
                self.await_stored(Attempt { command: Some(Command::Commit), upload })?;
                progress.stage("read back");
                let (image, _) = split(upload);
                self.compare_active(image)?;
            }
        }
        self.image_status()
    }

    fn stage(&self, upload: &[u8]) -> Result<(), RemoteError> {
        let Entry { object, .. } = Entry::of(Field::Image(ImageField::Staging));
        let sent = self.node().download_by(object.index, object.sub_index, upload, Method::Block);
        sent.map_err(|error| self.explain(error.into(), Attempt { command: None, upload }))?;
        if self.received(upload)? {
            return Ok(());
        }
        let problem =
            "it received other bytes than were sent: another client uploads, too? Nothing was changed; upload again"
                .into();
        Err(RemoteError::Image { node: self.id(), problem })
    }

    /// Returns `true` if the staging buffer has as many bytes as these, and whole ones.
    fn received(&self, upload: &[u8]) -> Result<bool, RemoteError> {
        let raw = |field| self.raw(Field::Image(field));
        Ok(raw(ImageField::Length)? == upload.len() as u64
            && raw(ImageField::Checksum)? == u64::from(CRC.checksum(upload)))
    }

    /// Waits until flash is written, or was refused to be.
    fn await_stored(&self, attempt: Attempt) -> Result<(), RemoteError> {
        let deadline = Instant::now() + STORING;
        loop {
            match self.image_state()? {
                State::Active => return Ok(()),
                State::Storing | State::Committed if Instant::now() < deadline => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                state => {
                    let code = self.raw(Field::Image(ImageField::Result))? as u16;
                    if code != 0 {
                        return Err(attempt.refused(self, code));
                    }
                    let problem = format!("storing did not come to its end: the image is {state:?}");
                    return Err(RemoteError::Image { node: self.id(), problem });
                }
            }
        }
    }

    /// The image in use, as it is stored; empty where there is none.
    pub fn active_image(&self) -> Result<Vec<u8>, RemoteError> {
        let Entry { object, .. } = Entry::of(Field::Image(ImageField::Active));
        Ok(self.node().upload_by(object.index, object.sub_index, Method::Block)?)
    }

    fn compare_active(&self, image: &[u8]) -> Result<(), RemoteError> {
        let stored = self.active_image()?;
        // The tag is no part of what is kept, or is: that is the joint's business.
        if split(&stored).0 == image {
            return Ok(());
        }
        let problem =
            "the image that it stored reads back differently: `jointctl rollback` goes back to the one before".into();
        Err(RemoteError::Image { node: self.id(), problem })
    }

    /// Makes the stored previous image the one in use. The motor has to be off.
    pub fn roll_back_image(&self) -> Result<ImageStatus, RemoteError> {
        self.require_off("rolling back")?;
        self.image_command(Command::RollBack, &[])?;
        self.await_stored(Attempt { command: Some(Command::RollBack), upload: &[] })?;
        self.image_status()
    }

    /// Forgets what is staged; a trial or shadow of it ends.
    pub fn discard_image(&self) -> Result<ImageStatus, RemoteError> {
        self.image_command(Command::Discard, &[])?;
        self.image_status()
    }
}
