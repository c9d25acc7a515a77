//! A joint is commissioned from a page. A busy machine may miss held-messages or a joint's frames: it is done again.

use crate::led::{Led, Next, TIMES};
use crate::page::Page;
use crate::served::{NODE, PATIENCE, Served};
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use jointctl::remote::RemoteJoint;
use plant::ActuatorParameters;
use serde_json::{Value, json};
use std::time::Instant;

/// Little travel, so that it does not take long.
fn plan(acknowledge: bool) -> Value {
    json!({ "current": 8.0, "travel": 0.4, "turn": false, "acknowledge": acknowledge })
}

fn begin(page: &mut Page, acknowledge: bool) -> Led<'_> {
    Led::begin(page, "commission", json!({ "plan": plan(acknowledge), "index_only": false }))
}

/// Returns `true` if a machine was late.
fn late(ended: &Result<Value, String>) -> bool {
    let words = ["not held any more", "frames"];
    ended.as_ref().is_err_and(|error| words.iter().any(|word| error.contains(word)))
}

/// Replaces what a commissioning finds by wrong values.
fn forget(page: &mut Page) {
    let values = json!([["resistance", "1.0"], ["pole-pairs", "3"], ["electrical-zero", "0.1"]]);
    page.answer(json!({ "set": { "values": values } })).unwrap();
}

fn pole_pairs(joint: &RemoteJoint) -> u64 {
    joint.raw(Field::Setting(Setting::PolePairs)).unwrap()
}

pub fn a_joint_is_commissioned_with_the_motor_that_it_has_and_a_no_leaves_it_as_it_was() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.commands();
    forget(&mut page);
    // The third question is whether the joint shall take what was measured.
    let mut lead = |no| {
        let mut ended = begin(&mut page, false).answer_all(no);
        for _ in 0..TIMES {
            if !late(&ended) {
                break;
            }
            ended = begin(&mut page, true).answer_all(no);
        }
        ended
    };
    let declined = lead(Some(3)).unwrap_err();
    assert!(declined.contains("not confirmed"), "{declined}");
    assert_eq!(pole_pairs(&served.joints.joint()), 3, "nothing was taken");
    let found = lead(None).unwrap();
    let parameters = ActuatorParameters::reference().aligned();
    let joint = served.joints.joint();
    assert_eq!(pole_pairs(&joint) as usize, parameters.windings.pole_pairs);
    joint.require_off("what follows").unwrap();
    let settings = found["settings"].as_array().unwrap();
    let taken = |name: &str| settings.iter().find(|setting| setting["name"] == json!(name)).unwrap()["value"].as_f64();
    assert_eq!(taken("pole-pairs"), Some(7.0), "{found}");
    let resistance = parameters.joint.motor.resistance / 1.5 + parameters.inverter.on_resistance;
    assert!(
        page.seen.iter().any(|message| message["commission"]["found"].as_str().is_some_and(|text| {
            let ohm = text.split(' ').next().and_then(|number| number.parse::<f64>().ok());
            text.contains('Ω') && ohm.is_some_and(|ohm| (ohm / resistance - 1.0).abs() < 0.05)
        })),
        "{resistance}"
    );
    let names = found["files"].as_array().unwrap().iter().map(|file| file["name"].as_str().unwrap());
    assert_eq!(names.collect::<Vec<_>>(), ["commission.html", "commission.toml"]);
    // Live values come again.
    let before = page.seen.len();
    page.sees("velocity-actual-value", |velocity| velocity.abs() < 0.05);
    assert!(page.seen.len() > before);
}

/// Leads a page to the first stage under current; false where the machine was late.
fn under_current(led: &mut Led<'_>) -> bool {
    loop {
        match led.next() {
            Next::Question(question) => led.agree(question),
            Next::Stage(stage) if stage.contains("under current") => return true,
            Next::Stage(_) => {}
            Next::End(ended) => {
                assert!(late(&ended), "{ended:?}");
                led.page.let_go(true);
                return false;
            }
        }
    }
}

/// Ends a commissioning under current in a way; what it says.
fn ended_by(served: &Served, page: &mut Page, way: impl Fn(&mut Page)) -> String {
    for _ in 0..TIMES {
        let mut led = begin(page, true);
        if !under_current(&mut led) {
            continue;
        }
        way(led.page);
        let ended = loop {
            match led.next() {
                Next::End(ended) => break ended.unwrap_err(),
                Next::Stage(_) => {}
                Next::Question(question) => panic!("it goes on to question {question}"),
            }
        };
        led.page.let_go(true);
        let joint = served.joints.joint();
        joint.require_off("what follows").unwrap();
        assert_eq!(pole_pairs(&joint), 3, "nothing was taken");
        return ended;
    }
    panic!("it did not come under current in {TIMES} attempts");
}

pub fn what_is_let_go_stopped_or_gone_ends_a_commissioning_and_changes_nothing() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.commands();
    forget(&mut page);
    let told = ended_by(&served, &mut page, |page| page.let_go(true));
    assert!(told.contains("not held any more"), "{told}");
    let told = ended_by(&served, &mut page, |page| page.let_go(false));
    assert!(told.contains("not held any more"), "{told}");
    let told = ended_by(&served, &mut page, |page| {
        page.tell(json!("stop"));
    });
    assert!(told.contains("STOP") || told.contains("not held any more"), "{told}");
    // The page is gone while its joint is under current: the next one commands a joint that is off.
    for _ in 0..TIMES {
        if under_current(&mut begin(&mut page, true)) {
            break;
        }
    }
    let mut next = Page::connect(served.address, "default");
    drop(page);
    next.commands();
    let began = Instant::now();
    let refused = loop {
        match next.answer(json!("scan")) {
            Err(error) if error.contains("being commissioned") => assert!(began.elapsed() < PATIENCE),
            other => break other,
        }
    };
    refused.unwrap();
    served.joints.joint().require_off("what follows").unwrap();
    assert_eq!(pole_pairs(&served.joints.joint()), 3);
}

pub fn another_page_sees_the_questions_and_may_not_answer_them() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.commands();
    let mut other = Page::open(served.address);
    let mut led = begin(&mut page, false);
    let question = loop {
        match led.next() {
            Next::Question(question) => break question,
            Next::Stage(_) => {}
            Next::End(ended) => panic!("{ended:?}"),
        }
    };
    other.until(|message| (message["commission"]["question"]["number"] == json!(question)).then_some(()));
    let hold = other.press();
    let error = other.answer(json!({ "agree": { "question": question, "hold": hold } })).unwrap_err();
    assert!(error.contains("another page commands this joint"), "{error}");
    for ask in [json!("objects"), json!({ "set": { "values": [["pole-pairs", "3"]] } })] {
        let error = other.answer(ask).unwrap_err();
        assert!(error.contains("the joint is being commissioned"), "{error}");
    }
    // One that comes now is told where it is.
    let mut third = Page::connect(served.address, "default");
    third.until(|message| (message["commission"]["question"]["number"] == json!(question)).then_some(()));
    assert!(
        led.page
            .answer(json!({ "agree": { "question": question + 1, "hold": null } }))
            .unwrap_err()
            .contains("not open")
    );
    led.page.answer(json!({ "agree": { "question": question, "hold": null } })).unwrap();
    assert!(led.answer_all(None).unwrap_err().contains("not confirmed"));
    let error = led.page.answer(json!({ "agree": { "question": question, "hold": null } })).unwrap_err();
    assert_eq!(error, "no question is open");
    for (changed, expected) in [
        (json!({ "current": 0.05, "travel": 1.0, "turn": true, "acknowledge": false }), "--current is 0.05"),
        (json!({ "current": 8.0, "travel": 1.01, "turn": true, "acknowledge": false }), "--travel is 1.01"),
    ] {
        let error = led.page.answer(json!({ "commission": { "plan": changed, "index_only": false } })).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}
