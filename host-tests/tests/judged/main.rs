//! Joints that are less like the firmware's model than its own: gears that give way, friction with other laws, data
//! sheets in place of the truth. Each is recorded and fitted as its user would, then moved without and with its image.
//!
//! The figures are published in docs/judging-joints.md, which this program writes with `UPDATE_DOCS=1`; otherwise it
//! compares its own with them. The test command judges two joints; `JOINT_SAMPLES=all` judges all.

mod page;

use host_tests::in_the_loop::{RandomJoint, for_seeds};
use host_tests::samples::every;
use host_tests::variant::{ADAPTIVE, DEFAULT};
use page::{Gear, Row};

/// Seeds of the joints that are judged; no figure of the firmware's or of identification was chosen by them.
const SEEDS: std::ops::Range<u64> = 701..721;
/// Those of the test command.
const PART: std::ops::Range<u64> = 717..719;

fn judge(seed: u64) -> Result<Row, String> {
    let joint = RandomJoint::judging(seed)?;
    let [off, on, adaptive] = [joint.without()?, joint.with(&DEFAULT)?, joint.with(&ADAPTIVE)?];
    let led = joint.in_torque_mode(&DEFAULT)?;
    Ok(Row {
        seed,
        gear: Gear::of(&joint.parameters.joint),
        moves: [off.moves.torque, on.moves.torque, adaptive.moves.torque],
        reversals: [off.reversals.torque, on.reversals.torque, adaptive.reversals.torque],
        tracking: [off.reversals.tracking, on.reversals.tracking].map(|error| 1e3 * error),
        torque_mode: [led.guided, led.moved],
        cold: joint.begun_at(&DEFAULT, 0.0)?,
        hot: joint.begun_at(&DEFAULT, 60.0)?,
        restarted: joint.restarted_warm(&DEFAULT)?,
    })
}

#[test]
fn compensation_is_as_published_on_joints_that_are_not_the_models() {
    let updates = std::env::var_os("UPDATE_DOCS").is_some();
    let seeds = if every() || updates { SEEDS } else { PART };
    let judged: Result<Vec<Row>, String> = for_seeds(seeds, judge).into_iter().collect();
    let rows = judged.unwrap();
    println!("{}", page::document(&rows));
    if updates {
        std::fs::write(page::PATH, page::document(&rows)).unwrap();
    }
    let published = page::read(&std::fs::read_to_string(page::PATH).unwrap()).unwrap();
    let differences: Vec<String> = rows.iter().flat_map(|row| row.differences(&published)).collect();
    assert!(differences.is_empty(), "{}", differences.join("\n"));
    let harmed: Vec<String> = rows.iter().flat_map(Row::harmed).collect();
    assert!(harmed.is_empty(), "{}", harmed.join("\n"));
}

#[test]
fn the_page_has_every_joint_once_and_says_what_its_figures_say() {
    let text = std::fs::read_to_string(page::PATH).unwrap();
    let rows = page::read(&text).unwrap();
    assert_eq!(rows.iter().map(|row| row.seed).collect::<Vec<_>>(), SEEDS.collect::<Vec<_>>());
    assert!(
        page::document(&rows) == text,
        "the page says something else than its figures; UPDATE_DOCS=1 writes it anew"
    );
    assert!(rows.iter().all(|row| row.differences(&rows).is_empty()));
    // A figure that is off by more than its margin is found, and one that is not passes.
    let mut off = rows[0].clone();
    off.moves[1] *= 1.0 + 0.9 * page::MARGIN;
    assert!(off.differences(&rows).is_empty());
    off.moves[1] = rows[0].moves[1] * (1.0 + 1.1 * page::MARGIN) + page::LEAST;
    assert_eq!(off.differences(&rows).len(), 1);
    off.cold[1] = 1.2 * off.cold[0] + 1.0;
    assert_eq!(off.harmed().count(), 1);
}
