//! Checks before anything flows: is the joint in a state to be commissioned, and does what is wanted fit its limits?

use super::bench::{Bench, Condition};
use super::failure::Failure;
use joint_firmware::objects::settings::Setting;

/// The alternating current needs room below the current limit: the limit over the current, at least.
pub(super) const ROOM: f64 = 1.3;
/// Least current that is commissioned with, A.
const LEAST_CURRENT: f64 = 0.1;
/// Supply that can be applied along the field at any angle, as a part of it: 1/sqrt(3), less what the duties leave.
const APPLICABLE: f64 = 0.5;
/// Distance that a temperature must have from its limit, K.
const COOL: f64 = 20.0;

/// State of the joint before anything flows.
#[derive(Clone, Debug, PartialEq)]
pub struct Checked {
    /// Condition, as it tells itself.
    pub condition: Condition,
    /// Control steps per second, Hz.
    pub rate: f64,
    /// Highest voltage that is applied, V.
    pub highest_voltage: f64,
    /// The motor's current limit, A.
    pub current_limit: f64,
}

/// Checks a joint; a fault is acknowledged where that is wanted.
pub(super) fn check<B: Bench>(bench: &mut B, acknowledge: bool) -> Result<Checked, Failure> {
    let mut condition = bench.condition()?;
    if !condition.faults.is_empty() && acknowledge {
        bench.acknowledge()?;
        condition = bench.condition()?;
    }
    if !condition.faults.is_empty() {
        return Err(Failure::Fault { faults: condition.faults });
    }
    if condition.armed {
        return Err(Failure::Armed { state: condition.state });
    }
    if condition.staged {
        return Err(Failure::Staged);
    }
    let limits = [bench.setting(Setting::LowestBusVoltage)?, bench.setting(Setting::HighestBusVoltage)?];
    if !(limits[0]..=limits[1]).contains(&condition.supply) {
        return Err(Failure::Supply { supply: condition.supply, limits });
    }
    for (part, temperature, limit) in [
        ("winding", condition.winding, bench.setting(Setting::WindingTemperature)?),
        ("bridge", condition.bridge, bench.setting(Setting::BridgeTemperature)?),
    ] {
        let limit = limit - COOL;
        if temperature > limit {
            return Err(Failure::Hot { part, temperature, limit });
        }
    }
    Ok(Checked {
        rate: bench.rate()?,
        highest_voltage: APPLICABLE * condition.supply,
        current_limit: bench.setting(Setting::CurrentLimit)?,
        condition,
    })
}

/// Checks that a current leaves room below the motor's limit.
pub(super) fn current(current: f64, limit: f64) -> Result<(), Failure> {
    let limits = [LEAST_CURRENT, limit / ROOM];
    // A limit that the joint holds as a REAL32 is a little less than the number that was meant.
    if current >= limits[0] && current <= limits[1] * (1.0 + 1e-6) {
        Ok(())
    } else {
        Err(Failure::Current { current, limits })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_current_is_refused_just_beyond_what_leaves_room() {
        assert_eq!(current(10.0, 13.0), Ok(()));
        assert_eq!(current(10.01, 13.0), Err(Failure::Current { current: 10.01, limits: [0.1, 10.0] }));
        assert_eq!(current(0.1, 13.0), Ok(()));
        assert!(current(0.099, 13.0).is_err() && current(f64::NAN, 13.0).is_err());
    }
}
