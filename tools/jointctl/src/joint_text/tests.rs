use super::*;
use friction_compensation::compensation::Request;
use joint_firmware::joint::configuration::{
    AdaptationRequest, CollisionReaction, LoadConfiguration, LoadFeedforwardRequest, VelocitySource,
};
use joint_firmware::joint::stop_options::StopConfiguration;
use joint_firmware::motor::angle::{Direction, ElectricalAngle};
use plant::ActuatorParameters;
use plant::virtual_joint::Setup;

fn setup(seed: u64) -> Setup {
    Setup::of(&ActuatorParameters::randomised(seed).aligned())
}

fn refusal(text: &str) -> String {
    from_text(text, Path::new("elbow.toml"), &setup(1).bridge).unwrap_err().to_string()
}

#[test]
fn a_configuration_comes_back_from_its_text_bit_by_bit() {
    for seed in 0..40 {
        let Setup { mut configuration, bridge } = setup(seed);
        configuration.motor.alignment.electrical_zero = ElectricalAngle((seed as u32).wrapping_mul(0x9e37_79b9));
        configuration.motor.alignment.direction = if seed % 2 == 0 { Direction::Forward } else { Direction::Reverse };
        configuration.compensation.velocity_source =
            if seed % 3 == 0 { VelocitySource::Measured } else { VelocitySource::Reference };
        configuration.compensation.request =
            [Request::Off, Request::Physical, Request::PhysicalAndNetwork, Request::NetworkInShadow][seed as usize % 4];
        configuration.compensation.adaptation =
            [AdaptationRequest::Off, AdaptationRequest::Shadow, AdaptationRequest::On][seed as usize % 3];
        configuration.load = LoadConfiguration {
            request: [
                LoadFeedforwardRequest::Off,
                LoadFeedforwardRequest::Acceleration,
                LoadFeedforwardRequest::Gravity,
                LoadFeedforwardRequest::Both,
            ][seed as usize % 4],
            payload_mass: 0.1 * seed as f32,
            payload_arm: 0.3,
            uncertainty: 0.01 * seed as f32,
            collision_threshold: 0.2 * seed as f32,
            collision_reaction: [
                CollisionReaction::Off,
                CollisionReaction::Warning,
                CollisionReaction::QuickStop,
                CollisionReaction::Hold,
                CollisionReaction::Yield,
            ][seed as usize % 5],
            ..configuration.load
        };
        configuration.gear.ratio *= if seed % 5 == 0 { -1.0 } else { 1.0 };
        let text = to_text(&configuration).unwrap();
        assert_eq!(from_text(&text, Path::new("joint.toml"), &bridge).unwrap(), configuration, "{text}");
    }
}

#[test]
fn every_key_is_explained_and_every_explanation_has_its_key() {
    let text = to_text(&setup(1).configuration).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let keys = lines.iter().filter(|line| line.contains(" = ") && !line.starts_with('#')).count();
    assert_eq!(keys, FIELDS.len(), "{text}");
    for pair in lines.windows(2).filter(|pair| pair[1].contains(" = ") && !pair[1].starts_with('#')) {
        assert!(pair[0].starts_with("# "), "{}", pair[1]);
    }
}

/// The text of a good configuration with another value for one field.
fn with(field: &fields::Field, value: &str) -> String {
    let good = to_text(&setup(1).configuration).unwrap();
    let mut table = "";
    let changed: Vec<String> = good
        .lines()
        .map(|line| {
            if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
                table = name;
            }
            match line.split_once(" = ") {
                Some((key, _)) if table == field.table && key == field.key => format!("{key} = {value}"),
                _ => line.to_owned(),
            }
        })
        .collect();
    changed.join("\n")
}

#[test]
fn what_lies_outside_a_stated_range_is_refused() {
    for field in FIELDS.iter() {
        let Some((low, high)) = field.range else { continue };
        let below = if low == 0.0 { -1e-3 } else { low - 1e-3 * low.abs() };
        let above = high + 1e-3 * high;
        for value in [below, above] {
            let value = match field.key {
                "pole_pairs" if value < low => "0".to_owned(),
                "pole_pairs" => "65".to_owned(),
                "encoder_counts" if value < low => "15".to_owned(),
                "encoder_counts" => "65536".to_owned(),
                "oscillator_trim" if value < low => "53".to_owned(),
                "oscillator_trim" => "75".to_owned(),
                "position" | "bus_voltage" if value < low => format!("[{value}, 50.0]"),
                "position" | "bus_voltage" => format!("[10.0, {value}]"),
                _ => format!("{value:?}"),
            };
            let text = with(field, &value);
            let refused = from_text(&text, Path::new("elbow.toml"), &setup(1).bridge);
            let Err(JointTextError::Refused { source, .. }) = &refused else {
                panic!("{}.{} = {value}: {refused:?}", field.table, field.key);
            };
            let shown = source.to_string();
            assert!(shown.contains("must"), "{shown}");
        }
    }
}

#[test]
fn a_misspelt_or_missing_key_and_a_wrong_choice_are_named() {
    let good = to_text(&setup(1).configuration).unwrap();
    let misspelt = refusal(&good.replacen("stiffness = ", "stifness = ", 1));
    assert!(misspelt.contains("elbow.toml") && misspelt.contains("stifness"), "{misspelt}");
    let missing: Vec<&str> = good.lines().filter(|line| !line.starts_with("command_deadline")).collect();
    let missing = refusal(&missing.join("\n"));
    assert!(missing.contains("missing field `command_deadline`"), "{missing}");
    let choice = refusal(&good.replacen("request = \"off\"", "request = \"full\"", 1));
    assert!(choice.contains("physical-and-network") && choice.contains("line"), "{choice}");
    let turns = refusal(&good.replacen("electrical_zero = 0.0", "electrical_zero = 1.0", 1));
    assert!(turns.contains("0 to below 1"), "{turns}");
    let unreadable = read(Path::new("nowhere.toml"), &setup(1).bridge).unwrap_err().to_string();
    assert!(unreadable.contains("nowhere.toml: cannot be read"), "{unreadable}");
}

#[test]
fn limits_that_contradict_each_other_are_refused_with_what_is_possible() {
    let mut configuration = setup(1).configuration;
    configuration.limits.over_current = configuration.motor.current_limit;
    let shown = refusal(&to_text(&configuration).unwrap());
    assert!(shown.contains("over-current limit is") && shown.contains("must lie in"), "{shown}");
}

/// Files of before there was one: the message has to say in which table, because `gains` has a `damping`, too.
#[test]
fn a_file_without_limit_damping_is_refused_by_name() {
    let good = to_text(&setup(1).configuration).unwrap();
    let damping = good.lines().find(|line| line.starts_with("damping = ")).unwrap();
    let message = refusal(&good.replacen(damping, "", 1));
    assert!(message.contains("[limits]") && message.contains("missing field `damping`"), "{message}");
}

/// A key that came later has to be added here, with the value that it stands for.
#[test]
fn a_file_of_an_earlier_program_stands_for_what_that_program_did() {
    let Setup { mut configuration, bridge } = setup(1);
    let later = [
        ("", "oscillator_trim"),
        ("motor", "field_weakening_current"),
        ("motor", "encoder_counts"),
        ("limits", "chopper_voltage"),
        ("limits", "chopper_share"),
        ("gains", "voltage_fraction"),
        ("compensation", "uncertainty"),
        ("compensation", "adaptation"),
        ("load", "uncertainty"),
        ("load", "collision_threshold"),
        ("load", "collision_reaction"),
    ];
    configuration.oscillator_trim = 60;
    configuration.motor.field_weakening_current = 0.1;
    configuration.motor.encoder_counts = 400;
    configuration.limits.chopper_share = 0.7;
    configuration.gains.voltage_fraction = 0.9;
    configuration.stops.quick_stop = 6;
    configuration.compensation.uncertainty = 0.1;
    configuration.compensation.adaptation = AdaptationRequest::On;
    configuration.load.inertia = 0.2;
    configuration.load.uncertainty = 0.1;
    configuration.load.collision_threshold = 5.0;
    configuration.load.collision_reaction = CollisionReaction::Hold;
    let written = to_text(&configuration).unwrap();
    let without = |tables: &[&str]| {
        let mut table = "";
        let kept = written.lines().filter(|line| {
            table = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')).unwrap_or(table);
            let key = line.split_once(" = ").map_or("", |(key, _)| key);
            !later.contains(&(table, key)) && !tables.contains(&table)
        });
        let text = kept.collect::<Vec<_>>().join("\n");
        from_text(&text, Path::new("joint.toml"), &bridge).unwrap_or_else(|error| panic!("{error}\n{text}"))
    };
    configuration.oscillator_trim = 64;
    configuration.motor.field_weakening_current = 0.0;
    configuration.motor.encoder_counts = 4_000;
    configuration.limits.chopper_voltage = 0.0;
    configuration.limits.chopper_share = 0.1;
    configuration.gains.voltage_fraction = 1.0;
    configuration.compensation.uncertainty = 0.6;
    configuration.compensation.adaptation = AdaptationRequest::Off;
    configuration.load.uncertainty = 0.3;
    configuration.load.collision_threshold = 0.0;
    configuration.load.collision_reaction = CollisionReaction::Off;
    assert_eq!(without(&[]), configuration);
    // Before there were stops and a load.
    configuration.stops = StopConfiguration::DEFAULT;
    configuration.load = LoadConfiguration::NONE;
    assert_eq!(without(&["stops", "load"]), configuration);
}

#[test]
fn an_option_code_of_a_stop_that_there_is_not_is_refused_with_those_that_there_are() {
    let good = to_text(&setup(1).configuration).unwrap();
    for (from, to) in
        [("quick_stop = 2", "quick_stop = 3"), ("halt = 1", "halt = 0"), ("late_command = 1", "late_command = 2")]
    {
        assert!(good.contains(from), "{from}");
        let shown = refusal(&good.replacen(from, to, 1));
        assert!(shown.contains("quick_stop must be 0, 1, 2, 5 or 6") && shown.contains("elbow.toml"), "{shown}");
    }
    let held = good.replacen("quick_stop = 2", "quick_stop = 6", 1);
    assert_eq!(from_text(&held, Path::new("elbow.toml"), &setup(1).bridge).unwrap().stops.quick_stop, 6);
}
