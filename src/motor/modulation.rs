//! Space-vector modulation: from a voltage vector to three duties, and what they really apply; control step.
//!
//! Half the sum of the largest and the smallest phase voltage is taken from all phases. This centres them between the
//! rails, which is what space-vector modulation does with its zero vectors (Holmes and Lipo, Pulse Width Modulation for
//! Power Converters, section 6.2), and a vector of any angle fits up to V_bus / sqrt 3. Beyond that the duties reach
//! their limits one after the other; the corners of the hexagon lie at 2/3 V_bus. A vector that leaves it is shortened
//! until the span of its phase voltages, largest less smallest, fits: its angle is kept, and a torque stays smoother
//! than with duties that are cut off one by one.
//!
//! While a leg's two transistors are both off, its current chooses the rail. A current out of the leg costs the dead
//! time's part of the period times V_bus, a current into it gains as much. Compensation adds that back by the sign of
//! the current; within a band around zero in proportion, because there the sign is noise.

use super::number::{greater, lesser, limited, square_root};
use super::phases::Phases;
use super::setting::{SettingError, in_range};
use super::transform::{AlphaBeta, Dq, FRAC_1_SQRT_3};

/// 2 / sqrt 3: from the circle in the hexagon to its corners.
pub const HIGHEST_VOLTAGE_FRACTION: f32 = 1.154_700_5;

/// Settings of the bridge's modulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModulationSettings {
    /// Longest voltage vector as a fraction of the longest one that fits at any angle: 0.1 to 2 / sqrt 3; up to 1 no
    /// duty ever reaches its limit.
    pub voltage_fraction: f32,
    /// Least duty of the high side; 0 to 0.4.
    pub minimum_duty: f32,
    /// Greatest duty of the high side; 0.6 to 1. Low-side shunts are sampled in what is left.
    pub maximum_duty: f32,
    /// Time in which both transistors of a leg are off at each commutation, beyond what the switching itself hides, as
    /// a fraction of the PWM period; 0 (no compensation) to 0.1.
    pub dead_time: f32,
    /// Below this phase current, A, compensation is in proportion to it; 0.001 to 100.
    pub dead_time_band: f32,
    /// Supply below which nothing is modulated, V; at least 1.
    pub minimum_bus_voltage: f32,
}

/// Duties, and the voltage that they apply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulated {
    /// Fraction of the period that each high side conducts; always within the limits.
    pub duties: Phases,
    /// Voltage at the motor, V: what was asked for, less what did not fit.
    pub applied: AlphaBeta,
    /// `true` if a duty met its limit or the supply was too low.
    pub limited: bool,
}

/// Compare value of a centre-aligned timer that counts up to `top`, for a duty of at most `largest`. A duty that is no
/// number is 0.
#[inline(always)]
pub fn compare_value(duty: f32, top: u16, largest: f32) -> u16 {
    // Held to 16 bits as an integer: one instruction, where the conversion to `u16` takes two comparisons.
    ((lesser(greater(duty, 0.0), largest) * f32::from(top)) as i32).clamp(0, u16::MAX.into()) as u16
}

/// Modulation with its settings checked and prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulator {
    /// Duty in the middle of the permitted range.
    centre: f32,
    minimum_duty: f32,
    maximum_duty: f32,
    /// Longest vector as a fraction of the supply.
    reach: f32,
    /// Widest span of the phase voltages as a fraction of the supply; infinite where no permitted vector has a wider
    /// one.
    span: f32,
    dead_time: f32,
    dead_time_per_ampere: f32,
    minimum_bus_voltage: f32,
}

/// A leg's part of [`Modulated`].
struct Leg {
    duty: f32,
    /// The duty less what its dead time takes.
    applied: f32,
    limited: bool,
}

impl Modulator {
    /// Checks settings and prepares them.
    pub fn new(settings: &ModulationSettings) -> Result<Self, SettingError> {
        let fraction = in_range!("voltage fraction", "", settings.voltage_fraction, 0.1, HIGHEST_VOLTAGE_FRACTION)?;
        let minimum_duty = in_range!("minimum duty", "", settings.minimum_duty, 0.0, 0.4)?;
        let maximum_duty = in_range!("maximum duty", "", settings.maximum_duty, 0.6, 1.0)?;
        let dead_time = in_range!("dead time in PWM periods", "", settings.dead_time, 0.0, 0.1)?;
        let band = in_range!("dead-time compensation band", "A", settings.dead_time_band, 1e-3, 100.0)?;
        let minimum_bus_voltage = in_range!("least supply voltage", "V", settings.minimum_bus_voltage, 1.0, 1000.0)?;
        let span = maximum_duty - minimum_duty - 2.0 * dead_time;
        in_range!("duty range left by the dead time", "", span, 0.1, 1.0)?;
        Ok(Self {
            centre: 0.5 * (minimum_duty + maximum_duty),
            minimum_duty,
            maximum_duty,
            reach: fraction * span * FRAC_1_SQRT_3,
            span: if fraction > 1.0 { span } else { f32::INFINITY },
            dead_time,
            dead_time_per_ampere: dead_time / band,
            minimum_bus_voltage,
        })
    }

    /// The longest voltage vector that is permitted at a supply, V; 0 where the supply is too low, or not a number.
    #[inline(always)]
    pub fn reach(&self, bus_voltage: f32) -> f32 {
        if bus_voltage > self.minimum_bus_voltage { self.reach * lesser(bus_voltage, 1000.0) } else { 0.0 }
    }

    /// Cuts a voltage to the permitted length: d is kept as far as it fits, q gets what is left. NaN counts as 0.
    ///
    /// d comes first because without it field weakening loses the flux, and then the current and not only the torque.
    #[inline(always)]
    pub fn limit(&self, voltage: Dq, bus_voltage: f32) -> Dq {
        let reach = self.reach(bus_voltage);
        if voltage.norm_squared() <= reach * reach {
            return voltage;
        }
        let d = limited(voltage.d, reach);
        let q = limited(voltage.q, square_root(reach * reach - d * d));
        Dq { d, q }
    }

    /// Duties for a voltage vector, V. `currents`, A, out of the bridge: the ones that will flow while the duties act;
    /// the reference's are quieter near zero than measured ones.
    ///
    /// If the supply is too low (or not a number) all duties are at their centre and nothing is applied. NaN in a
    /// voltage or current counts as 0.
    #[inline(always)]
    pub fn modulate(&self, voltage: AlphaBeta, bus_voltage: f32, currents: Phases) -> Modulated {
        if !(bus_voltage > self.minimum_bus_voltage && bus_voltage.is_finite()) {
            return Modulated { duties: Phases::uniform(self.centre), applied: AlphaBeta::ZERO, limited: true };
        }
        let per_volt = 1.0 / bus_voltage;
        let wanted = (voltage * per_volt).to_phases();
        // A vector that no supply could give would turn into infinities below.
        let wanted = Phases { a: limited(wanted.a, 2.0), b: limited(wanted.b, 2.0), c: limited(wanted.c, 2.0) };
        let largest = greater(wanted.a, greater(wanted.b, wanted.c));
        let smallest = lesser(wanted.a, lesser(wanted.b, wanted.c));
        // A product with one changes no bit, and takes less than a branch around four.
        let span = largest - smallest;
        let beyond = span > self.span;
        let part = if beyond { self.span / span } else { 1.0 };
        let middle = self.centre - 0.5 * (part * (largest + smallest));

        let a = self.leg(middle + part * wanted.a, currents.a);
        let b = self.leg(middle + part * wanted.b, currents.b);
        let c = self.leg(middle + part * wanted.c, currents.c);
        Modulated {
            duties: Phases { a: a.duty, b: b.duty, c: c.duty },
            applied: AlphaBeta::from_phases(Phases { a: a.applied, b: b.applied, c: c.applied }) * bus_voltage,
            limited: a.limited | b.limited | c.limited | beyond,
        }
    }

    /// One leg: the duty that was asked for, and that for the dead time at a current, A. No closure: optimised for
    /// nothing but size, the compiler calls those.
    #[inline(always)]
    fn leg(&self, wanted: f32, current: f32) -> Leg {
        let compensation = limited(current * self.dead_time_per_ampere, self.dead_time);
        let ideal = wanted + compensation;
        // A number: everything in it is limited.
        let duty = match () {
            () if ideal > self.maximum_duty => self.maximum_duty,
            () if ideal < self.minimum_duty => self.minimum_duty,
            () => ideal,
        };
        Leg { duty, applied: duty - compensation, limited: duty != ideal }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::angle::ElectricalAngle;
    use proptest::prelude::*;

    const SETTINGS: ModulationSettings = ModulationSettings {
        voltage_fraction: 1.0,
        minimum_duty: 0.0,
        maximum_duty: 0.94,
        dead_time: 0.01,
        dead_time_band: 0.5,
        minimum_bus_voltage: 6.0,
    };

    fn vector(length: f32, angle: u32) -> AlphaBeta {
        Dq { d: length, q: 0.0 }.to_stationary(ElectricalAngle(angle).sin_cos())
    }

    proptest! {
        #[test]
        fn up_to_the_linear_range_every_vector_is_applied_exactly(
            fraction in 0.0f32..1.0, angle: u32, bus in 7.0f32..60.0, a in -9.0f32..9.0, b in -9.0f32..9.0,
        ) {
            let modulator = Modulator::new(&SETTINGS).unwrap();
            let wanted = vector(fraction * modulator.reach(bus), angle);
            let modulated = modulator.modulate(wanted, bus, Phases { a, b, c: -a - b });
            let error = modulated.applied - wanted;
            prop_assert!(error.alpha.abs().max(error.beta.abs()) < 2e-5 * bus, "{modulated:?}");
            prop_assert!(!modulated.limited);
        }

        #[test]
        fn duties_stay_in_their_limits_and_all_results_are_finite(bits: [u32; 6]) {
            let modulator = Modulator::new(&ModulationSettings { voltage_fraction: 1.15, ..SETTINGS }).unwrap();
            let [alpha, beta, bus, a, b, c] = bits.map(f32::from_bits);
            for bus in [bus, 24.0] {
                let modulated = modulator.modulate(AlphaBeta { alpha, beta }, bus, Phases { a, b, c });
                let Phases { a, b, c } = modulated.duties;
                for duty in [a, b, c] {
                    prop_assert!((0.0..=0.94).contains(&duty), "{modulated:?}");
                }
                prop_assert!(modulated.applied.alpha.is_finite() && modulated.applied.beta.is_finite(), "{modulated:?}");
                let limit = modulator.limit(Dq { d: alpha, q: beta }, bus);
                prop_assert!(limit.norm() <= modulator.reach(bus) * 1.000_01, "{limit:?}");
            }
        }

        #[test]
        fn beyond_the_linear_range_what_is_applied_is_what_the_duties_give(
            length in 15.1f32..40.0, angle: u32, a in -9.0f32..9.0,
        ) {
            let modulator = Modulator::new(&ModulationSettings { voltage_fraction: 1.15, dead_time: 0.0, ..SETTINGS }).unwrap();
            let modulated = modulator.modulate(vector(length, angle), 24.0, Phases { a, b: -a, c: 0.0 });
            let given = AlphaBeta::from_phases(modulated.duties) * 24.0;
            prop_assert!(modulated.limited);
            prop_assert!((given - modulated.applied).alpha.abs() < 1e-4 && (given - modulated.applied).beta.abs() < 1e-4);
        }
    }

    #[test]
    fn the_linear_range_is_the_supply_over_sqrt_3_and_the_corners_lie_further_out() {
        let settings = ModulationSettings {
            maximum_duty: 1.0,
            dead_time: 0.0,
            voltage_fraction: HIGHEST_VOLTAGE_FRACTION,
            ..SETTINGS
        };
        let full = Modulator::new(&settings).unwrap();
        let linear = Modulator::new(&ModulationSettings { voltage_fraction: 1.0, ..settings }).unwrap();
        assert!((linear.reach(24.0) - 24.0 / 3f32.sqrt()).abs() < 1e-5);
        assert!((full.reach(24.0) - 16.0).abs() < 1e-5);
        let corner = full.modulate(vector(15.999, 0), 24.0, Phases::default());
        assert!((corner.applied.alpha - 15.999).abs() < 1e-3, "the corner of the hexagon is reached: {corner:?}");
        let edge = full.modulate(vector(16.0, 1 << 30), 24.0, Phases::default());
        assert!((edge.applied.beta - 24.0 / 3f32.sqrt()).abs() < 1e-3, "between corners the edge ends it: {edge:?}");
    }

    proptest! {
        #[test]
        fn beyond_the_hexagon_the_angle_is_kept_and_the_edge_is_reached(length in 13.9f32..40.0, angle: u32) {
            let full = ModulationSettings { maximum_duty: 1.0, voltage_fraction: HIGHEST_VOLTAGE_FRACTION, ..SETTINGS };
            let wanted = vector(length, angle);
            let modulated = Modulator::new(&full).unwrap().modulate(wanted, 24.0, Phases::default());
            let Modulated { duties: Phases { a, b, c }, applied, limited } = modulated;
            let phases = wanted.to_phases();
            let most = phases.a.max(phases.b).max(phases.c) - phases.a.min(phases.b).min(phases.c);
            prop_assert_eq!(limited, most > 24.0 * 0.98);
            prop_assert!((applied.alpha * wanted.beta - applied.beta * wanted.alpha).abs() < 1e-3 * length, "{applied:?}");
            if limited {
                prop_assert!((a.max(b).max(c) - a.min(b).min(c) - 0.98).abs() < 1e-5, "{modulated:?}");
            }
        }
    }

    #[test]
    fn d_is_kept_and_q_gets_what_is_left() {
        let modulator = Modulator::new(&ModulationSettings { maximum_duty: 1.0, dead_time: 0.0, ..SETTINGS }).unwrap();
        let reach = modulator.reach(24.0);
        let kept = modulator.limit(Dq { d: -0.6 * reach, q: 50.0 }, 24.0);
        assert!((kept.d + 0.6 * reach).abs() < 1e-5 && (kept.q - 0.8 * reach).abs() < 1e-4, "{kept:?}");
        let only_d = modulator.limit(Dq { d: 99.0, q: -50.0 }, 24.0);
        assert!(only_d.d == reach && only_d.q.abs() < 1e-2, "{only_d:?}");
    }

    #[test]
    fn without_a_supply_the_duties_are_centred_and_nothing_is_applied() {
        let modulator = Modulator::new(&SETTINGS).unwrap();
        for bus in [0.0, -24.0, 6.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let modulated = modulator.modulate(vector(5.0, 0), bus, Phases::uniform(1.0));
            assert_eq!(modulated.duties, Phases::uniform(0.47), "{bus}");
            assert_eq!(modulated.applied, AlphaBeta::ZERO);
            assert!(modulated.limited);
        }
    }

    #[test]
    fn compensation_follows_the_current_and_is_proportional_within_its_band() {
        let modulator = Modulator::new(&SETTINGS).unwrap();
        let modulated = modulator.modulate(AlphaBeta::ZERO, 24.0, Phases { a: 3.0, b: -3.0, c: 0.25 });
        let Phases { a, b, c } = modulated.duties;
        assert!((a - 0.48).abs() < 1e-6 && (b - 0.46).abs() < 1e-6 && (c - 0.475).abs() < 1e-6, "{modulated:?}");
    }

    #[test]
    fn settings_out_of_range_are_refused_by_name() {
        let refused = |settings: ModulationSettings| Modulator::new(&settings).unwrap_err().name;
        assert_eq!(refused(ModulationSettings { voltage_fraction: 1.2, ..SETTINGS }), "voltage fraction");
        assert_eq!(refused(ModulationSettings { minimum_duty: -0.1, ..SETTINGS }), "minimum duty");
        assert_eq!(refused(ModulationSettings { maximum_duty: f32::NAN, ..SETTINGS }), "maximum duty");
        assert_eq!(refused(ModulationSettings { dead_time: 0.2, ..SETTINGS }), "dead time in PWM periods");
        assert_eq!(refused(ModulationSettings { dead_time_band: 0.0, ..SETTINGS }), "dead-time compensation band");
        assert_eq!(refused(ModulationSettings { minimum_bus_voltage: 0.0, ..SETTINGS }), "least supply voltage");
        let narrow = ModulationSettings { minimum_duty: 0.4, maximum_duty: 0.6, dead_time: 0.08, ..SETTINGS };
        assert_eq!(refused(narrow), "duty range left by the dead time");
    }
}
