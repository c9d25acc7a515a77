//! Current control in the rotor's frame: PI with decoupling, from wanted currents to the voltage that they need;
//! control step.
//!
//! The machine in the rotor's frame (Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, chapter 3):
//!
//! ```text
//! v_d = R i_d + L_d di_d/dt - w L_q i_q
//! v_q = R i_q + L_q di_q/dt + w L_d i_d + w psi
//! ```
//!
//! The terms with the electrical speed w are fed forward, which leaves two windings R + s L. The zero of each PI lies
//! on its winding's pole, so the open loop is an integrator with the wanted bandwidth and the delay of sampling,
//! computing and holding: one and a half periods. Seen from one period to the next, with a = exp(-R T / L), the gains
//! of that are k_p = w_c L (1 + R T / 2 L) and k_i T = w_c R T.
//!
//! Voltage that the bridge could not apply is taken out of the integral as if the reference had been one that it could
//! follow (Hanus' conditioning), so nothing winds up.

use super::number::{limited, or_zero};
use super::setting::{SettingError, in_range};
use super::transform::Dq;
use core::f32::consts::TAU;

/// Periods from a current's sample to the middle of the period in which the voltage that it led to is applied.
pub const DELAY_PERIODS: f32 = 1.5;
/// Least number of control periods in one period of the bandwidth. The delay turns 1.5 x 360° / 18 = 30° away, of
/// the integrator's 90° a phase margin of 60° is left.
pub const LEAST_PERIODS: f32 = 18.0;

/// Constants of the motor for the current loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorConstants {
    /// Resistance of a phase, Ω; 0.001 to 100.
    pub resistance: f32,
    /// Inductance along the magnet's flux, H; 1 µH to 0.1 H.
    pub inductance_d: f32,
    /// Inductance across the magnet's flux, H; 1 µH to 0.1 H.
    pub inductance_q: f32,
    /// Magnet's flux linkage, Wb: peak phase voltage per electrical rad/s; 0 to 1. Torque is 3/2 times pole pairs
    /// times flux linkage times i_q.
    pub flux_linkage: f32,
}

/// Settings of the current loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentSettings {
    /// The motor.
    pub motor: MotorConstants,
    /// Frequency at which the open loop's gain is 1, Hz; 10 Hz to an eighteenth of the rate.
    pub bandwidth: f32,
    /// Control steps a second, Hz; 1 kHz to 200 kHz.
    pub rate: f32,
    /// Largest voltage that the integral may hold, V; 1 to 1000. The highest supply is a good choice.
    pub highest_voltage: f32,
}

/// Settings of the current loop, checked and prepared. May be swapped between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentGains {
    /// V/A.
    proportional: Dq,
    /// 1 / proportional, A/V.
    inverse_proportional: Dq,
    /// V/A in a period.
    integral: f32,
    inductance: Dq,
    flux_linkage: f32,
    highest_voltage: f32,
}

impl CurrentGains {
    /// Checks settings and prepares them. The bandwidth is refused where the delay would leave a phase margin below
    /// 60°, and the winding where its time constant is below two periods: it is too fast for the rate.
    pub fn new(settings: &CurrentSettings) -> Result<Self, SettingError> {
        let rate = in_range!("control rate", "Hz", settings.rate, 1e3, 200e3)?;
        let bandwidth = in_range!("current loop's bandwidth", "Hz", settings.bandwidth, 10.0, rate / LEAST_PERIODS)?;
        let motor = &settings.motor;
        let resistance = in_range!("phase resistance", "Ω", motor.resistance, 1e-3, 100.0)?;
        let fastest = 2.0 / rate * resistance;
        let least = if fastest > 1e-6 { fastest } else { 1e-6 };
        let inductance = Dq {
            d: in_range!("inductance along d", "H", motor.inductance_d, least, 0.1)?,
            q: in_range!("inductance along q", "H", motor.inductance_q, least, 0.1)?,
        };
        let crossover = TAU * bandwidth;
        let half_drop = 0.5 * resistance / rate;
        let proportional = Dq { d: crossover * (inductance.d + half_drop), q: crossover * (inductance.q + half_drop) };
        Ok(Self {
            proportional,
            inverse_proportional: Dq { d: 1.0 / proportional.d, q: 1.0 / proportional.q },
            integral: crossover * resistance / rate,
            inductance,
            flux_linkage: in_range!("flux linkage", "Wb", motor.flux_linkage, 0.0, 1.0)?,
            highest_voltage: in_range!("highest voltage", "V", settings.highest_voltage, 1.0, 1000.0)?,
        })
    }
}

/// The current loop's state from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurrentControl {
    integral: Dq,
    asked: Dq,
}

impl CurrentControl {
    /// The voltage that takes `measured` to `reference`, V, for currents in A at an electrical speed in rad/s.
    ///
    /// If a measured or wanted current is not a number its axis has no error in this step, and if the speed is not a
    /// number nothing is fed forward. The result is finite for any finite currents below 1e15 A. [`Self::settle`] must
    /// follow.
    #[inline(always)]
    pub fn step(&mut self, gains: &CurrentGains, reference: Dq, measured: Dq, electrical_speed: f32) -> Dq {
        let error = reference - measured;
        let error = Dq { d: or_zero(error.d), q: or_zero(error.q) };
        let coupling =
            Dq { d: -gains.inductance.q * measured.q, q: gains.inductance.d * measured.d + gains.flux_linkage }
                * electrical_speed;
        let coupling = Dq { d: or_zero(coupling.d), q: or_zero(coupling.q) };
        self.asked = Dq {
            d: gains.proportional.d * error.d + self.integral.d + coupling.d,
            q: gains.proportional.q * error.q + self.integral.q + coupling.q,
        };
        self.integral = Dq {
            d: limited(self.integral.d + gains.integral * error.d, gains.highest_voltage),
            q: limited(self.integral.q + gains.integral * error.q, gains.highest_voltage),
        };
        self.asked
    }

    /// The voltage of the last step, V.
    #[inline(always)]
    pub(super) fn asked(&self) -> Dq {
        self.asked
    }

    /// Takes out of the integral what of the last step's voltage was not applied.
    #[inline(always)]
    pub fn settle(&mut self, gains: &CurrentGains, applied: Dq) {
        let missing = applied - self.asked;
        self.integral = Dq {
            d: limited(
                self.integral.d + gains.integral * gains.inverse_proportional.d * or_zero(missing.d),
                gains.highest_voltage,
            ),
            q: limited(
                self.integral.q + gains.integral * gains.inverse_proportional.q * or_zero(missing.q),
                gains.highest_voltage,
            ),
        };
    }

    /// Forgets the past: for the first step after the bridge was off.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MOTOR: MotorConstants =
        MotorConstants { resistance: 0.12, inductance_d: 60e-6, inductance_q: 90e-6, flux_linkage: 0.005 };
    const SETTINGS: CurrentSettings =
        CurrentSettings { motor: MOTOR, bandwidth: 1000.0, rate: 20_000.0, highest_voltage: 60.0 };

    /// The machine in the rotor's frame at a constant speed; a voltage acts in the period after the one that computed
    /// it.
    struct Machine {
        current: (f64, f64),
        speed: f64,
        next: Dq,
    }

    impl Machine {
        fn at(speed: f64) -> Self {
            Self { current: (0.0, 0.0), speed, next: Dq::ZERO }
        }

        fn measured(&self) -> Dq {
            Dq { d: self.current.0 as f32, q: self.current.1 as f32 }
        }

        fn period(&mut self, voltage: Dq) {
            let [r, ld, lq, psi] =
                [MOTOR.resistance, MOTOR.inductance_d, MOTOR.inductance_q, MOTOR.flux_linkage].map(f64::from);
            for _ in 0..20 {
                let (d, q) = self.current;
                let w = self.speed;
                let step = 1.0 / 20_000.0 / 20.0;
                self.current.0 += step * (self.next.d as f64 - r * d + w * lq * q) / ld;
                self.current.1 += step * (self.next.q as f64 - r * q - w * (ld * d + psi)) / lq;
            }
            self.next = voltage;
        }
    }

    /// A control step with the voltage limited to `reach` on each axis.
    fn control(
        control: &mut CurrentControl,
        gains: &CurrentGains,
        machine: &mut Machine,
        wanted: Dq,
        reach: f32,
    ) -> Dq {
        let voltage = control.step(gains, wanted, machine.measured(), machine.speed as f32);
        let applied = Dq { d: limited(voltage.d, reach), q: limited(voltage.q, reach) };
        control.settle(gains, applied);
        machine.period(applied);
        applied
    }

    /// Gain of the open loop, current over error, at a frequency: by a sine on the reference and a Fourier sum.
    fn open_loop_gain(gains: &CurrentGains, pick: fn(f32) -> Dq, axis: fn(Dq) -> f32, frequency: f64) -> f64 {
        let (mut controller, mut machine) = (CurrentControl::default(), Machine::at(0.0));
        let mut sums = [0.0; 4];
        for n in 0..20_000 {
            let (sin, cos) = (core::f64::consts::TAU * frequency * n as f64 / 20_000.0).sin_cos();
            let current = machine.measured();
            let wanted = pick(sin as f32);
            if n >= 10_000 {
                let (i, e) = (axis(current) as f64, (axis(wanted) - axis(current)) as f64);
                for (sum, part) in sums.iter_mut().zip([i * sin, i * cos, e * sin, e * cos]) {
                    *sum += part;
                }
            }
            control(&mut controller, gains, &mut machine, wanted, 60.0);
        }
        sums[0].hypot(sums[1]) / sums[2].hypot(sums[3])
    }

    #[test]
    fn the_open_loop_crosses_one_at_the_wanted_bandwidth_within_3_percent() {
        for bandwidth in [100.0, 500.0, 1100.0] {
            let gains = CurrentGains::new(&CurrentSettings { bandwidth, ..SETTINGS }).unwrap();
            let d = open_loop_gain(&gains, |d| Dq { d, q: 0.0 }, |i| i.d, bandwidth as f64);
            let q = open_loop_gain(&gains, |q| Dq { d: 0.0, q }, |i| i.q, bandwidth as f64);
            assert!((d - 1.0).abs() < 0.03 && (q - 1.0).abs() < 0.03, "{bandwidth} Hz: {d} {q}");
        }
    }

    #[test]
    fn a_step_settles_with_little_overshoot_even_at_the_highest_bandwidth() {
        let gains = CurrentGains::new(&CurrentSettings { bandwidth: 20_000.0 / 18.0, ..SETTINGS }).unwrap();
        let (mut controller, mut machine) = (CurrentControl::default(), Machine::at(0.0));
        let mut highest = 0f32;
        for _ in 0..40 {
            control(&mut controller, &gains, &mut machine, Dq { d: 0.0, q: 10.0 }, 60.0);
            highest = highest.max(machine.measured().q);
        }
        assert!(highest < 10.9, "{highest}");
        assert!((machine.measured().q - 10.0).abs() < 0.05, "{:?}", machine.measured());
    }

    #[test]
    fn after_a_reset_the_first_voltage_is_that_of_a_controller_that_never_ran() {
        let gains = CurrentGains::new(&SETTINGS).unwrap();
        let wanted = Dq { d: 1.0, q: 10.0 };
        let first = |mut controller: CurrentControl| controller.step(&gains, wanted, Dq::ZERO, 0.0);
        let (mut controller, mut machine) = (CurrentControl::default(), Machine::at(0.0));
        for _ in 0..100 {
            control(&mut controller, &gains, &mut machine, wanted, 60.0);
        }
        assert_ne!(first(controller), first(CurrentControl::default()));
        controller.reset();
        assert_eq!(first(controller), first(CurrentControl::default()));
    }

    /// Largest d current while q steps to 10 A at a speed, with the flux and inductances that are fed forward scaled.
    fn disturbance_of_d(decoupling: f32) -> f32 {
        let mut gains = CurrentGains::new(&SETTINGS).unwrap();
        gains.inductance = gains.inductance * decoupling;
        let (mut controller, mut machine) = (CurrentControl::default(), Machine::at(3000.0));
        let mut worst = 0f32;
        for n in 0..2_000 {
            let q = if n < 1_000 { 0.0 } else { 10.0 };
            control(&mut controller, &gains, &mut machine, Dq { d: 0.0, q }, 60.0);
            if n >= 1_000 {
                worst = worst.max(machine.measured().d.abs());
            }
        }
        worst
    }

    #[test]
    fn decoupling_keeps_q_out_of_d() {
        let (with, without) = (disturbance_of_d(1.0), disturbance_of_d(0.0));
        assert!(with < 0.5 * without, "{with} A with, {without} A without");
    }

    /// Largest error of q after the rotor's speed jumps, without the change of the integral that would follow.
    fn disturbance_of_speed(flux: f32) -> f32 {
        let mut gains = CurrentGains::new(&SETTINGS).unwrap();
        gains.flux_linkage *= flux;
        let (mut controller, mut machine) = (CurrentControl::default(), Machine::at(0.0));
        let mut worst = 0f32;
        for n in 0..2_000 {
            machine.speed = if n < 1_000 { 0.0 } else { 1000.0 };
            control(&mut controller, &gains, &mut machine, Dq::ZERO, 60.0);
            worst = worst.max(machine.measured().q.abs());
        }
        worst
    }

    #[test]
    fn the_back_emf_is_fed_forward() {
        let (with, without) = (disturbance_of_speed(1.0), disturbance_of_speed(0.0));
        assert!(with < 0.6 * without, "{with} A with, {without} A without");
    }

    /// Steps until q is back within 5 % after a second of a reference that the voltage cannot reach.
    fn recovery(settles: bool) -> usize {
        let gains = CurrentGains::new(&SETTINGS).unwrap();
        let (mut controller, mut machine) = (CurrentControl::default(), Machine::at(0.0));
        for n in 0.. {
            let q = if n < 20_000 { 100.0 } else { 5.0 };
            let voltage = controller.step(&gains, Dq { d: 0.0, q }, machine.measured(), 0.0);
            let applied = Dq { d: limited(voltage.d, 3.0), q: limited(voltage.q, 3.0) };
            if settles {
                controller.settle(&gains, applied);
            }
            machine.period(applied);
            if n >= 20_000 && (machine.measured().q - 5.0).abs() < 0.25 {
                return n - 20_000;
            }
        }
        unreachable!()
    }

    #[test]
    fn nothing_winds_up_while_the_voltage_is_at_its_limit() {
        let (with, without) = (recovery(true), recovery(false));
        assert!(with < 20 && without > 3 * with, "{with} steps with, {without} without");
    }

    #[test]
    fn after_a_current_that_is_not_a_number_the_controller_recovers() {
        let gains = CurrentGains::new(&SETTINGS).unwrap();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            let (mut controller, mut machine) = (CurrentControl::default(), Machine::at(500.0));
            for n in 0..1_000 {
                let reference = Dq { d: 0.0, q: 5.0 };
                if n == 500 {
                    let voltage = controller.step(&gains, reference, Dq { d: bad, q: bad }, bad);
                    let applied = Dq { d: limited(voltage.d, 13.0), q: limited(voltage.q, 13.0) };
                    controller.settle(&gains, applied);
                    machine.period(applied);
                } else {
                    control(&mut controller, &gains, &mut machine, reference, 13.0);
                }
                let Dq { d, q } = controller.integral;
                assert!(d.is_finite() && q.is_finite());
            }
            assert!((machine.measured().q - 5.0).abs() < 0.01, "{bad}: {:?}", machine.measured());
        }
    }

    proptest! {
        #[test]
        fn no_input_leaves_anything_unbounded_behind(bits: [u32; 7], rounds in 1usize..5) {
            let gains = CurrentGains::new(&SETTINGS).unwrap();
            let mut controller = CurrentControl::default();
            let [a, b, c, d, e, f, g] = bits.map(f32::from_bits);
            for _ in 0..rounds {
                controller.step(&gains, Dq { d: a, q: b }, Dq { d: c, q: d }, e);
                controller.settle(&gains, Dq { d: f, q: g });
                prop_assert!(controller.integral.d.abs() <= 60.0 && controller.integral.q.abs() <= 60.0);
            }
        }
    }

    #[test]
    fn a_bandwidth_beyond_the_delay_and_a_winding_beyond_the_rate_are_refused() {
        let error = CurrentGains::new(&CurrentSettings { bandwidth: 1200.0, ..SETTINGS }).unwrap_err();
        assert_eq!(error.name, "current loop's bandwidth");
        assert!((error.high - 1111.1).abs() < 0.1);
        let motor = MotorConstants { resistance: 2.0, ..MOTOR };
        let error = CurrentGains::new(&CurrentSettings { motor, ..SETTINGS }).unwrap_err();
        assert_eq!(error.name, "inductance along d");
        assert!((error.low - 200e-6).abs() < 1e-9);
    }
}
