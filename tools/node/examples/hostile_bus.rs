//! Random, mutated and well-formed frames through server and object table, judged after each; overflow checks on in the
//! dev profile.
//!
//! `cargo run -p node --example hostile_bus [-- FRAMES [SEED]]`; a million frames by default, half of them against a
//! joint with a key. [`node::hostile`] says what is judged. A violation or panic ends with the seed and the number of
//! the frame.

use friction_compensation::parameters::authentication::Key;
use node::hostile::{Counts, HostileNode, Noise, Statics};
use std::hint::black_box;
use std::process::ExitCode;
use std::time::Instant;

/// Frames that one node lives through.
const LIFE: u64 = 1_000_000;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<u64>());
    let (Ok(frames), Ok(seed)) = (arguments.next().unwrap_or(Ok(LIFE)), arguments.next().unwrap_or(Ok(1))) else {
        eprintln!("usage: hostile_bus [FRAMES [SEED]]");
        return ExitCode::from(2);
    };
    let key = Key::new(std::array::from_fn(|i| i as u8)).expect("its bytes differ");
    let (mut total, mut done, mut lives) = (Counts::default(), 0, 0);
    let began = Instant::now();
    while done < frames {
        let seed = seed + lives;
        let (mut noise, mut statics) = (Noise::new(seed, &key), Statics::new());
        let present = lives % 2 == 0;
        let mut node = HostileNode::new(&mut statics, present.then_some(&key)).expect("erased flash can be written");
        let mut lived = 0;
        // Without a node id only LSS is left.
        while lived < LIFE && done < frames && node.id() != canopen_node::NO_NODE_ID {
            if let Err(violation) = noise.attack(&mut node) {
                eprintln!(
                    "seed {seed}, frame {lived}, {}: {violation}",
                    if present { "with key" } else { "without key" }
                );
                return ExitCode::FAILURE;
            }
            (lived, done) = (lived + 1, done + 1);
        }
        total.add(node.counts());
        lives += 1;
    }
    println!("frames {done}, nodes {lives} (seeds {seed} to {}), violations 0", seed + lives - 1);
    println!("overflow checks {}", if overflow_is_checked() { "on" } else { "off" });
    println!(
        "in OPERATIONAL {}, sent {}, SDO aborts {}, trials and shadows {}, images stored {}, roll backs {}, wrong tags {}, configurations {}",
        total.operational,
        total.sent,
        total.aborts,
        total.run,
        total.stored,
        total.rolled_back,
        total.forged,
        total.configured
    );
    eprintln!("{:.0} s", began.elapsed().as_secs_f64());
    ExitCode::SUCCESS
}

/// Returns `true` if an overflow is a panic in this build.
fn overflow_is_checked() -> bool {
    std::panic::set_hook(Box::new(|_| {}));
    let checked = std::panic::catch_unwind(|| black_box(u8::MAX) + black_box(1)).is_err();
    drop(std::panic::take_hook());
    checked
}
