//! Reasons for which a joint refuses an image: the number (object 2212h:3) in words, with what both sides are known to
//! be; host.
//!
//! The joint tells a number. What stands behind it in [`Refusal`] is read from the joint and from the image, and said
//! in the firmware's own words; what cannot be known from here is said in general ones.

use super::error::RemoteError;
use super::joint::RemoteJoint;
use friction_compensation::friction::FrictionModel;
use friction_compensation::parameters::authentication::split;
use friction_compensation::parameters::certificate::certify;
use friction_compensation::parameters::image::{Image, ImageError};
use friction_compensation::parameters::life_cycle::{Command, Refusal, State};
use friction_compensation::parameters::slots::SlotError;
use joint_firmware::objects::field::{Field, ImageField};

/// General words for every number of [`Refusal::code`].
const WORDS: [(u16, &str); 33] = [
    (0x0101, "the upload is longer than a joint's staging buffer"),
    (0x0102, "not as many bytes arrived as were announced"),
    (0x0201, "the image is cut off"),
    (0x0202, "the image has more bytes than it says"),
    (0x0203, "these bytes are no image"),
    (0x0204, "the image has a format that the joint's program does not know"),
    (0x0205, "the image is damaged: its checksum is wrong"),
    (0x0206, "reserved bytes of the image are not zero"),
    (0x0207, "a field of the image has a value that it cannot have"),
    (0x0208, "the joint's program has room for one parameter set and no regimes: `jointctl fit` without --regimes"),
    (0x0301, "the joint has a key, but no tag of 32 bytes follows the image; `jointctl sign` puts one there"),
    (0x0302, "the tag is not that of this image and the joint's key"),
    (0x0304, "the joint's key is damaged: it takes no image, and keeps the one that it has"),
    (0x0401, "the image is older than the newest that the joint has stored with its key's tag"),
    (0x0501, "the image is for another product"),
    (0x0502, "the image is for another joint"),
    (0x0503, "the image's unit of effort is not the joint's"),
    (0x0601, "certificate: the network could overflow"),
    (0x0602, "certificate: the physical model could overflow"),
    (0x0603, "certificate: the friction could exceed the image's limit or the joint's torque limit"),
    (0x0604, "certificate: the network follows the measured torque too steeply"),
    (0x0605, "certificate: the friction changes too steeply with velocity"),
    (0x0701, "the joint's arithmetic gives other results than the image's golden vectors state"),
    (0x0801, "the joint does not know the command"),
    (0x0802, "not possible where the image stands now"),
    (0x0803, "what was begun before has not come to its end"),
    (
        0x0804,
        "the joint has one bank of flash: the motor must be off and nearly at rest; `jointctl disable` switches it off",
    ),
    (0x0805, "the time of the trial is out of range"),
    (0x0806, "the joint's staging buffer does not hold what was verified"),
    (0x0807, "the control step has not taken the image"),
    (0x0901, "the joint's flash could not be written"),
    (0x0902, "the joint's flash does not hold what was written"),
    (0x0903, "the image does not fit into a slot"),
];
/// More of them: of the slots.
const SLOTS: [(u16, &str); 3] = [
    (0x0904, "the buffer is too small for the stored image"),
    (0x0905, "there is no previous image"),
    (0x0906, "the stored image is damaged"),
];

/// The general words of a number.
pub fn words(code: u16) -> &'static str {
    let known = WORDS.iter().chain(&SLOTS).find(|(number, _)| *number == code);
    known.map_or("a reason that this program does not know; is it older than the joint's?", |(_, words)| words)
}

/// Refused attempt: the step, and the bytes where there are some.
#[derive(Clone, Copy, Debug)]
pub struct Attempt<'a> {
    /// The command; none for the upload itself.
    pub command: Option<Command>,
    /// Uploaded bytes: an image, and a tag where there is one. Empty where it is about stored images.
    pub upload: &'a [u8],
}

impl Attempt<'_> {
    fn step(&self) -> &'static str {
        match self.command {
            None => "take",
            Some(Command::Verify) => "accept",
            Some(Command::Trial) => "try",
            Some(Command::Commit) => "store",
            Some(Command::RollBack) => "roll back",
            Some(Command::Discard) => "discard",
            Some(Command::Shadow) => "shadow",
        }
    }

    /// The error for a number that the joint told.
    pub fn refused(&self, joint: &RemoteJoint, code: u16) -> RemoteError {
        let text = match self.reproduce(joint, code) {
            Ok(Some(refusal @ Refusal::State { command, state }))
                if command.is_none() || matches!(state, State::Shadow | State::Trial) =>
            {
                format!("{refusal}; `jointctl discard` ends that")
            }
            Ok(Some(refusal @ Refusal::Image(ImageError::TooManySets { .. }))) => refusal.to_string(),
            Ok(Some(refusal)) if refusal.code() == code => refusal.to_string(),
            // The refusal stands whether or not its details can be read.
            _ => words(code).to_owned(),
        };
        let version = joint.raw(Field::Actual(joint_firmware::objects::field::Actual::ImageVersion)).ok();
        let unchanged = match version {
            Some(0) => "It goes on without an image".to_owned(),
            Some(version) => format!("Version {version} stays in use"),
            None => "What is in use could not be read".to_owned(),
        };
        RemoteError::Refused { node: joint.id(), step: self.step(), code, text, unchanged }
    }

    /// The refusal with its details, as far as they can be known.
    fn reproduce(&self, joint: &RemoteJoint, code: u16) -> Result<Option<Refusal>, RemoteError> {
        let raw = |field| joint.raw(Field::Image(field));
        let identity = |sub_index| joint.node().number(0x1018, sub_index).map(u32::from_le_bytes);
        let (bytes, _) = split(self.upload);
        let image = Image::decode(bytes);
        Ok(Some(match (code, image) {
            // A joint with room for one parameter set has a shorter staging buffer.
            (0x0101 | 0x0208, Ok(image)) if image.friction.selector.sets() > 1 => {
                Refusal::Image(ImageError::TooManySets { sets: image.friction.selector.sets() as u8 })
            }
            (0x0102, _) => {
                Refusal::UploadLength { length: raw(ImageField::Length)? as usize, announced: self.upload.len() }
            }
            (0x0201..=0x0207, Err(error)) => Refusal::Image(error),
            (0x0302, _) => Refusal::TagWrong { failures: raw(ImageField::Failures)? as u16 },
            (0x0401, Ok(image)) => Refusal::Version { version: image.version, floor: raw(ImageField::Floor)? as u32 },
            (0x0501, Ok(image)) => Refusal::Product { image: image.target.product, joint: identity(2)? },
            (0x0502, Ok(image)) => Refusal::Serial { image: image.target.serial, joint: identity(4)? },
            (0x0601..=0x0605, Ok(image)) => match certify(&image.friction, &image.limits) {
                Err(refusal) => Refusal::Certificate(refusal),
                Ok(_) => return Ok(None),
            },
            (0x0701, Ok(image)) => match image.verify_golden(&FrictionModel::new(&image.friction, 1)) {
                Err(mismatch) => Refusal::Golden(mismatch),
                Ok(()) => return Ok(None),
            },
            (0x0802, _) => Refusal::State { command: self.command, state: joint.image_state()? },
            (0x0803, _) => Refusal::Busy,
            (0x0806, _) => Refusal::Changed,
            (0x0807, _) => Refusal::NotRun,
            (0x0905, _) => Refusal::Slots(SlotError::NoPrevious),
            _ => return Ok(None),
        }))
    }
}

/// The state with this number of object 2212h:2.
pub fn image_state(number: u8) -> Option<State> {
    use State::*;
    [Empty, Staged, Verified, Shadow, Trial, Storing, Committed, Active]
        .into_iter()
        .find(|state| *state as u8 == number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_the_firmware_has_words_and_no_other() {
        let source = include_str!("../../../../crates/friction-compensation/src/parameters/life_cycle/refusal.rs");
        let codes = source.lines().filter_map(|line| {
            let (_, number) = line.split_once("=> 0x")?;
            u16::from_str_radix(number.trim_end_matches(','), 16).ok()
        });
        let codes = codes.collect::<Vec<_>>();
        let known = WORDS.iter().chain(&SLOTS).map(|(code, _)| *code).collect::<Vec<_>>();
        assert_eq!(codes, known);
        assert!(words(0x7777).contains("does not know"));
    }
}
