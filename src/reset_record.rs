//! Reason for the program's stop, kept over the reset; written by the fault handlers, read once at start.
//!
//! Pure code: a record becomes sixteen words and words become a record again. Where the words lie is the board's
//! business. RAM that nobody initialises holds noise after power-on, so a record counts only with its magic word and
//! its CRC-32.

/// Words that a record takes.
pub const WORDS: usize = 16;
/// Bytes of the place that are kept: the end of a long path says more than its beginning.
pub const PLACE: usize = 40;
/// "JNT1", little-endian.
const MAGIC: u32 = u32::from_le_bytes(*b"JNT1");
const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// Cause of the program's stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The program panicked: detail is the line, place the file.
    Panic,
    /// A HardFault: detail is the configurable fault status register (CFSR; ARM DDI 0403, B3.2.15).
    HardFault,
    /// A non-maskable interrupt that is not a torn parameter word: detail is the flash ECC register.
    NonMaskable,
    /// An interrupt without a handler: detail is its exception number.
    Unexpected,
}

impl Cause {
    const ALL: [Self; 4] = [Self::Panic, Self::HardFault, Self::NonMaskable, Self::Unexpected];

    /// Number as it is kept and as object 2301h:2 says it.
    pub const fn code(self) -> u32 {
        match self {
            Self::Panic => 1,
            Self::HardFault => 2,
            Self::NonMaskable => 3,
            Self::Unexpected => 4,
        }
    }
}

/// Reason for the program's start: what the chip says, and what stopped the program before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastReset {
    /// Bits of what has reset the chip since they were cleared at the start before, as in bits 25 to 31 of its
    /// register RCC_CSR (RM0440, section 7.4.30).
    pub causes: u8,
    /// None where the program did not stop by itself.
    pub stop: Option<Record>,
}

impl LastReset {
    /// Bit of [`LastReset::causes`]: the supply was too low, or came.
    pub const POWER: u8 = 1 << 2;
    /// Bit of [`LastReset::causes`]: the program asked for it.
    pub const SOFTWARE: u8 = 1 << 3;
    /// Bit of [`LastReset::causes`]: the watchdog was not fed.
    pub const WATCHDOG: u8 = 1 << 4;
    /// The supply came.
    pub const POWER_UP: Self = Self { causes: Self::POWER, stop: None };
    /// The program asked for it.
    pub const REQUESTED: Self = Self { causes: Self::SOFTWARE, stop: None };
}

/// One stop of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Cause of the stop.
    pub cause: Cause,
    /// Address of the instruction that it stopped at; 0 where that is not known.
    pub address: u32,
    /// Depends on the cause.
    pub detail: u32,
    /// Stops in a row, this one included, or 0 once the program has run for long enough since. Saturates.
    pub repeats: u32,
    /// End of the name of a source file, padded with zeros; all zero where there is none.
    pub place: [u8; PLACE],
}

impl Record {
    /// A first stop, without a place.
    pub const fn new(cause: Cause, address: u32, detail: u32) -> Self {
        Self { cause, address, detail, repeats: 1, place: [0; PLACE] }
    }

    /// The record with the last [`PLACE`] bytes of `name` as its place.
    pub fn at(mut self, name: &str) -> Self {
        let name = name.as_bytes();
        let tail = name.iter().skip(name.len().saturating_sub(PLACE));
        self.place = [0; PLACE];
        for (kept, byte) in self.place.iter_mut().zip(tail) {
            *kept = *byte;
        }
        self
    }

    /// The record as one more stop after `previous`.
    pub const fn after(mut self, previous: Option<&Self>) -> Self {
        self.repeats = match previous {
            Some(previous) => previous.repeats.saturating_add(1),
            None => 1,
        };
        self
    }

    /// The program has run for long enough since: the next stop is the first.
    pub const fn forgotten(mut self) -> Self {
        self.repeats = 0;
        self
    }

    /// The place as text; empty where there is none, or where its beginning was cut inside a character.
    pub fn place(&self) -> &str {
        core::str::from_utf8(self.place_bytes()).unwrap_or("")
    }

    /// The place as it is kept.
    pub fn place_bytes(&self) -> &[u8] {
        let length = self.place.iter().position(|byte| *byte == 0).unwrap_or(PLACE);
        self.place.get(..length).unwrap_or_default()
    }

    /// The record as words.
    pub fn encode(&self) -> [u32; WORDS] {
        let mut words = [0; WORDS];
        let mut place = self.place.chunks_exact(4).map(|bytes| match bytes {
            [a, b, c, d] => u32::from_le_bytes([*a, *b, *c, *d]),
            _ => 0,
        });
        let head = [MAGIC, self.cause.code(), self.address, self.detail, self.repeats];
        for (word, value) in words.iter_mut().zip(head.into_iter().chain(&mut place)) {
            *word = value;
        }
        if let Some((last, before)) = words.split_last_mut() {
            *last = checksum(before);
        }
        words
    }

    /// The record in `words`; none where they hold anything else.
    pub fn decode(words: &[u32; WORDS]) -> Option<Self> {
        let (sum, content) = words.split_last()?;
        let (head, rest) = content.split_first_chunk::<5>()?;
        let [magic, code, address, detail, repeats] = *head;
        if magic != MAGIC || *sum != checksum(content) {
            return None;
        }
        let cause = Cause::ALL.into_iter().find(|cause| cause.code() == code)?;
        let mut place = [0; PLACE];
        for (kept, byte) in place.iter_mut().zip(rest.iter().flat_map(|word| word.to_le_bytes())) {
            *kept = byte;
        }
        Some(Self { cause, address, detail, repeats, place })
    }
}

fn checksum(words: &[u32]) -> u32 {
    let mut digest = CRC.digest();
    for word in words {
        digest.update(&word.to_le_bytes());
    }
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn records() -> impl Strategy<Value = Record> {
        let cause = prop::sample::select(Cause::ALL.to_vec());
        (cause, any::<u32>(), any::<u32>(), any::<u32>(), ".{0,60}").prop_map(
            |(cause, address, detail, repeats, name)| Record {
                repeats,
                ..Record::new(cause, address, detail).at(&name)
            },
        )
    }

    proptest! {
        #[test]
        fn a_record_survives_its_words(record in records()) {
            prop_assert_eq!(Record::decode(&record.encode()), Some(record));
        }

        #[test]
        fn a_record_with_one_flipped_bit_is_none(record in records(), word in 0..WORDS, bit in 0..32) {
            let mut words = record.encode();
            words[word] ^= 1u32 << bit;
            prop_assert_eq!(Record::decode(&words), None);
        }

        #[test]
        fn noise_of_a_first_power_on_is_none(words in any::<[u32; WORDS]>()) {
            prop_assert_eq!(Record::decode(&words), None);
        }
    }

    #[test]
    fn erased_and_blank_memory_is_none() {
        assert_eq!(Record::decode(&[0; WORDS]), None);
        assert_eq!(Record::decode(&[u32::MAX; WORDS]), None);
    }

    #[test]
    fn the_end_of_a_long_path_is_kept() {
        let path = "/home/somebody/projects/robots/arm/joint-firmware/src/board/control.rs";
        let record = Record::new(Cause::Panic, 0, 12).at(path);
        assert_eq!(record.place(), &path[path.len() - PLACE..]);
        assert_eq!(Record::new(Cause::Panic, 0, 12).at("src/main.rs").place(), "src/main.rs");
        assert_eq!(Record::new(Cause::HardFault, 0, 0).place(), "");
    }

    #[test]
    fn stops_in_a_row_are_counted() {
        let first = Record::new(Cause::Panic, 0, 1).after(None);
        let second = Record::new(Cause::HardFault, 0, 0).after(Some(&first));
        assert_eq!((first.repeats, second.repeats), (1, 2));
        assert_eq!(first.after(Some(&second.forgotten())).repeats, 1);
        let many = Record { repeats: u32::MAX, ..first };
        assert_eq!(second.after(Some(&many)).repeats, u32::MAX);
    }
}
