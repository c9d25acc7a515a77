//! The page in a browser: Chromium, driven by WebDriver (W3C, "WebDriver", 2018) over plain HTTP.

use crate::served::{NODE, PATIENCE, Served};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

/// Returns `true` if this machine has a browser and its driver.
pub fn is_there() -> bool {
    let answers = |program: &str| Command::new(program).arg("--version").stdout(Stdio::null()).status().is_ok();
    answers("chromedriver") && answers("chromium")
}

/// A browser with one window, which ends with this.
struct Browser {
    driver: Child,
    port: u16,
    session: String,
}

impl Browser {
    fn begin() -> Self {
        let port = bus::free_port().unwrap();
        let driver = Command::new("chromedriver").arg(format!("--port={port}")).stdout(Stdio::null()).spawn();
        let driver = driver.expect("chromedriver: Debian's packages chromium and chromium-driver have it");
        let mut browser = Self { driver, port, session: String::new() };
        let began = Instant::now();
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(began.elapsed() < PATIENCE, "chromedriver does not listen");
            std::thread::yield_now();
        }
        let arguments = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"];
        let options = json!({ "args": arguments });
        let wanted = json!({ "capabilities": { "alwaysMatch": { "goog:chromeOptions": options } } });
        let session = browser.call("POST", "", &wanted)["sessionId"].as_str().unwrap().to_owned();
        browser.session = format!("/{session}");
        browser
    }

    /// A command of the session; its value.
    fn call(&self, method: &str, path: &str, body: &Value) -> Value {
        let (path, body) = (format!("/session{}{path}", self.session), body.to_string());
        let body = if method == "POST" { body.as_str() } else { "" };
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let head = format!("{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n");
        write!(stream, "{head}Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}", body.len()).unwrap();
        let (mut reader, mut line, mut length) = (BufReader::new(stream), String::new(), 0);
        while reader.read_line(&mut line).unwrap() > 2 {
            if let Some(number) = line.to_lowercase().strip_prefix("content-length:") {
                length = number.trim().parse().unwrap();
            }
            line.clear();
        }
        let mut bytes = vec![0; length];
        reader.read_exact(&mut bytes).unwrap();
        let answer: Value = serde_json::from_slice(&bytes).unwrap();
        assert!(answer["value"].get("error").is_none(), "{method} {path} {body}: {answer}");
        answer["value"].clone()
    }

    /// Value of an expression in the page.
    fn value(&self, script: &str) -> Value {
        self.call("POST", "/execute/sync", &json!({ "script": format!("return {script};"), "args": [] }))
    }

    /// Does something within a frame.
    fn inside(&self, selector: &str, work: impl FnOnce()) {
        let frame = self.call("POST", "/element", &json!({ "using": "css selector", "value": selector }));
        self.call("POST", "/frame", &json!({ "id": frame }));
        work();
        self.call("POST", "/frame", &json!({ "id": null }));
    }

    fn until(&self, script: &str) {
        let began = Instant::now();
        while self.value(script) != json!(true) {
            let log = || self.value("document.body.innerText");
            assert!(began.elapsed() < PATIENCE, "never true: {script}\n{}", log());
        }
    }

    /// Presses the mouse on an element, or lets it go.
    fn mouse(&self, selector: &str, action: &str) {
        let found = self.call("POST", "/element", &json!({ "using": "css selector", "value": selector }));
        let steps = match action {
            "pointerDown" => vec![
                json!({ "type": "pointerMove", "duration": 0, "x": 0, "y": 0, "origin": found }),
                json!({ "type": action, "button": 0 }),
            ],
            _ => vec![json!({ "type": action, "button": 0 })],
        };
        let mouse = json!({ "type": "pointer", "id": "mouse", "actions": steps });
        self.call("POST", "/actions", &json!({ "actions": [mouse] }));
    }

    fn click(&self, selector: &str) {
        self.mouse(selector, "pointerDown");
        self.mouse(selector, "pointerUp");
    }

    fn window(&self, width: u32, height: u32, scheme: &str) {
        // The smallest window is wider than a telephone: the page is shown as if it were on one.
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500 });
        let command = json!({ "cmd": "Emulation.setDeviceMetricsOverride", "params": metrics });
        self.call("POST", "/goog/cdp/execute", &command);
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.call("POST", "/goog/cdp/execute", &json!({ "cmd": "Emulation.setEmulatedMedia", "params": features }));
    }

    fn picture(&self, name: &str) {
        let text = self.call("GET", "/screenshot", &Value::Null);
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(file, decoded(text.as_str().unwrap())).unwrap();
    }
}

/// Base64 (RFC 4648, section 4), as WebDriver sends pictures.
fn decoded(text: &str) -> Vec<u8> {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digits = text.bytes().filter_map(|byte| DIGITS.iter().position(|digit| *digit == byte));
    let digits = digits.collect::<Vec<_>>();
    let bytes = digits.chunks(4).flat_map(|chunk| {
        let bits = chunk.iter().fold(0u32, |bits, digit| bits << 6 | *digit as u32) << (6 * (4 - chunk.len()));
        [bits >> 16, bits >> 8, bits].map(|byte| byte as u8).into_iter().take(chunk.len() - 1).collect::<Vec<_>>()
    });
    bytes.collect()
}

impl Drop for Browser {
    fn drop(&mut self) {
        if !self.session.is_empty() && !std::thread::panicking() {
            self.call("DELETE", "", &Value::Null);
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

/// Sets a field of the page.
fn set(browser: &Browser, id: &str, what: &str) {
    browser.value(&format!("void (document.querySelector('#{id}').{what})"));
}

/// Leads a sequence by its buttons until an expression is true; on a machine that is late for it, again.
fn lead(browser: &Browser, part: &str, acknowledge: &str, done: &str) {
    let click = |selector: &str| {
        browser.value(&format!("void document.querySelector('{selector}').scrollIntoView({{ block: 'center' }})"));
        browser.click(selector);
    };
    let asks = format!("!document.querySelector('#{part}-question').hidden");
    let began = Instant::now();
    while browser.value(done) != json!(true) {
        let alert = || browser.value("document.querySelector('#alert').textContent");
        assert!(began.elapsed() < 3 * PATIENCE, "{}", alert());
        click(&format!("#{part}"));
        loop {
            browser.until(&format!("{asks} || !panel.isLed()"));
            if browser.value("panel.isLed()") != json!(true) {
                break;
            }
            browser.picture(&format!("panel-{part}.png"));
            click(&format!("#{part}-yes"));
        }
        set(browser, acknowledge, "checked = true");
    }
}

/// Commissions the joint by the page's buttons.
fn commission(browser: &Browser) {
    set(browser, "plan-current", "value = '8'");
    set(browser, "plan-travel", "value = '0.4'");
    set(browser, "plan-turn", "checked = false");
    let taken = "document.querySelector('#taken tr:nth-child(8)') !== null";
    lead(browser, "commission", "plan-acknowledge", taken);
    assert_eq!(browser.value("document.querySelectorAll('#reports button').length"), json!(3));
    browser.until("document.querySelector('#commission-log').textContent.includes('7 pole pairs')");
}

/// Lets it learn by the page's buttons.
fn retrain(browser: &Browser) {
    for (name, value) in [("excitation", 4.0), ("validation", 2.5), ("restarts", 0.0)] {
        set(browser, &format!("retrain-{name}"), &format!("value = '{value}'"));
    }
    lead(browser, "retrain", "retrain-acknowledge", "document.querySelector('#judged tr:nth-child(3)') !== null");
    assert_eq!(browser.value("document.querySelectorAll('#learned button').length"), json!(7));
    browser.until("document.querySelector('#images').textContent.includes('version 1')");
    // The report stands in a frame of the page, with its own styles.
    browser.value(
        "void [...document.querySelectorAll('#learned button')].find((b) => b.textContent.startsWith('Show')).click()",
    );
    browser.inside("#learned-frame", || {
        browser.until("document.querySelector('svg') !== null && document.styleSheets.length > 0");
    });
    browser.picture("panel-report.png");
}

/// Holds the button of a jog until an expression is true. A busy machine may miss held-messages: then it is pressed
/// again.
fn jog(browser: &Browser, velocity: &str, moved: &str) {
    set(browser, "jog-velocity", &format!("value = '{velocity}'"));
    browser.value("void document.querySelector('#jog-forward').scrollIntoView({ block: 'center' })");
    let began = Instant::now();
    loop {
        browser.mouse("#jog-forward", "pointerDown");
        browser.until(&format!("{moved} || !panel.isHeld()"));
        if browser.value(moved) == json!(true) {
            return;
        }
        browser.mouse("#jog-forward", "pointerUp");
        assert!(began.elapsed() < PATIENCE, "the joint does not move");
    }
}

pub fn a_robot_is_drawn_where_its_joints_are_and_each_has_its_own_page() {
    let served = Served::arm(&[NODE, NODE + 1, NODE + 2]);
    let browser = Browser::begin();
    browser.window(1280, 1000, "light");
    let shoulder = format!("http://{}/#node={}", served.address, NODE + 1);
    browser.call("POST", "/url", &json!({ "url": shoulder }));
    browser.until("panel.robot.joints.length === 3 && panel.side.cards.size === 2");
    let all = "panel.robot.joints.every(({ node }) => Number.isFinite(panel.robot.position(node)))";
    browser.until(all);
    // It hangs: the forearm's centre is 0.5 m below the shoulder, which is 1 m high.
    let tip = "panel.robot.lines().at(-1)[1]";
    browser.until(&format!("Math.hypot({tip}[0] - 0.01, {tip}[1] - 0.02, {tip}[2] - 0.5) < 0.01"));
    jog(&browser, "0.4", &format!("Math.abs({tip}[0]) > 0.1"));
    browser.mouse("#jog-forward", "pointerUp");
    browser.until("document.querySelector('#state').textContent.startsWith('disabled')");
    let robot = "void document.querySelector('#robot').scrollIntoView({ block: 'center' })";
    browser.value(robot);
    browser.picture("panel-robot.png");
    // What is held is not moved by gravity, and the picture stays.
    browser.until(&format!("panel.robot.frames > 10 && Math.abs({tip}[0]) > 0.1"));
    browser.value("void document.querySelector('#robot a').click()");
    browser.until("document.title === 'Joint 5' && panel.robot.joints.length === 3");
    browser.window(390, 1000, "dark");
    browser.until("document.documentElement.scrollWidth <= window.innerWidth");
    browser.value(robot);
    browser.picture("panel-robot-390-dark.png");
    assert_eq!(browser.value("panel.problems"), json!([]));
}

pub fn the_page_shows_values_that_move_and_the_joint_stands_once_the_button_is_let_go() {
    let served = Served::joints(&[NODE, 9]);
    let browser = Browser::begin();
    browser.window(1280, 1000, "light");
    browser.call("POST", "/url", &json!({ "url": format!("http://{}/", served.address) }));
    // The page shows what the joint sends.
    browser.until("document.querySelector('#state').textContent.startsWith('disabled')");
    browser.until("Number.isFinite(panel.latest('velocity-actual-value'))");
    let strokes = "panel.plots.count()";
    let before = browser.value(strokes).as_u64().unwrap();
    browser.until(&format!("{strokes} > {}", before + 20));
    jog(&browser, "0.8", "panel.latest('velocity-actual-value') > 0.6");
    browser.picture("panel-moving.png");
    browser.mouse("#jog-forward", "pointerUp");
    browser.until("document.querySelector('#state').textContent.startsWith('disabled')");
    browser.until("Math.abs(panel.latest('velocity-actual-value')) < 0.05");
    // The space bar is STOP, whatever has the focus; a hidden page holds nothing.
    browser.mouse("#jog-back", "pointerDown");
    browser.until("panel.isHeld()");
    browser.value("void window.dispatchEvent(new Event('blur'))");
    browser.until("!panel.isHeld()");
    browser.mouse("#jog-back", "pointerUp");
    browser.value("void document.dispatchEvent(new KeyboardEvent('keydown', { code: 'Space', cancelable: true }))");
    browser.until("document.querySelector('#log').textContent.includes('STOP')");
    for (button, shown) in [
        ("#load-checklist", "#checklist tr:nth-child(5)"),
        ("#load-scan", "#joints tr:nth-child(1)"),
        ("#load-objects", "#objects tr:nth-child(40)"),
        ("#load-images", "#images tr:nth-child(3)"),
    ] {
        browser.value(&format!("void document.querySelector('{button}').scrollIntoView({{ block: 'center' }})"));
        browser.click(button);
        browser.until(&format!("document.querySelector('{shown}') !== null"));
    }
    // The other joint stands beside this one, and no longer.
    browser.value("void document.querySelector('#joints button').click()");
    browser.until("Number.isFinite(panel.side.cards.get(9).plots.latest('velocity-actual-value'))");
    browser.picture("panel-beside.png");
    browser.value("void document.querySelector('#joints button').click()");
    browser.until("document.querySelector('#side').childElementCount === 0");
    // A new board's settings are filled in, and none of them is set.
    browser.value("void (document.querySelector('#new-board').value = 'moteus-r4')");
    browser.value("void document.querySelector('#new-board').dispatchEvent(new Event('change'))");
    browser.until("document.querySelectorAll('#objects tr.changed').length > 5");
    browser.value("void document.querySelector('#load-objects').click()");
    browser.until("document.querySelectorAll('#objects tr.changed').length === 0");
    commission(&browser);
    retrain(&browser);
    for (width, height, scheme) in
        [(1280, 3200, "light"), (1280, 3200, "dark"), (390, 3200, "light"), (390, 3200, "dark")]
    {
        browser.window(width, height, scheme);
        browser.value("void window.scrollTo(0, 0)");
        let drawn = browser.value("panel.plots.drawn()").as_u64().unwrap();
        browser.until(&format!("panel.plots.drawn() > {}", drawn + 2));
        browser.picture(&format!("panel-{width}-{scheme}.png"));
        // No element hangs over the side.
        browser.until("document.documentElement.scrollWidth <= window.innerWidth");
    }
    assert_eq!(browser.value("panel.problems"), json!([]));
}
