//! Rounds of motion in real time, on a machine that may have much else to do.
//!
//! A machine that is late with set-points disturbs the motion by which an image is learned and judged. Whether it was
//! late is measured: a round that failed on a machine in time is a failure at once, one on a machine that was late is
//! void, and is repeated.

use std::process::Output;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Lateness from which a round is void: a set-point at 200 Hz.
const LATE: Duration = Duration::from_millis(5);
/// Time between two looks at the clock.
const LOOK: Duration = Duration::from_millis(2);
/// Rounds at most.
const ROUNDS: usize = 12;

/// Largest lateness of a thread that wants to wake up every [`LOOK`].
struct Watch {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Duration>,
}

impl Watch {
    fn begin() -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let mut worst = Duration::ZERO;
            while !stopped.load(Ordering::Relaxed) {
                let began = Instant::now();
                std::thread::sleep(LOOK);
                worst = worst.max(began.elapsed().saturating_sub(LOOK));
            }
            worst
        });
        Self { stop, thread }
    }

    fn end(self) -> Duration {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// Runs a round, again where it failed on a machine that was late. It is given its number, from 0.
pub fn round<T>(run: impl FnMut(usize) -> T, has_failed: impl Fn(&T) -> bool) -> T {
    repeated(run, has_failed, |run| {
        let watch = Watch::begin();
        let result = run();
        (result, watch.end())
    })
}

/// Runs a round of a command, which keeps what a joint has with exit code 3, or learned from such a motion what a joint
/// refuses. It is given what a repeated one ends with.
pub fn command(run: impl Fn(&str) -> Output) -> Output {
    let refused = |output: &Output| String::from_utf8_lossy(&output.stderr).contains("does not accept the image");
    let kept = |output: &Output| output.status.code() == Some(3) || refused(output);
    round(|number| run(if number > 0 { " --force" } else { "" }), kept)
}

fn repeated<T>(
    mut run: impl FnMut(usize) -> T,
    has_failed: impl Fn(&T) -> bool,
    timed: impl Fn(&mut dyn FnMut() -> T) -> (T, Duration),
) -> T {
    let mut number = 0;
    loop {
        let (result, lateness) = timed(&mut || run(number));
        number += 1;
        if !has_failed(&result) || lateness < LATE || number == ROUNDS {
            return result;
        }
    }
}

/// Numbers of the rounds that were run until one that does not fail, on a machine with this lateness in each.
fn rounds(lateness: Duration, passes: usize) -> usize {
    repeated(|number| number, |number| *number != passes, |run| (run(), lateness))
}

pub fn a_round_that_failed_is_repeated_only_where_the_machine_was_late() {
    let just = Duration::from_micros(1);
    assert_eq!(rounds(LATE, 3), 3);
    assert_eq!(rounds(LATE - just, 3), 0);
    assert_eq!(rounds(LATE, usize::MAX), ROUNDS - 1);
    assert_eq!(rounds(Duration::ZERO, 0), 0);
}
