//! Joints that share a drive: friction of one is less while the other moves faster (003, section II-C).

use crate::drives::RobotDescription;
use crate::tree::Tree;

/// Two joints that share a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Indices of the joints.
    pub joints: [usize; 2],
    /// Speed by which one of them has to be the faster one to lead, rad/s or m/s.
    pub band: f64,
}

/// Two joints that cannot share a drive.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("pair of {} and {}: {reason}", joints[0], joints[1])]
pub struct PairDefect {
    /// Their names.
    pub joints: [String; 2],
    /// Reason, with the joint and the remedy.
    pub reason: String,
}

impl Pair {
    /// The other one of the two; None for a joint that is neither.
    pub fn partner(&self, joint: usize) -> Option<usize> {
        let [first, second] = self.joints;
        if joint == first { Some(second) } else { (joint == second).then_some(first) }
    }
}

/// The pairs of a description, checked.
///
/// # Errors
/// The first contradiction, with the joint and the remedy.
pub(crate) fn pairs(description: &RobotDescription, tree: &Tree) -> Result<Vec<Pair>, PairDefect> {
    let mut found: Vec<Pair> = Vec::new();
    for described in &description.pair {
        let names = &described.joints;
        let wrong = |reason: String| PairDefect { joints: names.clone(), reason };
        let place = |name: &String| match tree.joints.iter().position(|joint| joint.name == *name) {
            Some(place) => Ok(place),
            None if description.locked.contains(name) => {
                Err(wrong(format!("{name} is listed under `locked` and does not move; remove one of the two")))
            }
            None => Err(wrong(format!("there is no moving joint {name}; correct its name, or remove the pair"))),
        };
        let joints = [place(&names[0])?, place(&names[1])?];
        let [first, second] = joints;
        if first == second {
            return Err(wrong(format!("{} cannot share a drive with itself; name the other joint", names[0])));
        }
        if let Some(at) = joints.iter().position(|&joint| found.iter().any(|pair| pair.partner(joint).is_some())) {
            return Err(wrong(format!("{} is in another pair as well; a joint has one partner", names[at])));
        }
        let [one, other] = joints.map(|joint| tree.joints[joint].kind);
        if one != other {
            return Err(wrong(format!(
                "{} is {one:?} and {} {other:?}, so their speeds cannot be compared; remove the pair",
                names[0], names[1]
            )));
        }
        let band = described.band;
        if !(band > 0.0 && band <= 10.0) {
            return Err(wrong(format!("band is {band}, expected a number above 0, at most 10")));
        }
        found.push(Pair { joints, band });
    }
    Ok(found)
}
