//! The limits of torque, velocity and position as bounds of the torque, by gains of their own; control step, once a
//! round of the motion loop.
//!
//! A joint of any mode, stiffness and damping may be given the whole permitted torque within its limits, in both
//! directions, at rest even at a position limit. Towards a limit the torque is held below a straight line in the
//! velocity v, with the limit damping D:
//!
//! ```text
//! bound = D (v0 - v), within plus and minus the torque limit T
//! ```
//!
//! v0 is the speed at which nothing is left to drive the joint on; above it, it is braked. With the fade f = T/D, the
//! room x up to the position limit in the direction of motion, the margin m behind it, and the quick stop's
//! deceleration a, v0 is the least of
//!
//! | | v0 |
//! |---|---|
//! | velocity limit | the velocity limit |
//! | on the way to a position limit, x >= 0 | sqrt(f^2 + 2 a x) |
//! | beyond it, x < 0 | f (1 + 2 x / m) |
//!
//! So at a velocity limit v the torque is whole up to v - f, none at v, and brakes with T from v + f on. At a position
//! limit it is whole at rest, none half the margin behind it, where a constant push outwards ends, and -T where the
//! margin ends and the fault begins. A joint that approaches at a speed is braked along the parabola of its quick stop.
//! The parabola begins with f, so that it leads into the straight line: the slope D dv0/dx, a stiffness, is
//! a D^2 / T there and less before, where sqrt(2 a x) alone would have none that is finite.
//!
//! **Where it holds.** A joint of inertia J that is driven outwards with T all the way is braked at a along v = v0 + J
//! a / D, passes the limit with f (1 + J a / T), and meets a spring of 2 T / m with the damper D. With D = T / sqrt(a
//! m) it gets 0.8 m behind the limit where J a = T / 2; where J a = 0.8 T it takes twice that damping to stay within
//! the margin. Where J a > T, or friction, a load or a hot winding's derating leave less torque than J a, the joint may
//! pass it.
//!
//! **Against the delays** of motion loop, current loop and observer, the time constant J / D has to be long. The
//! configuration does not know J, so that no upper limit of D would mean anything but the least D does: a lighter joint
//! needs a higher velocity limit. Behind a gear that gives way J is the rotor's alone. With an observer of 200 Hz and a
//! motion loop of 4 kHz, 1 ms is enough; at 0.3 ms, the torque ripples by 12 % at the velocity limit. The observer's
//! noise times D is a torque, too. Tests measure all of this (`tools/plant/tests/joint/limits.rs`).

use super::active::{Active, JointMotion};
use crate::motor::number::{greater, lesser, limited};

/// Lowest and highest torque that the joint may be given where it is, Nm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Negative, or positive where it brakes.
    pub lowest: f32,
    /// Positive, or negative where it brakes.
    pub highest: f32,
}

impl Bounds {
    /// The bounds for a motion and a torque limit, Nm, derating included. Zero for a velocity that is not a number.
    #[inline(always)]
    pub fn at(active: &Active, motion: &JointMotion, limit: f32) -> Self {
        let (low, high) = active.limits.position;
        Self {
            lowest: -bound(active, motion.position - low, -motion.velocity, limit),
            highest: bound(active, high - motion.position, motion.velocity, limit),
        }
    }

    /// The nearest torque within them.
    #[inline(always)]
    pub fn hold(&self, torque: f32) -> f32 {
        greater(lesser(torque, self.highest), self.lowest)
    }
}

/// Torque, Nm, towards a position limit that is `room` rad away, at a velocity, rad/s, in its direction.
#[inline(never)]
fn bound(active: &Active, room: f32, velocity: f32, limit: f32) -> f32 {
    let gains = &active.limit_gains;
    let permitted = if room > 0.0 && velocity > 0.0 {
        lesser(
            gains.speed(gains.fade_squared + gains.twice_deceleration * room, &active.limits),
            active.limits.velocity,
        )
    } else {
        // A joint that goes away from the limit, or stands, has more than its fade: the whole torque.
        gains.fade + gains.slope * lesser(room, 0.0)
    };
    limited(active.limits.damping * (permitted - velocity), limit)
}

#[cfg(test)]
mod tests {
    use super::super::command::{Command, Mode};
    use super::super::motion_law::MotionLaw;
    use super::*;
    use crate::default_configuration::B_G431B_ESC1;
    use crate::joint::configuration::Configuration;
    use proptest::prelude::*;

    /// A joint of 90 Nm and 6 rad/s whose torque fades over 1 rad/s.
    fn prepared(change: impl Fn(&mut Configuration)) -> Active {
        let mut configuration = B_G431B_ESC1.joint;
        let limits = &mut configuration.limits;
        (limits.torque, limits.velocity, limits.damping) = (90.0, 6.0, 90.0);
        (limits.position, limits.position_margin) = ((-1.0, 2.0), 0.2);
        configuration.gains.quick_stop_deceleration = 30.0;
        change(&mut configuration);
        configuration.prepare(&B_G431B_ESC1.bridge).unwrap()
    }

    fn motion(position: f32, velocity: f32) -> JointMotion {
        JointMotion { position, velocity, acceleration: 0.0 }
    }

    fn highest(position: f32, velocity: f32) -> f32 {
        Bounds::at(&prepared(|_| {}), &motion(position, velocity), 90.0).highest
    }

    fn near(value: f32, expected: f32) -> bool {
        (value - expected).abs() <= 1e-5 * 90.0
    }

    /// Each mode, asked for far more torque than there is.
    #[test]
    fn every_mode_has_the_whole_torque_within_the_limits_whatever_its_gains_are() {
        let gains = [0.0, 1e-3, 1.0, 20.0, 1e3, 1e4];
        for stiffness in gains.into_iter().chain([1e5]) {
            for damping in gains {
                let active = prepared(|configuration| {
                    (configuration.gains.stiffness, configuration.gains.damping) = (stiffness, damping);
                });
                for mode in [Mode::Torque, Mode::Velocity, Mode::Position, Mode::Impedance] {
                    for (position, velocity) in [(0.5, 0.0), (0.5, 3.0), (0.5, -3.0), (-1.0, 0.0), (2.0, 0.0)] {
                        for (torque, derating) in [(1e7, 1.0), (-1e7, 1.0), (1e7, 0.3), (-1e7, 0.3)] {
                            let command =
                                Command { mode, position: 0.5, torque, stiffness, damping, ..Command::NOTHING };
                            let at = motion(position, velocity);
                            let given = MotionLaw::default().step(&active, &command, &at, derating).torque;
                            let expected = torque.signum() * derating * 90.0;
                            assert!(near(given, expected), "{given}, not {expected}: {command:?} {at:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn torque_fades_towards_the_velocity_limit_and_brakes_beyond_it() {
        for (velocity, expected) in [
            (-6.0, 90.0),
            (4.99, 90.0),
            (5.01, 89.1),
            (5.5, 45.0),
            (6.0, 0.0),
            (6.5, -45.0),
            (6.99, -89.1),
            (7.1, -90.0),
        ] {
            assert!(near(highest(-0.9, velocity), expected), "{velocity}: {}", highest(-0.9, velocity));
        }
    }

    #[test]
    fn torque_fades_behind_a_position_limit_at_rest_and_reverses() {
        for (position, expected) in [
            (1.999, 90.0),
            (2.0, 90.0),
            (2.001, 89.1),
            (2.05, 45.0),
            (2.1, 0.0),
            (2.15, -45.0),
            (2.199, -89.1),
            (2.3, -90.0),
        ] {
            assert!((highest(position, 0.0) - expected).abs() < 0.01, "{position}: {}", highest(position, 0.0));
        }
    }

    #[test]
    fn a_joint_on_its_way_to_a_position_limit_is_braked_along_the_parabola_of_its_quick_stop() {
        for room in [0.01f32, 0.1, 0.3] {
            let nothing_left = (1.0 + 2.0 * 30.0 * room).sqrt();
            assert!(near(highest(2.0 - room, nothing_left), 0.0));
            assert!((highest(2.0 - room, nothing_left - 0.5) - 45.0).abs() < 0.01);
            assert!((highest(2.0 - room, nothing_left + 0.5) + 45.0).abs() < 0.01);
        }
        // Never faster than the velocity limit, which is met 35 / 60 rad before.
        assert!(near(highest(2.0 - 0.6, 5.5), 45.0) && highest(2.0 - 0.57, 5.5) < 44.0);
    }

    /// Excursion behind its limit, as a part of the margin, of a joint that the whole torque drives onto it from afar.
    /// `inertia` is what of the torque the quick stop's deceleration takes, `damping` counts from T / sqrt(a m) on.
    fn farthest(inertia: f32, damping: f32) -> f32 {
        let active = prepared(|configuration| {
            configuration.limits.velocity = 60.0;
            configuration.limits.damping = damping * 90.0 / (30.0f32 * 0.2).sqrt();
        });
        let (mut at, period) = (motion(-1.0, 0.0), 1e-4);
        let mut most = at.position;
        for _ in 0..30_000 {
            at.velocity += period * 30.0 / inertia * Bounds::at(&active, &at, 90.0).highest / 90.0;
            at.position += period * at.velocity;
            most = most.max(at.position);
        }
        (most - 2.0) / 0.2
    }

    #[test]
    fn a_joint_stays_within_the_margin_where_the_deceleration_and_the_damping_are_as_documented() {
        for (inertia, damping, low, high) in
            [(0.5, 1.0, 0.7, 0.85), (0.8, 1.0, 1.5, 2.2), (0.8, 2.0, 0.55, 0.7), (1.1, 2.0, 1.8, 2.4)]
        {
            let found = farthest(inertia, damping);
            assert!((low..high).contains(&found), "{inertia} {damping}: {found}");
        }
    }

    #[test]
    fn the_two_directions_are_alike() {
        let active = prepared(|configuration| configuration.limits.position = (-2.0, 2.0));
        for position in [-2.2, -2.05, -1.0, 0.0, 1.9, 2.1f32] {
            for velocity in [-7.0, -2.0, 0.0, 1.0, 5.5f32] {
                let one = Bounds::at(&active, &motion(position, velocity), 60.0);
                let other = Bounds::at(&active, &motion(-position, -velocity), 60.0);
                assert_eq!((one.lowest, one.highest), (-other.highest, -other.lowest));
            }
        }
    }

    proptest! {
        #[test]
        fn whatever_bits_come_the_torque_is_within_the_limit(position: u32, velocity: u32, torque: u32, derating in 0.0f32..=1.0) {
            let active = prepared(|_| {});
            let limit = 90.0 * derating;
            let bounds = Bounds::at(&active, &motion(f32::from_bits(position), f32::from_bits(velocity)), limit);
            prop_assert!(bounds.hold(f32::from_bits(torque)).abs() <= limit, "{:?}", bounds);
        }

        /// In every state that a joint can be in, something is left between them.
        #[test]
        fn the_bounds_never_cross(position in -1.5f32..2.5, velocity in -8.0f32..8.0, derating in 0.0f32..=1.0) {
            let bounds = Bounds::at(&prepared(|_| {}), &motion(position, velocity), 90.0 * derating);
            prop_assert!(bounds.lowest <= bounds.highest, "{:?}", bounds);
        }
    }

    #[test]
    fn the_damping_is_checked_against_the_torque_and_the_velocity_limit() {
        let refused = |damping: f32| {
            let mut configuration = B_G431B_ESC1.joint;
            let limits = &mut configuration.limits;
            (limits.torque, limits.velocity, limits.damping) = (90.0, 6.0, damping);
            configuration.prepare(&B_G431B_ESC1.bridge).err().map(|error| error.to_string())
        };
        assert_eq!((refused(75.0), refused(1e6)), (None, None));
        let message = refused(74.99).unwrap();
        assert!(message.contains("limit damping") && message.contains("75"), "{message}");
        for damping in [1.001e6, 0.0, -75.0, f32::NAN] {
            assert!(refused(damping).is_some_and(|message| message.contains("limit damping")), "{damping}");
        }
    }
}
