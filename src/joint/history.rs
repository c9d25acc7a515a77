//! The last steps before a fault, kept for whoever asks what happened; control step writes, task reads.
//!
//! A step takes 20 bytes. All of its numbers but the position are cut to their upper halves: a sign, the whole range of
//! a single-precision number and 8 significant bits, so that they are up to 0.8 % too small in magnitude; what is not a
//! number remains none.

use super::fault::{Fault, Faults};
use super::state_machine::State;
use crate::motor::transform::Dq;
use friction_compensation::dsp::pkhtb;

/// Steps that are kept.
pub const LENGTH: usize = 64;

/// One control step as it is noted, and as the history gives it back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// State after the step.
    pub state: State,
    /// Faults present in the step.
    pub faults: Faults,
    /// Position, rad, and velocity, rad/s, of the joint.
    pub position: f32,
    /// rad/s.
    pub velocity: f32,
    /// Torque before compensation, Nm.
    pub commanded_torque: f32,
    /// Torque that compensation added, Nm.
    pub compensation_torque: f32,
    /// Measured current, A.
    pub current: Dq,
    /// Supply, V.
    pub bus_voltage: f32,
}

/// A snapshot as it is kept.
#[derive(Clone, Copy, Debug)]
struct Packed {
    /// [`Faults`], and the state from bit [`STATE_BIT`] on.
    state: u32,
    position: f32,
    /// Velocity and commanded torque, compensation torque and current d, current q and supply: the first one's upper
    /// half in the lower half of the word.
    pairs: [u32; 3],
}

/// Bits below are faults, which are numbered from 1 on.
const STATE_BIT: u32 = 24;
const _: () = assert!(Fault::ALL.len() < STATE_BIT as usize);

impl Packed {
    #[inline(always)]
    fn new(snapshot: &Snapshot) -> Self {
        let pair = |first: f32, second: f32| pkhtb(first.to_bits() as i32, second.to_bits() as i32);
        Self {
            state: snapshot.faults.bits() | (snapshot.state as u32) << STATE_BIT,
            position: snapshot.position,
            pairs: [
                pair(snapshot.velocity, snapshot.commanded_torque),
                pair(snapshot.compensation_torque, snapshot.current.d),
                pair(snapshot.current.q, snapshot.bus_voltage),
            ],
        }
    }

    fn snapshot(&self) -> Snapshot {
        let pair = |word: u32| (f32::from_bits(word << 16), f32::from_bits(word & 0xffff_0000));
        let [(velocity, commanded_torque), (compensation_torque, d), (q, bus_voltage)] = self.pairs.map(pair);
        Snapshot {
            state: State::at(self.state >> STATE_BIT),
            faults: Faults::from_bits(self.state & ((1 << STATE_BIT) - 1)),
            position: self.position,
            velocity,
            commanded_torque,
            compensation_torque,
            current: Dq { d, q },
            bus_voltage,
        }
    }
}

/// A ring of the last [`LENGTH`] steps that stands still from a fault on, until it is released.
#[derive(Clone, Copy, Debug)]
pub struct History {
    ring: [Packed; LENGTH],
    /// Place of the next step.
    next: usize,
    frozen: bool,
}

impl Default for History {
    fn default() -> Self {
        // A constant: made step by step, the ring would lie on the stack of whoever makes a joint.
        const EMPTY: History = History { ring: [Packed::NONE; LENGTH], next: 0, frozen: false };
        EMPTY
    }
}

impl Packed {
    /// Entry before the first step: not ready, no fault, all zeros.
    const NONE: Self = Self { state: 0, position: 0.0, pairs: [0; 3] };
}

impl History {
    /// Notes a step. The first one with a fault is the last that is noted.
    #[inline(always)]
    pub fn note(&mut self, snapshot: Snapshot) {
        if self.frozen {
            return;
        }
        self.frozen = !snapshot.faults.is_empty();
        if let Some(place) = self.ring.get_mut(self.next) {
            *place = Packed::new(&snapshot);
        }
        self.next = (self.next + 1) % LENGTH;
    }

    /// Goes on noting: the fault has been acknowledged.
    pub fn release(&mut self) {
        self.frozen = false;
    }

    /// Returns `true` if a fault stopped it.
    pub const fn is_frozen(&self) -> bool {
        self.frozen
    }

    /// The steps, oldest first; the last one is the newest, or the one with the fault.
    pub fn iter(&self) -> impl Iterator<Item = Snapshot> {
        let (newer, older) = self.ring.split_at_checked(self.next).unwrap_or((&self.ring, &[]));
        older.iter().chain(newer).map(Packed::snapshot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_step_with_the_fault_is_the_last_and_stays_until_released() {
        let mut history = History::default();
        let mut faults = Faults::NONE;
        faults.set(Fault::OverSpeed, true);
        for n in 0..100 {
            let faults = if n >= 70 { faults } else { Faults::NONE };
            history.note(Snapshot { position: n as f32, faults, ..Snapshot::default() });
        }
        let positions: Vec<f32> = history.iter().map(|snapshot| snapshot.position).collect();
        assert_eq!(positions, (7..=70).map(|n| n as f32).collect::<Vec<_>>());
        history.release();
        history.note(Snapshot { position: -1.0, ..Snapshot::default() });
        assert_eq!(history.iter().last().unwrap().position, -1.0);
    }

    proptest! {
        #[test]
        fn a_step_comes_back_with_eight_significant_bits_whatever_it_holds(
            state in 0u32..8, fault in prop::option::of(0..Fault::ALL.len()), position: f32, numbers in [any::<f32>(); 6],
        ) {
            let mut faults = Faults::NONE;
            if let Some(fault) = fault {
                faults.set(Fault::ALL[fault], true);
            }
            let [velocity, commanded_torque, compensation_torque, d, q, bus_voltage] = numbers;
            let current = Dq { d, q };
            let noted = Snapshot {
                state: State::at(state), faults, position, velocity, commanded_torque, compensation_torque, current, bus_voltage,
            };
            let mut history = History::default();
            history.note(noted);
            let kept = history.iter().last().unwrap();
            prop_assert_eq!((kept.state, kept.faults), (noted.state, noted.faults));
            prop_assert_eq!(kept.position.to_bits(), noted.position.to_bits());
            let kept = [
                kept.velocity, kept.commanded_torque, kept.compensation_torque, kept.current.d, kept.current.q,
                kept.bus_voltage,
            ];
            for (kept, noted) in kept.into_iter().zip(numbers) {
                let least = noted.abs() * (1.0 - 1.0 / 128.0);
                let near = kept.is_sign_positive() == noted.is_sign_positive()
                    && (least..=noted.abs()).contains(&kept.abs());
                prop_assert!(near || noted.is_nan() && kept.is_nan() || noted.is_subnormal(), "{} {}", kept, noted);
            }
        }
    }

    #[test]
    fn the_history_takes_twenty_bytes_a_step() {
        assert_eq!(size_of::<History>() - size_of::<usize>() * 2, 20 * LENGTH);
    }
}
