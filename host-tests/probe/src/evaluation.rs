// A joint's state evaluated in full, the same on the board's core and on the host: included by the program `states` and
// by the test that sends it images and states.

use friction_compensation::compensation::{Acting, Compensation, Reason, Request, Settings, SettingsError};
use friction_compensation::friction::state::{JointState, SIGNALS};
use friction_compensation::friction::{FrictionModel, FrictionParameters};
use friction_compensation::quantity::{Torque, Velocity};

/// Control rate, Hz.
pub const RATE: u32 = 20_000;
/// States that are exchanged at once.
pub const BATCH: usize = 256;
/// Words of a state: its signals, the velocity of the coupled joint, and the set that is evaluated by itself.
pub const INPUTS: usize = SIGNALS + 2;
/// Words of an evaluation; see [`NAMES`].
pub const OUTPUTS: usize = 11;
/// Words of settings: request, gain, clamp, slew limit, and whether there is a model.
pub const SETTINGS: usize = 5;

/// Names of the words of an evaluation.
#[allow(dead_code, reason = "the program prints nothing")]
pub const NAMES: [&str; OUTPUTS] = [
    "regime",
    "physical torque",
    "network torque",
    "weight of the physical model",
    "weight of the network",
    "signal outside",
    "compensation torque",
    "torque in shadow",
    "acting",
    "reason",
    "limited",
];

/// No signal.
const NONE: i32 = -1;

/// The settings of these words.
pub fn settings(words: &[i32; SETTINGS]) -> Result<Settings, SettingsError> {
    let [request, gain, clamp, slew, _] = *words;
    let request = match request {
        0 => Request::Off,
        1 => Request::Physical,
        2 => Request::PhysicalAndNetwork,
        _ => Request::NetworkInShadow,
    };
    Settings::new(request, gain as u32, Torque::from_bits(clamp), Torque::from_bits(slew), RATE)
}

/// One joint, from one state to the next.
#[derive(Default)]
pub struct Evaluator {
    compensation: Compensation,
    regime: usize,
}

impl Evaluator {
    /// Everything known of friction in this state.
    pub fn step(
        &mut self,
        parameters: &FrictionParameters,
        model: &FrictionModel,
        settings: &Settings,
        has_model: bool,
        words: &[i32; INPUTS],
    ) -> [i32; OUTPUTS] {
        let [signals @ .., coupled, set] = *words;
        let state = JointState { coupled_velocity: Velocity::from_bits(coupled), ..JointState::from_signals(signals) };
        self.regime = parameters.selector.select(&state, self.regime);
        let estimate = model.evaluate(set as usize, &state);
        let weights = model.fade().weights(&signals);
        let output = self.compensation.step(has_model.then_some(model), settings, &state);
        [
            self.regime as i32,
            estimate.physical.to_bits(),
            estimate.network.to_bits(),
            weights.physical,
            weights.network,
            weights.outside.map_or(NONE, |signal| signal as i32),
            output.torque.to_bits(),
            output.shadow.to_bits(),
            acting(output.acting),
            reason(output.reason),
            i32::from(output.limited),
        ]
    }
}

/// Number of the model that acted.
pub fn acting(acting: Acting) -> i32 {
    acting as i32
}

/// Number of the reason.
pub fn reason(reason: Reason) -> i32 {
    match reason {
        Reason::Off => 0,
        Reason::NoModel => 1,
        Reason::AsRequested => 2,
        Reason::NoNetwork => 3,
        Reason::OutsideTrainedBox(signal) => 10 + signal as i32,
        Reason::FarOutsideTrainedBox(signal) => 20 + signal as i32,
    }
}
