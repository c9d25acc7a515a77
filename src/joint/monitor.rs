//! Watches measurements and loop for faults; control step.
//!
//! Every check answers in the step in which its signal shows the fault; that of the current loop at the end of a round
//! of the motion loop. Three signals cannot be told from noise or from an ordinary transient in one step; for them the
//! number of steps is a constant here. What each check takes until the bridge is off stands in docs/faults.md,
//! measured.
//!
//! The current loop is watched by the motor's own equations (see [`crate::motor::current`]), on its means over a round
//! of the motion loop: of the voltage that the bridge applied, resistance, inductance and induced voltage explain all
//! but the errors of the constants. What is left shows an encoder that no longer tells where the rotor is, because the
//! voltage that the rotor really induces is missing in the equations, and a phase without current, because the loop
//! raises the voltage and nothing follows. In the second case the current misses its reference.

use super::JointMotion;
use super::active::{Active, VOLTAGE_FILTER};
use super::configuration::MOTION_STEPS;
use super::fault::{Fault, Faults};
use super::signals::Measurements;
use crate::motor::field_oriented::FieldOrientedOutput;
use crate::motor::number::{exceeds, greater, magnitude, or_zero};
use crate::motor::observer::Observation;
use crate::motor::phases::Phases;
use crate::motor::transform::Dq;

/// Steps without an encoder sample that the observer bridges.
pub const ENCODER_STEPS: u32 = 5;
/// Steps for which the phase currents must fail to add up to zero: a fast current is not sampled in all phases at once.
pub const CURRENT_SUM_STEPS: u32 = 3;
/// Steps for which the voltage must be unexplained: longer than the current loop takes for a step of its reference.
pub const UNEXPLAINED_STEPS: u32 = 30;
/// The same in rounds of the motion loop, in each of which it is looked at once.
const UNEXPLAINED_ROUNDS: u32 = UNEXPLAINED_STEPS / MOTION_STEPS;
/// Error of the resistance that counts as explained: copper 100 K above the temperature that the constants hold for has
/// 39 % more.
const RESISTANCE_ERROR: f32 = 0.5;
/// Error of what the rotor's turning induces that counts as explained: a saturated or hot magnet, and an electrical
/// angle that is a few degrees off, which turns it from one axis to the other.
const INDUCED_ERROR: f32 = 0.3;
/// The current misses its reference by this part of the current limit and ...
const MISSED_LIMIT: f32 = 0.02;
/// ... this part of the reference.
const MISSED_REFERENCE: f32 = 0.25;
/// Temperatures outside these are an open or shorted sensor, °C.
const SENSOR_RANGE: (f32, f32) = (-40.0, 180.0);

/// Counts bad steps twice and good ones once against them, so that what is bad every other step is found too. A fault
/// stays until as many good steps have come as the bad ones count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Bucket {
    level: u32,
    full: bool,
}

impl Bucket {
    /// Counts one more step; returns `true` if it is full then: after `steps` bad ones in a row.
    #[inline(always)]
    fn step(&mut self, bad: bool, steps: u32) -> bool {
        let full = steps.saturating_mul(2);
        if bad {
            self.level = self.level.saturating_add(2);
            if self.level >= full {
                self.level = full;
                self.full = true;
            }
        } else {
            self.level = self.level.saturating_sub(1);
            self.full = self.full && self.level > 0;
        }
        self.full
    }
}

/// Memory of the checks that take several steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Monitor {
    current_sum: Bucket,
    encoder: Bucket,
    /// Steps since the encoder answered.
    silent: u32,
    /// `true` once the rotor's number of turns is not known any more.
    adrift: bool,
    voltage: Voltage,
}

/// Sums over control steps of the current loop's values since it was checked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    /// Control steps.
    steps: f32,
    /// Reference, A.
    reference: Dq,
    /// A.
    current: Dq,
    /// V.
    voltage: Dq,
    /// Way of the encoder, 2^32 a turn.
    way: f32,
}

/// Filtered signals of the current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Voltage {
    /// Sums since the last check.
    sums: Sums,
    /// The last step's current, A.
    last: Dq,
    /// Voltage less what resistance and the rotor's turning explain, V.
    unexplained: Dq,
    /// The same across the magnet's flux in the last round alone, V.
    last_unexplained: f32,
    /// Voltage that the rotor's turning explains, V.
    induced: Dq,
    /// Current of the rounds' last steps, A.
    current: Dq,
    /// Reference less current, A.
    error: Dq,
    /// Too much is unexplained.
    rounds: Bucket,
    /// Number of these rounds in which the current missed its reference, less the others.
    missed: i32,
    /// Faults that the last check found.
    found: Faults,
}

/// Returns `true` if a value lies within bounds. What is not a number does not.
#[inline(always)]
fn within(value: f32, low: f32, high: f32) -> bool {
    value >= low && value <= high
}

/// One round of a first-order filter. Once not a number it finds nothing until the bridge goes off, which a current
/// that is no number causes by its limit in the same step.
#[inline(always)]
fn filter(state: &mut Dq, value: Dq) {
    let step = |state: f32, value: f32| state + VOLTAGE_FILTER * (value - state);
    *state = Dq { d: step(state.d, value.d), q: step(state.q, value.q) };
}

impl Monitor {
    /// Returns `true` if the encoder is lost: it did not answer in several steps. Also at the start, when nothing else
    /// is watched.
    ///
    /// After more than `bridged` silent steps in a row it stays lost, whatever it says: nobody knows how many turns it
    /// made meanwhile.
    #[inline(always)]
    pub fn encoder_is_lost(&mut self, valid: bool, bridged: u32) -> bool {
        let lost = self.encoder.step(!valid, ENCODER_STEPS + 1);
        if !valid {
            self.silent = self.silent.saturating_add(1);
            self.adrift |= self.silent > bridged;
        } else {
            self.silent = 0;
        }
        lost | self.adrift
    }

    /// Faults of the measurements themselves, whether or not the bridge switches. `currents` are without offsets.
    #[inline(always)]
    pub fn measurements(
        &mut self,
        active: &Active,
        measured: &Measurements,
        currents: Phases,
        observation: &Observation,
    ) -> Faults {
        let limits = &active.limits;
        let mut faults = Faults::NONE;
        let Phases { a, b, c } = currents;
        let over = |current: f32| exceeds(current, limits.over_current);
        faults.set(Fault::OverCurrent, over(a) | over(b) | over(c));
        let unbalanced = exceeds(a + b + c, active.current_sum_limit);
        faults.set(Fault::CurrentSensor, self.current_sum.step(unbalanced, CURRENT_SUM_STEPS));

        let (lowest, highest) = limits.bus_voltage;
        // Comparison as integers, see `motor::number`: negative numbers and what is none come after all others.
        let supply = measured.bus_voltage.to_bits();
        faults.set(Fault::OverVoltage, supply > highest.to_bits());
        faults.set(Fault::UnderVoltage, !(lowest.to_bits()..=f32::INFINITY.to_bits()).contains(&supply));

        let lost = self.encoder.full | self.adrift;
        faults.set(Fault::EncoderLost, lost);
        faults.set(Fault::EncoderJump, !lost && exceeds(observation.innovation, active.jump_limit));

        let implausible = |sensor: bool, value: f32| sensor && !within(value, SENSOR_RANGE.0, SENSOR_RANGE.1);
        let bridge = implausible(active.has_bridge_sensor, measured.bridge_temperature);
        let winding = implausible(active.has_winding_sensor, measured.winding_temperature);
        faults.set(Fault::TemperatureSensor, bridge || winding);
        faults.set(Fault::BridgeTemperature, measured.bridge_temperature >= limits.bridge_temperature);
        faults.set(Fault::BridgeDriver, measured.bridge_fault);
        faults.set(Fault::Overrun, measured.overrun);
        faults
    }

    /// Faults that only a joint in motion, or meant to be, can have. `winding` is the part of the current that the
    /// winding's temperature permits.
    #[inline(always)]
    pub fn motion(&mut self, active: &Active, motion: &JointMotion, stale_steps: u32, winding: f32) -> Faults {
        let mut faults = Faults::NONE;
        faults.set(Fault::OverSpeed, exceeds(motion.velocity, active.over_speed));
        let (low, high) = active.fault_position;
        faults.set(Fault::PositionLimit, !within(motion.position, low, high));
        faults.set(Fault::WindingTemperature, winding <= 0.0);
        faults.set(Fault::StaleCommand, stale_steps > active.deadline_steps);
        faults
    }

    /// Takes the current loop's values of a step in which the bridge switched. `reference` is the wanted current, A;
    /// `way` the encoder's since the step before, 2^32 a turn: the observer's speed takes some milliseconds to see a
    /// rotor stopped by an obstacle, and what its estimate then induces would look like a fault.
    #[inline(always)]
    pub fn current_loop(&mut self, reference: Dq, output: &FieldOrientedOutput, way: f32) {
        let Voltage { sums, last, .. } = &mut self.voltage;
        sums.steps += 1.0;
        sums.reference = sums.reference + reference;
        sums.current = sums.current + output.current;
        sums.voltage = sums.voltage + output.voltage;
        sums.way += way;
        *last = output.current;
    }

    /// Faults that the current loop showed at its last check.
    #[inline(always)]
    pub fn found(&self) -> Faults {
        self.voltage.found
    }

    /// Checks the current loop by what it did since the last time: once a round of the motion loop. A bridge that has
    /// not switched shows nothing.
    #[inline(never)]
    pub fn check_current_loop(&mut self, active: &Active) {
        let memory = &mut self.voltage;
        let Sums { steps, reference, current, voltage, way } = core::mem::take(&mut memory.sums);
        if steps == 0.0 {
            return;
        }
        let share = 1.0 / steps;
        let (current, voltage) = (current * share, voltage * share);
        let reference = reference * share;
        let speed = active.alignment.electrical_speed(way * share * active.encoder_speed);
        let (resistance, inductance) = (active.resistance, active.inductance);
        let induced = Dq { d: -inductance.q * current.q, q: inductance.d * current.d + active.flux_linkage } * speed;

        let unexplained = voltage - current * resistance - induced;
        // The speed of two samples errs by up to two counts a round, and in the next round the other way: with a coarse
        // encoder that is more voltage than all that counts as explained. A stuck encoder's voltage keeps its
        // sign.
        let keeps_sign = (unexplained.q.to_bits() ^ memory.last_unexplained.to_bits()) as i32 >= 0;
        memory.last_unexplained = unexplained.q;
        filter(&mut memory.unexplained, unexplained);
        filter(&mut memory.induced, induced);
        filter(&mut memory.error, reference - current);

        // The filtered slope of the current is that of the filtered current.
        let before = memory.current;
        filter(&mut memory.current, Dq { d: or_zero(memory.last.d), q: or_zero(memory.last.q) });
        let change = memory.current - before;
        let left = Dq {
            d: memory.unexplained.d - inductance.d * active.motion.rate * change.d,
            q: memory.unexplained.q - inductance.q * active.motion.rate * change.q,
        };
        // A wrong resistance shows along the current only: across it the bound is close.
        let turning = INDUCED_ERROR * (magnitude(memory.induced.d) + magnitude(memory.induced.q));
        // Nor is what of the dead time is not compensated, with little current.
        let uncompensated = active.uncompensated_voltage - active.compensated_slope * magnitude(memory.current.q);
        let rest = turning + greater(uncompensated, 0.0);
        let explained = |current: f32| rest + RESISTANCE_ERROR * resistance * magnitude(current);
        let contradicts = exceeds(left.d, active.implausible_voltage.d + explained(memory.current.d))
            || keeps_sign && exceeds(left.q, active.implausible_voltage.q + explained(memory.current.q));
        let found = memory.rounds.step(contradicts, UNEXPLAINED_ROUNDS);

        let permitted =
            MISSED_LIMIT * active.current_limit + MISSED_REFERENCE * (magnitude(reference.d) + magnitude(reference.q));
        let missed = memory.error.norm_squared() > permitted * permitted;
        memory.missed = match (contradicts, missed) {
            (true, true) => memory.missed.saturating_add(1),
            (true, false) => memory.missed.saturating_sub(1),
            (false, _) if memory.rounds.level == 0 => 0,
            (false, _) => memory.missed,
        };
        memory.found = Faults::NONE;
        memory.found.set(Fault::CurrentNotFollowed, found && memory.missed > 0);
        memory.found.set(Fault::EncoderImplausible, found && memory.missed <= 0);
    }

    /// The bridge is off: the current loop's checks start anew.
    pub fn loop_is_off(&mut self) {
        self.voltage = Voltage::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bucket_fills_in_a_row_or_every_other_step_and_empties_in_twice_the_time() {
        let mut row = Bucket::default();
        assert_eq!([true; 4].map(|bad| row.step(bad, 3)), [false, false, true, true]);
        let good: Vec<bool> = (0..8).map(|_| row.step(false, 3)).collect();
        assert_eq!(good, [true, true, true, true, true, false, false, false]);

        let mut flickering = Bucket::default();
        let found = (1..100).find(|n| flickering.step(n % 2 == 1, 3));
        assert_eq!(found, Some(9));
        let mut rare = Bucket::default();
        assert!((1..1000).all(|n| !rare.step(n % 3 == 0, 3)), "one in three is not enough");
    }

    #[test]
    fn a_bridge_that_has_not_switched_shows_no_fault_and_one_that_switches_again_is_checked_as_before() {
        let board = crate::default_configuration::B_G431B_ESC1;
        let active = board.joint.prepare(&board.bridge).unwrap();
        let (duties, voltage) = (Phases::uniform(0.5), Dq { d: 0.0, q: 10.0 });
        let output = FieldOrientedOutput { duties, current: Dq::ZERO, voltage, limited: false };
        let found_after = |idle: u32| {
            let mut monitor = Monitor::default();
            for _ in 0..idle {
                monitor.check_current_loop(&active);
                assert!(monitor.found().is_empty());
            }
            // A voltage without a current: a phase is open.
            (1..1000).find(|_| {
                monitor.current_loop(Dq::ZERO, &output, 0.0);
                monitor.check_current_loop(&active);
                !monitor.found().is_empty()
            })
        };
        assert!(found_after(0).is_some());
        assert_eq!(found_after(1000), found_after(0));
    }

    #[test]
    fn a_lost_encoder_shows_at_the_step_after_those_that_are_bridged() {
        let mut monitor = Monitor::default();
        let lost = (1..100).find(|_| monitor.encoder_is_lost(false, 1000));
        assert_eq!(lost, Some(ENCODER_STEPS + 1));
    }
}
