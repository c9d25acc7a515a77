//! A browser: Chromium, driven by WebDriver (W3C, "WebDriver", 2018) over plain HTTP.

use crate::served::PATIENCE;
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
pub struct Browser {
    driver: Child,
    port: u16,
    session: String,
}

impl Browser {
    pub fn begin() -> Self {
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

    /// A command of the session; its value, or the driver's refusal.
    pub fn answer(&self, method: &str, path: &str, body: &Value) -> Result<Value, String> {
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
        match answer["value"].get("error") {
            None => Ok(answer["value"].clone()),
            Some(_) => Err(format!("{method} {path} {body}: {answer}")),
        }
    }

    /// The same, where nothing may be wrong with it.
    pub fn call(&self, method: &str, path: &str, body: &Value) -> Value {
        self.answer(method, path, body).unwrap()
    }

    /// Sends a signal to the browser's processes, as `kill` names it.
    #[cfg(target_os = "linux")]
    pub fn signal(&self, signal: &str) {
        let mut signalled = vec![self.driver.id()];
        // Parents come first: a process may begin others meanwhile, and these are named by the next look.
        while let Some(more) = children(&signalled) {
            signalled.extend(more);
        }
        let processes = signalled[1..].iter().map(u32::to_string);
        assert!(Command::new("kill").arg(signal).args(processes).status().unwrap().success());
    }

    /// Shows the page of a server.
    pub fn open(&self, address: impl std::fmt::Display) {
        self.call("POST", "/url", &json!({ "url": format!("http://{address}") }));
    }

    /// Value of an expression in the page.
    pub fn value(&self, script: &str) -> Value {
        self.call("POST", "/execute/sync", &json!({ "script": format!("return {script};"), "args": [] }))
    }

    /// Does something within a frame.
    pub fn inside(&self, selector: &str, work: impl FnOnce()) {
        let frame = self.call("POST", "/element", &json!({ "using": "css selector", "value": selector }));
        self.call("POST", "/frame", &json!({ "id": frame }));
        work();
        self.call("POST", "/frame", &json!({ "id": null }));
    }

    /// Chooses a file of this machine.
    pub fn choose(&self, selector: &str, file: &Path) {
        let found = self.call("POST", "/element", &json!({ "using": "css selector", "value": selector }));
        let id = found.as_object().unwrap().values().next().unwrap().as_str().unwrap();
        self.call("POST", &format!("/element/{id}/value"), &json!({ "text": file.to_str().unwrap() }));
    }

    /// Waits until an expression is true.
    pub fn until(&self, script: &str) {
        let began = Instant::now();
        while self.value(script) != json!(true) {
            let log = || self.value("document.body.innerText");
            assert!(began.elapsed() < PATIENCE, "never true: {script}\n{}", log());
        }
    }

    /// Presses the mouse on an element, or lets it go.
    pub fn mouse(&self, selector: &str, action: &str) {
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

    /// Brings an element to where the mouse reaches it.
    pub fn show(&self, selector: &str) {
        self.value(&format!("void document.querySelector('{selector}').scrollIntoView({{ block: 'center' }})"));
    }

    pub fn click(&self, selector: &str) {
        self.show(selector);
        self.mouse(selector, "pointerDown");
        self.mouse(selector, "pointerUp");
    }

    pub fn window(&self, width: u32, height: u32, scheme: &str) {
        // The smallest window is wider than a telephone: the page is shown as if it were on one.
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500 });
        let command = json!({ "cmd": "Emulation.setDeviceMetricsOverride", "params": metrics });
        self.call("POST", "/goog/cdp/execute", &command);
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.call("POST", "/goog/cdp/execute", &json!({ "cmd": "Emulation.setEmulatedMedia", "params": features }));
    }

    pub fn picture(&self, name: &str) {
        let text = self.call("GET", "/screenshot", &Value::Null);
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::write(file, decoded(text.as_str().unwrap())).unwrap();
    }
}

/// Processes that these have begun and that are none of them; none where there are none.
#[cfg(target_os = "linux")]
fn children(known: &[u32]) -> Option<Vec<u32>> {
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let processes = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let parent = |process: u32| {
        // Behind the name, which may have spaces and parentheses: state, parent.
        let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
        stat.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse::<u32>().ok()
    };
    let found = processes
        .filter(|process| !known.contains(process) && parent(*process).is_some_and(|parent| known.contains(&parent)))
        .collect::<Vec<_>>();
    (!found.is_empty()).then_some(found)
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
            // The browser may be gone already.
            let _ = self.answer("DELETE", "", &Value::Null);
        }
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}
