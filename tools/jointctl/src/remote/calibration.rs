//! A joint measures its own motor: begun with a current, watched, and given up where nobody watches any more; host.

use super::configuration::explained;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use bus::client::Abort;
use bus::client::ClientError;
use joint_firmware::objects::field::{CalibrationField, ConfigurationField, Field};
use joint_firmware::objects::settings::Setting;
use std::time::{Duration, Instant};

/// Longer than any calibration takes: the joint ends each within its own time.
const LONGEST: Duration = Duration::from_secs(120);
/// How often the joint is asked.
const PERIOD: Duration = Duration::from_millis(100);
/// Object 2107h:2.
const STAGES: [&str; 8] =
    ["not begun", "current offsets", "resistance", "inductance", "alignment", "ending", "done", "given up"];
const DONE: u64 = 6;
const GIVEN_UP: u64 = 7;
/// Object 2107h:3 in words, with the unit of the two numbers beside it; none where they say nothing.
const FAILURES: [(&str, Option<&str>); 20] = [
    ("no reason is told", None),
    ("it was asked to, or something commanded the joint or broke", None),
    ("it took too long", None),
    ("the supply is too low", Some("V")),
    ("over-current", Some("A")),
    ("the encoder did not answer", Some("steps")),
    ("the rotor turned while the bridge was off", Some("turns")),
    ("a current sensor reads too much without current", Some("A")),
    ("a phase carries no current", Some("A")),
    ("the current is not reached: resistance too high, or a current sensor with the wrong sign", Some("A")),
    ("the phase currents do not add up to zero", Some("A")),
    ("the resistance is none of a motor", Some("Ω")),
    ("the alternating current is too small to measure an inductance by", Some("A")),
    ("the winding answers like a resistor", Some("")),
    ("the rotor did not follow the field: blocked, too little current, or not this encoder", Some("turns")),
    ("the rotor did not come back the way that it went", Some("turns")),
    ("the field's turns are no whole multiple of the rotor's", None),
    ("the motor has another number of pole pairs", None),
    ("the rotor lagged too far behind the field: more current", Some("turns")),
    ("the rotor lies beside the field: less current", Some("turns")),
];

/// What was found, as the joint's configuration has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrated {
    /// Ω at 25 °C.
    pub resistance: f64,
    /// H, along and across the magnet.
    pub inductance: [f64; 2],
    /// Pole pairs.
    pub pole_pairs: u64,
    /// The encoder counts down while the field turns forward.
    pub reversed: bool,
    /// Electrical turns.
    pub electrical_zero: f64,
    /// Electrical turns that the rotor lagged behind the field.
    pub lag: f64,
}

impl std::fmt::Display for Calibrated {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [d, q] = self.inductance.map(|henry| henry * 1e6);
        let Self { resistance, pole_pairs, electrical_zero, .. } = self;
        let reversed = if self.reversed { ", encoder reversed" } else { "" };
        writeln!(f, "resistance       {resistance:.4} Ω at 25 °C")?;
        writeln!(f, "inductance d, q  {d:.1} µH, {q:.1} µH")?;
        writeln!(f, "pole pairs       {pole_pairs}{reversed}")?;
        writeln!(f, "electrical zero  {electrical_zero:.4} turns")?;
        write!(f, "rotor's lag      {:.1}° electrical", 360.0 * self.lag)
    }
}

/// Has a joint calibrate itself with `current` A. `running` is asked all the time: once it says no, the calibration is given up. `tell`
/// gets every stage.
///
/// # Errors
/// The joint is not off, refuses the current, or gives the calibration up; what it found does not go with its other settings.
pub fn calibrate(
    joint: &RemoteJoint,
    current: f64,
    running: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(&str),
) -> Result<Calibrated, RemoteError> {
    let field = Field::Calibration;
    joint.require_off("a calibration")?;
    let begun = joint.write_raw(field(CalibrationField::Current), (current as f32).to_bits().into());
    begun.map_err(|error| explained(joint, error))?;
    let given_up = |problem: String| RemoteError::Calibration { node: joint.id(), problem };
    let (end, mut last) = (Instant::now() + LONGEST, u64::MAX);
    loop {
        let stage = joint.raw(field(CalibrationField::Progress))?;
        if stage != last {
            last = stage;
            tell(STAGES.get(stage as usize).copied().unwrap_or("unknown"));
        }
        match stage {
            DONE => return found(joint),
            GIVEN_UP => return Err(given_up(reason(joint)?)),
            _ if !running() => {
                joint.write_raw(field(CalibrationField::Current), 0)?;
                return Err(given_up("interrupted".into()));
            }
            _ if Instant::now() > end => {
                joint.write_raw(field(CalibrationField::Current), 0)?;
                return Err(given_up(format!("no end after {} s", LONGEST.as_secs())));
            }
            _ => std::thread::sleep(PERIOD),
        }
    }
}

/// Why the joint gave up.
fn reason(joint: &RemoteJoint) -> Result<String, RemoteError> {
    let number = joint.raw(Field::Calibration(CalibrationField::Failure))?;
    let Some((words, unit)) = FAILURES.get(number as usize) else { return Ok(format!("reason {number}")) };
    let Some(unit) = unit else { return Ok((*words).into()) };
    let value = joint.number(Field::Calibration(CalibrationField::Value))?;
    let limit = joint.number(Field::Calibration(CalibrationField::Limit))?;
    Ok(format!("{words} ({value:.3} against {limit:.3} {unit})").replace(" )", ")"))
}

fn found(joint: &RemoteJoint) -> Result<Calibrated, RemoteError> {
    // The joint takes what it found within a millisecond or two, as long as the control step runs.
    let refused = Field::Configuration(ConfigurationField::Result);
    let busy = |result: &u64| *result == 2;
    let mut result = joint.raw(refused)?;
    for _ in 0..10 {
        if !busy(&result) {
            break;
        }
        std::thread::sleep(PERIOD);
        result = joint.raw(refused)?;
    }
    if result != 0 {
        let object = bus::client::Object { node: joint.id(), index: 0x2107, sub_index: 1 };
        return Err(explained(joint, ClientError::Aborted { object, abort: Abort::VALUE }.into()));
    }
    let setting = |setting| joint.number(Field::Setting(setting));
    Ok(Calibrated {
        resistance: setting(Setting::Resistance)?,
        inductance: [setting(Setting::InductanceD)?, setting(Setting::InductanceQ)?],
        pole_pairs: joint.raw(Field::Setting(Setting::PolePairs))?,
        reversed: joint.raw(Field::Setting(Setting::Direction))? != 0,
        electrical_zero: setting(Setting::ElectricalZero)?,
        lag: joint.number(Field::Calibration(CalibrationField::Lag))?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use joint_firmware::motor::calibration::Failure;

    #[test]
    fn every_failure_of_a_calibration_has_words() {
        let last = Failure::RotorBesideField { turns: 0.0, limit: 0.0 };
        assert_eq!(FAILURES.len(), usize::from(last.number()) + 1);
        assert!(FAILURES[usize::from(Failure::Aborted.number())].0.contains("asked"));
        assert!(
            FAILURES[usize::from(Failure::SupplyTooLow { voltage: 0.0, least: 0.0 }.number())].0.contains("supply")
        );
        assert!(FAILURES[usize::from(last.number())].0.contains("beside"));
    }
}
