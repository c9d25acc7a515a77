//! Messages of each part of the page, from start to end.

use crate::page::Page;
#[cfg(unix)]
use crate::program::Program;
use crate::served::{Joints, NODE, PATIENCE, Served};
use bus::client::Command;
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use jointctl::remote::telemetry::USUAL;
use jointctl::remote::{Entry, RemoteJoint, Telemetry};
use node::SampleImage;
use serde_json::{Value, json};
use std::time::Duration;

const POSITION: &str = "position-actual-value";
const VELOCITY: &str = "velocity-actual-value";
const DISABLED: &str = "disabled (switch on disabled)";

fn jog(velocity: f64) -> Value {
    json!({ "jog": { "velocity": velocity } })
}

pub fn live_values_and_states_come_as_the_joint_is_jogged_and_the_table_holds_them() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    assert!(page.seen.contains(&json!({ "role": "commands" })), "{:?}", page.seen);
    for wanted in [POSITION, VELOCITY, "torque-actual-value", "torque-demand", "compensation-torque", "permitted-part"]
    {
        assert!(page.signals.iter().any(|signal| signal == wanted), "{wanted}: {:?}", page.signals);
    }
    page.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
    page.move_until(&jog(0.8), VELOCITY, |velocity| velocity > 0.7);
    page.let_go(true);
    assert_eq!(page.ended(), ("not held any more".to_owned(), DISABLED.to_owned()));
    page.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
    let states = page.seen.iter().filter(|message| message["event"]["kind"] == json!("state"));
    let states = states.filter_map(|message| message["event"]["text"].as_str()).collect::<Vec<_>>();
    for state in [DISABLED, "enabled (operation enabled)"] {
        assert!(states.contains(&state), "{state}: {states:?}");
    }
    // Minima stand below maxima, and times go on.
    let mut last = -1.0;
    for live in page.seen.iter().filter_map(|message| message.get("live")) {
        let strokes = live["t"].as_array().unwrap().iter().zip(live["low"].as_array().unwrap());
        for ((time, low), high) in strokes.zip(live["high"].as_array().unwrap()) {
            assert!(time.as_f64().unwrap() > last && low.as_array().unwrap().len() == page.signals.len());
            last = time.as_f64().unwrap();
            for (low, high) in low.as_array().unwrap().iter().zip(high.as_array().unwrap()) {
                assert!(low.as_f64() <= high.as_f64());
            }
        }
    }
    let table = page.answer(json!("csv")).unwrap();
    let table = table.as_str().unwrap();
    let header = table.lines().next().unwrap();
    assert!(header.starts_with("time_s,position-actual-value_rad,velocity-actual-value_rad_s,"), "{header}");
    let fastest = table.lines().skip(1).filter_map(|line| line.split(',').nth(2)?.parse().ok()).fold(0.0, f64::max);
    assert!(fastest > 0.7, "{fastest}");
    // Slow values have come beside them.
    page.until(|message| (message["slow"]["name"] == json!("winding-temperature")).then_some(()));
    let told =
        |message: &Value| message["slow"]["value"].as_f64().filter(|_| message["slow"]["name"] == json!("bus-load"));
    let load = page.seen.iter().find_map(told).unwrap_or_else(|| page.until(told));
    assert!(load > 0.0 && load < 100.0, "{load} %");
}

pub fn friction_is_drawn_by_its_parts_and_as_before() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.commands();
    page.answer(json!({ "upload": { "image": SampleImage::constant(1, 0.5), "usage": "commit" } })).unwrap();
    page.answer(json!({ "set": { "values": [["requested-model", "1"]] } })).unwrap();
    let parts = ["physical-torque", "network-torque", "pre-sliding-torque", "adaptation-torque"];
    let draw = |page: &mut Page, by_part: bool| {
        page.answer(json!({ "draw": { "by_part": by_part } })).unwrap();
        let hello = page.seen.iter().rev().find_map(|message| message.get("hello")).unwrap();
        let names = hello["signals"].as_array().unwrap().iter();
        page.signals = names.map(|signal| signal["name"].as_str().unwrap().to_owned()).collect();
        parts.map(|part| page.signals.iter().any(|signal| signal == part))
    };
    assert_eq!(draw(&mut page, true), [true; 4]);
    assert!(!page.signals.iter().any(|signal| signal == "external-torque"));
    page.move_until(&jog(0.3), "physical-torque", |torque| (torque - 0.5).abs() < 0.002);
    page.let_go(true);
    assert_eq!(page.ended().1, DISABLED);
    assert_eq!(draw(&mut page, false), [false; 4]);
    page.sees("external-torque", f64::is_finite);
}

pub fn every_motion_goes_where_it_was_asked_to_go_and_ends_disabled() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    let start = page.until(|message| message["live"]["high"].as_array()?.last()?[0].as_f64());
    let sine = json!({ "sine": { "amplitude": 0.15, "frequency": 1.0 } });
    let steps = json!({ "steps": { "step": -0.3, "dwell": 0.3 } });
    let spring = json!({ "impedance": { "offset": 0.4, "stiffness": 60.0, "damping": 2.0 } });
    page.move_until(&jog(-0.5), POSITION, |position| position < start - 0.05);
    page.let_go(true);
    assert_eq!(page.ended().1, DISABLED);
    for (motion, way) in [(sine, 0.1), (steps, -0.25), (spring, 0.25)] {
        page.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
        let from = page.until(|message| message["live"]["high"].as_array()?.last()?[0].as_f64());
        page.move_until(&motion, POSITION, |position| (position - from) / way > 1.0);
        page.let_go(true);
        assert_eq!(page.ended().1, DISABLED, "{motion}");
    }
    assert_eq!(served.joints.joint().faults().unwrap(), []);
}

pub fn a_motion_beyond_a_limit_is_refused_by_name() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    for (motion, expected) in [
        (jog(-1e3), "velocity-limit (2103h:2)"),
        (json!({ "sine": { "amplitude": 999.0, "frequency": 0.01 } }), "highest-position (2103h:4)"),
        (
            json!({ "sine": { "amplitude": 0.1, "frequency": 20.1 } }),
            "the frequency is 20.1 Hz, must lie in 0.01 to 20",
        ),
        (json!({ "sine": { "amplitude": 1.0, "frequency": 20.0 } }), "velocity-limit (2103h:2)"),
        (json!({ "steps": { "step": 0.1, "dwell": 0.0 } }), "the dwell is 0 s, must lie in 0.05 to 60 s"),
        (json!({ "impedance": { "offset": 0.0, "stiffness": 1e5, "damping": 0.0 } }), "stiffness-range (2012h:3)"),
    ] {
        let hold = page.press();
        let error = page.answer(json!({ "move": { "hold": hold, "motion": motion } })).unwrap_err();
        assert!(error.contains(expected), "{motion}: {error}");
    }
    assert!(page.seen.iter().all(|message| message.get("motion").is_none()));
}

pub fn a_robot_is_told_where_it_is_given() {
    let hello = |served: &Served| {
        let mut page = Page::connect(served.address, "default");
        page.until(|message| message.get("hello").cloned())
    };
    let robot = &hello(&Served::arm(&[NODE, 6, 7]))["robot"];
    assert_eq!((&robot[2]["name"], &robot[2]["node"], &robot[2]["parent"]), (&json!("elbow"), &json!(7), &json!(1)));
    assert!(hello(&Served::joints(&[NODE]))["robot"].is_null());
}

pub fn joints_on_the_bus_and_what_they_miss_are_listed() {
    let served = Served::joints(&[NODE, 9]);
    let mut page = Page::open(served.address);
    let joints = page.answer(json!("scan")).unwrap();
    let nodes = joints.as_array().unwrap().iter().map(|joint| joint["node"].as_u64().unwrap()).collect::<Vec<_>>();
    assert_eq!(nodes, [5, 9], "{joints}");
    for joint in joints.as_array().unwrap() {
        assert_eq!((&joint["faults"], &joint["state"]), (&json!("none"), &json!(DISABLED)), "{joint}");
        assert!(
            joint["supply"].as_str().unwrap().ends_with(" V") && joint["winding"].as_str().unwrap().ends_with("°C")
        );
    }
    let list = page.answer(json!("checklist")).unwrap();
    let done = |name: &str| {
        let found = list.as_array().unwrap().iter().find(|item| item["name"] == json!(name));
        found.unwrap_or_else(|| panic!("{name}: {list}"))["done"].as_bool().unwrap()
    };
    for name in ["supply", "faults", "storage", "encoder", "motor and encoder", "last start"] {
        assert!(done(name), "{name}: {list}");
    }
    for name in ["friction image", "compensation requested", "owner"] {
        assert!(!done(name), "{name}: {list}");
    }
    let slow = |message: &Value| Some(&message["slow"]).filter(|slow| slow["name"] == json!("reason")).cloned();
    assert_eq!(page.until(slow)["shown"], json!("switched off"));
    // The other joint can be looked at without a page that commands it, which may come later.
    let mut card = Page::connect(served.address, "9/look");
    assert_eq!(card.until(|message| message["hello"]["node"].as_u64()), 9);
    assert!(card.seen.contains(&json!({ "role": "looks" })));
    let error = card.answer(json!({ "set": { "values": [["damping", "3"]] } })).unwrap_err();
    assert_eq!(error, "this page looks on, and may stop the joint");
    // The other joint has a page of its own.
    let mut other = Page::connect(served.address, "9");
    assert_eq!(other.until(|message| message["hello"]["node"].as_u64()), 9);
    assert!(other.seen.contains(&json!({ "role": "commands" })));
}

pub fn joints_without_a_node_id_get_one() {
    let served = Served::joints(&[NODE, 255]);
    let mut page = Page::open(served.address);
    let first = |first: u8| json!({ "address": { "first": first } });
    let error = page.answer(first(128)).unwrap_err();
    assert!(error.contains("128"), "{error}");
    let given = page.answer(first(9)).unwrap();
    assert_eq!((&given[0]["node"], given.as_array().unwrap().len()), (&json!(9), 1), "{given}");
    let joints = page.answer(json!("scan")).unwrap();
    let nodes = joints.as_array().unwrap().iter().map(|joint| joint["node"].as_u64().unwrap()).collect::<Vec<_>>();
    assert_eq!(nodes, [5, 9], "{joints}");
    assert_eq!(page.answer(first(9)).unwrap(), json!([]));
}

#[cfg(unix)]
pub fn where_nobody_but_a_new_joint_is_the_page_gives_it_its_node_id_and_shows_it() {
    let bus = format!("udp:239.74.163.9:{}", bus::free_port().unwrap());
    let _joints = Joints::on(&bus, &[255]);
    // A node that is not there is waited for as long before each question of the page.
    let program = Program::within(Duration::from_secs(3), &bus, &[]);
    let mut page = Page::connect(program.address, "default");
    page.commands();
    assert_eq!(page.answer(json!("scan")).unwrap(), json!([]));
    assert_eq!(page.answer(json!("checklist")).unwrap_err(), "node 5 has not answered yet");
    let given = page.answer(json!({ "address": { "first": 5 } })).unwrap();
    assert_eq!((&given[0]["node"], given.as_array().unwrap().len()), (&json!(5), 1), "{given}");
    assert_eq!(page.until(|message| message["hello"]["node"].as_u64()), 5);
    assert!(page.answer(json!("checklist")).unwrap().as_array().is_some_and(|items| !items.is_empty()));
}

pub fn a_fault_is_told_with_its_emcy() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    assert_eq!(page.answer(json!("history")).unwrap()["steps"], json!([]));
    // A supply that counts as too low from now on.
    let set = json!({ "set": { "values": [["lowest-bus-voltage", "90"], ["highest-bus-voltage", "95"], ["regeneration-band", "1"]] } });
    page.answer(set).unwrap();
    let emcy = page.until(|message| {
        message["event"]["text"].as_str().filter(|_| message["event"]["kind"] == json!("emcy")).map(str::to_owned)
    });
    assert!(emcy.starts_with("node 5: EMCY 3"), "{emcy}");
    let mut faults = page.seen.iter().filter(|message| message["event"]["kind"] == json!("faults"));
    let last = faults.next_back().map(|message| message["event"]["text"].as_str().unwrap().to_owned());
    let told = last.filter(|text| text != "none").unwrap_or_else(|| {
        page.until(|message| {
            let event = message.get("event").filter(|event| event["kind"] == json!("faults"))?;
            event["text"].as_str().filter(|text| *text != "none").map(str::to_owned)
        })
    });
    assert!(told.contains("voltage"), "{told}");
    let list = page.answer(json!("checklist")).unwrap();
    let open = list.as_array().unwrap().iter().filter(|item| item["done"] == json!(false));
    let open = open.map(|item| item["name"].as_str().unwrap()).collect::<Vec<_>>();
    assert!(open.contains(&"supply") && open.contains(&"faults"), "{open:?}");
    // The steps before it: the last one has the fault, the first one of them has not.
    let history = page.answer(json!("history")).unwrap();
    let (signals, steps) = (history["signals"].as_array().unwrap(), history["steps"].as_array().unwrap());
    assert_eq!((steps.len(), &steps[0]["step"], &steps[63]["step"]), (64, &json!(-63), &json!(0)), "{history}");
    assert!(steps[63]["faults"].as_str().unwrap().contains("voltage") && steps[0]["faults"] == json!(""), "{history}");
    let supply = signals.iter().position(|signal| signal["name"] == json!("supply")).unwrap();
    let volts = steps[63]["signals"][supply].as_f64().unwrap();
    assert!((10.0..60.0).contains(&volts), "{volts} V");
}

pub fn objects_are_read_set_stored_exported_and_imported() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    let objects = page.answer(json!("objects")).unwrap();
    let limit = |objects: &Value| {
        let found = objects.as_array().unwrap().iter().find(|object| object["name"] == json!("torque-limit"));
        found.unwrap().clone()
    };
    let before = limit(&objects);
    assert_eq!(
        (&before["unit"], &before["object"], &before["setting"]),
        (&json!("Nm"), &json!("2103h:1"), &json!(true))
    );
    assert_eq!(before["limits"], json!([0.01, 2000.0]));
    assert!(before["text"].as_str().unwrap().contains("Largest torque"), "{before}");
    let exported = page.answer(json!("export")).unwrap().as_str().unwrap().to_owned();
    assert!(exported.contains("command_deadline = 0.5") && exported.contains("node_id = 5"), "{exported}");

    let set = |values: Value| json!({ "set": { "values": values } });
    let less = 0.9 * before["value"].as_f64().unwrap();
    let done = page.answer(set(json!([["torque-limit", less.to_string()], ["damping", "3"]]))).unwrap();
    assert_eq!(done[1]["shown"], json!("3 Nm s/rad"), "{done}");
    let now = limit(&page.answer(json!("objects")).unwrap());
    assert!((now["value"].as_f64().unwrap() / less - 1.0).abs() < 1e-6, "{now}");
    for (values, expected) in [
        (json!([["torque-limt", "5"]]), "did you mean torque-limit"),
        (json!([["torque-limit", "much"]]), "'much' is no number"),
        (json!([["torque-limit", "5000"]]), "5000 Nm is outside 0.01 to 2000 Nm"),
        (json!([["position-actual-value", "1"]]), "is read-only"),
        // Each may be, both may not: nothing is changed.
        (json!([["torque-limit", "1"], ["lowest-position", "5"], ["highest-position", "4"]]), "nothing was changed"),
    ] {
        let error = page.answer(set(values)).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
    let told = |page: &mut Page| page.answer(json!("stored")).unwrap().as_str().unwrap().to_owned();
    assert!(told(&mut page).starts_with("changed since it was stored"));
    page.answer(json!("store")).unwrap();
    assert!(told(&mut page).starts_with("as stored 20"));
    let kept = |page: &mut Page| {
        let list = page.answer(json!("checklist")).unwrap();
        list.as_array().unwrap().iter().find(|item| item["name"] == json!("configuration")).unwrap()["done"].clone()
    };
    assert_eq!(kept(&mut page), json!(true));
    // What differs from before is named, and not set.
    let compared = page.answer(json!({ "compare": { "with": { "file": &exported } } })).unwrap();
    let differ = compared.as_array().unwrap().iter().find(|entry| entry["name"] == json!("torque-limit")).unwrap();
    assert_eq!((&differ["value"], compared.as_array().unwrap().len()), (&before["value"], 2), "{compared}");
    assert_eq!(limit(&page.answer(json!("objects")).unwrap()), now);
    let board = page.answer(json!({ "compare": { "with": { "board": "moteus-r4" } } })).unwrap();
    assert!(board.as_array().unwrap().len() > 5, "{board}");
    let error = page.answer(json!({ "compare": { "with": { "board": "moteus" } } })).unwrap_err();
    assert_eq!(error, "'moteus' is no board; there are b-g431b-esc1 and moteus-r4");
    // The file of before brings everything of before back.
    let changed = page.answer(json!({ "import": { "text": &exported } })).unwrap();
    let names = changed.as_array().unwrap().iter().map(|entry| entry["name"].as_str().unwrap()).collect::<Vec<_>>();
    assert!(names.contains(&"torque-limit") && names.len() == 2, "{changed}");
    assert_eq!(kept(&mut page), json!(false));
    assert_eq!(limit(&page.answer(json!("objects")).unwrap()), before);
    assert_eq!(page.answer(json!("export")).unwrap(), json!(exported));
    let broken = exported.replace("torque = ", "torque = -");
    let error = page.answer(json!({ "import": { "text": broken } })).unwrap_err();
    assert!(error.contains("joint.toml") && error.contains("torque"), "{error}");
    let error = page.answer(json!({ "import": { "text": "torque" } })).unwrap_err();
    assert!(error.contains("line 1"), "{error}");
}

pub fn a_store_keeps_what_is_set_and_not_the_tpdos_that_the_page_watches_by() {
    fn mapped(joint: &RemoteJoint) -> Vec<[u32; 2]> {
        let number = |index, sub_index| u32::from_le_bytes(joint.node().number(index, sub_index).unwrap());
        let count = |index| joint.node().number::<1>(index, 0).unwrap()[0].into();
        let pdo = |pdo: u16| [[number(0x1800 + pdo, 1), count(0x1A00 + pdo)], [number(0x1A00 + pdo, 1), 0]];
        (0..4).flat_map(pdo).collect()
    }
    let new = mapped(&Joints::new(&[NODE]).joint());
    let mut served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
    let joint = served.joints.joint();
    assert_ne!(mapped(&joint), new, "nothing is watched");
    page.answer(json!({ "set": { "values": [["damping", "3"]] } })).unwrap();
    page.answer(json!("store")).unwrap();
    // It goes on.
    page.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
    served.end();
    joint.network().reset_and_wait(Command::ResetNode, NODE, PATIENCE).unwrap();
    assert_eq!(mapped(&joint), new);
    assert_eq!(joint.number(Field::Setting(Setting::Damping)).unwrap(), 3.0);
}

pub fn an_image_is_shadowed_tried_discarded_committed_and_rolled_back() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    let upload = |image: &[u8], usage: Value| json!({ "upload": { "image": image, "usage": usage } });
    let first = SampleImage::constant(1, 0.5);
    let told = page.answer(upload(&first, json!({ "shadow": 60.0 }))).unwrap();
    assert!(told["life"].as_str().unwrap().contains("in shadow") && told["active"].is_null(), "{told}");
    let told = page.answer(json!({ "use": { "usage": { "trial": 60.0 } } })).unwrap();
    assert!(told["life"].as_str().unwrap().contains("on trial"), "{told}");
    let told = page.answer(json!("discard")).unwrap();
    assert!(told["life"].as_str().unwrap().contains("nothing staged"), "{told}");
    page.answer(upload(&first, json!("commit"))).unwrap();
    let told = page.answer(upload(&SampleImage::constant(2, 0.25), json!("commit"))).unwrap();
    assert_eq!((&told["active"]["version"], &told["previous"]["version"]), (&json!(2), &json!(1)), "{told}");
    let told = page.answer(json!("roll-back")).unwrap();
    assert_eq!(told["active"]["version"], json!(1), "{told}");
    // Compensation is switched as any object is.
    page.answer(json!({ "set": { "values": [["requested-model", "1"]] } })).unwrap();
    assert_eq!(page.answer(json!("images")).unwrap()["requested"], json!(1));
    let mut damaged = first;
    damaged[40] ^= 1;
    let error = page.answer(upload(&damaged, json!("verify"))).unwrap_err();
    assert!(error.contains("damaged: checksum"), "{error}");
    let error = page.answer(upload(&[], json!("commit"))).unwrap_err();
    assert!(error.contains("0 bytes"), "{error}");
}

pub fn another_client_that_takes_the_tpdos_ends_the_live_values_until_they_are_asked_for() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.sees(VELOCITY, |_| true);
    let other = served.joints.joint();
    // A question of the page between two of its own is told to both, and asked again.
    let telemetry = loop {
        match Telemetry::begin(&other, &USUAL[..3]) {
            Ok(telemetry) => break telemetry,
            Err(error) => assert!(error.to_string().contains("another client"), "{error}"),
        }
    };
    let failure = page.until(|message| message["failure"].as_str().map(str::to_owned));
    assert!(failure.contains("another client changes the TPDOs"), "{failure}");
    telemetry.end().unwrap();
    assert_eq!(other.state().unwrap(), jointctl::remote::condition::state_of(0x40));
    drop(other);
    page.answer(json!("look")).unwrap();
    page.sees(VELOCITY, |_| true);
    // The names are those of the table.
    assert!(page.signals.iter().all(|name| Entry::one(name).is_ok()));
}
