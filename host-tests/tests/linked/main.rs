//! Promises of the boards' linked programs that show without running as a whole: a file a promise.
//!
//! Needs the target; where it is missing the tests are reported as ignored, by name; with `CI` set they run and fail.

mod control_interrupt;
mod division;
mod sizes;
mod stack;
mod thumb;

use host_tests::bare_metal::target_installed;
use libtest_mimic::Arguments;

fn main() {
    let arguments = Arguments::from_args();
    let ignored = std::env::var_os("CI").is_none() && !target_installed();
    let rooms = [control_interrupt::trials(), stack::trials(), division::trials(), sizes::trials()];
    let trials = rooms.into_iter().flatten().map(|trial| trial.with_ignored_flag(ignored)).collect();
    libtest_mimic::run(&arguments, trials).exit();
}
