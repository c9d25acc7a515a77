//! Authority to change what a joint adds to its torque: a tag behind every image, once the joint has a key; task or
//! host.
//!
//! # Bytes of an upload
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | L | the [image](super::image), whose bytes 6 and 7 state L |
//! | L | 0 or 32 | nothing, or the tag |
//!
//! The tag is HMAC-SHA256 (RFC 2104, FIPS 180-4) with the joint's key of 32 bytes over 16 bytes that say what is
//! signed, the ASCII characters `joint image tag1`, and the L bytes of the image. These hold the target (product and
//! serial number) and the version, so the tag binds both. The tag is not part of the image and is not stored with it:
//! what lies in a slot was let in before. An upload with a tag is at most [`STAGING`] bytes. A joint without a key
//! takes uploads with and without a tag.
//!
//! # Who may change what a joint can do
//!
//! An owned joint, which is one with a key, wants a session for whatever changes what it can do to its surroundings.
//! The owner reads a challenge of 16 random bytes (2215h:5) and writes the response (2215h:7): HMAC-SHA256 with the key
//! over 16 bytes for the purpose, product and serial number (4 bytes each, little-endian) and the challenge. A
//! challenge is good for one right response. Purposes: `joint session  1` opens a session, `joint key back 1` has the
//! joint forget its key. A new key (2215h:6, 64 bytes) comes as the key exclusive or HMAC(`joint key mask 1`, …), and
//! behind it the response for `joint key next 1`, which covers these 32 bytes too. Security access of ISO 14229-1,
//! service 27h, works alike, and like there a session that is open serves whoever sends on the bus: CAN does not say
//! who sent a frame.
//!
//! The same key verifies and signs: whoever reads it out of a joint can sign for every joint that shares it. Commands
//! in real time, setpoints among them, are not authenticated.
//!
//! Wrong tags are counted and keep nobody out: 256 bits cannot be guessed, and a joint that refused right tags after
//! wrong ones could be shut off from its owner by anybody on the bus.

use super::image::{MAX_LENGTH, ROOM};
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

/// Bytes of a tag.
pub const TAG: usize = 32;
/// Bytes of a key.
pub const KEY: usize = 32;
/// Longest upload: the longest image that the program has room for, and a tag.
pub const STAGING: usize = ROOM + TAG;
const _: () = assert!(MAX_LENGTH + TAG == 2048);

/// Bytes of a challenge: random, so that nobody meets the same one twice.
pub const CHALLENGE: usize = 16;

/// Context string that is signed with a tag; another use of the key has another text.
const IMAGE: &[u8; 16] = b"joint image tag1";
/// Text that the mask of a new key is made from.
const MASK: &[u8; 16] = b"joint key mask 1";
/// Text that the key's number is made from.
const KEY_ID: &[u8; 16] = b"joint key number";

/// Purpose of a response to a challenge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A session: protected objects can be written.
    Session,
    /// The joint is to forget its key.
    TakeBack,
    /// Another key.
    Rotate,
}

impl Purpose {
    const fn text(self) -> &'static [u8; 16] {
        match self {
            Self::Session => b"joint session  1",
            Self::TakeBack => b"joint key back 1",
            Self::Rotate => b"joint key next 1",
        }
    }
}

/// The joint that gave a challenge, and its challenge: what a response is bound to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Challenge {
    /// Product of the joint (1018h:2).
    pub product: u32,
    /// Its serial number (1018h:4).
    pub serial: u32,
    /// Random bytes that it drew.
    pub random: [u8; CHALLENGE],
}

/// A joint's key. Its bytes are neither printed nor compared.
#[derive(Clone)]
pub struct Key([u8; KEY]);

impl core::fmt::Debug for Key {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        write!(f, "Key({:08x})", self.id())
    }
}

/// Reason for the refusal of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyRefusal {
    /// All bytes are equal: erased flash, a cleared buffer.
    Trivial,
}

impl core::fmt::Display for KeyRefusal {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match self {
            Self::Trivial => write!(f, "all {KEY} bytes of the key are equal"),
        }
    }
}

impl core::error::Error for KeyRefusal {}

impl Key {
    /// A key from its bytes.
    pub fn new(bytes: [u8; KEY]) -> Result<Self, KeyRefusal> {
        let [first, ..] = bytes;
        if bytes.iter().all(|byte| *byte == first) { Err(KeyRefusal::Trivial) } else { Ok(Self(bytes)) }
    }

    /// The bytes, to be stored.
    pub const fn to_bytes(&self) -> [u8; KEY] {
        self.0
    }

    /// A number to tell keys apart, which says nothing of their bytes: the first four bytes of an HMAC, little-endian.
    pub fn id(&self) -> u32 {
        let [a, b, c, d, ..]: [u8; TAG] = self.mac(KEY_ID).finalize().into_bytes().into();
        u32::from_le_bytes([a, b, c, d])
    }

    /// The tag of an image.
    pub fn sign(&self, image: &[u8]) -> [u8; TAG] {
        self.mac(IMAGE).chain_update(image).finalize().into_bytes().into()
    }

    /// True where `tag` is the image's. Takes the same time wherever the two differ.
    pub fn verify(&self, image: &[u8], tag: &[u8; TAG]) -> bool {
        self.mac(IMAGE).chain_update(image).verify(tag.into()).is_ok()
    }

    /// The response to a challenge. For [`Purpose::Rotate`] `masked` is the masked new key, otherwise empty.
    pub fn respond(&self, purpose: Purpose, challenge: &Challenge, masked: &[u8]) -> [u8; TAG] {
        self.response(purpose, challenge, masked).finalize().into_bytes().into()
    }

    /// True where `response` is the one to the challenge. Takes the same time wherever the two differ.
    pub fn accepts(&self, purpose: Purpose, challenge: &Challenge, masked: &[u8], response: &[u8; TAG]) -> bool {
        self.response(purpose, challenge, masked).verify(response.into()).is_ok()
    }

    /// Another key's bytes as they go over the bus, or back: each is the exclusive or of the other and of an HMAC over
    /// the challenge.
    pub fn mask(&self, challenge: &Challenge, bytes: &[u8; KEY]) -> [u8; KEY] {
        let mut masked: [u8; KEY] = self.bound(MASK, challenge).finalize().into_bytes().into();
        masked.iter_mut().zip(bytes).for_each(|(place, byte)| *place ^= byte);
        masked
    }

    fn response(&self, purpose: Purpose, challenge: &Challenge, masked: &[u8]) -> Hmac<Sha256> {
        self.bound(purpose.text(), challenge).chain_update(masked)
    }

    fn bound(&self, purpose: &[u8; 16], challenge: &Challenge) -> Hmac<Sha256> {
        let Challenge { product, serial, random } = challenge;
        self.mac(purpose).chain_update(product.to_le_bytes()).chain_update(serial.to_le_bytes()).chain_update(random)
    }

    fn mac(&self, purpose: &[u8; 16]) -> Hmac<Sha256> {
        hmac(&self.0).chain_update(purpose)
    }
}

/// HMAC with a key of at most a block (64 bytes), which zeros fill up (RFC 2104, 2).
fn hmac(key: &[u8]) -> Hmac<Sha256> {
    let mut block = [0; 64];
    for (place, byte) in block.iter_mut().zip(key) {
        *place = *byte;
    }
    Hmac::new(&block.into())
}

/// An upload as image and tag. Whether the first is an image is not looked at; without a right length it has no tag.
pub fn split(upload: &[u8]) -> (&[u8], Option<&[u8; TAG]>) {
    let stated = match upload {
        [_, _, _, _, _, _, low, high, ..] => usize::from(u16::from_le_bytes([*low, *high])),
        _ => 0,
    };
    match upload.split_last_chunk::<TAG>() {
        Some((image, tag)) if stated != 0 && image.len() == stated => (image, Some(tag)),
        _ => (upload, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hex(bytes: &[u8]) -> String {
        bytes.iter().map(|byte| format!("{byte:02x}")).collect()
    }

    fn key() -> Key {
        Key::new(core::array::from_fn(|i| i as u8 * 7 + 1)).expect("a key")
    }

    /// Bytes that state their length as an image does.
    fn image(length: u16) -> Vec<u8> {
        let mut bytes: Vec<u8> = (0..length).map(|i| (i * 31 / 8) as u8).collect();
        bytes[6..8].copy_from_slice(&length.to_le_bytes());
        bytes
    }

    #[test]
    fn hmac_gives_the_published_values() {
        // RFC 4231, test cases 1 to 4.
        let counting: Vec<u8> = (1..=25).collect();
        let cases: [(&[u8], &[u8], &str); 4] = [
            (&[0x0b; 20], b"Hi There", "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7"),
            (
                b"Jefe",
                b"what do ya want for nothing?",
                "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843",
            ),
            (&[0xaa; 20], &[0xdd; 50], "773ea91e36800e46854db8ebd09181a72959098b3ef8c122d9635514ced565fe"),
            (&counting, &[0xcd; 50], "82558a389a443c0ea4cc819899f2083a85f0faa3e578f8077a2e3ff46729665b"),
        ];
        for (key, data, expected) in cases {
            assert_eq!(hex(&hmac(key).chain_update(data).finalize().into_bytes()), expected);
        }
    }

    #[test]
    fn a_tag_is_that_of_the_documented_bytes() {
        let image = image(200);
        let documented = hmac(&key().to_bytes()).chain_update([&b"joint image tag1"[..], &image].concat());
        assert_eq!(key().sign(&image)[..], documented.finalize().into_bytes()[..]);
    }

    #[test]
    fn every_single_bit_of_image_and_tag_matters() {
        let image = image(148);
        let tag = key().sign(&image);
        assert!(key().verify(&image, &tag));
        for bit in 0..8 * image.len() {
            let mut changed = image.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(!key().verify(&changed, &tag), "bit {bit} of the image");
        }
        for bit in 0..8 * TAG {
            let mut changed = tag;
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(!key().verify(&image, &changed), "bit {bit} of the tag");
        }
        for bit in 0..8 * KEY {
            let mut changed = key().to_bytes();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(!Key::new(changed).expect("a key").verify(&image, &tag), "bit {bit} of the key");
        }
        assert!(!key().verify(&image[..147], &tag) && !key().verify(&[&image[..], &[0]].concat(), &tag));
    }

    #[test]
    fn an_upload_has_a_tag_where_32_bytes_follow_the_stated_length() {
        let image = image(300);
        let tag = key().sign(&image);
        let upload = [&image[..], &tag].concat();
        assert_eq!(split(&upload), (&image[..], Some(&tag)));
        assert_eq!(split(&image), (&image[..], None));
        for length in (0..upload.len()).filter(|length| *length != image.len()) {
            assert_eq!(split(&upload[..length]), (&upload[..length], None));
        }
        assert_eq!(split(&[0; 32]), (&[0; 32][..], None));
    }

    #[test]
    fn a_key_does_not_show_and_is_not_of_equal_bytes() {
        for byte in 0..=255 {
            assert_eq!(Key::new([byte; KEY]).expect_err("refused"), KeyRefusal::Trivial);
        }
        assert_eq!(format!("{:?}", key()), format!("Key({:08x})", key().id()));
    }

    fn challenge() -> Challenge {
        Challenge { product: 2, serial: 4, random: core::array::from_fn(|i| 200 - i as u8) }
    }

    #[test]
    fn a_response_is_that_of_the_documented_bytes() {
        let Challenge { random, .. } = challenge();
        let documented = [&b"joint session  1"[..], &[2, 0, 0, 0, 4, 0, 0, 0], &random].concat();
        let documented = hmac(&key().to_bytes()).chain_update(documented).finalize().into_bytes();
        assert_eq!(key().respond(Purpose::Session, &challenge(), &[])[..], documented[..]);
    }

    #[test]
    fn a_response_is_bound_to_purpose_joint_challenge_and_new_key() {
        let (first, masked) = (key(), [9; KEY]);
        let response = first.respond(Purpose::Rotate, &challenge(), &masked);
        let accepts =
            |purpose, challenge: &Challenge, masked: &[u8]| first.accepts(purpose, challenge, masked, &response);
        assert!(accepts(Purpose::Rotate, &challenge(), &masked));
        for purpose in [Purpose::Session, Purpose::TakeBack] {
            assert!(!accepts(purpose, &challenge(), &masked));
        }
        assert!(!accepts(Purpose::Rotate, &Challenge { serial: 5, ..challenge() }, &masked));
        assert!(!accepts(Purpose::Rotate, &Challenge { product: 3, ..challenge() }, &masked));
        for bit in 0..8 * CHALLENGE {
            let mut other = challenge();
            other.random[bit / 8] ^= 1 << (bit % 8);
            assert!(!accepts(Purpose::Rotate, &other, &masked), "bit {bit} of the challenge");
        }
        for bit in 0..8 * KEY {
            let mut other = masked;
            other[bit / 8] ^= 1 << (bit % 8);
            assert!(!accepts(Purpose::Rotate, &challenge(), &other), "bit {bit} of the masked key");
        }
    }

    #[test]
    fn a_masked_key_comes_back_and_says_nothing() {
        let new: [u8; KEY] = core::array::from_fn(|i| 255 - i as u8);
        let masked = key().mask(&challenge(), &new);
        assert_eq!(key().mask(&challenge(), &masked), new);
        let other = key().mask(&Challenge { random: [0; CHALLENGE], ..challenge() }, &new);
        assert!(masked != new && masked != other);
    }
}
