//! Safety of the joint: whatever happens to a page, the joint is left disabled. A second page sees it.

use crate::page::Page;
use crate::served::{Joints, NODE, PATIENCE, Served};
use bus::Frame;
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;
use joint_firmware::joint::{Command, Mode};
use jointctl::remote::motion::Motion;
use jointctl::remote::{RemoteError, RemoteJoint};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tungstenite::Message;

const VELOCITY: &str = "velocity-actual-value";
const DISABLED: &str = "disabled (switch on disabled)";

fn jog() -> Value {
    json!({ "jog": { "velocity": 0.6 } })
}

fn fast(velocity: f64) -> bool {
    velocity > 0.5
}

/// A page whose joint moves, and another one that sees it.
fn moving(served: &Served) -> (Page, Page) {
    let mut page = Page::open(served.address);
    page.commands();
    let mut witness = Page::open(served.address);
    page.move_until(&jog(), VELOCITY, fast);
    witness.follow(&mut page);
    (page, witness)
}

/// Sees a motion end, and the joint stand.
fn stands(witness: &mut Page, reasons: &[&str]) {
    let (told, state) = witness.ended();
    assert!(reasons.contains(&told.as_str()), "{told}");
    assert_eq!(state, DISABLED);
    witness.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
}

pub fn a_page_that_is_gone_leaves_the_joint_disabled_and_the_next_one_commands() {
    let served = Served::joints(&[NODE]);
    let (page, mut witness) = moving(&served);
    assert!(witness.seen.contains(&json!({ "role": "looks" })));
    // End of a browser that is killed: no close frame.
    drop(page);
    stands(&mut witness, &["the page is gone", "not held any more"]);
    witness.commands();
    witness.move_until(&jog(), VELOCITY, fast);
    witness.let_go(true);
    assert_eq!(witness.ended().1, DISABLED);
}

pub fn held_messages_that_stop_coming_stop_the_joint() {
    let served = Served::joints(&[NODE]);
    let (mut page, _witness) = moving(&served);
    // The connection stays, nothing is said.
    page.let_go(false);
    stands(&mut page, &["not held any more"]);
    // A message of the same press that comes late moves nothing; the next press does.
    page.tell(json!({ "held": { "hold": 1 } }));
    page.move_until(&jog(), VELOCITY, fast);
    page.let_go(true);
    stands(&mut page, &["not held any more"]);
    assert_eq!(served.joints.joint().faults().unwrap(), []);
}

/// STOP of either page while the button is held on; on a busy machine the hold may end first, and it is tried again.
fn stop_in_motion(page: &mut Page, witness: &mut Page, of_witness: bool) {
    for _ in 0..20 {
        page.move_until(&jog(), VELOCITY, fast);
        witness.follow(page);
        (if of_witness { &mut *witness } else { &mut *page }).tell(json!("stop"));
        let (reason, state) = witness.sees_end_of(page);
        assert_eq!(state, DISABLED);
        page.let_go(true);
        if reason == "STOP" {
            witness.sees(VELOCITY, |velocity| velocity.abs() < 0.05);
            return;
        }
        assert_eq!(reason, "not held any more");
    }
    panic!("STOP did not end a motion");
}

pub fn stop_stops_whoever_asks_for_it() {
    let served = Served::joints(&[NODE]);
    let (mut page, mut other) = moving(&served);
    page.let_go(true);
    assert_eq!(other.ended().1, DISABLED);
    stop_in_motion(&mut page, &mut other, false);
    stop_in_motion(&mut page, &mut other, true);
    drop(page);
    // No page moves the joint: whoever else commands it is cut off.
    let joint = served.joints.joint();
    let command = Command { mode: Mode::Velocity, velocity: 0.6, ..Command::default() };
    let motion = Motion { command, duration: 1e3, rate: 100.0, acknowledge: false };
    let stopped = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let command = scope.spawn(|| {
            // A question of the page between two of its own ends it before it commands anything.
            while !stopped.load(Ordering::Relaxed) {
                assert!(motion.run(&joint, &|| true, &mut |_| {}).is_err());
            }
        });
        other.sees(VELOCITY, fast);
        // Not begun anew once it was stopped.
        stopped.store(true, Ordering::Relaxed);
        other.tell(json!("stop"));
        let state = other.until(|message| message["stopped"]["state"].as_str().map(str::to_owned));
        assert_eq!(state, DISABLED);
        command.join().unwrap();
    });
    assert_eq!(joint.state().unwrap(), State::SwitchOnDisabled);
}

pub fn a_second_page_looks_and_may_not_change_anything() {
    let served = Served::joints(&[NODE]);
    let (mut page, mut second) = moving(&served);
    let hold = second.press();
    for ask in [
        json!({ "move": { "hold": hold, "motion": jog() } }),
        json!({ "set": { "values": [["torque-limit", "1"]] } }),
        json!("store"),
        json!({ "import": { "text": "" } }),
        json!({ "upload": { "image": [1], "usage": "commit" } }),
        json!({ "use": { "usage": "commit" } }),
        json!("roll-back"),
        json!("discard"),
    ] {
        let error = second.answer(ask.clone()).unwrap_err();
        assert!(error.contains("another page commands this joint"), "{ask}: {error}");
    }
    second.let_go(true);
    // Requests that only look wait for the joint to stand, whoever asks.
    let refused = (0..20).any(|_| {
        page.move_until(&jog(), VELOCITY, fast);
        let answer = page.answer(json!("objects"));
        answer.is_err_and(|error| error.contains("the joint moves"))
    });
    assert!(refused);
    page.let_go(true);
    assert_eq!(page.ended().1, DISABLED);
    assert!(second.answer(json!("checklist")).is_ok());
}

/// Instants at random: so many messages after the joint has its speed, from a generator of its own (Marsaglia,
/// "Xorshift RNGs", 2003).
fn instants() -> impl Iterator<Item = u32> {
    let mut state = 0x2545_F491_u32;
    std::iter::repeat_with(move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state % 12
    })
}

pub fn what_is_not_a_message_stops_the_joint_and_is_told_in_words() {
    let served = Served::joints(&[NODE]);
    let long = "x".repeat((256 << 10) + 1);
    type Sends<'a> = Box<dyn Fn(&mut Page) + 'a>;
    let text = |text: &'static str| -> Sends<'_> { Box::new(move |page| page.send(Message::text(text))) };
    // Each with words of what is said, where the connection still carries them.
    let cases: Vec<(&str, Sends<'_>, &str)> = vec![
        ("no JSON", text("{"), "this is no message of the page"),
        ("another question", text(r#"{"id":1,"ask":"explode"}"#), "this is no message of the page: unknown variant"),
        ("a number too much", text(r#"{"id":1,"ask":{"held":{"hold":-1}}}"#), "this is no message of the page"),
        ("bytes", Box::new(|page| page.send(Message::binary(vec![0u8; 9]))), "messages are text"),
        ("too long", Box::new(|page| page.send(Message::text(long.clone()))), "Message too long: 262145 > 262144"),
        // RFC 6455: a client's frames are masked (5.1), opcode 3 is reserved (5.2), text is UTF-8 (5.6).
        ("no mask", Box::new(|page| page.raw(&[0x81, 0x01, b'x'])), ""),
        ("a reserved opcode", Box::new(|page| page.raw(&[0x83, 0x80, 0, 0, 0, 0])), ""),
        ("no UTF-8", Box::new(|page| page.raw(&[0x81, 0x81, 0, 0, 0, 0, 0xFF])), ""),
        ("half a frame and no more", Box::new(|page| page.raw(&[0x81, 0xFF])), ""),
    ];
    for ((name, sends, words), wait) in cases.into_iter().zip(instants()) {
        let (mut page, mut witness) = moving(&served);
        for _ in 0..wait {
            page.until(|message| message.get("live").map(drop));
        }
        sends(&mut page);
        page.let_go(false);
        let (reason, state) = witness.ended();
        assert!(["the page is gone", "not held any more"].contains(&reason.as_str()), "{name}: {reason}");
        assert_eq!(state, DISABLED, "{name}");
        if name != "half a frame and no more" {
            let said = page.closed();
            assert!(words.is_empty() || said.as_ref().is_some_and(|said| said.contains(words)), "{name}: {said:?}");
        }
    }
}

pub fn another_master_at_the_same_time_ends_in_a_joint_that_is_disabled() {
    let served = Served::joints(&[NODE]);
    let (mut page, _witness) = moving(&served);
    let other = bus::open(&served.joints.bus).unwrap();
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        // One that does not listen before it sends: controlword, mode and velocity of the page's own PDO.
        scope.spawn(|| {
            while !over.load(Ordering::Relaxed) {
                other.send(&Frame::new(0x300 + u16::from(NODE), &[0x0F, 0, 9, 0, 0, 0, 0]).unwrap()).unwrap();
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        let (reason, _) = page.ended();
        page.let_go(true);
        over.store(true, Ordering::Relaxed);
        assert_ne!(reason, "not held any more");
    });
    let joint = served.joints.joint();
    joint.disable().unwrap();
    assert!(matches!(joint.state().unwrap(), State::SwitchOnDisabled | State::Fault));
}

pub fn a_command_is_refused_while_a_page_moves_the_joint_and_the_page_goes_on() {
    let served = Served::joints(&[NODE]);
    let (mut page, _witness) = moving(&served);
    let command = Command { mode: Mode::Velocity, velocity: -0.6, ..Command::default() };
    let motion = Motion { command, duration: 0.5, rate: 100.0, acknowledge: true };
    let joint = served.joints.joint();
    // A busy machine may end the hold, or let a question of the page come between two of the command's.
    for _ in 0..20 {
        let refused = std::thread::scope(|scope| {
            let running = scope.spawn(|| motion.run(&joint, &|| true, &mut |_| {}));
            while !running.is_finished() {
                page.look().unwrap();
            }
            running.join().unwrap()
        });
        if let Err(error @ RemoteError::Commanded { .. }) = refused {
            assert!(error.to_string().contains("nothing was commanded"), "{error}");
            page.sees(VELOCITY, fast);
            page.let_go(true);
            assert_eq!(page.ended(), ("not held any more".into(), DISABLED.into()));
            return;
        }
        page.let_go(true);
        page.seen.clear();
        joint.disable().unwrap();
        page.move_until(&jog(), VELOCITY, fast);
    }
    panic!("a command was never refused");
}

pub fn a_button_that_is_let_go_before_the_joint_is_enabled_moves_nothing() {
    let served = Served::joints(&[NODE]);
    let mut page = Page::open(served.address);
    let hold = page.press();
    page.let_go(true);
    let error = page.answer(json!({ "move": { "hold": hold, "motion": jog() } })).unwrap_err();
    assert!(error.contains("let go before the joint was enabled"), "{error}");
    // A hold that never was is none.
    let error = page.answer(json!({ "move": { "hold": 77, "motion": jog() } })).unwrap_err();
    assert!(error.contains("let go before the joint was enabled"), "{error}");
    assert_eq!(served.joints.joint().state().unwrap(), State::SwitchOnDisabled);
}

pub fn a_server_that_ends_stops_the_joint() {
    let mut served = Served::joints(&[NODE]);
    let (page, witness) = moving(&served);
    served.end();
    let joint = served.joints.joint();
    assert_eq!((joint.state().unwrap(), joint.faults().unwrap()), (State::SwitchOnDisabled, vec![]));
    drop((page, witness));
}

#[cfg(unix)]
pub fn a_program_that_is_terminated_stops_the_joint_and_one_that_is_killed_leaves_it_to_its_deadline() {
    use crate::program::Program;
    use std::process::Command;
    for (signal, faults) in [("-TERM", vec![]), ("-KILL", vec![Fault::StaleCommand])] {
        let port = bus::free_port().unwrap();
        let joints = Joints::on(&format!("slcan:listen://127.0.0.1:{port}"), &[NODE]);
        let client = format!("slcan:tcp://127.0.0.1:{port}");
        let mut program = Program::begin(&client);
        let mut page = Page::open(program.address);
        page.move_until(&jog(), VELOCITY, fast);
        let kill = Command::new("kill").args([signal, &program.child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        program.child.wait().unwrap();
        // The adapter is free again.
        let joint = RemoteJoint::open_within(&client, NODE, PATIENCE).unwrap();
        let wanted = if faults.is_empty() { State::SwitchOnDisabled } else { State::Fault };
        let began = std::time::Instant::now();
        while joint.state().unwrap() != wanted && began.elapsed() < PATIENCE {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert_eq!((joint.state().unwrap(), joint.faults().unwrap()), (wanted, faults), "{signal}");
        drop((page, joints));
    }
}
