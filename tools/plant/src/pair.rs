//! Two joints that share a drive: dry friction of one is less while the other moves faster.
//!
//! Source: 003, section II-C. With the speeds of both and a band e, a joint's friction is the reduced one from
//! |v_other| >= |v_own| + e on, the whole one from |v_own| >= |v_other| + e on, and unchanged between. The paper
//! reduces it by other parameters of the same formula; here its level, load included, is multiplied by a factor.

use crate::error::{ParameterError, within};
use std::fmt;

/// Two joints that share a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Indices of the joints.
    pub joints: [usize; 2],
    /// Speed by which a joint has to be the faster one to lead, 0 to 10 rad/s.
    pub band: f64,
    /// Factor of the dry friction of the joint that does not lead, 0.01 to 1.
    pub relief: f64,
    /// The faster joint, 0 or 1; None before one of them was.
    leader: Option<usize>,
}

/// Reason for which two joints cannot share a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PairError {
    /// An index that no joint has.
    Absent(usize),
    /// A joint that is in two pairs, or twice in one.
    Twice(usize),
    /// Band or relief.
    Parameter(ParameterError),
}

impl fmt::Display for PairError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Absent(joint) => write!(f, "there is no joint {joint}"),
            Self::Twice(joint) => write!(f, "joint {joint} has a partner already, or would be its own"),
            Self::Parameter(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for PairError {}

impl Pair {
    /// Two joints, none of which leads.
    #[must_use]
    pub fn new(joints: [usize; 2], band: f64, relief: f64) -> Self {
        Self { joints, band, relief, leader: None }
    }

    /// Index of the joint that leads; None before one of them was the faster one.
    #[must_use]
    pub fn leader(&self) -> Option<usize> {
        self.leader.map(|leader| self.joints[leader])
    }

    /// Factors of both joints' dry friction at these speeds, rad/s.
    pub fn look(&mut self, [first, second]: [f64; 2]) -> [f64; 2] {
        if first >= second + self.band {
            self.leader = Some(0);
        } else if second >= first + self.band {
            self.leader = Some(1);
        }
        match self.leader {
            None => [1.0, 1.0],
            Some(0) => [1.0, self.relief],
            Some(_) => [self.relief, 1.0],
        }
    }
}

/// Checks the pairs of an arm of `joints` joints.
///
/// # Errors
/// Number and reason of the first pair that cannot be.
pub fn check(pairs: &[Pair], joints: usize) -> Result<(), (usize, PairError)> {
    let mut taken = Vec::new();
    for (number, pair) in pairs.iter().enumerate() {
        for joint in pair.joints {
            if joint >= joints {
                return Err((number, PairError::Absent(joint)));
            }
            if taken.contains(&joint) {
                return Err((number, PairError::Twice(joint)));
            }
            taken.push(joint);
        }
        let band = within("pair.band", pair.band, 0.0, 10.0);
        let relief = within("pair.relief", pair.relief, 0.01, 1.0);
        band.and(relief).map_err(|error| (number, PairError::Parameter(error)))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_is_relieved_from_the_band_on_and_until_it_leads_by_the_band_itself() {
        // Binary fractions: own speed and band add up exactly.
        let just = 2.0f64.powi(-40);
        let mut pair = Pair::new([0, 1], 0.25, 0.5);
        assert_eq!(pair.look([1.0, 1.0]), [1.0, 1.0], "neither is the faster one");
        assert_eq!(pair.look([1.0, 1.25 - just]), [1.0, 1.0]);
        assert_eq!(pair.look([1.0, 1.25]), [0.5, 1.0]);
        assert_eq!(pair.leader(), Some(1));
        // Hysteresis: unchanged until the first leads by the band.
        assert_eq!(pair.look([1.0, 1.0]), [0.5, 1.0]);
        assert_eq!(pair.look([1.25 - just, 1.0]), [0.5, 1.0]);
        assert_eq!(pair.look([1.25, 1.0]), [1.0, 0.5]);
        // And back.
        assert_eq!(pair.look([1.0, 1.25 - just]), [1.0, 0.5]);
        assert_eq!(pair.look([1.0, 1.25]), [0.5, 1.0]);
    }

    #[test]
    fn pairs_that_cannot_be_are_refused() {
        let found = |pairs: &[Pair]| check(pairs, 3);
        let pair = Pair::new([0, 1], 0.1, 0.5);
        assert_eq!(found(&[pair]), Ok(()));
        assert_eq!(found(&[Pair { joints: [0, 3], ..pair }]), Err((0, PairError::Absent(3))));
        assert_eq!(found(&[Pair { joints: [2, 2], ..pair }]), Err((0, PairError::Twice(2))));
        assert_eq!(found(&[pair, Pair { joints: [1, 2], ..pair }]), Err((1, PairError::Twice(1))));
        for wrong in [Pair { relief: 0.0, ..pair }, Pair { relief: 1.1, ..pair }, Pair { band: f64::NAN, ..pair }] {
            assert!(matches!(found(&[wrong]), Err((0, PairError::Parameter(_)))), "{wrong:?}");
        }
    }
}
