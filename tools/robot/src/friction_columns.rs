//! Friction beside the rigid bodies, linear in its coefficients, as wide as a choice needs it; host.
//!
//! Only the rigid bodies of this fit are kept: each joint's friction is identified anew by the pipeline of one joint.
//! Friction that is missing here would be learned by inertias.

use identification::pre_sliding;
use identification::samples::Samples;

/// Slope of the Coulomb friction at standstill, s/rad.
pub(super) const SLOPE: f64 = 100.0;
/// Velocities of the Stribeck columns, parts of the largest speed.
const STRIBECK: [f64; 3] = [0.02, 0.1, 0.3];
/// Distances of the pre-sliding columns, parts of the position range.
const DISTANCES: [f64; 5] = [0.001, 0.004, 0.015, 0.06, 0.2];

/// Columns of the relief where joints share drives: Coulomb friction and its load's, while the other joint leads.
const RELIEF: usize = 2;

/// Friction columns of every joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Friction {
    /// None: for the robot of a simulation.
    None,
    /// Viscous, Coulomb, offset.
    Simple,
    /// Coulomb friction of each direction, and in proportion to the load.
    Load,
    /// Friction of `Load` with Stribeck columns.
    Stribeck,
    /// Friction of `Load` with pre-sliding elements.
    PreSliding,
}

impl Friction {
    /// Competing models, simplest first.
    pub const ALL: [Self; 4] = [Self::Simple, Self::Load, Self::Stribeck, Self::PreSliding];

    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Simple => "viscous, Coulomb, offset",
            Self::Load => "with asymmetry and load",
            Self::Stribeck => "with asymmetry, load and Stribeck",
            Self::PreSliding => "with asymmetry, load and pre-sliding",
        }
    }

    /// Number of columns of a joint; `shared`: joints of the robot share drives in pairs.
    pub const fn width(self, shared: bool) -> usize {
        let relief = if shared { RELIEF } else { 0 };
        match self {
            Self::None => 0,
            Self::Simple => 3,
            Self::Load => 5 + relief,
            Self::Stribeck => 5 + STRIBECK.len() + relief,
            Self::PreSliding => 5 + DISTANCES.len() + relief,
        }
    }

    /// The columns of all samples of a joint, sample by sample; `load` is the magnitude of the theoretical torque, per
    /// sample, with which friction grows; without it that column is 0, as are those of a relief for a joint that shares
    /// its drive with none.
    pub fn columns(self, samples: &Samples, load: Option<&[f64]>, shared: bool) -> Vec<f64> {
        let (mut lowest, mut highest, mut fastest) = (f64::INFINITY, f64::NEG_INFINITY, f64::MIN_POSITIVE);
        for (q, v) in samples.position.iter().zip(&samples.velocity) {
            (lowest, highest, fastest) = (lowest.min(*q), highest.max(*q), fastest.max(v.abs()));
        }
        let bent: Vec<Vec<f64>> = match self {
            Self::PreSliding => {
                let stiffness = DISTANCES.map(|part| 1.0 / (part * (highest - lowest)).max(1e-9));
                stiffness.map(|k| pre_sliding::bent(samples, &[k]).iter().map(|b| b[0]).collect()).into()
            }
            _ => vec![],
        };
        let mut all = Vec::with_capacity(self.width(shared) * samples.len());
        for (i, &v) in samples.velocity.iter().enumerate() {
            if self == Self::None {
                break;
            }
            let direction = (SLOPE * v).tanh();
            all.extend([v, direction, 1.0]);
            if self != Self::Simple {
                all.extend([v.abs(), load.map_or(0.0, |load| load[i].abs() * direction)]);
            }
            if self == Self::Stribeck {
                all.extend(STRIBECK.map(|part| {
                    let u = v / (part * fastest);
                    u * (-u * u).exp()
                }));
            }
            all.extend(bent.iter().map(|bent| bent[i]));
            if shared && self != Self::Simple {
                let follows = samples.partner.as_ref().is_some_and(|partner| partner.leads[i]);
                let relieved = if follows { direction } else { 0.0 };
                all.extend([relieved, load.map_or(0.0, |load| load[i].abs() * relieved)]);
            }
        }
        all
    }
}
