//! The time over which a joint goes from one set-point of position or velocity to the next (60C2h), for as long as a
//! stream lasts; host. Without it each set-point is a step, which the position loop answers with a jerk.

use super::error::RemoteError;
use super::joint::RemoteJoint;
use joint_firmware::objects::field::{Field, ProfileParameter};
use std::time::Duration;

const FIELDS: [Field; 2] =
    [Field::Profile(ProfileParameter::InterpolationTime), Field::Profile(ProfileParameter::InterpolationExponent)];

/// Value and power of ten of a time in seconds, as finely as 60C2h:1 can have it.
fn encoded(period: Duration) -> [u64; 2] {
    let microseconds = period.as_micros() as u64;
    let finest = (-6..=0i8).zip((0..).map(|power| 10u64.pow(power)));
    let values = finest.map(|(exponent, unit)| ((microseconds + unit / 2) / unit, exponent));
    let (value, exponent) = values.clone().find(|(value, _)| *value <= 255).unwrap_or((255, 0));
    [value, u64::from(exponent as u8)]
}

/// 60C2h as it was before.
#[derive(Debug)]
pub(super) struct Interpolation([u64; 2]);

impl Interpolation {
    /// Has the joint interpolate over a period; none where it cannot.
    pub fn begin(joint: &RemoteJoint, period: Duration) -> Result<Option<Self>, RemoteError> {
        let mut before = [0; 2];
        for (field, before) in FIELDS.into_iter().zip(&mut before) {
            *before = match joint.raw(field) {
                Err(error) if error.is_absent() => return Ok(None),
                raw => raw?,
            };
        }
        write(joint, encoded(period))?;
        Ok(Some(Self(before)))
    }

    /// Puts it back.
    pub fn undo(&self, joint: &RemoteJoint) -> Result<(), RemoteError> {
        write(joint, self.0)
    }
}

fn write(joint: &RemoteJoint, values: [u64; 2]) -> Result<(), RemoteError> {
    FIELDS.into_iter().zip(values).try_for_each(|(field, value)| joint.write_raw(field, value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_is_as_fine_as_a_byte_can_have_it() {
        let of = |microseconds| encoded(Duration::from_micros(microseconds)).map(|byte| byte as u8 as i8);
        assert_eq!(of(10_000), [100, -4]);
        assert_eq!(of(4_000), [40, -4]);
        assert_eq!(encoded(Duration::from_micros(255)), [255, 0xFA]);
        assert_eq!(of(256), [26, -5]);
        assert_eq!(of(3_003), [30, -4]);
        assert_eq!(encoded(Duration::from_secs(1_000)), [255, 0]);
    }
}
