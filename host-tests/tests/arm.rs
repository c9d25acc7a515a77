//! An arm of three virtual joints, identified from a recording of all of them, moves by computed torque with low gains:
//! with the friction images it follows several times as closely.

use friction_compensation::compensation::Request;
use host_tests::virtual_arm::{Loop, identified};

/// Least factor by which the position error falls, RMS over the joints, where joints close the loop, and where the
/// master does in torque mode: docs/robot.md's, less a tenth.
const GAINS: [(Loop, f64); 2] = [(Loop::Joints, 16.3), (Loop::Master, 1.7)];

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
