//! The slots on a model of the flash; host.

mod model;
mod power_cuts;

use super::*;
use model::{Flash, Torn};

fn layout() -> Layout {
    Layout::new(0, 1, 1).expect("a layout")
}

fn active(flash: &mut Flash) -> Option<Vec<u8>> {
    let mut slots = Slots::open(flash, layout()).expect("opens");
    let mut buffer = [0; PAGE];
    slots.load(flash, &mut buffer).expect("loads").map(|length| buffer[..length].to_vec())
}

fn stored(payloads: &[&[u8]]) -> Flash {
    let mut flash = Flash::new(2, Torn::Error, 1);
    let mut slots = Slots::open(&mut flash, layout()).expect("opens");
    for payload in payloads {
        slots.store(&mut flash, payload).expect("stores");
    }
    flash
}

#[test]
fn empty_slots_hold_nothing_and_opening_writes_nothing() {
    let mut flash = Flash::new(2, Torn::Error, 1);
    let slots = Slots::open(&mut flash, layout()).expect("opens");
    assert_eq!([slots.first, slots.second], [SlotState::Empty; 2]);
    assert_eq!((slots.active(), slots.previous(), flash.operations), (None, None, 0));
    let mut flash = stored(&[b"one", b"two"]);
    let before = flash.operations;
    assert_eq!(active(&mut flash), Some(b"two".to_vec()));
    assert_eq!(flash.operations, before, "a settled pair is only read");
}

#[test]
fn payloads_of_every_length_come_back_and_others_are_refused() {
    let mut flash = Flash::new(2, Torn::Error, 1);
    let mut slots = Slots::open(&mut flash, layout()).expect("opens");
    for length in (1..40).chain(2000..=layout().capacity()) {
        let payload: Vec<u8> = (0..length).map(|i| (i * 7 + length) as u8).collect();
        slots.store(&mut flash, &payload).expect("stores");
        assert_eq!(active(&mut flash), Some(payload));
    }
    for length in [0, layout().capacity() + 1, 65_536 + 8] {
        let error = slots.store(&mut flash, &vec![0; length]).expect_err("refused");
        assert_eq!(error, SlotError::Length { length, limit: 2016 });
    }
    let needed = layout().capacity();
    let error = slots.load(&mut flash, &mut [0; 10]).expect_err("refused");
    assert_eq!(error, SlotError::Buffer { length: 10, needed });
}

#[test]
fn slots_of_several_pages_hold_payloads_longer_than_a_page() {
    let layout = Layout::new(1, 3, 5).expect("a layout");
    let mut flash = Flash::new(7, Torn::Error, 1);
    let payloads = [1u8, 2].map(|seed| (0..layout.capacity()).map(|i| (i % 251) as u8 ^ seed).collect::<Vec<_>>());
    let mut slots = Slots::open(&mut flash, layout).expect("opens");
    for payload in &payloads {
        slots.store(&mut flash, payload).expect("stores");
    }
    let mut buffer = vec![0; layout.capacity()];
    for (slot, payload) in [Slot::First, Slot::Second].into_iter().zip(&payloads) {
        assert_eq!(slots.copy(&mut flash, slot, &mut buffer), Ok(payload.len()));
        assert_eq!(&buffer, payload);
    }
    assert_eq!(flash.read(PAGE_WORDS - 1), Ok(BLANK), "the page before is not theirs");
    assert!(Layout::new(0, 0, 0).is_none() && Layout::new(0, 17, 0).is_none());
}

#[test]
fn sequence_numbers_wrap_without_losing_the_newest() {
    let mut flash = Flash::new(2, Torn::Error, 1);
    let mut slots = Slots::open(&mut flash, layout()).expect("opens");
    for number in 0..66_000u32 {
        slots.store(&mut flash, &number.to_le_bytes()).expect("stores");
        if number % 1_000 == 0 || (65_000..66_000).contains(&number) {
            assert_eq!(active(&mut flash), Some(number.to_le_bytes().to_vec()));
        }
    }
}

#[test]
fn rolling_back_swaps_the_two_contents() {
    let mut flash = stored(&[b"first", b"second"]);
    for expected in [&b"first"[..], b"second", b"first"] {
        let mut slots = Slots::open(&mut flash, layout()).expect("opens");
        slots.roll_back(&mut flash, &mut [0; PAGE]).expect("rolls back");
        assert_eq!(active(&mut flash).as_deref(), Some(expected));
    }
    let mut flash = stored(&[b"only"]);
    let mut slots = Slots::open(&mut flash, layout()).expect("opens");
    assert_eq!(slots.roll_back(&mut flash, &mut [0; PAGE]), Err(SlotError::NoPrevious));
    assert_eq!(active(&mut flash), Some(b"only".to_vec()));
}

#[test]
fn a_payload_can_be_read_in_place_and_a_damaged_one_gives_way_to_the_other() {
    let mut flash = stored(&[b"the one before it", b"the newest content"]);
    let mut slots = Slots::open(&mut flash, layout()).expect("opens");
    let in_place = |slots: &mut Slots, flash: &mut Flash| {
        let slot = slots.usable(flash).expect("reads")?;
        let range = slots.range(slot).expect("a range");
        let words: Vec<u8> = (0..2 * PAGE_WORDS).flat_map(|word| flash.read(word).expect("whole")).collect();
        Some(words[range].to_vec())
    };
    assert_eq!(in_place(&mut slots, &mut flash).as_deref(), Some(&b"the newest content"[..]));
    flash.rot(layout().first_word(Slot::Second) + HEADER_WORDS, 3);
    assert_eq!(in_place(&mut slots, &mut flash).as_deref(), Some(&b"the one before it"[..]));
    assert_eq!((slots.range(Slot::Second), slots.is_whole(&mut flash, Slot::Second)), (None, false));
    flash.rot(layout().first_word(Slot::First) + HEADER_WORDS, 3);
    assert_eq!(in_place(&mut slots, &mut flash), None);
}

#[test]
fn content_of_another_kind_is_not_taken() {
    let mut flash = stored(&[b"friction"]);
    let other = Layout::new(0, 1, 2).expect("a layout");
    let slots = Slots::open(&mut flash, other).expect("opens");
    assert_eq!((slots.active(), slots.state(Slot::First)), (None, SlotState::Damaged));
}

#[test]
fn every_rotten_bit_of_the_newest_is_reported_and_the_other_slot_is_used_from_then_on() {
    let whole = stored(&[b"the one before it", b"the newest content"]);
    let start = layout().first_word(Slot::Second);
    // The header and the payload of 18 bytes; the marks of a settled slot may rot.
    for word in [start, start + 4, start + 5, start + 6] {
        let bits = if word == start + 6 { 16 } else { 64 };
        for bit in 0..bits {
            let mut flash = whole.clone();
            flash.rot(word, bit);
            let slots = Slots::open(&mut flash, layout()).expect("opens");
            assert_eq!(slots.state(Slot::Second), SlotState::Damaged, "bit {bit} of double word {word}");
            assert_eq!(active(&mut flash), Some(b"the one before it".to_vec()));
            // Right again: it was given up all the same.
            if word != start {
                flash.rot(word, bit);
            }
            let operations = flash.operations;
            for _ in 0..3 {
                assert_eq!(active(&mut flash), Some(b"the one before it".to_vec()));
                let slots = Slots::open(&mut flash, layout()).expect("opens");
                assert_eq!((slots.state(Slot::Second), slots.is_lost()), (SlotState::Damaged, true), "at every start");
            }
            assert_eq!(flash.operations, operations, "given up once");
            let mut slots = Slots::open(&mut flash, layout()).expect("opens");
            slots.store(&mut flash, b"stored anew").expect("stores");
            assert!(!slots.is_lost() && !Slots::open(&mut flash, layout()).expect("opens").is_lost());
            assert_eq!(active(&mut flash), Some(b"stored anew".to_vec()));
        }
    }
    for mark in [start + 1, start + 2, start + 3] {
        let mut flash = whole.clone();
        flash.rot(mark, 9);
        assert_eq!(active(&mut flash), Some(b"the newest content".to_vec()), "mark {mark}");
    }
}

#[test]
fn a_worn_double_word_makes_starts_agree_after_the_first_that_finds_it() {
    for seed in 1..200 {
        let mut flash = Flash::new(2, Torn::Flicker, seed);
        let mut slots = Slots::open(&mut flash, layout()).expect("opens");
        slots.store(&mut flash, b"the one before it").expect("stores");
        slots.store(&mut flash, b"the newest content").expect("stores");
        flash.wear(layout().first_word(Slot::Second) + 4 + (seed as usize % 3));
        let found: Vec<_> = (0..20).filter_map(|_| active(&mut flash)).collect();
        let first_old =
            found.iter().position(|content| content == b"the one before it").expect("found within 20 starts");
        assert!(found[first_old..].iter().all(|content| content == b"the one before it"), "seed {seed}");
        assert!(found[..first_old].iter().all(|content| content == b"the newest content"), "seed {seed}");
    }
}

#[test]
fn a_damaged_only_copy_is_not_used_and_the_next_store_replaces_it() {
    for (slot, payloads) in [(Slot::First, &[b"a"][..]), (Slot::Second, &[b"a", b"b"])] {
        let mut flash = stored(&payloads.iter().map(|payload| &payload[..]).collect::<Vec<_>>());
        for slot in [Slot::First, Slot::Second] {
            flash.rot(layout().first_word(slot) + 4, 3);
        }
        let mut slots = Slots::open(&mut flash, layout()).expect("opens");
        assert_eq!((slots.active(), slots.state(slot)), (None, SlotState::Damaged));
        slots.store(&mut flash, b"c").expect("stores");
        assert_eq!(active(&mut flash), Some(b"c".to_vec()));
        // The damage heals: the old content does not come back.
        flash.rot(layout().first_word(Slot::Second) + 4, 3);
        assert_eq!(active(&mut flash), Some(b"c".to_vec()));
    }
}

#[test]
fn damage_after_opening_is_found_where_the_payload_is_copied() {
    let mut flash = stored(&[b"old", b"new"]);
    let mut slots = Slots::open(&mut flash, layout()).expect("opens");
    flash.rot(layout().first_word(Slot::Second) + 4, 0);
    let mut buffer = [0; PAGE];
    assert_eq!(slots.load(&mut flash, &mut buffer), Ok(Some(3)));
    assert_eq!((&buffer[..3], slots.state(Slot::Second)), (&b"old"[..], SlotState::Damaged));
    assert_eq!(active(&mut flash), Some(b"old".to_vec()));
}

#[test]
fn a_store_that_the_flash_refuses_leaves_the_content_in_use() {
    let mut flash = stored(&[b"old", b"new"]);
    let mut slots = Slots::open(&mut flash, layout()).expect("opens");
    // The power goes and comes while the program runs on, as a write error would look like.
    flash.cut_at(7);
    assert!(matches!(slots.store(&mut flash, b"newest"), Err(SlotError::Write(_))));
    assert_eq!(slots.active(), Some(Slot::Second));
    flash.power_on();
    assert_eq!(active(&mut flash), Some(b"new".to_vec()));
    slots.store(&mut flash, b"newest").expect("stores");
    assert_eq!(active(&mut flash), Some(b"newest".to_vec()));
}

#[test]
fn a_payload_that_does_not_read_back_is_refused_and_the_content_in_use_stays() {
    let payload = b"the newest content, four words";
    for word in 0..payload.len().div_ceil(DOUBLE_WORD) {
        for (slot, before) in [(Slot::First, &[][..]), (Slot::Second, &[&b"a"[..]]), (Slot::First, &[b"a", b"b"])] {
            let mut flash = stored(before);
            let in_use = before.last().map(|payload| payload.to_vec());
            let mut slots = Slots::open(&mut flash, layout()).expect("opens");
            let active_before = slots.active();
            flash.weaken(layout().first_word(slot) + HEADER_WORDS + word);
            assert_eq!(slots.store(&mut flash, payload), Err(SlotError::Verify { slot }), "double word {word}");
            assert_eq!((slots.active(), slots.state(slot)), (active_before, SlotState::Interrupted));
            let mut buffer = [0; PAGE];
            let loaded = slots.load(&mut flash, &mut buffer).expect("loads");
            assert_eq!(loaded.map(|length| buffer[..length].to_vec()), in_use);
            assert_eq!(active(&mut flash), in_use, "after a restart");
            slots.store(&mut flash, payload).expect("stores");
            assert_eq!(active(&mut flash), Some(payload.to_vec()));
        }
    }
}

#[test]
fn errors_name_what_where_and_the_limit() {
    let text = |error: SlotError| error.to_string();
    assert_eq!(text(SlotError::Length { length: 0, limit: 2016 }), "payload of 0 bytes, must be 1 to 2016");
    assert_eq!(text(SlotError::Verify { slot: Slot::First }), "First slot does not read back as it was written");
    assert_eq!(text(WriteError { word: 4 }.into()), "the flash refuses to write double word 4 of the parameters");
}
