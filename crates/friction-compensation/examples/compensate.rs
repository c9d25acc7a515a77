//! Coulomb and viscous friction of a joint, certified, then compensated 20,000 times a second:
//! `cargo run -p friction-compensation --example compensate`.
//!
//! Parameters come from `jointctl fit` otherwise, as an image: `parameters::image::Image::decode`.

use friction_compensation::compensation::{Compensation, Request, Settings};
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::Selector;
use friction_compensation::friction::state::{JointState, SIGNALS, Signal};
use friction_compensation::friction::{FrictionModel, FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::prove;
use friction_compensation::quantity::{Torque, Velocity};

/// Evaluations a second.
const RATE: u32 = 20_000;

/// A number in Q16.16.
fn q16(value: f64) -> i32 {
    (value * 65_536.0).round() as i32
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Identified between -4 and 4 rad/s; beyond, the compensation fades out within half of that.
    let mut ranges = [Range::ANY; SIGNALS];
    ranges[Signal::Velocity as usize] = Range { low: q16(-4.0), high: q16(4.0) };
    let domain = Domain { ranges, margin: q16(0.5) as u32, reference_temperature: q16(25.0) };
    // Coefficients are stored at full scale of their signal.
    let full_scale = f64::from(2).powi(15 - domain.shifts()[Signal::Velocity as usize] as i32);
    let coefficients = Coefficients {
        coulomb_positive: q16(1.5),
        coulomb_negative: q16(1.2),
        coulomb_slope: q16(full_scale / 0.02),
        viscous: q16(0.8 * full_scale),
        ..Coefficients::default()
    };
    let physical = PhysicalParameters { terms: Terms::COULOMB.union(Terms::VISCOUS), coefficients };
    let mut sets = [ParameterSet::default(); _];
    sets[0] = ParameterSet { physical, network: None };
    let parameters = FrictionParameters { domain, selector: Selector::default(), common: CommonTerms::default(), sets };

    // Bound of this friction in every state, roundings included: it fits the motor, or it is refused.
    let certificate = prove(&parameters).map_err(|refusal| format!("{refusal:?}"))?;
    println!("friction is at most {:.2} Nm", certificate.output_torque().to_f64());

    let model = FrictionModel::new(&parameters, RATE);
    let settings =
        Settings::new(Request::PhysicalAndNetwork, 1 << 16, Torque::from_f64(5.0)?, Torque::from_f64(100.0)?, RATE)?;
    let mut compensation = Compensation::default();
    for velocity in [1.0, -1.0, 3.0, 8.0] {
        let state = JointState { velocity: Velocity::from_f64(velocity)?, ..JointState::default() };
        // In the control step: no allocation, no panic, and never faster than the slew rate.
        let output = (0..RATE / 10).map(|_| compensation.step(Some(&model), &settings, &state)).last();
        let output = output.ok_or("no step")?;
        println!("{velocity:+.1} rad/s: {:+.2} Nm ({:?})", output.torque.to_f64(), output.reason);
    }
    Ok(())
}
