//! 2210h to 221Fh: the life of a parameter image, from upload to roll back, and who owns the joint.

use super::*;
use crate::objects::field::{
    Actual, Field::Actual as A, Field::Image as I, Field::Owner as O, ImageField, OwnerField, StoredField as F, Which,
};

room! {
    0x2210 "image staging" {
        0, "image staging", Domain, RW, UNMAPPED, I(ImageField::Staging); "", 1.0, ANY;
            "Upload: an image, and behind it its tag where there is one; at most 2048 bytes. What is staged can be read back"
    }
    0x2211 "active image" {
        0, "active image", Domain, RO, UNMAPPED, I(ImageField::Active); "", 1.0, ANY;
            "The stored image in use; empty where there is none"
    }
    0x2212 "image life cycle" {
        1, "command", U8, WO, UNMAPPED, I(ImageField::Command); "", 1.0, within(1.0, 6.0);
            "1 verify, 2 trial, 3 commit, 4 roll back, 5 discard, 6 shadow"
        2, "state", U8, RO, TRANSMIT, A(Actual::ImageState); "", 1.0, ANY;
            "0 empty, 1 staged, 2 verified, 3 shadow, 4 trial, 5 storing, 6 committed, 7 active"
        3, "result", U16, RO, UNMAPPED, I(ImageField::Result); "", 1.0, ANY;
            "Why the last command was refused; 0 where it was not"
        4, "staged length", U32, RO, UNMAPPED, I(ImageField::Length); "B", 1.0, ANY;
            "Bytes staged"
        5, "staged CRC-32", U32, RO, UNMAPPED, I(ImageField::Checksum); "", 1.0, ANY;
            "CRC-32 (ISO-HDLC) of the bytes staged; the same for every sound image without a tag, because an image ends with its own CRC-32"
        6, "trial time left", U32, RO, UNMAPPED, I(ImageField::TrialLeft); "s", 1e-3, ANY;
            "What is left of a trial or shadow; 0 outside"
        7, "trial time", U32, RW, UNMAPPED, I(ImageField::TrialTime); "s", 1e-3, within(0.001, 3_600.0);
            "Time of the trials and shadows that follow"
        8, "trial ending", U8, RO, UNMAPPED, I(ImageField::Ending); "", 1.0, ANY;
            "How the last trial ended by itself: 0 not, 1 its time was over, 2 a monitored heartbeat was lost"
    }
    0x2213 "active image's identity" {
        1, "version", U32, RO, TRANSMIT, A(Actual::ImageVersion); "", 1.0, ANY;
            "Version of the image in use; 0 where there is none"
        2, "CRC-32", U32, RO, UNMAPPED, I(ImageField::Stored(Which::Active, F::Checksum)); "", 1.0, ANY;
            "The image's own checksum"
        3, "model", U8, RO, UNMAPPED, I(ImageField::Stored(Which::Active, F::Model)); "", 1.0, ANY;
            "0 none, 1 physical, 2 physical and network"
        4, "slot", U8, RO, UNMAPPED, I(ImageField::Stored(Which::Active, F::Slot)); "", 1.0, ANY;
            "1 or 2; 0 where there is no image"
        5, "created", U32, RO, UNMAPPED, I(ImageField::Stored(Which::Active, F::Created)); "s", 1.0, ANY;
            "Since 1970-01-01 UTC; 0 where it is not stated"
    }
    0x2214 "previous image's identity" {
        1, "version", U32, RO, UNMAPPED, I(ImageField::Stored(Which::Previous, F::Version)); "", 1.0, ANY;
            "Version of the image that a roll back would make active; 0 where there is none"
        2, "CRC-32", U32, RO, UNMAPPED, I(ImageField::Stored(Which::Previous, F::Checksum)); "", 1.0, ANY;
            "The image's own checksum"
        3, "model", U8, RO, UNMAPPED, I(ImageField::Stored(Which::Previous, F::Model)); "", 1.0, ANY;
            "0 none, 1 physical, 2 physical and network"
        4, "slot", U8, RO, UNMAPPED, I(ImageField::Stored(Which::Previous, F::Slot)); "", 1.0, ANY;
            "1 or 2; 0 where there is no image"
        5, "created", U32, RO, UNMAPPED, I(ImageField::Stored(Which::Previous, F::Created)); "s", 1.0, ANY;
            "Since 1970-01-01 UTC; 0 where it is not stated"
    }
    0x2215 "ownership" {
        1, "key present", Bool, RO, UNMAPPED, O(OwnerField::KeyPresent); "", 1.0, ANY;
            "1 once the joint has a key: images then need a tag, settings a session. With key number 0 the stored key is damaged, and nothing that needs them is taken"
        2, "key number", U32, RO, UNMAPPED, O(OwnerField::KeyNumber); "", 1.0, ANY;
            "Tells keys apart; 0 where there is none"
        3, "version floor", U32, RO, UNMAPPED, I(ImageField::Floor); "", 1.0, ANY;
            "Lowest image version that is taken: with a key the highest that its tag was right for and that was to be stored, and up to it 2212h:1 = 3 is the owner's alone; without a key 0"
        4, "wrong tags", U16, RO, UNMAPPED, I(ImageField::Failures); "", 1.0, ANY;
            "Wrong tags and responses so far; kept over a loss of power at 1, 2, 4, 8 and so on. They keep no right one out"
        5, "challenge", Domain, RO, UNMAPPED, O(OwnerField::Challenge); "", 1.0, ANY;
            "16 random bytes that the next response answers; others once one was right"
        6, "key", Domain, WO, UNMAPPED, O(OwnerField::Key); "", 1.0, ANY;
            "32 bytes: the first key, where somebody is present. 64 bytes: another one, masked, and the response that goes with it"
        7, "response", Domain, WO, UNMAPPED, O(OwnerField::Response); "", 1.0, ANY;
            "32 bytes that the key makes of the challenge: opens a session, or has the joint forget its key"
        8, "session time left", U32, RW, UNMAPPED, O(OwnerField::Session); "s", 1e-3, within(0.0, 60.0);
            "60 s after what was last written in it, and 10 minutes after it was opened at the latest; 0 where none is open. Writing 0 ends it, nothing else can be written"
        9, "presence", Bool, RO, UNMAPPED, O(OwnerField::Presence); "", 1.0, ANY;
            "1 while somebody is at the joint: the button is pressed, or where there is none, less than 60 s since its supply came and no master has started it"
        10, "forget key", U32, WO, UNMAPPED, O(OwnerField::Forget); "", 1.0, ANY;
            "Where somebody is present, 6B636162h takes the key back, also a damaged one: the joint then belongs to nobody, and its version floor is 0"
    }
}
