//! A brake chopper: a resistor that an output of the board connects to the supply while it is too high; control step.
//!
//! It conducts from its voltage on until the supply is 1 % below it, whatever state the joint is in, and before the
//! regeneration band begins, so that braking loses none of its torque as long as the resistor takes what comes. The
//! board sees a supply of a control step ago; a step later the output acts.
//!
//! **So that the resistor bears it** the part of the time in which it conducted, over some 10 s, is held below a
//! setting: for a resistor R of the power P that is P R / U^2. It is a first-order mean: from cold the resistor gets up
//! to 10 s times the setting at once, as energy P 10 s. Over the last fifth of it the voltage at which it conducts
//! rises to the highest supply, through the band in which the braking torque fades (`regeneration`): a resistor that is
//! gone at once would leave a supply that rises faster than the current can follow. A voltage below what the supply has
//! by itself uses its share up, too, and burns no more.

use super::configuration::Limits;
use crate::motor::number::greater;

/// `true` if this program has one.
pub const CHOPS: bool = !cfg!(all(target_os = "none", feature = "little-room"));
/// Time over which the mean is taken, s.
const MEMORY: f32 = 10.0;
/// Part of its voltage by which the supply has to fall below it.
const HYSTERESIS: f32 = 0.01;
/// Part of the share from which on the threshold rises.
const USED: f32 = 0.8;
/// A mean that counts as none.
const FORGOTTEN: f32 = 1e-5;

/// Thresholds, prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChopperGains {
    /// Supply above which it begins to conduct, V; infinite without one.
    on: f32,
    /// Supply down to which it goes on, V.
    off: f32,
    /// Largest mean of the time.
    share: f32,
    /// Mean from which on the thresholds rise, and by how much for each part of it, V.
    used: f32,
    rise: f32,
    /// Part of a control step in the mean.
    part: f32,
}

impl ChopperGains {
    /// Never.
    pub const NONE: Self = Self { on: f32::INFINITY, off: f32::INFINITY, share: 0.0, used: 0.0, rise: 0.0, part: 0.0 };

    /// Gains for `rate` control steps a second, Hz.
    pub fn new(limits: &Limits, rate: f32) -> Self {
        let on = if limits.chopper_voltage > 0.0 { limits.chopper_voltage } else { f32::INFINITY };
        let share = limits.chopper_share;
        let rise = greater(limits.bus_voltage.1 - on, 0.0) / ((1.0 - USED) * share);
        Self { on, off: (1.0 - HYSTERESIS) * on, share, used: USED * share, rise, part: 1.0 / (MEMORY * rate) }
    }
}

/// The chopper, from one control step to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Chopper {
    conducts: bool,
    mean: f32,
}

impl Chopper {
    /// One control step at a supply, V; what is not a number is none.
    #[inline(always)]
    pub fn step(&mut self, gains: &ChopperGains, supply: f32) {
        // Comparison as integers, see `motor::number`: negative numbers and what is none come after all others, and are
        // looked at more closely.
        if supply.to_bits() > gains.off.to_bits() || self.mean.to_bits() != 0 {
            self.decide(gains, supply);
        }
    }

    /// A function of its own: it is seldom run.
    #[inline(never)]
    fn decide(&mut self, gains: &ChopperGains, supply: f32) {
        let from = if self.conducts { gains.off } else { gains.on };
        let rise = gains.rise * greater(self.mean - gains.used, 0.0);
        self.conducts = supply > from + rise && self.mean < gains.share;
        let now = if self.conducts { 1.0 } else { 0.0 };
        self.mean += gains.part * (now - self.mean);
        if !self.conducts && self.mean < FORGOTTEN {
            self.mean = 0.0;
        }
    }

    /// Returns `true` while it conducts.
    #[inline(always)]
    pub const fn conducts(&self) -> bool {
        self.conducts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::default_configuration::MOTEUS_R4;

    const RATE: f32 = 1e4;

    fn gains(voltage: f32, share: f32) -> ChopperGains {
        let mut limits = MOTEUS_R4.joint.limits;
        (limits.chopper_voltage, limits.chopper_share) = (voltage, share);
        ChopperGains::new(&limits, RATE)
    }

    #[test]
    fn it_conducts_from_its_voltage_on_until_the_supply_is_a_hundredth_below() {
        let (gains, mut chopper) = (gains(25.0, 1.0), Chopper::default());
        for (supply, conducts) in [
            (24.99, false),
            (25.01, true),
            (24.76, true),
            (24.74, false),
            (24.99, false),
            (40.0, true),
            (f32::NAN, false),
            (f32::INFINITY, true),
            (-1.0, false),
        ] {
            chopper.step(&gains, supply);
            assert_eq!(chopper.conducts(), conducts, "{supply}");
        }
    }

    #[test]
    fn without_one_no_supply_conducts() {
        let (gains, mut chopper) = (gains(0.0, 1.0), Chopper::default());
        for supply in [0.0, 44.0, 1e9, f32::MAX, f32::INFINITY, f32::NAN] {
            chopper.step(&gains, supply);
            assert!(!chopper.conducts(), "{supply}");
        }
    }

    #[test]
    fn it_conducts_for_no_larger_part_of_the_time_than_its_resistor_bears() {
        for share in [0.01, 0.1, 0.5] {
            let (gains, mut chopper) = (gains(25.0, share), Chopper::default());
            let mut conducted = |seconds: f32| {
                let steps = (seconds * RATE) as u32;
                let on = (0..steps).filter(|_| {
                    chopper.step(&gains, 60.0);
                    chopper.conducts()
                });
                on.count() as f32 / steps as f32
            };
            // From cold: -10 s ln(1 - share) at once, and then its share.
            let at_once = -MEMORY * (1.0 - share).ln();
            let first = conducted(at_once);
            assert!(first > 0.99, "{share}: {first}");
            let later = conducted(20.0);
            assert!((later / share - 1.0).abs() < 0.02, "{share}: {later}");
        }
    }
}
