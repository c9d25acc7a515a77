//! Power that goes at every erase and write of every operation, once more at every one of what follows, for five kinds
//! of torn words.
//!
//! After each: the joint starts with the old content or the new one, whole, with the same one at every start from then
//! on, and can store again. Host.

use super::super::*;
use super::model::{Flash, Torn};

const FRICTION: u32 = 1;
const CONFIGURATION: u32 = 2;
/// Starts in a row that must agree.
const STARTS: usize = 4;

/// Content number `number`: none of its double words is like another.
fn content(number: u64, length: usize) -> Vec<u8> {
    let mut state = number.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    (0..length)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state as u8
        })
        .collect()
}

/// A way to keep one content through losses of power.
trait Protocol: Clone {
    /// Content that the joint starts with; an error where the power goes meanwhile.
    fn start(&self, flash: &mut Flash) -> Result<Option<Vec<u8>>, SlotError>;
    fn store(&self, flash: &mut Flash, payload: &[u8]) -> Result<(), SlotError>;
    fn roll_back(&self, flash: &mut Flash) -> Result<(), SlotError>;
}

/// The slots as they are.
impl Protocol for Layout {
    fn start(&self, flash: &mut Flash) -> Result<Option<Vec<u8>>, SlotError> {
        let mut slots = Slots::open(flash, *self)?;
        let mut buffer = vec![0; self.capacity()];
        let length = slots.load(flash, &mut buffer)?;
        Ok(length.map(|length| buffer[..length].to_vec()))
    }

    fn store(&self, flash: &mut Flash, payload: &[u8]) -> Result<(), SlotError> {
        Slots::open(flash, *self)?.store(flash, payload)
    }

    fn roll_back(&self, flash: &mut Flash) -> Result<(), SlotError> {
        Slots::open(flash, *self)?.roll_back(flash, &mut vec![0; self.capacity()])
    }
}

/// Initial state of a case, and its operation.
#[derive(Clone)]
struct Scenario<P> {
    protocol: P,
    flash: Flash,
    old: Option<Vec<u8>>,
    new: Vec<u8>,
    roll_back: bool,
}

#[derive(Clone, Copy, Debug)]
enum Operation {
    FirstProvisioning,
    Commit,
    RollBack,
    ConfigurationStore,
}

impl Operation {
    const ALL: [Self; 4] = [Self::FirstProvisioning, Self::Commit, Self::RollBack, Self::ConfigurationStore];
}

fn scenario(operation: Operation, torn: Torn, seed: u64, length: usize) -> Scenario<Layout> {
    let friction = Layout::new(0, 1, FRICTION).expect("a layout");
    let configuration = Layout::new(2, 2, CONFIGURATION).expect("a layout");
    let mut flash = Flash::new(6, torn, seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let stored = |flash: &mut Flash, layout: Layout, numbers: &[u64]| {
        for number in numbers {
            layout.store(flash, &content(*number, length - *number as usize)).expect("power");
        }
        numbers.last().map(|number| content(*number, length - *number as usize))
    };
    let (protocol, old, new, roll_back) = match operation {
        Operation::FirstProvisioning => (friction, None, content(9, length), false),
        Operation::Commit => (friction, stored(&mut flash, friction, &[1, 2, 3]), content(9, length), false),
        Operation::RollBack => (friction, stored(&mut flash, friction, &[1, 2, 3]), content(2, length - 2), true),
        Operation::ConfigurationStore => {
            stored(&mut flash, friction, &[1, 2]);
            (configuration, stored(&mut flash, configuration, &[4, 5]), content(9, length), false)
        }
    };
    Scenario { protocol, flash, old, new, roll_back }
}

impl<P: Protocol> Scenario<P> {
    fn perform(&self, flash: &mut Flash) -> Result<(), SlotError> {
        if self.roll_back { self.protocol.roll_back(flash) } else { self.protocol.store(flash, &self.new) }
    }

    /// Erases and writes of the operation.
    fn operations(&self) -> usize {
        let mut flash = self.flash.clone();
        self.perform(&mut flash).expect("power");
        flash.operations - self.flash.operations
    }

    /// The flash after a loss of power in operation `cut`.
    fn cut(&self, cut: usize) -> Flash {
        let mut flash = self.flash.clone();
        flash.cut_at(cut);
        assert!(self.perform(&mut flash).is_err() && flash.off, "power went in operation {cut}");
        flash.power_on();
        flash
    }

    /// Starts and stores, without a further loss of power; false where a promise is broken.
    fn recovers(&self, mut flash: Flash, permitted: &[Option<Vec<u8>>]) -> bool {
        let Ok(found) = self.protocol.start(&mut flash) else { return false };
        let next = content(20, self.new.len() / 2);
        permitted.contains(&found)
            && (1..STARTS).all(|_| self.protocol.start(&mut flash).as_ref() == Ok(&found))
            && self.protocol.store(&mut flash, &next).is_ok()
            && (0..2).all(|_| self.protocol.start(&mut flash) == Ok(Some(next.clone())))
    }

    /// [`Scenario::recovers`] with a second loss of power in the `second` operation from now, in a start or in the
    /// store that follows. None where there are not so many operations.
    fn recovers_with_a_cut(&self, mut flash: Flash, second: usize) -> Option<bool> {
        let mut permitted = vec![self.old.clone(), Some(self.new.clone())];
        flash.cut_at(second);
        for _ in 0..STARTS {
            match self.protocol.start(&mut flash) {
                Ok(found) if permitted.contains(&found) => permitted = vec![found],
                Err(_) if flash.off => break,
                _ => return Some(false),
            }
        }
        if !flash.off {
            let next = content(21, self.new.len());
            if self.protocol.store(&mut flash, &next).is_ok() {
                return None;
            }
            permitted.push(Some(next));
        }
        if !flash.off {
            return Some(false);
        }
        flash.power_on();
        Some(self.recovers(flash, &permitted))
    }
}

/// Cases and how many of them break a promise.
#[derive(Debug, Default, PartialEq)]
struct Tally {
    one_cut: usize,
    two_cuts: usize,
    bad: usize,
}

impl Tally {
    fn judge<P: Protocol>(&mut self, scenario: &Scenario<P>, cut: usize, followed: bool) {
        let flash = scenario.cut(cut);
        self.one_cut += 1;
        self.bad += usize::from(!scenario.recovers(flash.clone(), &[scenario.old.clone(), Some(scenario.new.clone())]));
        for second in (1..).take_while(|_| followed) {
            let Some(good) = scenario.recovers_with_a_cut(flash.clone(), second) else { break };
            self.two_cuts += 1;
            self.bad += usize::from(!good);
        }
    }
}

#[test]
fn two_losses_of_power_anywhere_leave_the_old_content_or_the_new_one_for_good() {
    /// Noise decides how flickering words read; the other kinds hardly need it.
    const SEEDS: [(Torn, u64); 5] =
        [(Torn::Error, 4), (Torn::Zeros, 4), (Torn::Ones, 4), (Torn::Stable, 24), (Torn::Flicker, 200)];
    let mut total = Tally::default();
    for operation in Operation::ALL {
        for (torn, seeds) in SEEDS {
            let mut tally = Tally::default();
            for seed in 1..=seeds {
                let scenario = scenario(operation, torn, seed, 61);
                for cut in 1..=scenario.operations() {
                    tally.judge(&scenario, cut, true);
                }
            }
            println!("{operation:?}, torn words {torn:?}: {tally:?}");
            total.one_cut += tally.one_cut;
            total.two_cuts += tally.two_cuts;
            total.bad += tally.bad;
        }
    }
    println!("61 B: {} cases, {} bad", total.one_cut + total.two_cuts, total.bad);
    assert_eq!(total.bad, 0);
    assert!(total.two_cuts > 20_000, "{total:?}");
}

#[test]
fn a_payload_that_fills_its_slot_survives_a_loss_of_power_at_every_operation() {
    let mut total = Tally::default();
    for operation in Operation::ALL {
        for torn in Torn::ALL {
            let scenario = scenario(operation, torn, 77, PAGE - OVERHEAD);
            let operations = scenario.operations();
            for cut in 1..=operations {
                // Payload words are alike: a second loss of power after the first and last of them, and around all
                // marks.
                let followed = torn == Torn::Flicker && (cut <= 6 || cut + 6 > operations);
                total.judge(&scenario, cut, followed);
            }
        }
    }
    println!("2016 B: {} cases, {} bad", total.one_cut + total.two_cuts, total.bad);
    assert_eq!(total.bad, 0);
    assert!(total.one_cut >= 20 * 250, "{total:?}");
}

#[test]
fn every_operation_can_end_either_way() {
    for operation in Operation::ALL {
        let scenario = scenario(operation, Torn::Flicker, 3, 61);
        let found = |cut| scenario.protocol.start(&mut scenario.cut(cut)).expect("power");
        assert_eq!(found(1), scenario.old, "{operation:?}");
        assert_eq!(found(scenario.operations()), Some(scenario.new.clone()), "{operation:?}");
    }
}

/// Two slots with one mark, as one would do it first.
#[derive(Clone, Copy)]
struct OneMark {
    layout: Layout,
    /// The header is written before the payload, and without its checksum.
    header_first: bool,
}

impl OneMark {
    fn slot(&self, flash: &mut Flash, slot: Slot) -> Option<(u16, Vec<u8>)> {
        let start = self.layout.first_word(slot);
        let header = Header::decode(flash.read(start).ok()?, self.layout.capacity())?;
        if !self.header_first && !fits(flash, &self.layout, slot, header) {
            return None;
        }
        let words = (1..).map(|offset| flash.read(start + HEADER_WORDS - 1 + offset));
        let words: Vec<_> =
            words.take(usize::from(header.length).div_ceil(DOUBLE_WORD)).collect::<Result<_, _>>().ok()?;
        let mut payload = words.concat();
        payload.truncate(header.length.into());
        Some((header.sequence, payload))
    }
}

impl Protocol for OneMark {
    fn start(&self, flash: &mut Flash) -> Result<Option<Vec<u8>>, SlotError> {
        let both = [self.slot(flash, Slot::First), self.slot(flash, Slot::Second)];
        Ok(both.into_iter().flatten().max_by_key(|(sequence, _)| *sequence).map(|(_, payload)| payload))
    }

    fn store(&self, flash: &mut Flash, payload: &[u8]) -> Result<(), SlotError> {
        let both = [self.slot(flash, Slot::First), self.slot(flash, Slot::Second)].map(|slot| slot.map_or(0, |s| s.0));
        let slot = if both[0] >= both[1] && both[0] != 0 { Slot::Second } else { Slot::First };
        let (length, sequence) = (payload.len() as u16, both[0].max(both[1]) + 1);
        let mut checksum = Checksum::new(self.layout.kind, length, sequence);
        checksum.add(payload);
        let header = Header { length, sequence, checksum: checksum.value() }.encode();
        let start = self.layout.first_word(slot);
        flash.erase_page(self.layout.page(slot))?;
        if self.header_first {
            flash.program(start, header)?;
        }
        for (index, piece) in payload.chunks(DOUBLE_WORD).enumerate() {
            let mut bytes = BLANK;
            bytes[..piece.len()].copy_from_slice(piece);
            flash.program(start + HEADER_WORDS + index, bytes)?;
        }
        if !self.header_first {
            flash.program(start, header)?;
        }
        Ok(())
    }

    fn roll_back(&self, _: &mut Flash) -> Result<(), SlotError> {
        Err(SlotError::NoPrevious)
    }
}

fn tally_of_one_mark(header_first: bool, torn: Torn) -> Tally {
    let mut tally = Tally::default();
    for seed in 1..=20 {
        let protocol = OneMark { layout: Layout::new(0, 1, FRICTION).expect("a layout"), header_first };
        let mut flash = Flash::new(2, torn, seed);
        let old = content(1, 61);
        protocol.store(&mut flash, &old).expect("power");
        let scenario = Scenario { protocol, flash, old: Some(old), new: content(9, 61), roll_back: false };
        for cut in 1..=scenario.operations() {
            tally.judge(&scenario, cut, false);
        }
    }
    tally
}

#[test]
fn the_model_finds_a_store_that_writes_the_header_first() {
    for torn in Torn::ALL {
        let tally = tally_of_one_mark(true, torn);
        println!("header first, torn words {torn:?}: {tally:?}");
        // An ECC error gives the torn payload away.
        assert_eq!(tally.bad > 0, torn != Torn::Error, "{torn:?}: {tally:?}");
    }
}

#[test]
fn the_model_finds_that_one_word_written_last_is_not_enough_where_words_flicker() {
    for torn in Torn::ALL {
        let tally = tally_of_one_mark(false, torn);
        println!("header last, torn words {torn:?}: {tally:?}");
        assert_eq!(tally.bad > 0, torn == Torn::Flicker, "{torn:?}: {tally:?}");
    }
}
