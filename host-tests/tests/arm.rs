//! An arm of three virtual joints, identified from a recording of all of them, moves by computed torque with low gains:
//! with the friction images it follows several times as closely.

use friction_compensation::compensation::Request;
use host_tests::virtual_arm::{Loop, identified, identified_from, recorded};
use plant::Pair;

/// Least factor by which the position error falls, RMS over the joints, where joints close the loop, and where the
/// master does in torque mode: docs/robot.md's, less a tenth.
const GAINS: [(Loop, f64); 2] = [(Loop::Joints, 20.4), (Loop::Master, 1.9)];

/// The same of an arm with a pair, where joints close the loop: docs/coupled-joints.md's, less a tenth.
const PAIR_GAIN: f64 = 14.4;

#[test]
fn computed_torque_at_low_gains_follows_several_times_as_closely_with_the_friction_images() {
    let identified = identified().unwrap();
    let [simplest, bodies, images] = identified.percent;
    println!("error on another motion: simplest {simplest:.2} %, bodies {bodies:.2} %, images {images:.2} %");
    assert!(images < 0.5 * simplest, "{images} % with images, {simplest} % with the simplest model");
    let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let mrad = |errors: &[f64]| errors.iter().map(|error| 1e3 * error).collect::<Vec<f64>>();
    let gains = GAINS.map(|(by, least)| {
        let [without, with] =
            [Request::Off, Request::PhysicalAndNetwork].map(|request| identified.tracked(request, by).unwrap());
        let gain = rms(&without) / rms(&with);
        println!("{by:?}: {:.1?} -> {:.1?} mrad RMS, {gain:.1} times", mrad(&without), mrad(&with));
        (gain, least)
    });
    assert!(gains.iter().all(|(gain, least)| gain >= least), "{gains:?}");
}

#[test]
fn joints_that_share_a_drive_have_a_set_for_each_leader_and_follow_several_times_as_closely() {
    let pairs = [Pair::new([1, 2], 0.04, 0.5)];
    let arm = identified_from(&recorded(&pairs).unwrap(), &pairs, true).unwrap();
    println!("reliefs {:?}, true 0.5", arm.reliefs);
    let sets: Vec<usize> = arm.images.iter().map(|image| image.friction.selector.sets()).collect();
    assert_eq!((arm.reliefs[0], sets), (None, vec![1, 2, 2]));
    let rms = |request: Request| {
        let errors = arm.tracked(request, Loop::Joints).unwrap();
        (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
    };
    let [without, with] = [Request::Off, Request::PhysicalAndNetwork].map(rms);
    println!("{:.1} -> {:.1} mrad RMS, {:.1} times", 1e3 * without, 1e3 * with, without / with);
    assert!(with < without / PAIR_GAIN, "{without} rad without images, {with} rad with them");
}
