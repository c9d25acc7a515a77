//! Losses of power at any operation of the flash, and what is found afterwards.

use super::super::flash::{PAGE, Torn};
use super::super::variant;
use super::flash::{erase, program, unlock};
use super::*;
use proptest::prelude::*;

#[derive(Clone, Copy, Debug)]
enum Step {
    Program(u32),
    Erase(u32),
}

const BASE: u32 = 0x0801_d000;

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![4 => (0u32..512).prop_map(Step::Program), 1 => (0u32..2).prop_map(Step::Erase)]
}

/// Content that a double word may hold.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Word {
    Erased,
    Written(u64),
    /// Work on it was cut short.
    Torn,
}

/// A double word as the program reads it, and whether the error correction complained.
fn read(bench: &mut Bench, word: u32) -> (u64, bool) {
    let low = bench.get(BASE + 8 * word);
    let high = bench.get(BASE + 8 * word + 4);
    let wrong = bench.signals.nmi;
    bench.set(FLASH + 0x18, 1 << 31);
    (u64::from(low) | u64::from(high) << 32, wrong)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn only_what_was_worked_on_is_torn(
        steps in prop::collection::vec(step(), 1..24),
        cut in 1u64..24,
        kind in prop::sample::select(&Torn::ALL[..]),
        seed: u64,
    ) {
        let mut bench = Bench::new(&variant::STM32G431CB);
        bench.chip.seed(seed);
        bench.speed_up();
        unlock(&mut bench);
        bench.chip.power_cut_at(cut, kind);
        let mut words = [Word::Erased; 512];
        for (number, step) in steps.into_iter().enumerate() {
            match step {
                Step::Program(word) => {
                    let value = 0x1000_0000_0000_0000 | number as u64;
                    let before = words[word as usize];
                    let status = program(&mut bench, BASE + 8 * word, value as u32, (value >> 32) as u32);
                    if bench.chip.is_powered() && before != Word::Erased {
                        prop_assert_eq!(status, 1 << 3);
                        bench.set(FLASH + 0x10, 1 << 3);
                    } else {
                        words[word as usize] = if bench.chip.is_powered() { Word::Written(value) } else { Word::Torn };
                    }
                }
                Step::Erase(page) => {
                    let number = (BASE - 0x0800_0000) / PAGE + page;
                    prop_assert_eq!(erase(&mut bench, 0, number), 0);
                    let after = if bench.chip.is_powered() { Word::Erased } else { Word::Torn };
                    words[256 * page as usize..][..256].fill(after);
                }
            }
            if !bench.chip.is_powered() {
                break;
            }
        }
        let cut_short = !bench.chip.is_powered();
        if cut_short {
            bench.chip.power_up(bench.now);
        }
        prop_assert_eq!(cut_short, words.contains(&Word::Torn));
        for (number, word) in (0..).zip(words) {
            let (value, wrong) = read(&mut bench, number);
            match word {
                Word::Erased => prop_assert_eq!((value, wrong), (u64::MAX, false)),
                Word::Written(expected) => prop_assert_eq!((value, wrong), (expected, false)),
                // Erased, as it was, or torn in the way that was chosen.
                Word::Torn => prop_assert!(!wrong || matches!(kind, Torn::Error | Torn::Flicker)),
            }
        }
    }

    #[test]
    fn each_kind_of_torn_word_reads_as_it_says(kind in prop::sample::select(&Torn::ALL[..]), seed: u64) {
        let mut bench = Bench::new(&variant::STM32G431CB);
        bench.chip.seed(seed);
        bench.speed_up();
        unlock(&mut bench);
        bench.chip.power_cut_at(1, kind);
        program(&mut bench, BASE, 1, 2);
        prop_assert!(!bench.chip.is_powered());
        bench.chip.power_up(bench.now);
        let reads: Vec<_> = (0..64).map(|_| read(&mut bench, 0)).collect();
        let same = reads.iter().all(|read| *read == reads[0]);
        let complaints = reads.iter().filter(|(_, wrong)| *wrong).count();
        match kind {
            Torn::Error => prop_assert!(same && complaints == 64),
            Torn::Zeros => prop_assert!(same && reads[0] == (0, false)),
            Torn::Ones => prop_assert!(same && reads[0] == (u64::MAX, false)),
            Torn::Junk => prop_assert!(same && complaints == 0),
            Torn::Flicker => prop_assert!(!same && (16..64).contains(&complaints)),
        }
        // Whatever it reads as, it is not erased.
        unlock(&mut bench);
        prop_assert_eq!(program(&mut bench, BASE, 1, 2), 1 << 3);
    }
}

#[test]
fn a_page_whose_erasing_was_cut_short_holds_old_erased_and_torn_words() {
    let mut bench = Bench::fast();
    assert!(bench.chip.program(BASE, &[0x5a; PAGE as usize]));
    unlock(&mut bench);
    bench.chip.power_cut_at(1, Torn::Error);
    erase(&mut bench, 0, (BASE - 0x0800_0000) / PAGE);
    assert!(!bench.chip.is_powered());
    bench.chip.power_up(bench.now);
    let (mut old, mut erased, mut torn) = (0, 0, 0);
    for word in 0..256 {
        match read(&mut bench, word) {
            (_, true) => torn += 1,
            (0x5a5a_5a5a_5a5a_5a5a, _) => old += 1,
            (u64::MAX, _) => erased += 1,
            other => panic!("{other:?}"),
        }
    }
    assert!(old > 40 && erased > 40 && torn > 40, "{old} {erased} {torn}");
    // The next erase makes it whole.
    bench.speed_up();
    unlock(&mut bench);
    assert_eq!(erase(&mut bench, 0, (BASE - 0x0800_0000) / PAGE), 0);
    assert!((0..256).all(|word| read(&mut bench, word) == (u64::MAX, false)));
}

#[test]
fn the_power_goes_in_the_middle_of_the_operation_and_everything_is_refused() {
    let mut bench = Bench::fast();
    unlock(&mut bench);
    bench.chip.power_cut_at(2, Torn::Zeros);
    assert_eq!(program(&mut bench, BASE, 1, 1), 0);
    assert!(bench.chip.is_powered(), "not at the first");
    let begin = bench.now;
    program(&mut bench, BASE + 8, 1, 1);
    assert!(!bench.chip.is_powered());
    let microseconds = (bench.now - begin) / 170;
    assert!((38..44).contains(&microseconds), "half of 82 µs: {microseconds}");
    assert!(bench.signals.reset);
    assert!(bench.unread(BASE).contains("no power"));
    assert!(bench.unread(RCC).contains("no power"));
}
