//! Open-loop voltage: a field of a commanded voltage and speed, and means of the winding's answer; control step.
//!
//! Commissioning measures a motor that nobody has described: resistance, inductances, pole pairs, direction and
//! electrical zero are computed by whoever commands this, from the means that a window of [`WINDOW`] control steps
//! gives. Nothing here needs a constant of the motor.
//!
//! The voltage lies along a field that turns at the commanded speed from phase A on. On top of it a voltage may
//! alternate with an eighth of the control rate, along the field and across it. All voltages slew at [`SLEW`], and fall
//! where the current exceeds its limit, so that a winding of any resistance is reached slowly.
//!
//! The current is not controlled: it swings about its limit and passes it, by how much is in docs/commissioning.md.

use super::angle::{ElectricalAngle, STEPS};
use super::modulation::Modulator;
use super::number::{limited, square_root};
use super::phases::Phases;
use super::transform::{AlphaBeta, Dq};

/// Control steps of a window: sixteen periods of the alternating voltage.
pub const WINDOW: u32 = 128;
/// Slew rate of all voltages, V/s.
pub const SLEW: f32 = 50.0;
/// Highest speed of the field, electrical turns/s.
pub const HIGHEST_SPEED: f32 = 50.0;
/// Longest time between two commands, s.
pub const DEADLINE: f32 = 0.1;
/// Part of the voltages that is left after a step in which the current exceeded its limit: they halve in 44 steps.
const BACK_OFF: f32 = 63.0 / 64.0;
/// One step of the field speed, electrical turns/s.
const SPEED_STEP: f32 = 0.01;
/// One step of a voltage, V.
const VOLTAGE_STEP: f32 = 1e-3;
/// Part of a window that a step is.
const SHARE: f32 = 1.0 / WINDOW as f32;

/// The command, in the steps of object 2107h:1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Voltage along the field, phase amplitude, mV.
    pub voltage: u16,
    /// Speed of the field, 0.01 electrical turns/s; beyond [`HIGHEST_SPEED`] it counts as that.
    pub speed: i16,
    /// Amplitude of the alternating voltage along the field, mV.
    pub along: u16,
    /// Amplitude of the alternating voltage across the field, mV.
    pub across: u16,
}

impl Frame {
    /// Decodes object 2107h:1: voltage in the lowest 16 bits, then speed, along, across.
    pub const fn from_bits(bits: u64) -> Self {
        Self {
            voltage: bits as u16,
            speed: (bits >> 16) as i16,
            along: (bits >> 32) as u16,
            across: (bits >> 48) as u16,
        }
    }

    /// The number of object 2107h:1.
    pub const fn to_bits(self) -> u64 {
        self.voltage as u64 | (self.speed as u16 as u64) << 16 | (self.along as u64) << 32 | (self.across as u64) << 48
    }
}

/// Means over one window. All vectors are in the field's frame: d along it, q across it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// Windows since the start; 0 where there was none.
    pub number: u32,
    /// Current, A.
    pub current: Dq,
    /// Voltage that was applied, V.
    pub voltage: Dq,
    /// Amplitude of the current in phase with the alternating voltage, A.
    pub in_phase: Dq,
    /// Amplitude of the current a quarter of a period ahead of that, A.
    pub quadrature: Dq,
    /// Amplitude of the alternating voltage, V.
    pub alternating: Dq,
    /// Supply, V.
    pub bus_voltage: f32,
    /// Encoder in the last step, 2^32 a turn.
    pub encoder: u32,
    /// Field in the last step, 2^32 an electrical turn.
    pub field: u32,
    /// `true` if the encoder's zero is known.
    pub referenced: bool,
}

impl Window {
    /// Window before the first one.
    pub const NOTHING: Self = Self {
        number: 0,
        current: Dq::ZERO,
        voltage: Dq::ZERO,
        in_phase: Dq::ZERO,
        quadrature: Dq::ZERO,
        alternating: Dq::ZERO,
        bus_voltage: 0.0,
        encoder: 0,
        field: 0,
        referenced: false,
    };
}

/// Gains that depend on the control rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenLoopGains {
    /// Change of a voltage in a step, V.
    slew: f32,
    /// Way of the field in a step for each electrical turn/s, 2^32 an electrical turn.
    way: f32,
    /// Control steps without a command after which the bridge switches off.
    pub deadline_steps: u32,
}

impl OpenLoopGains {
    /// Gains for a control rate, Hz.
    pub fn new(rate: f32) -> Self {
        Self { slew: SLEW / rate, way: STEPS / rate, deadline_steps: (DEADLINE * rate) as u32 }
    }
}

/// Inputs of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenLoopInput {
    /// Phase currents without the sensors' offsets, A.
    pub phase_currents: Phases,
    /// Length of the current vector beyond which the voltages fall, A.
    pub current_limit: f32,
    /// Torque of an ampere across the magnet, Nm/A.
    pub torque_per_current: f32,
    /// Supply, V.
    pub bus_voltage: f32,
    /// Encoder, 2^32 a turn.
    pub encoder: u32,
    /// `true` if the encoder's zero is known.
    pub referenced: bool,
}

/// Outputs of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenLoopOutput {
    /// Duties for the next period, within the modulation's limits.
    pub duties: Phases,
    /// Current in the field's frame, A.
    pub current: Dq,
    /// The most torque that it can make, Nm: nobody knows where the magnet lies.
    pub torque: f32,
}

/// Sums over the steps of a window so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    current: Dq,
    voltage: Dq,
    in_phase: Dq,
    quadrature: Dq,
    alternating: Dq,
    bus_voltage: f32,
}

/// The open loop, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OpenLoop {
    field: ElectricalAngle,
    /// V.
    voltage: f32,
    /// Amplitude, V.
    alternating: Dq,
    step: u32,
    sums: Sums,
    window: Window,
    /// The last step ended a window.
    complete: bool,
}

/// Sine of an eighth of a turn a step.
fn sine(step: u32) -> f32 {
    const DIAGONAL: f32 = core::f32::consts::FRAC_1_SQRT_2;
    match step % 8 {
        0 | 4 => 0.0,
        1 | 3 => DIAGONAL,
        2 => 1.0,
        5 | 7 => -DIAGONAL,
        _ => -1.0,
    }
}

impl OpenLoop {
    /// Begins anew, with the field on phase A and no voltage; the last window stays.
    #[inline(never)]
    pub fn begin(&mut self) {
        *self = Self { window: self.window, ..Self::default() };
    }

    /// One control step.
    #[inline(never)]
    pub fn step(
        &mut self,
        gains: &OpenLoopGains,
        modulator: &Modulator,
        frame: &Frame,
        input: &OpenLoopInput,
    ) -> OpenLoopOutput {
        let rotation = self.field.sin_cos();
        let current = AlphaBeta::from_phases(input.phase_currents).to_rotor(rotation);
        let squared = current.norm_squared();
        if squared > input.current_limit * input.current_limit {
            self.voltage *= BACK_OFF;
            self.alternating = self.alternating * BACK_OFF;
        } else {
            let towards = |now: f32, target: u16| now + limited(VOLTAGE_STEP * f32::from(target) - now, gains.slew);
            self.voltage = towards(self.voltage, frame.voltage);
            self.alternating =
                Dq { d: towards(self.alternating.d, frame.along), q: towards(self.alternating.q, frame.across) };
        }
        let (sine, cosine) = (sine(self.step), sine(self.step + 2));
        let asked = Dq { d: self.voltage, q: 0.0 } + self.alternating * sine;
        let modulated = modulator.modulate(asked.to_stationary(rotation), input.bus_voltage, input.phase_currents);

        let sums = &mut self.sums;
        sums.current = sums.current + current;
        sums.voltage = sums.voltage + modulated.applied.to_rotor(rotation);
        sums.in_phase = sums.in_phase + current * sine;
        sums.quadrature = sums.quadrature + current * cosine;
        sums.alternating = sums.alternating + self.alternating;
        sums.bus_voltage += input.bus_voltage;
        self.step += 1;
        self.complete = self.step >= WINDOW;
        if self.complete {
            self.end(input);
        }
        let speed = limited(SPEED_STEP * f32::from(frame.speed), HIGHEST_SPEED);
        self.field = ElectricalAngle(self.field.0.wrapping_add((speed * gains.way) as i32 as u32));
        let torque = input.torque_per_current * square_root(squared);
        OpenLoopOutput { duties: modulated.duties, current, torque }
    }

    fn end(&mut self, input: &OpenLoopInput) {
        let Sums { current, voltage, in_phase, quadrature, alternating, bus_voltage } = core::mem::take(&mut self.sums);
        self.step = 0;
        self.window = Window {
            // 0 stands for none.
            number: self.window.number.wrapping_add(1).max(1),
            current: current * SHARE,
            voltage: voltage * SHARE,
            in_phase: in_phase * (2.0 * SHARE),
            quadrature: quadrature * (2.0 * SHARE),
            alternating: alternating * SHARE,
            bus_voltage: bus_voltage * SHARE,
            encoder: input.encoder,
            field: self.field.0,
            referenced: input.referenced,
        };
    }

    /// The last complete window.
    pub fn window(&self) -> &Window {
        &self.window
    }

    /// Returns `true` if the last step completed it.
    #[inline(always)]
    pub fn is_complete(&self) -> bool {
        self.complete
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::modulation::ModulationSettings;
    use crate::motor::virtual_motor::{RATE, VirtualMotor};
    use proptest::prelude::*;

    const SUPPLY: f32 = 24.0;

    fn modulator() -> Modulator {
        Modulator::new(&ModulationSettings {
            voltage_fraction: 1.0,
            minimum_duty: 0.0,
            maximum_duty: 0.95,
            dead_time: 0.0,
            dead_time_band: 1.0,
            minimum_bus_voltage: 6.0,
        })
        .unwrap()
    }

    /// A motor under open-loop voltage, and the largest current since the start, A.
    struct Bench {
        motor: VirtualMotor,
        open_loop: OpenLoop,
        gains: OpenLoopGains,
        modulator: Modulator,
        limit: f32,
        largest: f32,
    }

    impl Bench {
        fn new(motor: VirtualMotor, limit: f32) -> Self {
            let gains = OpenLoopGains::new(RATE as f32);
            Self { motor, open_loop: OpenLoop::default(), gains, modulator: modulator(), limit, largest: 0.0 }
        }

        fn step(&mut self, frame: &Frame) -> OpenLoopOutput {
            let input = OpenLoopInput {
                phase_currents: self.motor.measured_currents(),
                current_limit: self.limit,
                torque_per_current: 1.0,
                bus_voltage: SUPPLY,
                encoder: self.motor.encoder(),
                referenced: true,
            };
            let output = self.open_loop.step(&self.gains, &self.modulator, frame, &input);
            self.motor.period(Some(output.duties), SUPPLY.into());
            self.largest = self.largest.max(output.current.norm_squared().sqrt());
            output
        }

        /// The first whole window after `seconds` of a command.
        fn window(&mut self, frame: &Frame, seconds: f64) -> Window {
            (0..(seconds * RATE) as u32).for_each(|_| {
                self.step(frame);
            });
            let before = self.open_loop.window().number;
            while self.open_loop.window().number < before + 2 {
                self.step(frame);
            }
            *self.open_loop.window()
        }
    }

    #[test]
    fn the_frame_is_four_numbers_of_16_bits_the_lowest_first() {
        let frame = Frame { voltage: 0x1234, speed: -2, along: 0x5678, across: 0x9abc };
        assert_eq!(frame.to_bits(), 0x9abc_5678_fffe_1234);
        assert_eq!(Frame::from_bits(frame.to_bits()), frame);
    }

    #[test]
    fn two_voltages_tell_the_resistance_and_an_alternating_one_tells_both_inductances() {
        let mut bench = Bench::new(VirtualMotor { inertia: 1e3, ..VirtualMotor::default() }, 20.0);
        let [first, second] = [300, 900].map(|voltage| bench.window(&Frame { voltage, ..Frame::default() }, 0.2));
        let rise = second.current.d - first.current.d;
        let resistance = f64::from(second.voltage.d - first.voltage.d) / f64::from(rise);
        assert!((resistance / 0.12 - 1.0).abs() < 0.01 && rise > 4.0, "{resistance} Ohm");
        assert!((second.voltage.d - 0.9).abs() < 1e-3 && (second.bus_voltage - SUPPLY).abs() < 1e-3);
        assert!(second.current.q.abs() < 0.01 && second.alternating == Dq::ZERO);

        // The winding is a filter of first order with the voltage held for a period: |i / v| at an eighth of the rate.
        let gain = |inductance: f64| {
            let a = (-0.12 / RATE / inductance).exp();
            let (re, im) = (core::f64::consts::FRAC_1_SQRT_2 - a, core::f64::consts::FRAC_1_SQRT_2);
            (1.0 - a) / 0.12 / re.hypot(im)
        };
        let amplitude = |in_phase: f32, quadrature: f32| f64::from(in_phase).hypot(f64::from(quadrature));
        let d = bench.window(&Frame { voltage: 900, along: 2_000, ..Frame::default() }, 0.2);
        let q = bench.window(&Frame { voltage: 900, across: 2_000, ..Frame::default() }, 0.2);
        let measured = [amplitude(d.in_phase.d, d.quadrature.d), amplitude(q.in_phase.q, q.quadrature.q)];
        for (amplitude, inductance) in measured.into_iter().zip([60e-6, 90e-6]) {
            assert!((amplitude / (2.0 * gain(inductance)) - 1.0).abs() < 0.01, "{amplitude} A, {inductance} H");
        }
        assert!((d.alternating.d - 2.0).abs() < 1e-6 && d.alternating.q == 0.0 && q.alternating.q > 1.999);
    }

    #[test]
    fn the_rotor_follows_the_field_and_the_window_tells_both_angles() {
        let mut bench = Bench::new(VirtualMotor::default(), 20.0);
        let still = bench.window(&Frame { voltage: 900, ..Frame::default() }, 0.3);
        let turning = bench.window(&Frame { voltage: 900, speed: 200, ..Frame::default() }, 1.0);
        assert_eq!(still.field, 0);
        let field = f64::from(turning.field) / 2f64.powi(32);
        let rotor = 14.0 * f64::from(turning.encoder.wrapping_sub(still.encoder)) / 2f64.powi(32);
        // Within the encoder's step and the lag by friction, electrical turns.
        let apart = (rotor - field + 0.5).rem_euclid(1.0) - 0.5;
        assert!(apart.abs() < 0.1 && bench.motor.position > 1.9 / 14.0, "{field} {rotor}");
    }

    #[test]
    fn the_field_is_no_faster_than_its_highest_speed() {
        let gains = OpenLoopGains::new(RATE as f32);
        for (speed, expected) in [(4_999, 49.99), (5_000, 50.0), (5_001, 50.0), (i16::MAX, 50.0), (i16::MIN, -50.0)] {
            let mut bench = Bench::new(VirtualMotor { held_speed: Some(0.0), ..VirtualMotor::default() }, 20.0);
            bench.step(&Frame { speed, ..Frame::default() });
            let turns = f64::from(bench.open_loop.field.0 as i32) / 2f64.powi(32) * RATE;
            assert!((turns - expected).abs() < 1e-4, "{speed}: {turns} turns/s");
        }
        assert_eq!(gains.deadline_steps, 2_000);
    }

    #[test]
    fn no_voltage_rises_faster_than_the_slew_rate() {
        let mut bench = Bench::new(VirtualMotor { resistance: 5.0, ..VirtualMotor::default() }, 20.0);
        let frame = Frame { voltage: u16::MAX, along: u16::MAX, across: u16::MAX, ..Frame::default() };
        for n in 1..=2_000 {
            bench.step(&frame);
            let most = SLEW / RATE as f32 * n as f32 * 1.0001;
            let Dq { d, q } = bench.open_loop.alternating;
            assert!(
                [bench.open_loop.voltage, d, q].iter().all(|voltage| (0.99 * most..=most).contains(voltage)),
                "{n}"
            );
        }
    }

    #[test]
    fn the_current_stays_near_its_limit_whatever_is_asked_for() {
        for (along, across) in [(0, 0), (20_000, 0), (0, 20_000)] {
            for speed in [0, 300] {
                let mut bench = Bench::new(VirtualMotor::default(), 5.0);
                bench.window(&Frame { voltage: 12_000, speed, along, across }, 1.0);
                assert!(bench.largest > 4.5 && bench.largest < 6.5, "{} A, {along} {across} mV", bench.largest);
            }
        }
    }

    #[test]
    fn a_new_beginning_forgets_all_but_the_last_window() {
        let mut bench = Bench::new(VirtualMotor::default(), 20.0);
        let last = bench.window(&Frame { voltage: 500, speed: 100, ..Frame::default() }, 0.1);
        bench.step(&Frame::default());
        bench.open_loop.begin();
        assert_eq!(bench.open_loop, OpenLoop { window: last, ..OpenLoop::default() });
        let next = bench.window(&Frame::default(), 0.0);
        assert!(next.number == last.number + 2 && next.voltage == Dq::ZERO);
    }

    proptest! {
        #[test]
        fn no_input_leads_to_duties_beyond_the_limits_or_to_a_voltage_that_is_no_number(
            bits: [u32; 5], command: u64, steps in 1usize..300
        ) {
            let gains = OpenLoopGains::new(RATE as f32);
            let (modulator, mut open_loop) = (modulator(), OpenLoop::default());
            let [a, b, c, current_limit, bus_voltage] = bits.map(f32::from_bits);
            let input = OpenLoopInput {
                phase_currents: Phases { a, b, c },
                current_limit,
                torque_per_current: 1.0,
                bus_voltage,
                encoder: 0,
                referenced: false,
            };
            for _ in 0..steps {
                let Phases { a, b, c } =
                    open_loop.step(&gains, &modulator, &Frame::from_bits(command), &input).duties;
                prop_assert!([a, b, c].iter().all(|duty| (0.0..=0.95).contains(duty)));
                prop_assert!(open_loop.voltage.is_finite() && open_loop.alternating.d.is_finite());
            }
        }
    }
}
