//! A joint is commissioned over a bus.

use crate::served::{NODE, Served, program};
use crate::tables::COMMISSION;
use bus::client::Command;
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use jointctl::commission::joint::{Joint, Objects};
use jointctl::commission::{Bench as _, Failure, Guide, Plan, Stage, Stopped, commission, page};
use jointctl::remote::commission::RemoteObjects;
use jointctl::remote::configuration::set;
use jointctl::remote::{Entry, RemoteJoint};
use plant::ActuatorParameters;
use std::cell::Cell;

/// Factor by which the joint lives slower than the clock. It bears 0.1 s without a frame, which a dozen questions and
/// answers must fit into; on a busy machine they take longer.
const SLOWER: u32 = 4;

/// Its objects, for which time passes as it does for the joint.
struct Slowed<'r>(RemoteObjects<'r>);

impl Objects for Slowed<'_> {
    fn upload(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, Stopped> {
        self.0.upload(index, sub_index)
    }

    fn download(&mut self, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Stopped> {
        self.0.download(index, sub_index, data)
    }

    fn network(&mut self, command: Command) -> Result<(), Stopped> {
        self.0.network(command)
    }

    fn store(&mut self) -> Result<(), Stopped> {
        self.0.store()
    }

    fn pass(&mut self, seconds: f64) -> Result<(), Stopped> {
        self.0.pass(seconds * f64::from(SLOWER))
    }
}

/// Replaces what a commissioning finds by wrong values.
fn forget(joint: &RemoteJoint) {
    let wrong = [("resistance", "1.0"), ("pole-pairs", "3"), ("electrical-zero", "0.1")];
    let pairs = wrong.map(|(name, text)| {
        let entry = Entry::one(name).unwrap();
        (entry, entry.parse(text).unwrap())
    });
    set(joint, &pairs).unwrap();
}

struct Yes<'y> {
    told: Vec<String>,
    stage: &'y Cell<Option<Stage>>,
}

impl Guide for Yes<'_> {
    fn stage(&mut self, stage: Stage) {
        self.stage.set(Some(stage));
    }

    fn found(&mut self, text: &str) {
        self.told.push(text.into());
    }

    fn agrees(&mut self, _: &str) -> bool {
        true
    }
}

/// Little travel, so that it does not take long; the payload-free link of the virtual joint is free to.
fn plan() -> Plan {
    Plan { travel: 0.4, turn: false, ..Plan::new(8.0) }
}

pub fn a_joint_is_commissioned_with_the_motor_that_it_has_and_stopped_at_once_when_asked() {
    let served = Served::slowed(SLOWER);
    let joint = served.joint();
    forget(&joint);
    let stage = Cell::new(None);

    // The user has enough of it in the middle of the first sweep.
    let running = || stage.get() != Some(Stage::Inductance);
    let mut bench = Joint::new(Slowed(RemoteObjects::new(joint.clone(), &running)));
    let stopped = commission(&mut bench, &plan(), &mut Yes { told: Vec::new(), stage: &stage });
    assert_eq!(stopped.unwrap_err(), Failure::Stopped(Stopped::Interrupted));
    drop(bench);
    joint.require_off("what follows").unwrap();
    assert_eq!(joint.raw(Field::Setting(Setting::PolePairs)).unwrap(), 3, "nothing was changed");

    stage.set(None);
    let mut bench = Joint::new(Slowed(RemoteObjects::new(joint.clone(), &|| true)));
    let refused = bench.set(&[(Setting::OverCurrent, 0.5)]).unwrap_err().to_string();
    assert!(refused.contains("refuses its over-current limit of 0.5: "), "{refused}");
    let mut yes = Yes { told: Vec::new(), stage: &stage };
    let mut found = commission(&mut bench, &plan(), &mut yes);
    // A machine with much else to do may be late more often than a commissioning bears.
    for _ in 0..5 {
        if found != Err(Failure::Stopped(Stopped::Late)) {
            break;
        }
        found = commission(&mut bench, &Plan { acknowledge: true, ..plan() }, &mut yes);
    }
    let found = found.unwrap_or_else(|failure| panic!("{failure}\n{}", yes.told.join("\n")));
    let parameters = ActuatorParameters::reference().aligned();
    let resistance = parameters.joint.motor.resistance / 1.5 + parameters.inverter.on_resistance;
    let measured = found.resistance.resistance.value;
    assert!((measured / resistance - 1.0).abs() < 0.05, "{measured} of {resistance} Ohm");
    let kept = |setting| joint.number(Field::Setting(setting)).unwrap();
    assert_eq!(kept(Setting::PolePairs) as usize, parameters.windings.pole_pairs);
    let zero = kept(Setting::ElectricalZero);
    assert!((zero - zero.round()).abs() < 5.0 / 360.0, "{zero} turns");
    joint.require_off("what follows").unwrap();

    let files = page::files(&found, NODE).unwrap();
    let text = |number: usize| String::from_utf8(files[number].contents.clone()).unwrap();
    assert!(text(0).contains("Commissioning of node 5") && text(0).contains("pole pairs"));
    let values: toml::Table = text(1).parse().unwrap();
    assert_eq!(values["motor"]["pole-pairs"].as_integer(), Some(7), "{}", text(1));
    let json = page::json(&found, NODE);
    let settings = json["settings"].as_object().unwrap();
    assert_eq!((settings.len(), &json["node"]), (found.settings.len(), &5.into()), "{json}");
    assert_eq!(settings["motor.pole-pairs"]["value"], 7.0, "{json}");
}

pub fn a_commissioning_prints_json_alone_where_that_is_asked_for() {
    let served = Served::joints_on_slcan();
    let folder = tempfile::tempdir().unwrap();
    let run = |reset: &str| {
        let line = format!("{COMMISSION}{reset} --bus {} --node {NODE}", served.bus());
        let output = program().current_dir(&folder).args(line.split(' ')).output().unwrap();
        (output.status.success(), output.stdout, String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (mut done, mut result, mut told) = run("");
    // This joint lives in real time, and a machine with much else to do may be late: what fails prints no result.
    for _ in 0..5 {
        assert!(told.contains("error: ") != done, "{told}");
        if done {
            break;
        }
        assert!(result.is_empty(), "{told}");
        (done, result, told) = run(" --reset");
    }
    // That it may be late for good is no matter of this test.
    if !done {
        assert!(told.contains(&Stopped::Late.to_string()), "{told}");
        return;
    }
    let value: serde_json::Value = serde_json::from_slice(&result).unwrap();
    assert_eq!((&value["node"], &value["settings"]["motor.pole-pairs"]["value"]), (&5.into(), &7.0.into()), "{value}");
    let resistance = &value["settings"]["motor.resistance"];
    assert!(resistance["standard_error"].as_f64().is_some_and(|error| error > 0.0), "{value}");
}
