//! Commands and states of the life cycle, each with its number and in words.

use super::Refusal;

/// Command of a client, with the number that it writes to object 2212:1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Command {
    /// Check what is staged.
    Verify = 1,
    /// Run it from RAM for a time.
    Trial = 2,
    /// Store it.
    Commit = 3,
    /// Go back to the stored previous image.
    RollBack = 4,
    /// Forget what is staged; where it runs, go back to the stored image.
    Discard = 5,
    /// Compute it for a time beside the stored one, without effect.
    Shadow = 6,
}

impl Command {
    /// All commands, by number.
    pub const ALL: [Self; 6] = [Self::Verify, Self::Trial, Self::Commit, Self::RollBack, Self::Discard, Self::Shadow];

    /// The command in words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Verify => "a verification",
            Self::Trial => "a trial",
            Self::Commit => "a commit",
            Self::RollBack => "a roll back",
            Self::Discard => "a discard",
            Self::Shadow => "a shadow",
        }
    }

    /// The command with this number.
    pub fn from_number(value: u8) -> Result<Self, Refusal> {
        Self::ALL.into_iter().find(|command| *command as u8 == value).ok_or(Refusal::UnknownCommand { value })
    }
}

/// State of an image, with the number of object 2212:2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// No image is staged.
    #[default]
    Empty = 0,
    /// Bytes have arrived.
    Staged = 1,
    /// Verified bytes: everything holds of them.
    Verified = 2,
    /// Computed without effect.
    Shadow = 3,
    /// Trial from RAM.
    Trial = 4,
    /// Being written to flash, or the roll back is.
    Storing = 5,
    /// Stored in flash, not in use yet.
    Committed = 6,
    /// Stored in flash and in use; nothing is staged.
    Active = 7,
}

impl State {
    /// The state in words, behind "while".
    pub const fn phrase(self) -> &'static str {
        match self {
            Self::Empty => "nothing is staged",
            Self::Staged => "the staged image is not verified",
            Self::Verified => "a verified image waits",
            Self::Shadow => "an image is in shadow",
            Self::Trial => "an image is on trial",
            Self::Storing => "flash is being written",
            Self::Committed => "the stored image is not in use yet",
            Self::Active => "nothing is staged beside the image in use",
        }
    }
}
