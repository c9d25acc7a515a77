//! Log of faults that outlives the power: a journal in two pages of flash; task or host.
//!
//! A fault takes one double word, so that a page is erased once for 254 of them:
//!
//! | bytes | content |
//! |---|---|
//! | 0, 1 | error code (CiA 301, 7.2.7); 0000h: a power-up; 0001h: head of a page |
//! | 2 to 5 | time since the program started, s; number of the power-up; number of the page |
//! | 6 | number of the fault as the application counts them, 0 for none; 0 |
//! | 7 | CRC-8/AUTOSAR of the others |
//!
//! A page begins with its head and the number of power-ups. Where it is full the other one is erased, so that the last
//! 252 entries at least are there at any time. A loss of power costs the entry that is being written: a double word
//! that cannot be read, or whose checksum does not fit, is passed over. Opening writes nothing.
//!
//! # Wear
//!
//! A page bears 10,000 erases at least (DS12589 Rev 6, table 47), so both bear [`ENTRIES`] entries. Who appends has to
//! bound their rate: the objects permit one a minute, which takes nine years of nothing but faults.

use super::slots::{BLANK, DOUBLE_WORD, PAGE_WORDS, ReadError, SlotFlash, WriteError};
use heapless::Deque;

/// Faults that can be read.
pub const LOGGED: usize = 16;
/// Entries that two pages bear: of each page's double words, two are the page's own.
pub const ENTRIES: u32 = 2 * 10_000 * (PAGE_WORDS as u32 - OWN as u32);

/// Double words that a page begins with.
const OWN: usize = 2;
/// Codes that are no fault's.
const POWER_UP: u16 = 0;
const HEAD: u16 = 1;
const CRC: crc::Crc<u8, crc::NoTable> = crc::Crc::<u8, crc::NoTable>::new(&crc::CRC_8_AUTOSAR);

/// A fault as it is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LoggedFault {
    /// Error code, CiA 301.
    pub code: u16,
    /// Number of the fault, 0 for an error that is none of the joint's.
    pub fault: u8,
    /// Number of the power-up, from 1 on.
    pub power_up: u32,
    /// Time since the program started, s.
    pub time: u32,
}

/// A double word that is whole: code, number, and last byte.
type Entry = (u16, u32, u8);

fn encode((code, number, fault): Entry) -> [u8; DOUBLE_WORD] {
    let ([a, b], [c, d, e, f]) = (code.to_le_bytes(), number.to_le_bytes());
    [a, b, c, d, e, f, fault, CRC.checksum(&[a, b, c, d, e, f, fault])]
}

fn decode(word: Result<[u8; DOUBLE_WORD], ReadError>) -> Option<Entry> {
    let [a, b, c, d, e, f, fault, sum] = word.ok()?;
    let fits = CRC.checksum(&[a, b, c, d, e, f, fault]) == sum;
    fits.then(|| (u16::from_le_bytes([a, b]), u32::from_le_bytes([c, d, e, f]), fault))
}

/// One of the two pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Page {
    First,
    Second,
}

impl Page {
    const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// The log, with its newest faults.
#[derive(Debug)]
pub struct FaultLog {
    first_page: usize,
    /// The page that is written.
    page: Page,
    /// Its next double word.
    next: usize,
    /// Its number; 0 where nothing was ever written.
    number: u32,
    power_ups: u32,
    /// `true` while this power-up is not in flash yet.
    new: bool,
    newest: Deque<LoggedFault, LOGGED>,
}

impl FaultLog {
    /// Finds out what the pages from `first_page` on hold. `powered_up`: the supply came, which counts; other resets
    /// do not.
    pub fn open(flash: &mut impl SlotFlash, first_page: usize, powered_up: bool) -> Self {
        let mut log = Self {
            first_page,
            page: Page::Second,
            next: PAGE_WORDS,
            number: 0,
            power_ups: 0,
            new: powered_up,
            newest: Deque::new(),
        };
        let numbers = [Page::First, Page::Second].map(|page| match decode(flash.read(log.word(page, 0))) {
            Some((HEAD, number, _)) => number,
            _ => 0,
        });
        let [first, second] = numbers;
        log.page = if first > second { Page::First } else { Page::Second };
        log.number = first.max(second);
        for (page, number) in [(log.page.other(), first.min(second)), (log.page, log.number)] {
            if number != 0 {
                log.next = log.read(flash, page);
            }
        }
        log.power_ups = log.power_ups.saturating_add(powered_up.into());
        log
    }

    const fn word(&self, page: Page, word: usize) -> usize {
        (self.first_page + matches!(page, Page::Second) as usize) * PAGE_WORDS + word
    }

    /// Reads a page's entries; the first double word behind them.
    fn read(&mut self, flash: &mut impl SlotFlash, page: Page) -> usize {
        let mut next = 1;
        for word in 1..PAGE_WORDS {
            let found = flash.read(self.word(page, word));
            if found == Ok(BLANK) {
                continue;
            }
            next = word + 1;
            match decode(found) {
                Some((POWER_UP, number, _)) => self.power_ups = number,
                Some((HEAD, ..)) | None => {}
                Some((code, time, fault)) => {
                    self.note(LoggedFault { code, fault, power_up: self.power_ups, time });
                }
            }
        }
        next
    }

    fn note(&mut self, fault: LoggedFault) {
        if self.newest.is_full() {
            self.newest.pop_back();
        }
        // It was made room for above.
        let _ = self.newest.push_front(fault);
    }

    /// Number of power-ups, this one included.
    pub const fn power_ups(&self) -> u32 {
        self.power_ups
    }

    /// The newest faults, the newest first.
    pub fn newest(&self) -> impl Iterator<Item = &LoggedFault> {
        self.newest.iter()
    }

    /// Returns `true` while this power-up is not in flash yet.
    pub const fn is_new(&self) -> bool {
        self.new
    }

    /// Puts this power-up into flash, unless it is there.
    pub fn keep_power_up(&mut self, flash: &mut impl SlotFlash) -> Result<(), WriteError> {
        if self.new {
            self.write(flash, (POWER_UP, self.power_ups, 0))?;
            self.new = false;
        }
        Ok(())
    }

    /// Appends a fault of this power-up; behind its number, where that is not in flash yet. `time` since the program
    /// started, s.
    pub fn append(&mut self, flash: &mut impl SlotFlash, code: u16, fault: u8, time: u32) -> Result<(), WriteError> {
        self.keep_power_up(flash)?;
        self.write(flash, (code, time, fault))?;
        self.note(LoggedFault { code, fault, power_up: self.power_ups, time });
        Ok(())
    }

    /// Writes an entry. A double word that was torn may read as blank and refuse: it is passed over, by the next entry
    /// too.
    fn write(&mut self, flash: &mut impl SlotFlash, entry: Entry) -> Result<(), WriteError> {
        if self.next >= PAGE_WORDS {
            self.turn(flash)?;
        }
        let word = self.word(self.page, self.next);
        self.next += 1;
        flash.program(word, encode(entry))
    }

    /// Goes on in the other page.
    fn turn(&mut self, flash: &mut impl SlotFlash) -> Result<(), WriteError> {
        let (page, number) = (self.page.other(), self.number.saturating_add(1));
        let first = self.word(page, 0);
        flash.erase_page(first / PAGE_WORDS)?;
        flash.program(first, encode((HEAD, number, 0)))?;
        (self.page, self.number, self.next) = (page, number, OWN);
        // If this power-up is to follow, the one before it is the number that is carried over.
        let carried = self.power_ups.saturating_sub(self.new.into());
        flash.program(first + 1, encode((POWER_UP, carried, 0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::slots::ZERO;
    use proptest::prelude::*;

    /// First page of the log: something else lies before it.
    const FIRST: usize = 1;

    /// Three pages; writes end, with a loss of power, after so many.
    #[derive(Clone)]
    struct Flash {
        words: Vec<Result<[u8; DOUBLE_WORD], ReadError>>,
        left: u32,
        /// Reading of the double word that is torn by the loss of power.
        torn: Result<[u8; DOUBLE_WORD], ReadError>,
        erases: [u32; 3],
        writes: u32,
    }

    impl Flash {
        fn new() -> Self {
            let words = vec![Ok(BLANK); 3 * PAGE_WORDS];
            Self { words, left: u32::MAX, torn: Err(ReadError), erases: [0; 3], writes: 0 }
        }

        /// Returns `true` if power is still there for a write.
        fn counts(&mut self, word: usize) -> Result<bool, WriteError> {
            let last = self.left == 1;
            self.left = self.left.checked_sub(1).ok_or(WriteError { word })?;
            self.writes += 1;
            Ok(!last)
        }
    }

    impl SlotFlash for Flash {
        fn erase_page(&mut self, page: usize) -> Result<(), WriteError> {
            assert!(page >= FIRST, "not the log's");
            self.erases[page] += 1;
            let whole = self.counts(page * PAGE_WORDS)?;
            let torn = self.torn;
            for (word, place) in self.words[page * PAGE_WORDS..][..PAGE_WORDS].iter_mut().enumerate() {
                // A part of the page is erased.
                *place = if whole || word % 3 == 0 { Ok(BLANK) } else { torn };
            }
            if whole { Ok(()) } else { Err(WriteError { word: page * PAGE_WORDS }) }
        }

        fn program(&mut self, word: usize, bytes: [u8; DOUBLE_WORD]) -> Result<(), WriteError> {
            assert!(word >= FIRST * PAGE_WORDS, "not the log's");
            assert!(self.left == 0 || self.words[word] == Ok(BLANK) || bytes == ZERO, "written twice: {word}");
            let whole = self.counts(word)?;
            self.words[word] = if whole { Ok(bytes) } else { self.torn };
            if whole { Ok(()) } else { Err(WriteError { word }) }
        }

        fn read(&mut self, word: usize) -> Result<[u8; DOUBLE_WORD], ReadError> {
            self.words[word]
        }
    }

    fn found(log: &FaultLog) -> Vec<LoggedFault> {
        log.newest().copied().collect()
    }

    #[test]
    fn faults_are_there_after_any_number_of_power_ups_with_the_number_of_their_own() {
        let mut flash = Flash::new();
        for power_up in 1..=600u32 {
            let mut log = FaultLog::open(&mut flash, FIRST, true);
            assert_eq!(log.power_ups(), power_up);
            // The third of each ten has faults, the others run for long enough to be counted.
            match power_up % 10 {
                3 => (0..4).for_each(|n| log.append(&mut flash, 0x3210 + n, n as u8, 7 * power_up).unwrap()),
                _ => log.keep_power_up(&mut flash).unwrap(),
            }
            // A reset is no power-up.
            let again = FaultLog::open(&mut flash, FIRST, false);
            assert_eq!((again.power_ups(), again.is_new()), (power_up, false));
            assert_eq!(found(&again), found(&log));
        }
        let log = FaultLog::open(&mut flash, FIRST, true);
        let expected: Vec<_> = (0..LOGGED as u32)
            .map(|back| {
                let (power_up, n) = (593 - back / 4 * 10, 3 - back % 4);
                LoggedFault { code: 0x3210 + n as u16, fault: n as u8, power_up, time: 7 * power_up }
            })
            .collect();
        assert_eq!(found(&log), expected);
        assert_eq!(log.power_ups(), 601);
    }

    #[test]
    fn a_page_is_erased_once_for_254_entries() {
        let mut flash = Flash::new();
        let mut log = FaultLog::open(&mut flash, FIRST, false);
        let room = PAGE_WORDS as u32 - 2;
        for entry in 0..10 * room {
            log.append(&mut flash, 0x2310, 1, entry).unwrap();
            assert_eq!(flash.erases[1] + flash.erases[2], entry / room + 1, "{entry}");
        }
        assert_eq!(flash.erases, [0, 5, 5]);
        assert_eq!(ENTRIES, 20_000 * room);
    }

    #[test]
    fn opening_writes_nothing() {
        let mut flash = Flash::new();
        let mut log = FaultLog::open(&mut flash, FIRST, true);
        assert_eq!(flash.writes, 0);
        log.append(&mut flash, 0x2310, 1, 3).unwrap();
        let writes = flash.writes;
        FaultLog::open(&mut flash, FIRST, true);
        assert_eq!(flash.writes, writes);
    }

    /// Power is lost at every write of some 300, and what is torn reads in every way: what was there before is there
    /// still, and what comes afterwards is kept.
    #[test]
    fn a_loss_of_power_costs_the_entry_that_was_being_written_and_no_other() {
        let entry = encode((0x3210, 12, 4));
        let mut other = entry;
        other[3] ^= 0x10;
        for torn in [Err(ReadError), Ok(BLANK), Ok(entry), Ok(other), Ok(ZERO)] {
            for power in 1..=300 {
                let mut flash = Flash { left: power, torn, ..Flash::new() };
                let mut log = FaultLog::open(&mut flash, FIRST, true);
                let mut kept = 0;
                while log.append(&mut flash, 0x2310, 1, kept).is_ok() {
                    kept += 1;
                }
                flash.left = u32::MAX;
                let mut log = FaultLog::open(&mut flash, FIRST, true);
                let times: Vec<_> = log.newest().filter(|fault| fault.code == 0x2310).map(|fault| fault.time).collect();
                let whole: Vec<_> = (0..kept).rev().take(LOGGED).collect();
                let lost = LOGGED.min(whole.len()) - times.len();
                assert!(whole.starts_with(&times) && lost <= 1, "{torn:?}, {power}: {times:?} of {kept}");
                // One that reads as it was to be is there, and takes the place of the oldest.
                assert!(lost == 0 || torn == Ok(entry), "{torn:?}, {power}: {times:?} of {kept}");
                // A blank double word that was torn is written again, which a chip may refuse: then the next is taken.
                let before = log.power_ups();
                log.append(&mut flash, 0x7305, 6, 1).unwrap();
                let log = FaultLog::open(&mut flash, FIRST, false);
                let newest = log.newest().next().copied().unwrap();
                assert_eq!((newest.code, newest.power_up), (0x7305, before), "{torn:?}, {power}");
            }
        }
    }

    #[test]
    fn a_double_word_that_refuses_to_be_written_is_passed_over() {
        let mut flash = Flash::new();
        let mut log = FaultLog::open(&mut flash, FIRST, false);
        log.append(&mut flash, 0x2310, 1, 1).unwrap();
        flash.left = 0;
        assert!(log.append(&mut flash, 0x2310, 1, 2).is_err());
        flash.left = u32::MAX;
        log.append(&mut flash, 0x2310, 1, 3).unwrap();
        let times = found(&FaultLog::open(&mut flash, FIRST, false)).iter().map(|fault| fault.time).collect::<Vec<_>>();
        assert_eq!(times, [3, 1]);
    }

    proptest! {
        #[test]
        fn an_entry_survives_its_bytes(code: u16, number: u32, fault: u8) {
            prop_assert_eq!(decode(Ok(encode((code, number, fault)))), Some((code, number, fault)));
        }

        #[test]
        fn an_entry_with_one_flipped_bit_is_none(code: u16, number: u32, fault: u8, bit in 0..64usize) {
            let mut word = encode((code, number, fault));
            word[bit / 8] ^= 1 << (bit % 8);
            prop_assert_eq!(decode(Ok(word)), None);
        }

        #[test]
        fn any_content_of_the_pages_is_borne(words in prop::collection::vec(any::<[u8; DOUBLE_WORD]>(), 2 * PAGE_WORDS)) {
            let mut flash = Flash::new();
            flash.words[PAGE_WORDS..].iter_mut().zip(words).for_each(|(place, word)| *place = Ok(word));
            let mut log = FaultLog::open(&mut flash, FIRST, true);
            log.append(&mut flash, 0x2310, 1, 5).unwrap();
            let again = FaultLog::open(&mut flash, FIRST, false);
            prop_assert_eq!(again.newest().next().map(|fault| (fault.code, fault.time)), Some((0x2310, 5)));
        }
    }

    #[test]
    fn blank_and_zero_words_are_no_entries() {
        assert_eq!([BLANK, ZERO].map(|word| decode(Ok(word))), [None; 2]);
    }
}
