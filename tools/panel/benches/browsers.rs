//! Ways in which a browser ceases to hold a joint, at instants all over a motion, and when the joint is safe; Linux.
//!
//! `cargo bench -p panel --bench browsers` has Chromium hold the button of a jog, and ends that at 100 instants, or
//! `PANEL_INSTANTS`, by each way in turn. What is told, and where it fails, is as of `stops`, which does the same with
//! a client that is no browser. Times begin as the browser is asked to do it; those of the mouse begin as its event
//! came about, by the event's own time (W3C, "High Resolution Time", section 4), for the driver takes its own time
//! until then, which is told beside.

#![allow(dead_code, reason = "browser and joint are those of the tests, which use more of them")]

#[cfg(target_os = "linux")]
#[path = "../tests/panel/hands.rs"]
mod hands;
#[cfg(target_os = "linux")]
#[path = "../tests/panel/program.rs"]
mod program;
#[cfg(target_os = "linux")]
#[path = "../tests/panel/served.rs"]
mod served;
#[cfg(target_os = "linux")]
mod watched;
#[cfg(target_os = "linux")]
#[path = "../tests/panel/webdriver.rs"]
mod webdriver;

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    #[cfg(target_os = "linux")]
    if std::env::args().any(|argument| argument == "--bench") {
        at_instants::run();
    }
}

#[cfg(target_os = "linux")]
mod at_instants {
    use crate::hands::set;
    use crate::program::Program;
    use crate::served::{NODE, PATIENCE};
    use crate::watched::{MS, REACTION, SPEED, STANDS, Seen, follows, instants, moves, tell, until, wait, watched};
    use crate::webdriver::Browser;
    use joint_firmware::joint::state_machine::State;
    use joint_firmware::joint::{Command, Mode};
    use jointctl::remote::motion::Motion;
    use jointctl::remote::{RemoteError, RemoteJoint};
    use serde_json::{Value, json};
    use std::sync::Mutex;
    use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

    /// A way in which a browser ceases to hold.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Way {
        TabClosed,
        Killed,
        /// All of its processes stand, as on a laptop that sleeps.
        Asleep,
        /// Another tab in front of the page.
        Hidden,
        StopElsewhere,
        /// A command that moves the joint is refused; then the button is let go.
        Command,
    }

    impl Way {
        const ALL: [Self; 6] =
            [Self::TabClosed, Self::Killed, Self::Asleep, Self::Hidden, Self::StopElsewhere, Self::Command];

        const fn name(self) -> &'static str {
            match self {
                Self::TabClosed => "the tab is closed",
                Self::Killed => "the browser is killed",
                Self::Asleep => "the browser stands still",
                Self::Hidden => "another tab is in front",
                Self::StopElsewhere => "STOP in another browser",
                Self::Command => "let go after a command",
            }
        }
    }

    /// Has the page keep when the last event of a kind of its mouse came about, ms since 1970.
    fn keeps(browser: &Browser, event: &str) {
        let kept = "happened = performance.timeOrigin + event.timeStamp";
        browser.value(&format!("void addEventListener('{event}', (event) => {{ {kept}; }}, true)"));
    }

    /// Time that the driver took until the event that a page kept, from when it was asked.
    fn driver(browser: &Browser, asked: SystemTime) -> Duration {
        let happened = Duration::from_secs_f64(browser.value("happened").as_f64().unwrap() / 1e3);
        (UNIX_EPOCH + happened).duration_since(asked).expect("the event came about after it was asked for")
    }

    /// Longest time until the joint no longer follows set-points: that of a page that is silent.
    fn permitted() -> Duration {
        panel::hold::LIMIT + REACTION
    }

    fn looking(program: &Program) -> Browser {
        let browser = Browser::begin();
        browser.open(program.address);
        browser.until("panel.plots.count() > 0");
        browser
    }

    /// Holds the button of a jog towards the middle of the joint's range, until it moves.
    fn press(browser: &Browser, seen: &Mutex<Seen>, acknowledge: bool) {
        browser.until("!document.querySelector('#moves').disabled");
        set(browser, "reset", &format!("checked = {acknowledge}"));
        set(browser, "jog-velocity", &format!("value = '{}'", SPEED[0]));
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            let button = if seen.lock().unwrap().position > 0.0 { "#jog-back" } else { "#jog-forward" };
            browser.show(button);
            browser.mouse(button, "pointerDown");
            let pressed = Instant::now();
            while pressed.elapsed() < PATIENCE && browser.value("panel.isHeld()") == json!(true) {
                if moves(*seen.lock().unwrap()) {
                    return;
                }
            }
            browser.mouse(button, "pointerUp");
        }
        panic!("the joint does not move: {:?}", seen.lock().unwrap());
    }

    /// Has somebody else ask for a motion, who is to be refused.
    fn command(bus: &str) {
        let joint = RemoteJoint::open_within(bus, NODE, PATIENCE).unwrap();
        let command = Command { mode: Mode::Velocity, velocity: -0.6, ..Command::default() };
        let motion = Motion { command, duration: 0.5, rate: 100.0, acknowledge: true };
        let refused = motion.run(&joint, &|| true, &mut |_| {}).unwrap_err();
        assert!(matches!(refused, RemoteError::Commanded { .. }), "{refused}");
    }

    /// For each way, the times of its instants until the joint follows no set-points, and until it stands.
    fn measure(bus: &str, seen: &Mutex<Seen>) -> [Vec<[Duration; 2]>; 6] {
        let mut times = [const { Vec::new() }; 6];
        let (program, mut slowest) = (Program::begin(bus), Duration::ZERO);
        for instant in 0..instants() {
            let which = instant % Way::ALL.len();
            let way = Way::ALL[which];
            let browser = looking(&program);
            let elsewhere = (way == Way::StopElsewhere).then(|| looking(&program));
            press(&browser, seen, instant > 0);
            std::thread::sleep(wait(instant));
            let mouse = match way {
                Way::StopElsewhere => elsewhere.as_ref().map(|elsewhere| (elsewhere, "pointerdown")),
                Way::Command => Some((&browser, "pointerup")),
                _ => None,
            };
            if let Some((browser, event)) = mouse {
                keeps(browser, event);
            }
            if way == Way::Command {
                command(bus);
            }
            if !moves(*seen.lock().unwrap()) {
                panic!("the joint stands before {}: this machine is too busy for real time", way.name());
            }
            let (began, asked) = (Instant::now(), SystemTime::now());
            let done = std::thread::scope(|scope| {
                scope.spawn(|| match way {
                    Way::TabClosed => drop(browser.call("DELETE", "/window", &Value::Null)),
                    Way::Killed => browser.signal("-KILL"),
                    Way::Asleep => browser.signal("-STOP"),
                    Way::Hidden => {
                        let tab = browser.call("POST", "/window/new", &json!({ "type": "tab" }));
                        browser.call("POST", "/window", &json!({ "handle": tab["handle"] }));
                    }
                    Way::StopElsewhere => {
                        if let Some(elsewhere) = &elsewhere {
                            elsewhere.mouse("#stop", "pointerDown");
                        }
                    }
                    Way::Command => browser.mouse("#jog-forward", "pointerUp"),
                });
                until(seen, |seen| !follows(seen));
                let safe = began.elapsed();
                until(seen, |seen| seen.velocity.abs() < STANDS);
                [safe, began.elapsed()]
            });
            let driver = mouse.map_or(Duration::ZERO, |(browser, _)| driver(browser, asked));
            slowest = slowest.max(driver);
            times[which].push(done.map(|time| time.checked_sub(driver).expect("the joint is safe after the event")));
            if way == Way::Asleep {
                browser.signal("-KILL");
            }
            drop((browser, elsewhere));
            until(seen, |seen| matches!(seen.state, State::SwitchOnDisabled | State::Fault));
            std::thread::sleep(MS);
        }
        println!("The driver took at most {:.0} ms until an event of the mouse.", 1e3 * slowest.as_secs_f64());
        times
    }

    pub fn run() {
        let times = watched(measure);
        tell(Way::ALL.into_iter().zip(&times).map(|(way, times)| (way.name(), permitted(), times.as_slice())));
    }
}
