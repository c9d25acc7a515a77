//! FLASH, the interface of the embedded flash: RM0440, chapter 3 (category 3, STM32G474) and chapter 5 (category 2,
//! STM32G431).
//!
//! Keys, standard programming, page erase, error flags, error correction with its interrupt, the user options of OPTR.
//! Not modelled: fast programming, mass erase, other option bytes, write and read protection, power-down; nor what the
//! options do, but for the number of banks as delivered.
//!
//! Assumptions:
//! - Programming and erasing take the datasheet's typical times (DS12288, "Flash memory characteristics").
//! - The accelerator's caches are not simulated: an access costs all of the wait states, as if each missed. That is the
//!   slowest that it can be, and it is the same on every run; what has to be quick lies in SRAM.
//! - An address in ECCR counts bytes from the bank's start (3.7.7; unconfirmed).

mod array;
mod kept;

use array::Part;
pub use array::{Array, DOUBLE_WORD, PAGE, Torn};
pub use kept::KeptError;

use super::register::{Block, Register, register};
use super::time::{Instant, Moment};
use super::variant::Variant;
use crate::bus::{Refusal, Width};
use std::ops::Range;

/// Programming of a double word, ns: t_prog.
pub const PROGRAM_NS: u64 = 81_690;
/// Erasing of a page, ns: t_ERASE.
pub const ERASE_NS: u64 = 22_020_000;

const ACR: u32 = 0x00;
const KEYR: u32 = 0x08;
const OPTKEYR: u32 = 0x0c;
const SR: u32 = 0x10;
const CR: u32 = 0x14;
const ECCR: u32 = 0x18;
const OPTR: u32 = 0x20;

const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

const EOP: u32 = 1 << 0;
const OPERR: u32 = 1 << 1;
const PROGERR: u32 = 1 << 3;
const PGAERR: u32 = 1 << 5;
const SIZERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;
const BSY: u32 = 1 << 16;
/// Flags that must be cleared before the next operation (3.3.7).
const ERRORS: u32 = 0x3f8;

const PG: u32 = 1 << 0;
const PER: u32 = 1 << 1;
const BKER: u32 = 1 << 11;
const STRT: u32 = 1 << 16;
const OPTSTRT: u32 = 1 << 17;
const OBL_LAUNCH: u32 = 1 << 27;
const OPTLOCK: u32 = 1 << 30;
/// Read protection and the number of banks: changing them erases flash, which is not modelled.
const OPTIONS_KEPT: u32 = 0xff | 1 << 22;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const LOCK: u32 = 1 << 31;

const BK_ECC: u32 = 1 << 21;
const ECCD: u32 = 1 << 31;
/// ECCC2, ECCD2, ECCC and ECCD: cleared by a one.
const ECC_FLAGS: u32 = 0xf000_0000;

/// ACR: RUN_PD, SLEEP_PD. CR: MER1, MER2, FSTPG, securable areas. ECCR: ECCIE, as nothing is ever corrected.
const REGISTERS: &[Register] = &[
    register(ACR, "ACR", 0x0004_0600, 0x0004_1f0f, 0x0000_6000),
    register(0x04, "PDKEYR", 0, 0, u32::MAX),
    register(KEYR, "KEYR", 0, 0, 0),
    register(OPTKEYR, "OPTKEYR", 0, 0, 0),
    register(SR, "SR", 0, 0, 0),
    register(CR, "CR", 0xc000_0000, 0x0700_0bfb, 0x300c_8004),
    register(ECCR, "ECCR", 0, 0, 0x0100_0000),
    register(OPTR, "OPTR", 0, 0, 0),
];

/// Progress of the keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Keys {
    None,
    First,
    /// A wrong one came: locked until the next reset.
    Wrong,
}

/// Operation that is under way.
#[derive(Clone, Debug)]
struct Busy {
    until: Instant,
    /// Offsets that cannot be read meanwhile.
    bank: Range<u32>,
    /// Part that it changes, as it was; none where that is the options.
    before: Option<Part>,
}

/// A loss of power to come.
#[derive(Clone, Copy, Debug)]
struct Cut {
    operation: u64,
    kind: Torn,
}

/// The interface with its cells.
#[derive(Clone, Debug)]
pub struct Flash {
    block: Block,
    /// The cells.
    pub array: Array,
    size: u32,
    bank: u32,
    keys: Keys,
    option_keys: Keys,
    /// OPTR in its cells, and as the chip has loaded it.
    options: u32,
    loaded: u32,
    /// The options are to be loaded, which resets the chip.
    launched: bool,
    /// First word of a double word that waits for the second.
    first: Option<(u32, u32)>,
    busy: Option<Busy>,
    operations: u64,
    cut: Option<Cut>,
    /// Instant at which the power goes, and what it leaves.
    fails: Option<(Instant, Torn)>,
    rewritten: Option<Range<u32>>,
}

impl Flash {
    /// Erased.
    pub fn new(variant: &Variant) -> Self {
        let chapter = if variant.two_banks { "3.7" } else { "5.7" };
        let mut block = Block::new("FLASH", chapter, REGISTERS);
        block.set(OPTR, variant.options);
        Self {
            block,
            array: Array::new(variant.flash),
            size: variant.flash,
            bank: if variant.two_banks { variant.flash / 2 } else { variant.flash },
            keys: Keys::None,
            option_keys: Keys::None,
            options: variant.options,
            loaded: variant.options,
            launched: false,
            first: None,
            busy: None,
            operations: 0,
            cut: None,
            fails: None,
            rewritten: None,
        }
    }

    /// Back to reset. What an operation under way leaves is undefined (3.3.6): here a double error wherever it had
    /// begun to work.
    pub fn reset(&mut self) {
        self.stop(Torn::Error);
        self.block.reset();
        self.block.set(OPTR, self.loaded);
        (self.keys, self.option_keys, self.first, self.busy) = (Keys::None, Keys::None, None, None);
    }

    /// The power goes: an operation under way leaves what was asked for by [`cut_at`](Self::cut_at), or a double error.
    pub fn power_down(&mut self) {
        self.stop(self.fails.map_or(Torn::Error, |(_, kind)| kind));
    }

    fn stop(&mut self, kind: Torn) {
        if let Some(before) = self.busy.take().and_then(|busy| busy.before) {
            self.rewrite(before.offsets());
            self.array.tear(before, kind);
        }
    }

    /// The power came back.
    pub fn power_up(&mut self) {
        self.loaded = self.options;
        self.reset();
        (self.cut, self.fails) = (None, None);
    }

    /// Lets the power go in the middle of an operation: the `operation`th double word or page from now on, counted from
    /// 1.
    pub fn cut_at(&mut self, operation: u64, kind: Torn) {
        self.cut = Some(Cut { operation: self.operations.saturating_add(operation), kind });
    }

    /// Double words programmed and pages erased since the run began.
    pub const fn operations(&self) -> u64 {
        self.operations
    }

    /// Wait states (ACR.LATENCY).
    #[inline]
    pub fn latency(&self) -> u32 {
        self.block.get(ACR) & 0xf
    }

    /// Level of the interrupt: EOP and OPERR with their enables.
    pub fn interrupts(&self) -> bool {
        let (status, control) = (self.block.get(SR), self.block.get(CR));
        status & EOP != 0 && control & EOPIE != 0 || status & OPERR != 0 && control & ERRIE != 0
    }

    /// Level of the non-maskable interrupt: a double error was read and not cleared (3.3.2).
    #[inline]
    pub fn nmi(&self) -> bool {
        self.block.get(ECCR) & ECCD != 0
    }

    /// Offsets that changed since the last call.
    pub fn take_rewritten(&mut self) -> Option<Range<u32>> {
        self.rewritten.take()
    }

    /// Offsets that cannot be read, and until when; none where all can be. One bank stalls its readers as a whole, of
    /// two banks the one that is worked on (3.3.5 "Read-while-write").
    pub fn stall(&self) -> Option<(Range<u32>, Instant)> {
        self.busy.as_ref().map(|busy| (busy.bank.clone(), busy.until))
    }

    /// Returns `true` if the options are to be loaded (OBL_LAUNCH, 3.4.3), once: they are, and the caller resets the
    /// chip.
    pub fn take_launch(&mut self) -> bool {
        if !std::mem::take(&mut self.launched) {
            return false;
        }
        self.loaded = self.options;
        true
    }

    /// Instant at which something happens by itself.
    pub fn next(&self) -> Instant {
        let end = self.busy.as_ref().map_or(Instant::NEVER, |busy| busy.until);
        self.fails.map_or(end, |(fails, _)| fails.min(end))
    }

    /// Returns `true` if the power goes now.
    pub fn fails(&self, at: Instant) -> bool {
        self.fails.is_some_and(|(fails, _)| fails <= at)
    }

    /// Ends what is over.
    pub fn advance(&mut self, at: Instant) {
        if let Some(busy) = self.busy.take_if(|busy| busy.until <= at) {
            if busy.before.is_none() {
                self.options = self.block.get(OPTR);
            }
            if self.block.get(CR) & EOPIE != 0 {
                self.flag(EOP);
            }
        }
    }

    fn flag(&mut self, flags: u32) {
        let operation = if flags & ERRORS != 0 && self.block.get(CR) & ERRIE != 0 { OPERR } else { 0 };
        self.block.set(SR, self.block.get(SR) | flags | operation);
    }

    /// A load from the cells; none behind their end. A double error is noted in ECCR.
    #[inline(always)]
    pub fn load(&mut self, offset: u32, width: Width) -> Option<u32> {
        let (value, wrong) = self.array.read(offset, width)?;
        if let Some(wrong) = wrong {
            self.note(wrong);
        }
        Some(value)
    }

    /// The flags and the address stay until the program clears them (3.7.7).
    fn note(&mut self, offset: u32) {
        let status = self.block.get(ECCR);
        if status & ECC_FLAGS == 0 {
            let bank = if offset >= self.bank { BK_ECC } else { 0 };
            self.block.set(ECCR, ECCD | bank | (offset % self.bank));
        }
    }

    /// A load from a register.
    pub fn read(&self, offset: u32) -> Result<u32, Refusal> {
        let value = self.block.read(offset)?;
        Ok(if offset == SR && self.busy.is_some() { value | BSY } else { value })
    }

    /// A store to a register.
    pub fn write(&mut self, offset: u32, value: u32, at: Moment) -> Result<(), Refusal> {
        match offset {
            KEYR => return self.unlock(value),
            OPTKEYR => return self.unlock_options(value),
            OPTR => return self.write_options(value),
            SR => self.block.set(SR, self.block.get(SR) & !value),
            ECCR => {
                self.block.write(ECCR, value & !ECC_FLAGS & !0x007f_ffff)?;
                self.block.set(ECCR, self.block.get(ECCR) & !(value & ECC_FLAGS));
            }
            CR if self.busy.is_some() => {
                return Err(self.block.forbid(CR, "it is written while an operation is under way"));
            }
            CR => return self.control(value, at),
            _ => {
                self.block.write(offset, value)?;
            }
        }
        Ok(())
    }

    /// 3.3.6 "Flash main memory erase and programming": a wrong key locks until the next reset, and is a bus error.
    fn unlock(&mut self, key: u32) -> Result<(), Refusal> {
        let locked = self.block.get(CR) & LOCK != 0;
        self.keys = match self.keys {
            Keys::None if locked && key == KEYS[0] => Keys::First,
            Keys::First if key == KEYS[1] => {
                self.block.set(CR, self.block.get(CR) & !LOCK);
                Keys::None
            }
            _ => Keys::Wrong,
        };
        if self.keys == Keys::Wrong { Err(Refusal::NoAnswer) } else { Ok(()) }
    }

    /// 3.4.2: the flash is unlocked first; a wrong key as above.
    fn unlock_options(&mut self, key: u32) -> Result<(), Refusal> {
        let control = self.block.get(CR);
        let locked = control & LOCK == 0 && control & OPTLOCK != 0;
        self.option_keys = match self.option_keys {
            Keys::None if locked && key == OPTION_KEYS[0] => Keys::First,
            Keys::First if key == OPTION_KEYS[1] => {
                self.block.set(CR, control & !OPTLOCK);
                Keys::None
            }
            _ => Keys::Wrong,
        };
        if self.option_keys == Keys::Wrong { Err(Refusal::NoAnswer) } else { Ok(()) }
    }

    /// Locked, what is written is ignored (3.7.8).
    fn write_options(&mut self, value: u32) -> Result<(), Refusal> {
        let before = self.block.get(OPTR);
        if self.block.get(CR) & OPTLOCK == 0 {
            if (before ^ value) & OPTIONS_KEPT != 0 {
                return Err(self.block.refuse(OPTR, "another read protection or number of banks"));
            }
            self.block.set(OPTR, value);
        }
        Ok(())
    }

    fn control(&mut self, value: u32, at: Moment) -> Result<(), Refusal> {
        if self.block.get(CR) & LOCK != 0 {
            return Ok(());
        }
        let locks = value & (LOCK | OPTLOCK);
        let open = self.block.get(CR) & OPTLOCK == 0;
        self.block.write(CR, value & !(LOCK | OPTLOCK | STRT | OPTSTRT | OBL_LAUNCH))?;
        self.block.set(CR, self.block.get(CR) | locks);
        // Without the options' keys neither has an effect.
        self.launched |= open && value & OBL_LAUNCH != 0;
        if open && value & OPTSTRT != 0 {
            let until = at.instant().after_ns(ERASE_NS);
            self.busy = Some(Busy { until, bank: 0..self.bank, before: None });
            return Ok(());
        }
        if value & STRT != 0 {
            self.start_erase(value, at)?;
        }
        Ok(())
    }

    /// 3.3.7, "Page erase".
    fn start_erase(&mut self, control: u32, at: Moment) -> Result<(), Refusal> {
        if control & PER == 0 {
            return Err(self.block.forbid(CR, "STRT without what to erase"));
        }
        if control & PG != 0 || self.block.get(SR) & ERRORS != 0 {
            self.flag(PGSERR);
            return Ok(());
        }
        let second = control & BKER != 0;
        let page = control >> 3 & 0x7f;
        if page >= self.bank / PAGE || second && self.bank == self.size {
            return Err(self.block.forbid(CR, "a page is erased that is not there"));
        }
        let first = if second { self.bank / PAGE } else { 0 };
        self.begin(at, (first + page) * PAGE..(first + page + 1) * PAGE, ERASE_NS);
        self.array.erase(first + page);
        Ok(())
    }

    /// A store to the cells, of which the second completes a double word (3.3.7, "Standard programming").
    pub fn store(&mut self, offset: u32, width: Width, value: u32, at: Moment) -> Result<(), Refusal> {
        if self.busy.is_some() {
            return Err(self.block.forbid(SR, "the flash is written while an operation is under way"));
        }
        let control = self.block.get(CR);
        if control & PG == 0 || control & (PER | LOCK) != 0 || self.block.get(SR) & ERRORS != 0 {
            self.flag(PGSERR);
            return Ok(());
        }
        if width != Width::Word {
            self.flag(SIZERR);
            self.first = None;
            return Ok(());
        }
        match self.first.take() {
            None if offset.is_multiple_of(DOUBLE_WORD) => self.first = Some((offset, value)),
            Some((low, word)) if offset == low + 4 => {
                self.program(low / DOUBLE_WORD, u64::from(word) | u64::from(value) << 32, at);
            }
            _ => self.flag(PGAERR),
        }
        Ok(())
    }

    fn program(&mut self, word: u32, value: u64, at: Moment) {
        if !self.array.accepts(word, value) {
            self.flag(PROGERR);
            return;
        }
        self.begin(at, word * DOUBLE_WORD..(word + 1) * DOUBLE_WORD, PROGRAM_NS);
        self.array.program(word, value);
    }

    /// Tells that cells are others than before.
    fn rewrite(&mut self, offsets: Range<u32>) {
        self.rewritten = Some(match self.rewritten.take() {
            None => offsets,
            Some(before) => before.start.min(offsets.start)..before.end.max(offsets.end),
        });
    }

    /// Begins an operation. The caller changes the cells at once: nobody can read them before it ends.
    fn begin(&mut self, at: Moment, offsets: Range<u32>, nanoseconds: u64) {
        self.operations += 1;
        let start = offsets.start / self.bank * self.bank;
        let before = Some(self.array.part(offsets.clone()));
        self.busy = Some(Busy { until: at.instant().after_ns(nanoseconds), bank: start..start + self.bank, before });
        self.rewrite(offsets);
        if let Some(cut) = self.cut.filter(|cut| cut.operation == self.operations) {
            self.fails = Some((at.instant().after_ns(nanoseconds / 2), cut.kind));
        }
    }
}
