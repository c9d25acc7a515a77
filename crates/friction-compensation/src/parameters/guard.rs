//! Record that guards a joint: version floor, wrong tags, the owner's key; task or host. Boards and the virtual joint
//! keep the same bytes.
//!
//! | offset | bytes | content, little-endian |
//! |---|---|---|
//! | 0 | 4 | version floor |
//! | 4 | 2 | wrong tags and responses |
//! | 6 | 1 | 0 no key, 1 key, 2 damaged and no key left, 3 damaged and the key left |
//! | 7 | 1 | 0 |
//! | 8 | 32 | key; zeros where there is none |

use super::authentication::{KEY, Key};

/// Bytes of the record.
pub const GUARD: usize = 8 + KEY;

/// Content of the record.
#[derive(Clone, Debug, Default)]
pub struct Guard {
    /// Lowest version that is taken.
    pub floor: u32,
    /// Wrong tags and responses so far.
    pub failures: u16,
    /// The owner's key, once there is one.
    pub key: Option<Key>,
    /// `true` if what was kept is damaged: nothing that needs authority works before the owner has repaired it.
    pub locked: bool,
}

impl Guard {
    /// The record as it is kept.
    pub fn encode(&self) -> [u8; GUARD] {
        let mut bytes = [0; GUARD];
        let [a, b, c, d] = self.floor.to_le_bytes();
        let [low, high] = self.failures.to_le_bytes();
        let state = u8::from(self.locked) << 1 | u8::from(self.key.is_some());
        let head = [a, b, c, d, low, high, state, 0];
        let key = self.key.as_ref().map_or([0; KEY], Key::to_bytes);
        bytes.iter_mut().zip(head.into_iter().chain(key)).for_each(|(place, byte)| *place = byte);
        bytes
    }

    /// Guard that was kept; none where nothing ever was. Bytes that are no such record lock: they may have held a key.
    pub fn decode(bytes: Option<&[u8]>) -> Self {
        let Some(bytes) = bytes else { return Self::default() };
        let Some((&[a, b, c, d, low, high, state, _], rest)) = bytes.split_first_chunk() else { return Self::LOCKED };
        let Ok(bytes) = <[u8; KEY]>::try_from(rest) else { return Self::LOCKED };
        let key = Key::new(bytes).ok();
        let (key, locked) = match state {
            0 => (None, false),
            1 => (key.clone(), key.is_none()),
            3 => (key, true),
            _ => (None, true),
        };
        Self { floor: u32::from_le_bytes([a, b, c, d]), failures: u16::from_le_bytes([low, high]), key, locked }
    }

    /// Locked state: nothing is known.
    const LOCKED: Self = Self { floor: 0, failures: 0, key: None, locked: true };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key() -> Key {
        Key::new(core::array::from_fn(|i| i as u8 * 3 + 1)).expect("a key")
    }

    #[test]
    fn a_record_comes_back_as_it_was_kept() {
        for (key, locked) in [(None, false), (Some(key()), false), (None, true), (Some(key()), true)] {
            let guard = Guard { floor: 70_001, failures: 515, key, locked };
            let back = Guard::decode(Some(&guard.encode()));
            assert_eq!((back.floor, back.failures, back.locked), (70_001, 515, locked));
            assert_eq!(back.key.map(|key| key.to_bytes()), guard.key.map(|key| key.to_bytes()));
        }
        let nothing = Guard::decode(None);
        assert!(nothing.key.is_none() && !nothing.locked && nothing.floor == 0);
    }

    #[test]
    fn bytes_that_are_no_record_lock() {
        let whole = Guard { key: Some(key()), ..Guard::default() }.encode();
        for length in (0..2 * GUARD).filter(|length| *length != GUARD) {
            let bytes: Vec<u8> = whole.iter().cycle().take(length).copied().collect();
            let guard = Guard::decode(Some(&bytes));
            assert!(guard.locked && guard.key.is_none(), "{length} bytes");
        }
        for state in 2..=u8::MAX {
            let mut other = whole;
            other[6] = state;
            assert!(Guard::decode(Some(&other)).locked, "state {state}");
        }
        let mut trivial = whole;
        trivial[8..].fill(0xff);
        assert!(Guard::decode(Some(&trivial)).locked);
    }
}
