//! A trial on each emulated board.

/// Trials of one promise, named `<board>_<promise>`, on each emulated board. `$test` is generic over the board: it
/// takes the function that makes it from the drivetrain behind it, and the board's constants from
/// [`Observed`](crate::emulated::observed::Observed).
#[macro_export]
macro_rules! on_each_board {
    ($promise:literal, $test:path) => {
        [
            libtest_mimic::Trial::test(concat!("b_g431b_esc1_", $promise), || $test(emulator::board::BG431BEsc1::new)),
            libtest_mimic::Trial::test(concat!("moteus_r4_", $promise), || $test(emulator::board::MoteusR4::new)),
        ]
    };
}
