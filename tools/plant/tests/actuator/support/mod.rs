//! A vector current controller that knows the truth: the tests' way to a current, not a drive's.

use plant::actuator::frame::Frame;
use plant::actuator::windings::PhaseOrder;
use plant::actuator::{Actuator, ActuatorParameters};

pub const PERIOD: f64 = 5e-5;

/// Holds a current along d and q.
pub struct CurrentController {
    integral: [f64; 2],
    resistance: f64,
    inductance: [f64; 2],
    flux: f64,
    pole_pairs: f64,
    delay: f64,
}

impl CurrentController {
    pub fn new(parameters: &ActuatorParameters) -> Self {
        let windings = &parameters.windings;
        Self {
            integral: [0.0; 2],
            resistance: windings.phase_resistance(&parameters.joint.motor, 25.0) + parameters.inverter.on_resistance,
            inductance: [windings.inductance_d, windings.inductance_q],
            flux: windings.flux_linkage(&parameters.joint.motor),
            pole_pairs: windings.pole_pairs as f64,
            delay: parameters.inverter.duty_delay as f64,
        }
    }

    /// Duties for currents of `wanted` A along d and q.
    pub fn duties(&mut self, actuator: &Actuator, wanted: [f64; 2]) -> [f64; 3] {
        let state = actuator.state();
        let velocity = self.pole_pairs * state.rotor_velocity;
        let [d, q] = state.dq_current;
        let bandwidth = 0.1 / PERIOD;
        let mut voltage = [-velocity * self.inductance[1] * q, velocity * (self.inductance[0] * d + self.flux)];
        for (k, (wanted, is)) in wanted.into_iter().zip([d, q]).enumerate() {
            self.integral[k] += bandwidth * self.resistance * (wanted - is) * PERIOD;
            voltage[k] += bandwidth * self.inductance[k] * (wanted - is) + self.integral[k];
        }
        let angle = state.electrical_angle + velocity * PERIOD * (self.delay + 0.5);
        let [a, b, c] = Frame::at(angle).phases(voltage);
        let voltages = match actuator.parameters().windings.phase_order {
            PhaseOrder::Forward => [a, b, c],
            PhaseOrder::Exchanged => [a, c, b],
        };
        duties(voltages, state.bus_voltage)
    }
}

/// Duties for phase `voltages` about the middle of the rails.
pub fn duties(voltages: [f64; 3], bus_voltage: f64) -> [f64; 3] {
    voltages.map(|voltage| 0.5 + voltage / bus_voltage)
}

/// Drives `actuator` with currents of `wanted` A for `duration` s.
pub fn hold_current(actuator: &mut Actuator, wanted: [f64; 2], duration: f64) {
    let mut controller = CurrentController::new(actuator.parameters());
    for _ in 0..(duration / PERIOD).round() as usize {
        let duties = controller.duties(actuator, wanted);
        actuator.advance(true, duties, 0.0, PERIOD);
    }
}

/// Lets `actuator` be for `duration` s with the bridge off.
pub fn coast(actuator: &mut Actuator, external_torque: f64, duration: f64) {
    for _ in 0..(duration / PERIOD).round() as usize {
        actuator.advance(false, [0.5; 3], external_torque, PERIOD);
    }
}

pub fn actuator(parameters: ActuatorParameters) -> Actuator {
    Actuator::new(parameters, 25.0, 1).unwrap()
}
