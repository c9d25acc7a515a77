//! A joint learns from a page. A busy machine may miss held-messages or a joint's frames: it is done again.

use crate::led::{Led, Next, TIMES};
use crate::page::Page;
use crate::punctual;
use crate::security::get;
use crate::served::{NODE, Served};
use joint_firmware::objects::field::Field;
use joint_firmware::objects::settings::Setting;
use panel::reports::POLICY;
use serde_json::{Value, json};

const KEY: &str = "retrain";
/// The stage in which the joint is recorded.
const RECORDED: &str = "excite and record";

/// The smallest round that still learns.
fn wanted(acknowledge: bool) -> Value {
    json!({ "wanted": { "excitation": 4.0, "validation": 2.5, "restarts": 0, "acknowledge": acknowledge } })
}

/// Reasons for which a machine that was late ends a round: of the page, the joint, and what was learned from gaps.
fn late(error: &str) -> bool {
    ["not held any more", "deadline", "no sample", "keeps the image", "samples"].iter().any(|word| error.contains(word))
}

/// Leads a round, letting go as soon as the joint rests.
fn learned(page: &mut Page, acknowledge: bool) -> Result<Value, String> {
    let mut led = Led::begin(page, KEY, wanted(acknowledge));
    let (mut asked, mut rested) = (0, false);
    let ended = loop {
        match led.next() {
            Next::Question(question) => {
                led.page.let_go(true);
                asked = question;
                led.agree(question);
            }
            // What follows is computed.
            Next::Stage(stage) if asked == 1 && stage != RECORDED && !stage.starts_with("search an") && !rested => {
                rested = true;
                led.page.let_go(true);
            }
            Next::Stage(_) => {}
            Next::End(ended) => break ended,
        }
    };
    led.page.let_go(true);
    assert!(ended.is_err() || (asked == 2 && rested), "{asked} {rested}");
    ended
}

pub fn a_joint_learns_and_what_was_let_go_while_it_computed_is_held_again() {
    punctual::round(|_| a_round_of_a_new_joint(), Result::is_err).unwrap();
}

/// One whole round; an error where less was learned than a machine in time has it.
fn a_round_of_a_new_joint() -> Result<(), String> {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.commands();
    let mut outcome = Err(String::new());
    for attempt in 0..TIMES {
        outcome = learned(&mut page, attempt > 0);
        match &outcome {
            Err(error) if late(error) => {}
            _ => break,
        }
    }
    let told = outcome.unwrap();
    let [before, after] = ["before", "after"].map(|state| told[state]["residual"].as_f64().unwrap());
    if after >= 0.7 * before {
        return Err(told.to_string());
    }
    assert!(told["verdict"].as_str().unwrap().contains("Compensation removes"), "{told}");
    let images = page.answer(json!("images")).unwrap();
    assert_eq!((&images["active"]["version"], &images["previous"]), (&told["version"], &Value::Null), "{images}");
    assert!(images["life"].as_str().unwrap().contains("nothing staged"), "{images}");
    // What is offered to be saved is the image that acts, and what it was learned from.
    let files = page.seen.iter().rev().find_map(|message| message[KEY]["files"].as_array()).unwrap();
    let file = |name: &str| files.iter().find(|file| file["name"] == json!(name)).unwrap();
    let image = file("friction.img")["bytes"].as_array().unwrap();
    let image = image.iter().map(|byte| byte.as_u64().unwrap() as u8).collect::<Vec<_>>();
    let joint = served.joints.joint();
    assert_eq!(joint.active_image().unwrap(), image);
    let table = file("log.csv")["text"].as_str().unwrap();
    assert!(table.starts_with("time_s,position_rad,") && table.lines().count() > 500, "{}", table.lines().count());
    let report = file("report.html");
    assert!(report["text"].as_str().unwrap().contains("<html"));
    is_shown_in_a_box(&served, report);
    joint.require_off("what follows").unwrap();
    // Live values come again.
    page.sees("velocity-actual-value", |velocity| velocity.abs() < 0.05);
    Ok(())
}

/// A report is read at its path alone, by this server's page, with a policy that runs nothing.
fn is_shown_in_a_box(served: &Served, report: &Value) {
    let (path, own) = (report["path"].as_str().unwrap(), served.address.to_string());
    let (status, head, body) = get(served.address, path, &own, "");
    assert!(status == 200 && body == report["text"].as_str().unwrap(), "{status} {head}");
    let policies = head.lines().filter(|line| line.starts_with("content-security-policy:")).collect::<Vec<_>>();
    assert_eq!(policies, [format!("content-security-policy: {POLICY}")]);
    assert!(POLICY.starts_with("sandbox;") && !POLICY.contains("script"), "{POLICY}");
    assert_eq!(get(served.address, path, "evil.example", "").0, 403);
    assert_eq!(get(served.address, path, &own, "Origin: http://evil.example\r\n").0, 403);
    assert_eq!(get(served.address, &format!("{path}0"), &own, "").0, 404);
}

pub fn what_is_let_go_while_the_joint_moves_ends_a_round_and_keeps_what_it_had() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    page.commands();
    let request = |served: &Served| served.joints.joint().raw(Field::AtOnce(Setting::Request)).unwrap();
    let before = request(&served);
    let refused = json!({ "wanted": { "excitation": 1.9, "validation": 2.5, "restarts": 0, "acknowledge": false } });
    let error = page.answer(json!({ KEY: refused })).unwrap_err();
    assert_eq!(error, "recorded motions: 1.9 s is outside 2 to 120 s");
    // A no to the first question: nothing has moved.
    let error = Led::begin(&mut page, KEY, wanted(false)).answer_all(Some(1)).unwrap_err();
    assert!(error.contains("ended early"), "{error}");

    let ways: [fn(&mut Page); 3] = [
        |page| page.let_go(true),
        |page| page.let_go(false),
        |page| {
            page.tell(json!("stop"));
        },
    ];
    for way in ways {
        let mut led = Led::begin(&mut page, KEY, wanted(true));
        let ended = loop {
            match led.next() {
                Next::Question(question) => {
                    assert_eq!(question, 1, "it goes on");
                    let error = Page::connect(served.address, "default").answer(json!("images")).unwrap_err();
                    assert!(error.contains("the joint learns"), "{error}");
                    led.agree(question);
                }
                Next::Stage(stage) if stage == RECORDED => way(led.page),
                Next::Stage(_) => {}
                Next::End(ended) => break ended.unwrap_err(),
            }
        };
        led.page.let_go(true);
        assert!(ended.contains("not held any more") || ended.contains("STOP"), "{ended}");
        served.joints.joint().require_off("what follows").unwrap();
        assert_eq!(request(&served), before);
        let images = page.answer(json!("images")).unwrap();
        assert!(images["active"].is_null() && images["life"].as_str().unwrap().contains("nothing staged"), "{images}");
    }
}
