//! Field-oriented control of one motor: phase currents and a wanted current in, duties out; control step.
//!
//! The currents are sampled at an instant that the rotor's angle is known for. The voltage that they lead to acts in
//! the middle of the period after next, one and a half periods later, when the rotor has moved on. It is therefore
//! turned back into the stationary frame with the angle of that later instant: at 20 kHz and an electrical speed of
//! 3000 rad/s the difference is 13°, and 13° of the voltage would end up on the wrong axis.

use super::angle::{ElectricalAngle, TAU};
use super::current::{CurrentControl, CurrentGains, CurrentSettings, DELAY_PERIODS};
use super::field_weakening::{FieldWeakening, WeakeningGains};
use super::modulation::{Modulated, ModulationSettings, Modulator};
use super::phases::Phases;
use super::setting::SettingError;
use super::transform::{AlphaBeta, Dq};

/// Settings of the current loop and the modulation, checked and prepared. May be swapped between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOrientedGains {
    /// Gains of the current loop.
    pub current: CurrentGains,
    /// Modulation.
    pub modulator: Modulator,
    /// Field weakening; off unless it is set.
    pub weakening: WeakeningGains,
    /// Electrical turns that the rotor moves on in the delay at 1 rad/s.
    advance: f32,
}

impl FieldOrientedGains {
    /// Checks settings and prepares them.
    pub fn new(current: &CurrentSettings, modulation: &ModulationSettings) -> Result<Self, SettingError> {
        Ok(Self {
            current: CurrentGains::new(current)?,
            modulator: Modulator::new(modulation)?,
            weakening: WeakeningGains::default(),
            advance: DELAY_PERIODS / current.rate / TAU,
        })
    }
}

/// Inputs of a step of field-oriented control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOrientedInput {
    /// Phase currents without the sensors' offsets, A.
    pub phase_currents: Phases,
    /// Electrical angle at the instant that the currents were sampled.
    pub angle: ElectricalAngle,
    /// Electrical speed, rad/s.
    pub speed: f32,
    /// Supply, V.
    pub bus_voltage: f32,
    /// Wanted current, A.
    pub reference: Dq,
}

/// Outputs of a step of field-oriented control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOrientedOutput {
    /// Duties for the next PWM period; always within the modulation's limits.
    pub duties: Phases,
    /// Measured current in the rotor's frame, A; not a number where a phase current was none.
    pub current: Dq,
    /// Voltage that the duties apply, V.
    pub voltage: Dq,
    /// `true` if less was applied than the loop asked for.
    pub limited: bool,
}

/// Field-oriented control, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldOriented {
    control: CurrentControl,
    weakening: FieldWeakening,
}

impl FieldOriented {
    /// The current to be made in this control step, A, where `wanted` is the one without [field
    /// weakening](super::field_weakening): the same where that is off. `speed` is the electrical speed, rad/s,
    /// `limit` the current limit, A. [`step`](Self::step) must follow.
    #[inline(always)]
    pub fn reference(
        &mut self,
        gains: &FieldOrientedGains,
        wanted: Dq,
        speed: f32,
        bus_voltage: f32,
        limit: f32,
    ) -> Dq {
        if !gains.weakening.is_on() {
            return wanted;
        }
        let reach = gains.modulator.reach(bus_voltage);
        self.weakening.step(&gains.weakening, wanted, self.control.asked(), reach, speed, limit)
    }

    /// One control step.
    #[inline(always)]
    pub fn step(&mut self, gains: &FieldOrientedGains, input: &FieldOrientedInput) -> FieldOrientedOutput {
        let current = AlphaBeta::from_phases(input.phase_currents).to_rotor(input.angle.sin_cos());
        let asked = self.control.step(&gains.current, input.reference, current, input.speed);
        let permitted = gains.modulator.limit(asked, input.bus_voltage);

        let then = input.angle.advanced(input.speed * gains.advance).sin_cos();
        let Modulated { duties, applied, limited } = gains.modulator.modulate(
            permitted.to_stationary(then),
            input.bus_voltage,
            input.reference.to_stationary(then).to_phases(),
        );
        let voltage = applied.to_rotor(then);
        self.control.settle(&gains.current, voltage);
        FieldOrientedOutput { duties, current, voltage, limited: limited || permitted != asked }
    }

    /// Forgets the past: for the first step after the bridge was off.
    pub fn reset(&mut self) {
        self.control.reset();
        self.weakening.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::angle::EncoderAlignment;
    use crate::motor::current::MotorConstants;
    use crate::motor::virtual_motor::{RATE, VirtualMotor};
    use proptest::prelude::*;

    fn gains(dead_time: f32) -> FieldOrientedGains {
        let motor = MotorConstants { resistance: 0.12, inductance_d: 60e-6, inductance_q: 90e-6, flux_linkage: 0.005 };
        let current = CurrentSettings { motor, bandwidth: 800.0, rate: RATE as f32, highest_voltage: 30.0 };
        let modulation = ModulationSettings {
            voltage_fraction: 1.0,
            minimum_duty: 0.0,
            maximum_duty: 0.96,
            dead_time,
            dead_time_band: 0.1,
            minimum_bus_voltage: 6.0,
        };
        FieldOrientedGains::new(&current, &modulation).unwrap()
    }

    /// Currents of each step, in the true rotor's frame, with the speed held and the rotor's angle and speed known
    /// exactly.
    fn run(gains: &FieldOrientedGains, speed: f64, dead_time: f64, advance: bool, steps: usize) -> Vec<Dq> {
        let mut motor = VirtualMotor { dead_time, held_speed: Some(speed), ..VirtualMotor::default() };
        let mut gains = *gains;
        if !advance {
            gains.advance = 0.0;
        }
        let mut control = FieldOriented::default();
        let alignment: EncoderAlignment = motor.alignment();
        (0..steps)
            .map(|_| {
                let input = FieldOrientedInput {
                    phase_currents: motor.measured_currents(),
                    angle: alignment.electrical(motor.encoder()),
                    speed: (speed * motor.pole_pairs as f64) as f32,
                    bus_voltage: 24.0,
                    reference: Dq { d: 0.0, q: 2.0 },
                };
                let output = control.step(&gains, &input);
                motor.period(Some(output.duties), 24.0);
                motor.current()
            })
            .collect()
    }

    #[test]
    fn the_wanted_current_flows_at_any_speed() {
        for speed in [0.0, 20.0, -150.0, 150.0] {
            let last = *run(&gains(0.0), speed, 0.0, true, 3000).last().unwrap();
            assert!((last.q - 2.0).abs() < 0.02 && last.d.abs() < 0.02, "{speed} rad/s: {last:?}");
        }
    }

    #[test]
    fn the_angle_is_advanced_by_the_delay() {
        // The rotor turns 13° in the delay. Without the advance the back-EMF's voltage is turned by as much, and the
        // axes couple.
        let worst = |advance| {
            let currents = run(&gains(0.0), 3000.0 / 14.0, 0.0, advance, 60);
            currents.iter().map(|i| i.d.abs()).fold(0.0, f32::max)
        };
        let (with, without) = (worst(true), worst(false));
        assert!(with < 0.5 * without, "{with} A with, {without} A without");
    }

    /// RMS of the current's error over several electrical turns at a low speed, A, with a dead time of 1 % of the
    /// period.
    fn ripple(compensation: f32) -> f32 {
        let currents = run(&gains(compensation), 5.0, 0.01, true, 20_000);
        let late = &currents[2_000..];
        let sum: f32 = late.iter().map(|i| (*i - Dq { d: 0.0, q: 2.0 }).norm_squared()).sum();
        (sum / late.len() as f32).sqrt()
    }

    #[test]
    fn dead_time_compensation_takes_away_most_of_the_ripple_at_zero_crossings() {
        let (with, without) = (ripple(0.01), ripple(0.0));
        assert!(with < 0.4 * without, "{with} A with, {without} A without");
    }

    proptest! {
        #[test]
        fn whatever_is_measured_duties_stay_in_their_limits_and_the_loop_recovers(bits: [u32; 7], angle: u32) {
            let gains = gains(0.01);
            let mut control = FieldOriented::default();
            let [a, b, c, speed, bus_voltage, d, q] = bits.map(f32::from_bits);
            let mut input = FieldOrientedInput {
                phase_currents: Phases { a, b, c }, angle: ElectricalAngle(angle), speed, bus_voltage, reference: Dq { d, q },
            };
            for _ in 0..2 {
                let Phases { a, b, c } = control.step(&gains, &input).duties;
                prop_assert!([a, b, c].iter().all(|duty| (0.0..=0.96).contains(duty)), "{a} {b} {c}");
                input.bus_voltage = 24.0;
            }
            // From here on the measurements are a motor's, at rest.
            let mut motor = VirtualMotor { held_speed: Some(0.0), ..VirtualMotor::default() };
            for _ in 0..600 {
                let input = FieldOrientedInput {
                    phase_currents: motor.measured_currents(),
                    angle: motor.alignment().electrical(motor.encoder()),
                    speed: 0.0,
                    bus_voltage: 24.0,
                    reference: Dq { d: 0.0, q: 2.0 },
                };
                motor.period(Some(control.step(&gains, &input).duties), 24.0);
            }
            let Dq { d, q } = motor.current();
            prop_assert!(d.abs() < 0.3 && (q - 2.0).abs() < 0.3, "{d} {q}");
        }
    }
}
