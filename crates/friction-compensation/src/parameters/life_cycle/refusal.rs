//! Reasons for which an image is not taken a step further, with a number for each; task or host.
//!
//! The numbers are what a bus reads (result of the last command, object 2212:3). They never change their meaning; 0 is
//! success.

use super::{Command, MAX_TRIAL_MS, State};
use crate::parameters::certificate;
use crate::parameters::image::{Effort, GoldenMismatch, ImageError};
use crate::parameters::slots::SlotError;

/// Reason for which a command, or what followed from it, was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// More bytes than the staging buffer has.
    UploadTooLong {
        /// Bytes with those that were refused.
        length: usize,
        /// Bytes of the staging buffer.
        room: usize,
    },
    /// Number of bytes that is not the announced one.
    UploadLength {
        /// Bytes that arrived.
        length: usize,
        /// Bytes that were announced.
        announced: usize,
    },
    /// The bytes are no image, or a damaged one.
    Image(ImageError),
    /// The joint has a key and the upload no tag.
    TagMissing,
    /// The tag is not the image's.
    TagWrong {
        /// Wrong tags so far.
        failures: u16,
    },
    /// The stored key is damaged: nobody's tag can be checked.
    KeyDamaged,
    /// An older image than one that was in use.
    Version {
        /// Version of the image.
        version: u32,
        /// Lowest that is taken.
        floor: u32,
    },
    /// Image for another product.
    Product {
        /// Product that the image is for.
        image: u32,
        /// Product of this joint.
        joint: u32,
    },
    /// Image for another joint.
    Serial {
        /// Serial number that the image is for.
        image: u32,
        /// Serial number of this joint.
        joint: u32,
    },
    /// Effort in another unit than the joint commands.
    Effort {
        /// Unit of the image.
        image: Effort,
        /// Effort of this joint.
        joint: Effort,
    },
    /// The certificate cannot be given, within the image's limits and the joint's.
    Certificate(certificate::Refusal),
    /// Mismatch of arithmetic: this program's is not the one that the image was judged with.
    Golden(GoldenMismatch),
    /// No such command.
    UnknownCommand {
        /// Number that was written.
        value: u8,
    },
    /// Command or upload that this state does not permit.
    State {
        /// The command; none for an upload.
        command: Option<Command>,
        /// State of the life cycle.
        state: State,
    },
    /// Operation that was begun and has not come to its end.
    Busy,
    /// One bank of flash: the program stands still while it is written, and the motor must be off and nearly at rest.
    Armed {
        /// The command.
        command: Command,
    },
    /// A trial of no or too long a time.
    TrialTime {
        /// Time asked for, ms.
        time: u32,
    },
    /// The staging buffer does not hold what was verified.
    Changed,
    /// The control step does not take the image.
    NotRun,
    /// The slots do not do it.
    Slots(SlotError),
}

impl Refusal {
    /// The number of the reason; never 0. The upper byte groups the reasons.
    pub const fn code(self) -> u16 {
        use certificate::Refusal as C;
        match self {
            Self::UploadTooLong { .. } => 0x0101,
            Self::UploadLength { .. } => 0x0102,
            Self::Image(ImageError::Truncated { .. }) => 0x0201,
            Self::Image(ImageError::TooLong { .. }) => 0x0202,
            Self::Image(ImageError::NotAnImage { .. }) => 0x0203,
            Self::Image(ImageError::UnsupportedFormat { .. }) => 0x0204,
            Self::Image(ImageError::Checksum { .. }) => 0x0205,
            Self::Image(ImageError::Reserved { .. }) => 0x0206,
            Self::Image(ImageError::Field { .. }) => 0x0207,
            Self::Image(ImageError::TooManySets { .. }) => 0x0208,
            Self::TagMissing => 0x0301,
            Self::TagWrong { .. } => 0x0302,
            // 0303h was a lock-out.
            Self::KeyDamaged => 0x0304,
            Self::Version { .. } => 0x0401,
            Self::Product { .. } => 0x0501,
            Self::Serial { .. } => 0x0502,
            Self::Effort { .. } => 0x0503,
            Self::Certificate(C::NetworkOverflow { .. }) => 0x0601,
            Self::Certificate(C::PhysicalOverflow { .. }) => 0x0602,
            Self::Certificate(C::Output { .. }) => 0x0603,
            Self::Certificate(C::TorqueGain { .. }) => 0x0604,
            Self::Certificate(C::VelocitySlope { .. }) => 0x0605,
            Self::Golden(_) => 0x0701,
            Self::UnknownCommand { .. } => 0x0801,
            Self::State { .. } => 0x0802,
            Self::Busy => 0x0803,
            Self::Armed { .. } => 0x0804,
            Self::TrialTime { .. } => 0x0805,
            Self::Changed => 0x0806,
            Self::NotRun => 0x0807,
            Self::Slots(SlotError::Write(_)) => 0x0901,
            Self::Slots(SlotError::Verify { .. }) => 0x0902,
            Self::Slots(SlotError::Length { .. }) => 0x0903,
            Self::Slots(SlotError::Buffer { .. }) => 0x0904,
            Self::Slots(SlotError::NoPrevious) => 0x0905,
            Self::Slots(SlotError::Damaged { .. }) => 0x0906,
        }
    }
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match *self {
            Self::UploadTooLong { length, room } => write!(f, "upload of {length} bytes, at most {room} fit"),
            Self::UploadLength { length, announced } => {
                write!(f, "upload ended after {length} bytes, {announced} were announced")
            }
            Self::Image(error) => write!(f, "image: {error}"),
            Self::TagMissing => f.write_str("the joint has a key, but no tag of 32 bytes follows the image"),
            Self::TagWrong { failures } => {
                write!(f, "the tag is not that of this image and key ({failures} wrong ones so far)")
            }
            Self::KeyDamaged => {
                f.write_str("the joint's key is damaged: it takes no image, and keeps the one that it has")
            }
            Self::Version { version, floor } => write!(f, "image version {version}, must be at least {floor}"),
            Self::Product { image, joint } => write!(f, "image for product {image:#x}, this joint is {joint:#x}"),
            Self::Serial { image, joint } => write!(f, "image for serial number {image}, this joint has {joint}"),
            Self::Effort { image, joint } => {
                write!(f, "image in {}, this joint commands {}", image.symbol(), joint.symbol())
            }
            Self::Certificate(refusal) => write!(f, "certificate: {refusal}"),
            Self::Golden(mismatch) => mismatch.fmt(f),
            Self::UnknownCommand { value } => write!(f, "command {value} is not known, 1 to 6 are"),
            Self::State { command: Some(command), state } => {
                write!(f, "{} is not possible while {}", command.name(), state.phrase())
            }
            Self::State { command: None, state } => write!(f, "an upload is not possible while {}", state.phrase()),
            Self::Busy => f.write_str("what was begun before has not come to its end"),
            Self::Armed { command } => {
                write!(f, "{} writes the only bank of flash: the motor must be off and nearly at rest", command.name())
            }
            Self::TrialTime { time } => write!(f, "trial of {time} ms, must be 1 to {MAX_TRIAL_MS}"),
            Self::Changed => f.write_str("the staging buffer does not hold what was verified"),
            Self::NotRun => f.write_str("the control step has not taken the image"),
            Self::Slots(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

impl From<ImageError> for Refusal {
    fn from(error: ImageError) -> Self {
        Self::Image(error)
    }
}

impl From<SlotError> for Refusal {
    fn from(error: SlotError) -> Self {
        Self::Slots(error)
    }
}
