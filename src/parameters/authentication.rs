//! Who may change what a joint adds to its torque: a tag behind every image, once the joint has a key; task or host.
//!
//! # Bytes of an upload
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | L | the [image](super::image), whose bytes 6 and 7 state L |
//! | L | 0 or 32 | nothing, or the tag |
//!
//! The tag is HMAC-SHA256 (RFC 2104, FIPS 180-4) with the joint's key of 32 bytes over 16 bytes that say what is signed, the ASCII
//! characters `joint image tag1`, and the L bytes of the image. These hold the target (product and serial number) and the version,
//! so the tag binds both. The tag is not part of the image and is not stored with it: what lies in a slot was let in before.
//! An upload with a tag is at most [`STAGING`] bytes. A joint without a key takes uploads with and without a tag.
//!
//! The same key verifies and signs: whoever reads it out of a joint can sign for every joint that shares it. Commands in real time,
//! setpoints among them, are not authenticated.
//!
//! Wrong tags are counted and keep nobody out: 256 bits cannot be guessed, and a joint that refused right tags after wrong ones could be shut off from its
//! owner by anybody on the bus.

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

/// What is signed with a tag; another use of the key has another text.
const IMAGE: &[u8; 16] = b"joint image tag1";
/// What the key's number is made from.
const KEY_ID: &[u8; 16] = b"joint key number";

/// A joint's key. Its bytes are neither printed nor compared.
#[derive(Clone)]
pub struct Key([u8; KEY]);

impl core::fmt::Debug for Key {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        write!(f, "Key({:08x})", self.id())
    }
}

/// Why a key is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyRefusal {
    /// The joint has a key already; a key is written once.
    Present {
        /// Number of the joint's key.
        id: u32,
    },
    /// All bytes are equal: erased flash, a cleared buffer.
    Trivial,
}

impl core::fmt::Display for KeyRefusal {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        match self {
            Self::Present { id } => write!(f, "the joint has key {id:08x} already, and a key is written once"),
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

    /// The key that a joint with the key `present`, or none, gets when it is given `bytes`: once.
    pub fn provision(present: Option<&Self>, bytes: [u8; KEY]) -> Result<Self, KeyRefusal> {
        match present {
            Some(key) => Err(KeyRefusal::Present { id: key.id() }),
            None => Self::new(bytes),
        }
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
    fn a_key_is_written_once_and_does_not_show() {
        let first = Key::provision(None, key().to_bytes()).expect("the first key");
        let id = first.id();
        let refused = |present, bytes| Key::provision(present, bytes).expect_err("refused");
        let mut another = first.to_bytes();
        another[0] ^= 1;
        assert_eq!(refused(Some(&first), another), KeyRefusal::Present { id });
        assert_eq!(refused(Some(&first), first.to_bytes()), KeyRefusal::Present { id });
        for byte in 0..=255 {
            assert_eq!(refused(None, [byte; KEY]), KeyRefusal::Trivial);
        }
        assert_eq!(format!("{first:?}"), format!("Key({id:08x})"));
    }
}
