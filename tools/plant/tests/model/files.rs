//! Parameters and faults travel through TOML without loss, and a misspelt name is refused.

use plant::actuator::{Channel, Effect, Failure, Fault, Phase};
use plant::friction_factors::FrictionFactors;
use plant::{ActuatorParameters, JointParameters};

#[test]
fn parameters_come_back_from_toml_bit_by_bit() {
    for seed in 0..50 {
        let parameters = ActuatorParameters::randomised(seed);
        let text = toml::to_string(&parameters).unwrap();
        assert_eq!(toml::from_str::<ActuatorParameters>(&text).unwrap(), parameters, "{text}");
    }
    let factors = FrictionFactors::drawn(1, 0.3);
    assert_eq!(toml::from_str::<FrictionFactors>(&toml::to_string(&factors).unwrap()).unwrap(), factors);
}

#[test]
fn a_misspelt_or_missing_parameter_is_refused_by_name() {
    let text = toml::to_string(&JointParameters::reference()).unwrap();
    let misspelt = text.replace("gear_ratio", "gear_ration");
    let error = toml::from_str::<JointParameters>(&misspelt).unwrap_err().to_string();
    assert!(error.contains("gear_ration"), "{error}");
    let missing: String = text.lines().filter(|line| !line.starts_with("gear_loss")).collect::<Vec<_>>().join("\n");
    let error = toml::from_str::<JointParameters>(&missing).unwrap_err().to_string();
    assert!(error.contains("gear_loss"), "{error}");
}

#[test]
fn faults_and_effects_are_written_as_a_person_would() {
    #[derive(serde::Deserialize)]
    struct Scenario {
        faults: Vec<Fault>,
        without: Vec<Effect>,
    }
    let text = r#"
        without = ["dead-time", "encoder-eccentricity"]
        faults = [
            "gate-driver",
            { phase-open = "b" },
            { source-voltage = 12.5 },
            { sensor = ["current-a", "stuck"] },
            { sensor = ["encoder", { offset = 0.25 }] },
        ]
    "#;
    let scenario: Scenario = toml::from_str(text).unwrap();
    assert_eq!(scenario.without, [Effect::DeadTime, Effect::EncoderEccentricity]);
    assert_eq!(
        scenario.faults,
        [
            Fault::GateDriver,
            Fault::PhaseOpen(Phase::B),
            Fault::SourceVoltage(12.5),
            Fault::Sensor(Channel::CurrentA, Failure::Stuck),
            Fault::Sensor(Channel::Encoder, Failure::Offset(0.25)),
        ]
    );
}
